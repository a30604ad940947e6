"""The dashboard server: one line of text per command and answer.

Source: Universal Robots, "Dashboard Server, e-Series".
"""

import logging
import re
from collections.abc import Callable

from arcor2_fakes.ur.controller import Controller, Refused
from arcor2_fakes.ur.states import Runtime
from arcor2_fakes.wire import Connection

log = logging.getLogger("dashboard")

GREETING = "Connected: Universal Robots Dashboard Server"
SERIAL_NUMBER = "20235500042"
NOT_IN_LOCAL = "Command is not allowed due to safety reasons"
_MAX_LINE = 4096

_RUNTIME_WORDS = {
    Runtime.STOPPED: "STOPPED",
    Runtime.STOPPING: "STOPPED",
    Runtime.PAUSED: "PAUSED",
    Runtime.PAUSING: "PAUSED",
}
_REMOTE_ONLY = frozenset(
    {
        "play",
        "stop",
        "pause",
        "load",
        "load installation",
        "power on",
        "power off",
        "brake release",
        "unlock protective stop",
        "restart safety",
        "shutdown",
        "set operational mode",
        "clear operational mode",
    }
)


class Dashboard:
    """The commands, for all clients."""

    def __init__(self, controller: Controller, serial_number: str = SERIAL_NUMBER) -> None:
        self.controller = controller
        self.popup: str | None = None
        c = controller
        self._commands: dict[str, Callable[[str], str]] = {
            "robotmode": lambda _: f"Robotmode: {c.robot_mode.name}",
            "safetymode": lambda _: f"Safetymode: {c.safety.name}",
            "safetystatus": lambda _: f"Safetystatus: {c.safety.name}",
            "programState": lambda _: f"{_RUNTIME_WORDS.get(c.runtime, 'PLAYING')} {self._program_name()}",
            "running": lambda _: f"Program running: {str(c.runtime is Runtime.PLAYING).lower()}",
            "get loaded program": lambda _: f"Loaded program: {c.loaded}" if c.loaded else "No program loaded",
            "isProgramSaved": lambda _: f"true {self._program_name()}",
            "is in remote control": lambda _: str(c.remote).lower(),
            "get serial number": lambda _: serial_number,
            "get robot model": lambda _: c.model.upper().removesuffix("E"),
            "PolyscopeVersion": lambda _: f"URSoftware {self._version()} (Nov 21 2025)",
            "version": lambda _: self._version(),
            "get operational mode": lambda _: c.operational_mode,
            "set operational mode": self._set_operational_mode,
            "clear operational mode": lambda _: self._operational_mode("AUTOMATIC", "No longer controlling it"),
            "power on": lambda _: self._do(c.power_on, "Powering on"),
            "power off": lambda _: self._do(c.power_off, "Powering off"),
            "brake release": lambda _: self._do(c.brake_release, "Brake releasing"),
            "unlock protective stop": lambda _: self._do(c.unlock_protective_stop, "Protective stop releasing"),
            "restart safety": lambda _: self._do(c.restart_safety, "Restarting safety"),
            "close safety popup": lambda _: "closing safety popup",
            "popup": self._popup,
            "close popup": self._close_popup,
            "addToLog": lambda text: self._log(text),
            "setUserRole": lambda role: f"Setting user role: {role}",
            "getUserRole": lambda _: "PROGRAMMER",
            "play": lambda _: self._do(c.play_program, "Starting program"),
            "pause": lambda _: self._do(c.pause_program, "Pausing program"),
            "stop": self._stop,
            "load": self._load,
            "load installation": lambda name: f"Loading installation: {name}",
            "shutdown": lambda _: self._do(c.power_off, "Shutting down"),
        }
        self._names = sorted(self._commands, key=len, reverse=True)

    def opened(self, connection: Connection) -> None:
        """Serve a client."""
        buffer = bytearray()

        def received(data: bytes) -> None:
            buffer.extend(data)
            if len(buffer) > _MAX_LINE:
                connection.close()
                return
            while (end := buffer.find(b"\n")) >= 0:
                line = buffer[:end].decode("utf-8", "replace").strip()
                del buffer[: end + 1]
                if line == "quit":
                    connection.send(b"Disconnected\n")
                    connection.close()
                    return
                if line:
                    connection.send(f"{self.answer(line)}\n".encode())

        connection.received = received
        connection.send(f"{GREETING}\n".encode())

    def answer(self, line: str) -> str:
        """Return the answer to one command."""
        for name in self._names:
            if line == name or line.startswith(f"{name} "):
                if name in _REMOTE_ONLY and not self.controller.remote:
                    return NOT_IN_LOCAL
                answer = self._commands[name](line[len(name) :].strip())
                self.controller.changed()
                return answer
        return f"could not understand: '{line}'"

    def _do(self, action: Callable[[], None], answer: str) -> str:
        try:
            action()
        except Refused as e:
            return str(e)
        return answer

    def _stop(self, _: str) -> str:
        self.controller.note_stop("dashboard", "stop")
        self.controller.stop_program("dashboard stop")
        return "Stopped"

    def _load(self, name: str) -> str:
        c = self.controller
        if not re.fullmatch(r"[\w./ -]+\.urp", name):
            return f"File not found: {name}"
        if c.program is not None:
            return f"Error while loading program: {name}"
        c.loaded = name
        return f"Loading program: {name}"

    def _set_operational_mode(self, mode: str) -> str:
        if mode not in ("manual", "automatic"):
            return f"could not understand: 'set operational mode {mode}'"
        return self._operational_mode(mode.upper(), f"Setting operational mode: {mode.upper()}")

    def _operational_mode(self, mode: str, answer: str) -> str:
        self.controller.operational_mode = mode
        return answer

    def _popup(self, text: str) -> str:
        self.popup = text
        return "showing popup"

    def _close_popup(self, _: str) -> str:
        self.popup = None
        return "closing popup"

    def _log(self, text: str) -> str:
        log.info("log entry: %s", text)
        return "Added log message"

    def _program_name(self) -> str:
        program = self.controller.program
        return program.name if program is not None else (self.controller.loaded or "null")

    def _version(self) -> str:
        return ".".join(map(str, (*self.controller.version, 0, 0, 0)[:4]))
