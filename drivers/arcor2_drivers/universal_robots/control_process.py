"""The process that holds ur_rtde's control and I/O interfaces. Run as a script, by `control.py`; it decides nothing.

A process of its own because of what ur_rtde 1.6.5 does when its connection breaks: it reconnects on its own account and
sends its program again, which ends whatever plays on the controller by then, without the watchdog; it sometimes crashes
the process; and its constructors and destructors hold the interpreter. A process can be killed at any moment.

One request a line on standard input, `{"n": 1, "do": "moveL", "args": [...]}`, one answer a line on standard output,
`{"n": 1, "data": ...}` or `{"n": 1, "error": "..."}`; a request without a number is not answered. At the end of the
input the process is gone at once, whatever it is doing, and with it the kicks that the watchdog waits for.
"""

import contextlib
import json
import os
import queue
import sys
import threading
import time
from collections.abc import Callable
from typing import Any

from rtde_control import RTDEControlInterface
from rtde_io import RTDEIOInterface

COMMANDS = (
    "endTeachMode",
    "getForwardKinematics",
    "getInverseKinematics",
    "getInverseKinematicsHasSolution",
    "kickWatchdog",
    "moveJ",
    "moveL",
    "setPayload",
    "setTargetPayload",
    "setTcp",
    "speedJ",
    "speedL",
    "speedStop",
    "stopL",
    "stopScript",
    "teachMode",
)
SPEEDS = ("speedJ", "speedL")
SHOWN = 0.02  # s until the next command, a kick, may take the velocity's place in the register: two cycles of a CB3
RESUMED_WITHIN = 3.0  # s for the control program to play again; it takes 0.1
BEGINS_WITHIN = 2.0  # s for who asked for control to ask for the first thing, which is a kick
FIRST_KICKS = 0.01  # s between kicks until then
AHEAD = -10  # niceness that is asked for: kicks come in time on a busy computer
OUTPUTS = ("setConfigurableDigitalOut", "setStandardDigitalOut", "setToolDigitalOut")


def main() -> None:
    """Open with the arguments of the command line, a JSON object, and serve."""
    answers = os.fdopen(os.dup(1), "w", buffering=1, encoding="utf-8")
    with contextlib.suppress(OSError):  # as a service it needs LimitNICE for it
        os.setpriority(os.PRIO_PROCESS, 0, AHEAD)
    os.dup2(2, 1)  # the library writes to standard output as it pleases
    requests: queue.SimpleQueue[str] = queue.SimpleQueue()
    threading.Thread(target=_listen, args=(requests,), daemon=True).start()
    try:
        commands = _open(**json.loads(sys.argv[1]))
    except RuntimeError as e:
        answers.write(json.dumps({"n": 0, "error": str(e)}) + "\n")
        os._exit(1)
    answers.write(json.dumps({"n": 0, "data": None}) + "\n")
    first: str | None = _first(requests, commands["kickWatchdog"])
    while True:
        request = json.loads(first or requests.get())
        first = None
        number = request.get("n")
        try:
            answer = {"n": number, "data": commands[request["do"]](*request["args"])}
        except (RuntimeError, TypeError, ValueError, KeyError) as e:
            answer = {"n": number, "error": f"{type(e).__name__}: {e}"}
        if request["do"] in SPEEDS:
            time.sleep(SHOWN)
        if number is not None:
            answers.write(json.dumps(answer) + "\n")
        if request["do"] == "stopScript":
            os._exit(0)


def _first(requests: "queue.SimpleQueue[str]", kick: Callable[[], Any]) -> str | None:
    """Give the first request. Until it comes nothing moves, and the watchdog is kept quiet: who asks has to begin."""
    until = time.monotonic() + BEGINS_WITHIN
    while time.monotonic() < until:
        try:
            return requests.get(timeout=FIRST_KICKS)
        except queue.Empty:
            kick()
    return None


def _listen(requests: "queue.SimpleQueue[str]") -> None:
    for line in sys.stdin:
        requests.put(line)
    os._exit(0)


def _open(host: str, frequency: float, upper: bool, watchdog: float) -> dict[str, Callable[..., Any]]:
    io = RTDEIOInterface(host, False, upper)
    flags = RTDEControlInterface.FLAG_UPLOAD_SCRIPT | RTDEControlInterface.FLAG_NO_EXT_FT
    if upper:
        flags |= RTDEControlInterface.FLAG_UPPER_RANGE_REGISTERS
    control = RTDEControlInterface(host, frequency, flags)
    if not control.setWatchdog(watchdog):
        raise RuntimeError("the watchdog of the control program cannot be armed")
    registers = Registers(io, 42 if upper else 18)

    def resume() -> bool:
        """Send the control program again, after one of our own, and arm its watchdog."""
        until = time.monotonic() + RESUMED_WITHIN
        # While the library still believes that a program runs it would send "stop" first, which the new one obeys.
        while control.isProgramRunning() and time.monotonic() < until:
            time.sleep(0.002)
        control.reuploadScript()
        while not (control.isProgramRunning() and control.setWatchdog(watchdog)):
            if time.monotonic() > until:
                return False
            time.sleep(0.005)
        return True

    commands = {name: getattr(control, name) for name in COMMANDS} | {name: getattr(io, name) for name in OUTPUTS}
    return commands | {"resume": resume, "ready": registers.ready, "kick": registers.kick, "halt": registers.halt}


class Registers:
    """The two integer registers that a program of our own looks at: kicks, and the wish to stop."""

    def __init__(self, io: RTDEIOInterface, first: int) -> None:
        self._io, self._first, self._kicks = io, first, 0

    def ready(self) -> bool:
        """Take back an earlier wish to stop."""
        return bool(self._io.setInputIntRegister(self._first + 1, 0)) and self.kick()

    def kick(self) -> bool:
        """Tell the watchdog that we live."""
        self._kicks = (self._kicks + 1) % 1000
        return bool(self._io.setInputIntRegister(self._first, self._kicks))

    def halt(self) -> bool:
        """Wish that the program stops."""
        return bool(self._io.setInputIntRegister(self._first + 1, 1))


if __name__ == "__main__":
    main()
