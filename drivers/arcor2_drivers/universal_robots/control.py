"""Control of the arm while it is ours: the process that holds ur_rtde, and the guard over both.

The guard kicks the controller's watchdog, through that process, as long as this process lives and the observed stream
is fresh. It ends the session as soon as something is so that nothing may go on by itself: the process is killed, and
the program is stopped on a connection of its own. An ended session never comes back; control is taken anew.
"""

import contextlib
import itertools
import json
import logging
import os
import selectors
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from concurrent.futures import Future
from concurrent.futures import TimeoutError as FutureTimeout
from pathlib import Path
from typing import Any, Final

from arcor2_hw.data.robot import Safety
from arcor2_hw.exceptions import (
    Cancelled,
    ConnectionLost,
    DeviceError,
    DeviceFault,
    DeviceTimeout,
    NotInControl,
    SafetyStop,
)

from .dashboard import Dashboard
from .library_words import refusal, says_broken
from .observer import Observer
from .program import Registers, RunState
from .script_port import ScriptPort
from .session_times import (
    CALL_TIMEOUT,
    GUARD_ENDS,
    GUARD_PERIOD,
    KICKS_PER_PERIOD,
    LAST_STOP,
    PROGRAM_GONE,
    RESUME_TIMEOUT,
    SPEED_STOPPED,
    STOP_REACTION,
    STREAM_FREQUENCY,
    UNHEALTHY,
)
from .states import MAY_MOVE, REMEDIES, program_plays, safety_of

MOTIONS: Final = frozenset({"moveJ", "moveL", "teachMode", "ready"})
"""Commands before which a jog is ended: two threads of the program may not both move the arm."""
_SCRIPT: Final = Path(__file__).with_name("control_process.py")
log = logging.getLogger(__name__)


class ControlSession:
    """Control from `open` until it ends. `ended` is None while it lives, then the reason."""

    def __init__(self, observer: Observer, upper: bool, watchdog_frequency: float) -> None:
        self.host = observer.host
        self.who = observer.who
        self.upper = upper
        self.ended: DeviceError | None = None
        self._observer = observer
        self._watchdog = watchdog_frequency
        self._stop_line = Dashboard(observer.host)
        self._has_stop_line = True
        self._numbers = itertools.count(1)
        self._waiting: dict[int, Future[Any]] = {}
        self._order = threading.Lock()
        self._ending = threading.Event()
        self._released = False
        self._process: subprocess.Popen[bytes] | None = None
        self._speed_until: float | None = None
        self._guard: threading.Thread | None = None
        self.registers = Registers.of(upper)
        self.own: int | None = None
        """The number of the run of our own program that plays, or has just ended, in place of the control program."""

    # -------------------------------------------------------------------------------- begin and end
    def open(self, timeout: float, dashboard: bool) -> None:
        """Send the control program and arm its watchdog. Raises NotInControl, DeviceTimeout, DeviceFault."""
        if dashboard:
            self._stop_line.open(timeout)
        else:
            self._has_stop_line = False  # PolyScope X: without kicks the watchdog stops the program
        arguments = {
            "host": self.host,
            "frequency": STREAM_FREQUENCY,
            "upper": self.upper,
            "watchdog": self._watchdog,
        }
        opened: Future[Any] = Future()
        self._waiting[0] = opened
        self._process = subprocess.Popen(  # noqa: S603 - our own script
            [sys.executable, "-P", str(_SCRIPT), json.dumps(arguments)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
        )
        threading.Thread(target=self._listen, name=f"control answers {self.host}", daemon=True).start()
        try:
            opened.result(timeout)
        except FutureTimeout:
            error = DeviceTimeout(f"{self.who} did not start the control program in {timeout:g} s")
            self.end(error)
            self._stop_line.close()
            raise error from None
        except DeviceFault as e:
            named = refusal(self.who, self.upper, e.detail)
            self.end(named)
            self._stop_line.close()
            raise named from e
        self._guard = threading.Thread(target=self._watch, name=f"control guard {self.host}", daemon=True)
        self._guard.start()

    def end(self, reason: DeviceError) -> None:
        """End the session now: the process is killed, so that no further kick and no reconnection comes from it."""
        with self._order:
            if self.ended is not None:
                return
            self.ended = reason
            process = self._process
            if process is not None:
                process.kill()
            self._ending.set()
        if not self._released:
            log.warning("control of %s ends: %s", self.who, reason)

    def release(self, reason: DeviceError, wait: float) -> None:
        """End the control program in order, and the session."""
        self._released = True
        with contextlib.suppress(DeviceError):
            self.call("the end of control", "stopScript", timeout=wait)
        self.end(reason)

    def await_end(self) -> None:
        """Return when the guard of an ended session is through: its last stop must not meet the next program."""
        if self._guard is not None:
            self._guard.join(GUARD_ENDS)

    # -------------------------------------------------------------------------------- commands, from any thread
    def call(
        self,
        what: str,
        command: str,
        *arguments: Any,
        timeout: float = CALL_TIMEOUT,
        valid: Callable[[], bool] = lambda: True,
    ) -> Any:
        """Have a command carried out and give what it gives. `valid` is asked at the last moment: false drops it.

        Raises what ended the session, Cancelled when dropped, DeviceTimeout (and the session ends) when it takes longer
        than `timeout` s, DeviceFault when the library fails.
        """
        if command in MOTIONS and self._speed_until is not None:
            self._speed_until = None
            self._send("the end of a jog", "speedStop", ())
        future = self._send(what, command, arguments, valid)
        try:
            return future.result(timeout)
        except FutureTimeout:
            error = DeviceTimeout(f"{self.who} did not take {what} within {timeout:g} s")
            self.end(error)
            raise error from None

    def ask(self, what: str, question: str, *arguments: Any) -> Any:
        """Ask what changes nothing; once more when the library gives up on it, as it does on a busy computer."""
        try:
            return self.call(what, question, *arguments)
        except DeviceFault as e:
            log.info("%s: %s is asked again: %s", self.who, what, e.detail)
            return self.call(what, question, *arguments)

    def do(self, what: str, command: str, *arguments: Any, **options: Any) -> None:
        """As `call`, for a command that the library answers with true or false; DeviceFault on false."""
        if not self.call(what, command, *arguments, **options):
            if self._ending.wait(2.0 * PROGRAM_GONE) and self.ended is not None:
                raise self.ended  # the guard was about to see why
            raise DeviceFault(f"{self.who} did not accept {what}")

    def speed(
        self, command: str, velocities: list[float], acceleration: float, valid_for: float, valid: Callable[[], bool]
    ) -> None:
        """Begin or renew a motion by speed that the guard ends `valid_for` s from now unless it is renewed."""
        until = time.monotonic() + valid_for
        self._speed_until = until
        in_time: Callable[[], bool] = lambda: valid() and time.monotonic() < until  # noqa: E731
        # Without the library's own time: its call would last that long, and kicks and a stop would wait behind it.
        self.do("a jog", command, velocities, acceleration, valid=in_time)

    def set_output(self, number: int, on: bool) -> None:
        """Switch an output: 0 to 7 standard, 8 to 15 configurable, 16 and 17 of the tool."""
        command = ("setStandardDigitalOut", "setConfigurableDigitalOut", "setToolDigitalOut")[number // 8]
        self.do(f"digital output {number}", command, number % 8, on)

    def stop_motion(self, deceleration: float) -> None:
        """Stop what moves; by the dashboard, which ends the session, when the program does not react in time.

        Always the asynchronous stopL, the only one of the four that is run as what it is called: ur_rtde 1.6.5 runs a
        synchronous stopL as stopj until the first asynchronous stop, and stopJ as stopl from then on.
        """
        jogs, self._speed_until = self._speed_until is not None, None
        try:
            if jogs:  # a stopL beside the thread that holds the velocity is no stop
                self._send("a stop", "speedStop", ()).result(SPEED_STOPPED)
            elif (own := self.own) is not None:
                self._send("a stop", "halt", ())
                self._await_reaction(own)
            else:
                self._send("a stop", "stopL", (deceleration, True)).result(STOP_REACTION)
        except (FutureTimeout, DeviceFault):
            self.stop_by_dashboard()
        except DeviceError as e:
            log.debug("%s: control ended while stopping: %s", self.who, e)

    def _await_reaction(self, number: int) -> None:
        """Return when the run of that number stops or has ended. Raises FutureTimeout when it does not react."""
        until = time.monotonic() + STOP_REACTION
        while True:
            newest = self._observer.newest()
            if newest is None or newest.run(self.upper) != (number, RunState.RUNNING):
                return  # also before its first line: it looks at the register before it moves
            if time.monotonic() > until:
                raise FutureTimeout
            time.sleep(GUARD_PERIOD / 4.0)

    # -------------------------------------------------------------------------------- programs of our own
    def play(self, number: int, program: str, valid: Callable[[], bool]) -> ScriptPort:
        """Play a program of our own in place of the control program; `valid` is asked at the last moment.

        Gives the connection it was sent on, to be drained and closed. `resume` follows in any case.
        """
        port = ScriptPort.open(self.host, CALL_TIMEOUT)
        self.own = number  # from here on the other kicks: the library's own would wait for its program without end
        try:
            self.do("a program", "ready")  # behind the last of those; a wish to stop from now on is met by the program
            if not valid():
                raise Cancelled("a motion was stopped before it began")
            port.send(program, CALL_TIMEOUT)
        except Cancelled:
            port.close()
            self.own = None
            raise
        except DeviceError as e:
            port.close()
            self.end(e)
            raise
        return port

    def resume(self) -> None:
        """Have the control program play again. Raises what ended the session, DeviceFault, DeviceTimeout."""
        if self.own is None or self.ended is not None:
            return
        if (newest := self._observer.newest()) is None or program_plays(newest.runtime):
            self.end(NotInControl(f"another program plays on {self.who}"))
        self.do("the control program", "resume", timeout=RESUME_TIMEOUT)
        self.own = None

    def stop_by_dashboard(self) -> None:
        """The second path of a stop: stop the program, and with it the session."""
        reason = Cancelled(f"the control program of {self.who} was stopped by the dashboard")
        try:
            if self._has_stop_line:
                self._stop_line.do("stop", "Stopped")
        except DeviceError as e:
            self.end(e)  # without kicks the watchdog stops it
            raise
        self.end(reason)

    def _send(
        self, what: str, command: str, arguments: tuple[Any, ...], valid: Callable[[], bool] = lambda: True
    ) -> "Future[Any]":
        future: Future[Any] = Future()
        number = next(self._numbers)
        line = json.dumps({"n": number, "do": command, "args": arguments})
        with self._order:
            if self.ended is not None:
                raise self.ended
            if not valid():
                raise Cancelled(f"{what} was stopped before it began")
            self._waiting[number] = future
            self._write(line)
        return future

    def _write(self, line: str) -> None:
        assert self._process is not None
        assert self._process.stdin is not None
        with contextlib.suppress(OSError):  # gone: the listening thread sees it
            os.write(self._process.stdin.fileno(), line.encode() + b"\n")

    # -------------------------------------------------------------------------------- answers of the process
    def _listen(self) -> None:
        process = self._process
        assert process is not None
        assert process.stdout is not None
        assert process.stderr is not None
        buffers = {process.stdout: b"", process.stderr: b""}
        with selectors.DefaultSelector() as selector:
            for pipe in buffers:
                selector.register(pipe, selectors.EVENT_READ)
            while selector.get_map():
                for key, _ in selector.select():
                    pipe = process.stdout if key.fileobj is process.stdout else process.stderr
                    data = os.read(key.fd, 65536)
                    if not data:
                        selector.unregister(pipe)
                        continue
                    *lines, buffers[pipe] = (buffers[pipe] + data).split(b"\n")
                    for line in lines:
                        self._answered(line) if pipe is process.stdout else self._said(line)
        status = process.wait()
        self.end(ConnectionLost(f"the control process of {self.who} ended with status {status}"))
        assert process.stdin is not None
        process.stdin.close()
        process.stdout.close()
        process.stderr.close()
        with self._order:
            waiting, self._waiting = self._waiting, {}
        for future in waiting.values():
            assert self.ended is not None
            future.set_exception(self.ended)

    def _answered(self, line: bytes) -> None:
        answer = json.loads(line)
        future = self._waiting.pop(answer["n"], None)
        if future is None:
            return
        if "error" in answer:
            future.set_exception(DeviceFault(f"the control interface of {self.who} failed", answer["error"]))
        else:
            future.set_result(answer["data"])

    def _said(self, line: bytes) -> None:
        text = line.decode("utf-8", "replace").strip()
        if says_broken(line):
            self.end(ConnectionLost(f"the control connection to {self.who} broke", text))
        elif text:
            log.info("%s: %s", self.who, text)

    # -------------------------------------------------------------------------------- the guard
    def _watch(self) -> None:
        period = 1.0 / (KICKS_PER_PERIOD * self._watchdog)
        kick: Future[Any] | None = None
        due = gone_since = 0.0
        while True:
            now = time.monotonic()
            newest = self._observer.newest()
            if newest is None or newest.age > UNHEALTHY or not self._observer.observing.online:
                self.end(ConnectionLost(f"nothing is heard of {self.who}"))
            elif (safety := safety_of(newest.safety_mode)) not in MAY_MOVE:
                self._stopped_by_safety(safety)
            elif program_plays(newest.runtime) or self.own is not None:
                gone_since = 0.0
            elif gone_since == 0.0:  # by the samples' time: an old one was taken before the program was sent
                gone_since = newest.monotonic
            elif newest.monotonic - gone_since > PROGRAM_GONE:
                self.end(NotInControl(f"the control program was stopped at {self.who}, not by this driver"))
            if self._ending.is_set():
                break
            if self._speed_until is not None and now >= self._speed_until:
                self._speed_until = None
                with contextlib.suppress(DeviceError):
                    self._send("the end of a jog", "speedStop", ())
            if now >= due and (kick is None or kick.done()):  # on a busy computer they must not pile up before a stop
                due = now + period
                with contextlib.suppress(DeviceError):
                    kick = self._send("a kick", "kickWatchdog" if self.own is None else "kick", ())
            self._ending.wait(GUARD_PERIOD)
        self._last_stop()

    def _stopped_by_safety(self, safety: Safety) -> None:
        """End, and stop the program first: after a safeguard stop it would go on as soon as the guard closes."""
        reason = SafetyStop(f"{safety.value.replace('_', ' ')} of {self.who}", REMEDIES.get(safety, ""), safety.value)
        self._last_stop()
        self.end(reason)

    def _last_stop(self) -> None:
        """Leave no program of ours on the controller: a connection that broke may have brought it there once more."""
        newest = self._observer.newest()
        left_behind = newest is None or program_plays(newest.runtime)
        if self._has_stop_line and left_behind and not self._released:
            for _ in range(2):  # idempotent; the first attempt may meet a connection that was reset
                try:
                    self._stop_line.do("stop", "Stopped", LAST_STOP)
                    break
                except DeviceError as e:
                    log.warning("%s: the program could not be stopped by the dashboard: %s", self.who, e)
        if self._ending.is_set():
            self._stop_line.close()
