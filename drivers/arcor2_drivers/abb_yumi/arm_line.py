"""Connection to the motion server of one arm: a socket for commands, and one for keep-alive and stop."""

import contextlib
import queue
import select
import socket
import threading
import time
from collections.abc import Callable
from typing import Final

from arcor2_hw.exceptions import (
    ConnectionLost,
    DeviceError,
    DeviceFault,
    DeviceTimeout,
    NotConnected,
    NotInControl,
    Refused,
)
from arcor2_hw.keep_alive import PULSE_PERIOD, KeepAlive, RunningTime
from arcor2_hw.messages import Message

from .motion_lines import MAX_LINE_LENGTH, MAX_SEQUENCE, MEANING, VERSION, Answer, Code, Status, answer, line

ANSWER_TIMEOUT: Final = 2.0
"""Time for an answer that needs no motion, s; the server reads every 20 ms."""
KEEP_ALIVES_PER_PERIOD: Final = 4
"""Keep-alives per period of the watchdog."""
RECONNECT_INTERVAL: Final = 0.1
"""Time between two attempts to connect, s."""
KEEP_ALIVE_TIMEOUT: Final = 1.0
"""Time without an answer to a keep-alive after which the connection is lost, s."""
STOP_TIMEOUT: Final = 0.8
"""Time for the server to confirm standstill, s: 50 ms until it reads, 0.2 s of braking, and slack."""
NUMBERS: Final = {"left": 1, "right": 2}


class _Socket:
    """A socket that carries lines."""

    def __init__(self, raw: socket.socket) -> None:
        self.raw = raw
        self._rest = b""
        self._sending = threading.Lock()

    def send(self, data: bytes) -> None:
        with self._sending:
            self.raw.sendall(data)

    def lines(self) -> list[bytes]:
        """Return the complete lines received. Raise OSError, also when the other end has closed."""
        data = self.raw.recv(4096)
        if not data:
            raise ConnectionResetError("closed by the controller")
        *lines, self._rest = (self._rest + data).split(b"\n")
        if len(self._rest) > 2 * MAX_LINE_LENGTH:
            raise ConnectionResetError("it sends an endless line")
        return lines


class Command:
    """A command that was sent, and its answers."""

    def __init__(self, sequence: int, code: Code) -> None:
        self.sequence = sequence
        self.code = code
        self.answers: queue.SimpleQueue[Answer] = queue.SimpleQueue()

    @property
    def what(self) -> str:
        """Return the name of the command."""
        return self.code.name.lower().replace("_", " ")


class ArmLine:
    """Connection to one arm's motion server. `ended` is None, or the reason of its end."""

    def __init__(self, name: str, arm: str, host: str, port: int, on_ended: Callable[[DeviceError], None]) -> None:
        self.arm = arm
        self.who = Message.of("The {arm} arm of {name} ({address})", arm=arm, name=name, address=f"{host}:{port}")
        self.ended: DeviceError | None = None
        self._host, self._port = host, port
        self._on_ended = on_ended
        self._commands: _Socket | None = None
        self._watch: _Socket | None = None
        self._waiting: dict[int, Command] = {}
        self._motion: Command | None = None
        self._stopped: dict[int, threading.Event] = {}
        self._sequence = 0
        self._numbering = threading.Lock()
        self._asking = threading.Lock()
        self._over = threading.Event()
        self._keep_alive: KeepAlive | None = None
        self._silent = RunningTime()
        self._thread: threading.Thread | None = None

    # -------------------------------------------------------------------------------- connection
    def open(self, timeout: float, watchdog: float) -> None:
        """Connect, check the server, and start a session with its watchdog. Raise DeviceError."""
        until = time.monotonic() + timeout
        opened: list[socket.socket] = []
        try:
            opened.append(self._connect(self._port, until))
            opened.append(self._connect(self._port + 1, until))
        except OSError as e:
            for each in opened:
                each.close()
            self.ended = NotConnected(
                "{device} refuses the connection. Is its RAPID program running?", str(e), device=self.who
            )
            raise self.ended from e
        self.attach(opened[0], opened[1], watchdog)
        try:
            version, number = self.ask(Code.HELLO, within=max(until - time.monotonic(), 0.1))[:2]
            if version != VERSION:
                raise Refused(
                    "{device} runs RAPID modules of version {version:g}. Load version {other_version}.",
                    device=self.who,
                    version=version,
                    other_version=VERSION,
                )
            if number != NUMBERS[self.arm]:
                raise Refused("{device} is the server of the other arm. Check the ports.", device=self.who)
            self.ask(Code.BEGIN, watchdog)
        except DeviceTimeout as e:
            self.end(e)
            raise DeviceTimeout(
                "{device} does not answer. Its program is stopped, or serves another client.", device=self.who
            ) from e
        except (DeviceError, ValueError) as e:
            self.end(
                e
                if isinstance(e, DeviceError)
                else DeviceFault("{device} sent an invalid answer to hello.", device=self.who)
            )
            raise

    def end(self, reason: DeviceError, wait: bool = True) -> None:
        """Close the connection if it is open. The server then stops its arm."""
        if self.ended is None:
            self.ended = reason
        self._over.set()
        for each in (self._commands, self._watch):
            if each is not None:
                with contextlib.suppress(OSError):
                    each.raw.shutdown(socket.SHUT_RDWR)
        if self._thread is None:
            self._close()
        elif wait and self._thread is not threading.current_thread():
            self._thread.join(1.0)

    def _connect(self, port: int, until: float) -> socket.socket:
        while True:
            try:
                raw = socket.create_connection((self._host, port), max(until - time.monotonic(), 0.05))
                break
            except ConnectionRefusedError:  # a program that has just started does not listen yet
                if time.monotonic() + RECONNECT_INTERVAL > until:
                    raise
                time.sleep(RECONNECT_INTERVAL)
        raw.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        return raw

    def attach(self, commands: socket.socket, watch: socket.socket, watchdog: float) -> None:
        """Serve open sockets and keep the watchdog from tripping; the sockets are closed at the end."""
        for each in (commands, watch):
            each.settimeout(0.2)
        self._commands, self._watch = _Socket(commands), _Socket(watch)
        message = line(self._next(), Code.KEEP_ALIVE)
        try:
            self._keep_alive = KeepAlive(watch.fileno(), message, watchdog / KEEP_ALIVES_PER_PERIOD)
        except DeviceTimeout:
            self._close()
            raise
        self._silent = RunningTime()
        self._thread = threading.Thread(target=self._run, name=f"watching {self.who}", daemon=True)
        self._thread.start()

    def _close(self) -> None:
        if self._keep_alive is not None:
            self._keep_alive.close()
        for each in (self._commands, self._watch):
            if each is not None:
                each.raw.close()

    # -------------------------------------------------------------------------------- commands
    def ask(self, code: Code, *values: float, within: float = ANSWER_TIMEOUT) -> tuple[float, ...]:
        """Return the values of the server's answer. Raise DeviceTimeout, CommandRefused or the reason of the end."""
        with self._asking:
            if self._motion is not None:
                raise Refused("{device} is moving. Its server answers at standstill.", device=self.who)
            command = self._send(code, values)
        clock = RunningTime()
        try:
            while clock() < within:
                found = self.poll(command, 0.05)
                if found is not None:
                    return self.checked(found, command).values
        finally:
            self.forget(command)
        raise DeviceTimeout(
            "{device} did not answer {what} within {within:g} s.", device=self.who, what=command.what, within=within
        )

    def start(self, code: Code, *values: float, stopped: Callable[[], bool]) -> Command | None:
        """Start a motion. Return None if `stopped` returns True. Poll the command to its end, then `forget` it."""
        with self._asking:
            if stopped():
                return None
            self._motion = self._send(code, values)
            return self._motion

    def forget(self, command: Command) -> None:
        """Drop a command; its later answers are discarded."""
        self._waiting.pop(command.sequence, None)
        if self._motion is command:
            self._motion = None

    def poll(self, command: Command, wait: float) -> Answer | None:
        """Return the next answer to a command, None if none comes in `wait` s.

        Raise the reason if the connection ended.
        """
        with contextlib.suppress(queue.Empty):
            return command.answers.get(timeout=wait)
        if self.ended is not None:
            raise self.ended
        return None

    def checked(self, found: Answer, command: Command) -> Answer:
        """Return an answer with status DONE. Raise CommandRefused or DeviceFault for another status."""
        if found.status == Status.DONE:
            return found
        try:
            status = Status(found.status)
        except ValueError:
            raise DeviceFault(
                "{device} answered with the unknown status {status}.",
                fault_code=found.status,
                device=self.who,
                status=found.status,
            ) from None
        template = "{device}, {command}: {reason}"
        meaning = Message.of(MEANING.get(status, status.name))
        values = {"device": self.who, "command": command.what, "reason": meaning}
        if status in (Status.BAD_CHECK, Status.RAPID_ERROR):
            number = int(found.values[0]) if found.values else int(status)
            raise DeviceFault(template, f"status {int(status)} {found.values}", number, **values)
        raise CommandRefused(template, status, **values)

    def stop(self) -> bool:
        """Stop the arm, also during another request; return whether the server confirmed standstill in time."""
        watch = self._watch
        if watch is None or self.ended is not None:
            return False
        sequence, stood = self._next(), threading.Event()
        self._stopped[sequence] = stood
        try:
            watch.send(line(sequence, Code.STOP))
        except OSError:
            return False
        clock = RunningTime()
        while not stood.wait(0.02):
            if self.ended is not None or clock() > STOP_TIMEOUT:
                self._stopped.pop(sequence, None)
                return False
        return True

    def _next(self) -> int:
        with self._numbering:
            self._sequence = self._sequence % MAX_SEQUENCE + 1
            return self._sequence

    def _send(self, code: Code, values: tuple[float, ...]) -> Command:
        if self.ended is not None:
            raise self.ended
        assert self._commands is not None
        command = Command(self._next(), code)
        data = line(command.sequence, code, values)
        self._waiting[command.sequence] = command
        try:
            self._commands.send(data)
        except OSError as e:
            self._waiting.pop(command.sequence, None)
            raise ConnectionLost("{device}: the connection broke.", str(e), device=self.who) from e
        return command

    # -------------------------------------------------------------------------------- on the connection's thread
    def _run(self) -> None:
        try:
            self._serve()
        except (OSError, ValueError) as e:
            why: DeviceError = ConnectionLost("{device}: the connection broke.", str(e), device=self.who)
        except DeviceError as e:
            why = e
        else:
            why = NotInControl("{device}: the connection was closed.", device=self.who)
        first = self.ended is None
        if first:
            self.ended = why
        self._close()
        if first:
            self._on_ended(why)

    def _serve(self) -> None:
        commands, watch, keep_alive = self._commands, self._watch, self._keep_alive
        assert commands is not None
        assert watch is not None
        assert keep_alive is not None
        while not self._over.is_set():
            keep_alive.pulse()
            ready, _, _ = select.select([commands.raw, watch.raw], [], [], PULSE_PERIOD)
            for each in (commands, watch):
                if each.raw in ready:
                    for raw in each.lines():
                        self._take(answer(raw), each is watch)
            if self._silent() > KEEP_ALIVE_TIMEOUT:
                raise ConnectionLost(
                    "{device} has not answered for {silent:g} s.", device=self.who, silent=KEEP_ALIVE_TIMEOUT
                )

    def _take(self, found: Answer, from_watch: bool) -> None:
        if not from_watch:
            command = self._waiting.get(found.sequence)
            if command is not None and command.code == found.code:
                command.answers.put(found)  # other answers are late: their command was dropped
            return
        self._silent = RunningTime()
        if found.code == Code.STOP and found.status == Status.DONE:
            stood = self._stopped.pop(found.sequence, None)
            if stood is not None:
                stood.set()


class CommandRefused(Refused):
    """The motion server refused a command, or ended it early; `status` is the reason."""

    def __init__(self, message: str, status: Status, **values: object) -> None:
        super().__init__(message, f"status {int(status)}", **values)
        self.status = status
