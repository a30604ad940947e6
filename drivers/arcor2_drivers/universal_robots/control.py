"""Control of the arm while it is ours: the process that holds ur_rtde, and the guard over both.

The control process kicks the controller's watchdog as long as the guard here reports by pulses that it works. The guard
ends the session when something is wrong, so that nothing goes on by itself: the process is killed, and the program is
stopped on a connection of its own. An ended session never comes back; control is taken anew.
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
from pathlib import Path
from typing import Any, Final, NoReturn

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
from arcor2_hw.keep_alive import FROZEN_AFTER, PULSE_PERIOD, TOO_SLOW, once_within, pulse, result_within

from .dashboard import Dashboard
from .library_words import refusal, says_broken
from .observer import Observer
from .program import Registers, RunState
from .script_port import ScriptPort
from .session_times import (
    CALL_TIMEOUT,
    GUARD_ENDS,
    GUARD_PERIOD,
    LAST_STOP,
    PROCESS_ENDS,
    PROGRAM_GONE,
    RESUME_TIMEOUT,
    SPEED_STOPPED,
    STOP_REACTION,
    STREAM_FREQUENCY,
)
from .states import REMEDIES, program_plays, safety_of

_SCRIPT: Final = Path(__file__).with_name("control_process.py")
_TOO_SLOW: Final = {
    3: "the watchdog was not kicked in time",
    4: f"the cell host did not work for {FROZEN_AFTER:g} s",
}
"""What the exit status of the control process means when it ended because this computer was busy."""
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
        self._jogs_until = 0.0
        self._unsafe = observer.unsafe
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
            start_new_session=True,  # its own share of a busy computer
        )
        threading.Thread(target=self._listen, name=f"control answers {self.host}", daemon=True).start()
        try:
            result_within(opened, timeout)
        except TimeoutError:
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
        future = self._send(what, command, arguments, valid)
        try:
            return result_within(future, timeout)
        except TimeoutError:
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
            self._not_accepted(what)

    def _not_accepted(self, what: str) -> NoReturn:
        once_within(self._ending.is_set, 2.0 * PROGRAM_GONE, GUARD_PERIOD)
        if self.ended is not None:
            raise self.ended  # the guard was about to see why
        raise DeviceFault(f"{self.who} did not accept {what}")

    def speed(
        self, command: str, velocities: list[float], acceleration: float, valid_for: float, valid: Callable[[], bool]
    ) -> None:
        """Start or renew a motion by speed that the control process ends `valid_for` s from now unless renewed."""
        self._jogs_until = until = time.monotonic() + valid_for
        in_time: Callable[[], bool] = lambda: valid() and time.monotonic() < until  # noqa: E731
        if not self.call("a jog", command, velocities, acceleration, until, valid=in_time):
            if time.monotonic() >= until:
                raise Cancelled(f"a jog of {self.who} came too late: it was valid for {valid_for:g} s")
            self._not_accepted("a jog")

    def set_output(self, number: int, on: bool) -> None:
        """Switch an output: 0 to 7 standard, 8 to 15 configurable, 16 and 17 of the tool."""
        command = ("setStandardDigitalOut", "setConfigurableDigitalOut", "setToolDigitalOut")[number // 8]
        self.do(f"digital output {number}", command, number % 8, on)

    def stop_motion(self, deceleration: float) -> None:
        """Stop what moves; by the dashboard, which ends the session, when the program does not react in time."""
        jogs, self._jogs_until = time.monotonic() < self._jogs_until + SPEED_STOPPED, 0.0
        own = self.own
        try:
            stopping = self._send("a stop", "stop", (deceleration,))
            if own is None:
                result_within(stopping, SPEED_STOPPED if jogs else STOP_REACTION)
            elif not once_within(lambda: self._reacted(own), STOP_REACTION, GUARD_PERIOD / 4.0):
                self.stop_by_dashboard()
        except (TimeoutError, DeviceFault):
            self.stop_by_dashboard()
        except DeviceError as e:
            log.debug("%s: control ended while stopping: %s", self.who, e)

    def _reacted(self, number: int) -> bool:
        """Return whether the run of that number stops or has ended."""
        newest = self._observer.newest()
        # Also before its first line: it reads the register before it moves.
        return newest is None or newest.run(self.upper) != (number, RunState.RUNNING)

    # -------------------------------------------------------------------------------- programs of our own
    def play(self, number: int, program: str, valid: Callable[[], bool]) -> ScriptPort:
        """Play a program of our own in place of the control program; `valid` is asked at the last moment.

        Gives the connection it was sent on, to be drained and closed. `resume` follows in any case.
        """
        port = ScriptPort.open(self.host, CALL_TIMEOUT)
        self.own = number
        try:
            self.do("a program", "own")  # a request to stop from now on is met by the program
            if not valid():
                raise Cancelled("a motion was stopped before it began")
            port.send(program, CALL_TIMEOUT)
        except Cancelled:
            port.close()
            self.do("the control program", "control")
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
        line = json.dumps({"n": number, "do": command, "args": arguments}).encode() + b"\n"
        with self._order:
            if self.ended is not None:
                raise self.ended
            if not valid():
                raise Cancelled(f"{what} was stopped before it began")
            self._waiting[number] = future
            self._write(line)
        return future

    def _write(self, line: bytes) -> None:
        assert self._process is not None
        assert self._process.stdin is not None
        with contextlib.suppress(OSError, ValueError):  # gone: the listening thread notices
            os.write(self._process.stdin.fileno(), line)

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
        detail = f"the control process of {self.who} ended with status {status}"
        if status in _TOO_SLOW:
            self.end(ConnectionLost(f"{self.who}: {TOO_SLOW.format('robot')}", f"{_TOO_SLOW[status]}; {detail}"))
        else:
            self.end(ConnectionLost(detail))
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
        observer, due = self._observer, 0.0
        gone_since: float | None = None
        while not self._ending.is_set():
            newest = observer.newest()
            if newest is None or not observer.observing.online:
                self.end(ConnectionLost(f"{self.who} sends no state"))
            elif (unsafe := observer.unsafe) is not None and unsafe is not self._unsafe:
                self._stopped_by_safety(safety_of(unsafe.safety_mode))
            elif program_plays(newest.runtime) or self.own is not None:
                gone_since = None
            elif gone_since is None:  # by the controller's time: an old sample was taken before the program was sent
                gone_since = newest.timestamp
            elif newest.timestamp - gone_since > PROGRAM_GONE and not self._ending.wait(PROCESS_ENDS):
                self.end(NotInControl(f"the control program was stopped at {self.who}, not by this driver"))
            if not self._ending.is_set() and (now := time.monotonic()) >= due:
                due = now + PULSE_PERIOD
                self._write(pulse())
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
