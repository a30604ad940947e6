"""Control session: the process that holds ur_rtde's control interface, and the guard that supervises it.

The control process signals the controller's watchdog as long as the guard reports by pulses that it works. When
something is wrong, the guard ends the session, so that nothing continues by itself: it kills the process and stops the
program over a separate connection. An ended session is never resumed; control must be taken again.
"""

import contextlib
import logging
import threading
import time
from collections.abc import Callable
from concurrent.futures import Future
from typing import Any, Final, NoReturn

from arcor2_hw.exceptions import (
    Cancelled,
    ConnectionLost,
    DeviceError,
    DeviceFault,
    DeviceTimeout,
    NotInControl,
    SafetyStop,
    WatchdogTripped,
)
from arcor2_hw.keep_alive import FROZEN_AFTER, PULSE_PERIOD, TOO_SLOW, once_within, pulse, result_within
from arcor2_hw.objects.arm import label

from . import timing
from .control_client import ControlClient
from .dashboard import Dashboard
from .observer import Observer
from .program import Registers, RunState
from .script_port import ScriptPort
from .states import MODE_RUNNING, REMEDIES, program_plays, safety_of

_TOO_SLOW: Final = {
    3: "the watchdog was not signalled in time",
    4: f"the cell host did not work for {FROZEN_AFTER:g} s",
}
"""Causes by exit status of the control process if the computer was too busy."""
_BROKEN: Final = (b"disconnected", b"could not receive", b"closed the connection", b"lost connection", b"reconnecting")
"""Texts that ur_rtde 1.6.5 prints, in lower case, when its connection breaks and before it reconnects."""
MAX_ATTEMPTS: Final = 3
"""Attempts of a repeatable command."""
log = logging.getLogger(__name__)


def never() -> bool:
    """Return False: the command cannot be cancelled."""
    return False


class ControlSession:
    """Control of the arm, from `open` until it ends. `ended` is None, or the reason of its end."""

    def __init__(self, observer: Observer, upper: bool, watchdog_frequency: float) -> None:
        self.host = observer.host
        self.who = observer.who
        self.upper = upper
        self.registers = Registers.of(upper)
        self.ended: DeviceError | None = None
        self.too_slow = False
        """Whether the session ended because this computer was too busy for the watchdog."""
        self.own: int | None = None
        """Number of the run of a motion program that plays, or has just ended, in place of the control program."""
        self._observer = observer
        self._watchdog = watchdog_frequency
        self._dashboard: Dashboard | None = None
        self._lock = threading.Lock()
        self._ending = threading.Event()
        self._released = False
        self._process: ControlClient | None = None
        self._jogs_until = 0.0
        self._unsafe = observer.unsafe
        self._guard: threading.Thread | None = None

    # -------------------------------------------------------------------------------- start and end
    def open(self, timeout: float, dashboard: bool) -> None:
        """Send the control program and arm its watchdog.

        Args:
            timeout: Time for the control program to start, s.
            dashboard: Whether the controller has a dashboard server. PolyScope X has none: there the watchdog stops
                the program.

        Raises:
            NotInControl: The robot is in local control, or its registers are in use.
            DeviceTimeout: The program did not start in time.
            DeviceFault: The controller does not start the program.
        """
        if dashboard:
            self._dashboard = Dashboard(self.host)
            self._dashboard.open(timeout)
        arguments = {
            "host": self.host,
            "frequency": timing.STREAM_FREQUENCY,
            "upper": self.upper,
            "watchdog": self._watchdog,
        }
        process = self._process = ControlClient(self.who, arguments, self._on_output, self._on_exit)
        error: DeviceError
        try:
            result_within(process.opened, timeout)
        except (TimeoutError, DeviceError) as e:
            if isinstance(e, DeviceFault):
                error = self._refusal(e.detail)
            elif isinstance(e, DeviceError):
                error = e
            else:
                error = DeviceTimeout(
                    "{device} did not start the control program within {timeout:g} s.", device=self.who, timeout=timeout
                )
            self.end(error)
            if self._dashboard is not None:
                self._dashboard.close()
            raise error from e
        self._guard = threading.Thread(target=self._watch, name=f"control guard {self.host}", daemon=True)
        self._guard.start()

    def _refusal(self, text: str) -> DeviceError:
        """Return the error for a text of ur_rtde's constructor."""
        lower = text.lower()
        if "in use" in lower or "in_use" in lower:
            return NotInControl(
                "Input registers {registers} of {device} are used by a fieldbus or another client.",
                text,
                registers="24 to 47" if self.upper else "0 to 23",
                device=self.who,
            )
        if "remote control" in lower:
            return NotInControl("{device} is in local control.", text, device=self.who)
        return DeviceFault("{device} does not start the control program.", text, device=self.who)

    def end(self, reason: DeviceError) -> None:
        """End the session now and kill the process, so that it neither signals the watchdog nor reconnects."""
        with self._lock:
            if self.ended is not None:
                return
            self.ended = reason
            if self._process is not None:
                self._process.kill()
            self._ending.set()
        if not self._released:
            log.warning("Control of %s ended: %s", self.who, reason)

    def release(self, reason: DeviceError, wait: float) -> None:
        """Stop the control program normally within `wait` s, and end the session."""
        self._released = True
        with contextlib.suppress(DeviceError):
            self.call("the end of control", "stopScript", timeout=wait)
        self.end(reason)
        if self._process is not None:  # the registers of the process are in use until its connections are closed
            self._process.wait(timing.PROCESS_END_TIMEOUT)

    def await_end(self) -> None:
        """Wait for the guard of an ended session, because its last stop must not stop the next program."""
        if self._guard is not None:
            guard = self._guard
            once_within(lambda: not guard.is_alive(), timing.GUARD_END_TIMEOUT, timing.GUARD_PERIOD)

    # -------------------------------------------------------------------------------- commands, from any thread
    def call(
        self,
        operation: str,
        command: str,
        *arguments: Any,
        timeout: float = timing.CALL_TIMEOUT,
        stopped: Callable[[], bool] = never,
    ) -> Any:
        """Execute a command and return its result.

        Args:
            operation: Name of the command, for errors.
            command: Name of the method of ur_rtde.
            arguments: Arguments of the method.
            timeout: Time for the answer, s. The session ends when it elapses.
            stopped: Called right before the command is sent; True cancels it.

        Raises:
            DeviceError: The session has ended.
            Cancelled: The command was cancelled.
            DeviceTimeout: No answer came in time.
            DeviceFault: The library failed.
        """
        future = self._send(operation, command, arguments, stopped)
        try:
            return result_within(future, timeout)
        except TimeoutError:
            error = DeviceTimeout(
                "{device} did not execute {what} within {timeout:g} s.",
                device=self.who,
                what=operation,
                timeout=timeout,
            )
            self.end(error)
            raise error from None

    def ask(self, operation: str, question: str, *arguments: Any) -> Any:
        """Execute a repeatable command. Try MAX_ATTEMPTS times if the library fails, as on a busy computer."""
        for _ in range(MAX_ATTEMPTS - 1):
            try:
                if answer := self.call(operation, question, *arguments):
                    return answer
                reason = f"the answer was {answer}"
            except DeviceFault as e:
                reason = e.detail
            log.info("%s: asking again for %s: %s", self.who, operation, reason)
        return self.call(operation, question, *arguments)

    def set(self, operation: str, command: str, *arguments: Any) -> None:
        """Execute a command that sets values, and repeat it like `ask`. Raise as `do` if it is not accepted."""
        if not self.ask(operation, command, *arguments):
            self._not_accepted(operation)

    def do(self, operation: str, command: str, *arguments: Any, **options: Any) -> None:
        """Execute a command that returns whether it was accepted. Raise DeviceFault if it was not, or as `call`."""
        if not self.call(operation, command, *arguments, **options):
            self._not_accepted(operation)

    def _not_accepted(self, operation: str) -> NoReturn:
        once_within(
            self._ending.is_set, 2.0 * timing.PROGRAM_GONE_TIMEOUT + timing.PROCESS_END_TIMEOUT, timing.GUARD_PERIOD
        )
        if self.ended is not None:
            raise self.ended  # the guard is determining the cause
        raise DeviceFault("{device} did not accept {what}.", device=self.who, what=operation)

    def speed(
        self, command: str, velocities: list[float], acceleration: float, valid_for: float, stopped: Callable[[], bool]
    ) -> None:
        """Start or renew a motion by speed. The control process ends it `valid_for` s from now unless renewed."""
        self._jogs_until = until = time.monotonic() + valid_for

        def late() -> bool:
            return stopped() or time.monotonic() >= until

        if not self.call("a jog", command, velocities, acceleration, until, stopped=late):
            if time.monotonic() >= until:
                raise Cancelled(
                    "A jog of {device} was sent too late; it was valid for {valid_for:g} s.",
                    device=self.who,
                    valid_for=valid_for,
                )
            self._not_accepted("a jog")

    def end_jog(self) -> bool:
        """End a jog. Return whether one was running. Raise as `do`."""
        if time.monotonic() >= self._jogs_until + timing.JOG_STOP_TIMEOUT:
            return False
        self._jogs_until = 0.0
        self.do("the end of a jog", "speedStop")
        return True

    def set_output(self, number: int, on: bool) -> None:
        """Switch an output: 0 to 7 standard, 8 to 15 configurable, 16 and 17 at the tool."""
        command = ("setStandardDigitalOut", "setConfigurableDigitalOut", "setToolDigitalOut")[number // 8]
        self.do(f"digital output {number}", command, number % 8, on)

    def stop_motion(self, deceleration: float) -> None:
        """Stop the motion; by the dashboard, which ends the session, if the program does not react in time."""
        jogs, self._jogs_until = time.monotonic() < self._jogs_until + timing.JOG_STOP_TIMEOUT, 0.0
        own = self.own
        try:
            stopping = self._send("a stop", "stop", (deceleration,))
            if own is None:
                result_within(stopping, timing.JOG_STOP_TIMEOUT if jogs else timing.STOP_REACTION_TIMEOUT)
            elif not once_within(lambda: self._reacted(own), timing.STOP_REACTION_TIMEOUT, timing.GUARD_PERIOD / 4.0):
                self.stop_by_dashboard()
        except (TimeoutError, DeviceFault):
            self.stop_by_dashboard()
        except DeviceError as e:
            log.debug("%s: control ended while stopping: %s", self.who, e)

    def _reacted(self, number: int) -> bool:
        """Return whether a run is stopping or has ended."""
        newest = self._observer.newest()
        # Also before its first line: the program reads the stop register before it moves.
        return newest is None or newest.run(self.upper) != (number, RunState.RUNNING)

    # -------------------------------------------------------------------------------- motion programs
    def play(self, number: int, program: str, stopped: Callable[[], bool]) -> ScriptPort:
        """Play a motion program in place of the control program. Call `resume` afterwards in any case.

        Returns:
            The connection on which the program was sent, to be drained and closed.
        """
        port = ScriptPort.open(self.host, timing.CALL_TIMEOUT)
        self.own = number
        try:
            self.do("a program", "own")  # from now on the program receives stop requests
            if stopped():
                raise Cancelled("A motion was stopped before it started.")
            port.send(program, timing.CALL_TIMEOUT)
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
        """Let the control program play again.

        Raise DeviceFault, DeviceTimeout or the reason for the end of the session.
        """
        if self.own is None or self.ended is not None:
            return
        if (newest := self._observer.newest()) is None or program_plays(newest.runtime):
            self.end(NotInControl("Another program plays on {device}.", device=self.who))
        self.do("the control program", "resume", timeout=timing.RESUME_TIMEOUT)
        self.own = None

    def stop_by_dashboard(self) -> None:
        """Stop the program, and thereby the session, over the dashboard connection."""
        reason = Cancelled("The control program of {device} was stopped by the dashboard.", device=self.who)
        try:
            if self._dashboard is not None:
                self._dashboard.do("stop", "Stopped")
        except DeviceError as e:
            self.end(e)  # without signals the watchdog stops the program
            raise
        self.end(reason)

    def _send(
        self, operation: str, command: str, arguments: tuple[Any, ...], stopped: Callable[[], bool] = never
    ) -> "Future[Any]":
        with self._lock:
            if self.ended is not None:
                raise self.ended
            if stopped():
                raise Cancelled("{what} was stopped before it started.", what=operation)
            assert self._process is not None
            return self._process.request(command, arguments)

    # -------------------------------------------------------------------------------- from the control process
    def _on_exit(self, status: int) -> DeviceError:
        ended = ConnectionLost(
            "The control process of {device} ended with status {status}.", device=self.who, status=status
        )
        cause = _TOO_SLOW.get(status)
        error = ended if cause is None else self._too_slow(f"{cause}. {ended}")
        self.end(error)
        return self.ended or error

    def _too_slow(self, detail: str) -> ConnectionLost:
        self.too_slow = True
        return WatchdogTripped("{device}: {too_slow}", detail, device=self.who, too_slow=TOO_SLOW)

    def _on_output(self, line: bytes) -> None:
        text = line.decode("utf-8", "replace").strip()
        if any(words in line.lower() for words in _BROKEN):
            self.end(ConnectionLost("The control connection to {device} broke.", text, device=self.who))
        elif text:
            log.info("%s: %s", self.who, text)

    # -------------------------------------------------------------------------------- the guard
    def _watch(self) -> None:
        observer, process, due = self._observer, self._process, 0.0
        assert process is not None
        gone_since: float | None = None
        while not self._ending.is_set():
            newest = observer.newest()
            if newest is None or not observer.observing.online:
                self.end(ConnectionLost("{device} sends no state.", device=self.who))
            elif (unsafe := observer.unsafe) is not None and unsafe is not self._unsafe:
                self._end_by_safety(unsafe.safety_mode)
            elif program_plays(newest.runtime) or self.own is not None:
                gone_since = None
            elif gone_since is None:  # the controller's clock: an old sample was taken before the program was sent
                gone_since = newest.timestamp
            elif newest.timestamp - gone_since > timing.PROGRAM_GONE_TIMEOUT:
                self.end(self.program_gone())
            if not self._ending.is_set() and (now := time.monotonic()) >= due:
                due = now + PULSE_PERIOD
                process.write(pulse())
            self._ending.wait(timing.GUARD_PERIOD)
        self._last_stop()

    def program_gone(self) -> DeviceError:
        """Return why our program is not playing. Wait first for a reason that the control process may report."""
        gone = NotInControl(
            "{device} left remote control. Check the pendant, then retry.",
            "the program was stopped at the controller",
            device=self.who,
        )
        newest = self._observer.newest()
        if newest is not None and newest.robot_mode != MODE_RUNNING:
            return gone  # the watchdog alone would leave the arm switched on
        assert self._process is not None
        response = self._process.request("was_late", ())
        if (
            not once_within(self._ending.is_set, timing.PROCESS_END_TIMEOUT, timing.GUARD_PERIOD)
            and not response.done()
        ):
            return self._too_slow("the control process did not respond")
        if response.done() and response.exception() is None and response.result():
            return self._too_slow("the control process was late")
        return gone

    def _end_by_safety(self, safety_mode: int) -> None:
        """Stop the program, which would continue as soon as the guard door is closed, and end the session."""
        safety = safety_of(safety_mode)
        reason = SafetyStop(
            "{safety} of {device}", REMEDIES.get(safety, ""), safety.value, safety=label(safety), device=self.who
        )
        self._last_stop()
        self.end(reason)

    def _last_stop(self) -> None:
        """Stop our program on the controller once more, because a broken connection may have sent it again."""
        newest = self._observer.newest()
        left_behind = newest is None or program_plays(newest.runtime)
        if self._dashboard is not None and left_behind and not self._released:
            for _ in range(2):  # can be repeated: the first attempt may use a connection that was reset
                try:
                    self._dashboard.do("stop", "Stopped", timing.LAST_STOP_TIMEOUT)
                    break
                except DeviceError as e:
                    log.warning("%s: the dashboard could not stop the program: %s", self.who, e)
        if self._dashboard is not None and self._ending.is_set():
            self._dashboard.close()
