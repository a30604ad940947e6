"""Control of the arm while it is ours: one thread that alone touches ur_rtde, and one that guards it.

The lane thread owns the library's control interface: it carries out jobs one by one, an urgent one first, and between
them kicks the controller's watchdog. So the watchdog lives only as long as this process, this thread and the observed
connection do. The guard ends the session, and stops the controller's program on a connection of its own, as soon as
something is so that nothing may go on by itself. An ended session never comes back; control is taken anew.
"""

import collections
import contextlib
import ctypes
import logging
import threading
import time
from collections.abc import Callable
from concurrent.futures import Future
from concurrent.futures import TimeoutError as FutureTimeout
from typing import Any, Final, TypeVar

from rtde_control import RTDEControlInterface
from rtde_io import RTDEIOInterface

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
from .observer import Observer
from .states import MAY_MOVE, REMEDIES, program_plays, safety_of

T = TypeVar("T")

STREAM_FREQUENCY: Final = 125.0
"""Hz of the library's own stream: a command takes 16 ms instead of 4, the thread 5 % of a core instead of 10."""
KICKS_PER_PERIOD: Final = 4.0
"""Kicks within one period of the watchdog: three may be late."""
UNHEALTHY: Final = 0.3
"""Seconds without an observed sample after which the watchdog is no longer kicked and the session ends; the library
falls into endless reconnection, or crashes the process, from 2.5 s on."""
GUARD_PERIOD: Final = 0.01
CALL_TIMEOUT: Final = 1.0
"""Seconds for a command that moves nothing; the library itself waits 4 to 300."""
STOP_REACTION: Final = 0.05
"""Seconds the control program may take to react to a stop before the dashboard is used: two commands of 16 ms."""
PROGRAM_GONE: Final = 0.1
"""Seconds our program may be seen not playing before the session ends: two streams tell of it, not at one instant."""

log = logging.getLogger(__name__)


def _kept(interface: T) -> T:
    """Keep an interface of the library from ever being destroyed.

    The destructor of the control interface sleeps 0.5 s with the interpreter held, which would stall every device of
    this process. `disconnect` has closed its sockets and ended its threads; what stays is a few kilobytes.
    """
    ctypes.pythonapi.Py_IncRef(ctypes.py_object(interface))
    return interface


class _Job:
    def __init__(self, what: str, run: Callable[[RTDEControlInterface], Any], valid: Callable[[], bool]) -> None:
        self.what, self.run, self.valid = what, run, valid
        self.future: Future[Any] = Future()


class ControlSession:
    """Control from `open` until it ends. `ended` is None while it lives, then the reason."""

    def __init__(self, observer: Observer, upper: bool, watchdog_frequency: float) -> None:
        self.address = observer.host
        self.upper = upper
        self.ended: DeviceError | None = None
        self._observer = observer
        self._watchdog = watchdog_frequency
        self._stop_line = Dashboard(observer.host)
        self._jobs: collections.deque[_Job] = collections.deque()
        self._wake = threading.Condition()
        self._ending = threading.Event()
        self._opened: Future[None] = Future()
        self._lane = threading.Thread(target=self._run, name=f"control lane {self.address}", daemon=True)
        self._guard = threading.Thread(target=self._watch, name=f"control guard {self.address}", daemon=True)
        self._speeding = False
        self._speed_until = 0.0
        self._io: RTDEIOInterface | None = None

    # -------------------------------------------------------------------------------- for any thread
    def open(self, timeout: float, dashboard: bool) -> None:
        """Send the control program and arm its watchdog. Raises NotInControl, DeviceTimeout, DeviceFault."""
        if dashboard:
            self._stop_line.open(timeout)
        self._lane.start()
        try:
            self._opened.result(timeout)
        except FutureTimeout:
            error = DeviceTimeout(f"UR controller {self.address} did not start the control program in {timeout:g} s")
            self.end(error)
            raise error from None
        except BaseException:
            self._stop_line.close()
            raise
        self._guard.start()

    def call(
        self,
        what: str,
        run: Callable[[RTDEControlInterface], T],
        timeout: float = CALL_TIMEOUT,
        *,
        urgent: bool = False,
        valid: Callable[[], bool] = lambda: True,
    ) -> T:
        """Run a job in the lane and give what it gives. `valid` is asked at the last moment: false drops it.

        Raises what ended the session, Cancelled when dropped, DeviceTimeout (and the session ends) when it takes longer
        than `timeout` s, DeviceFault when the controller does not accept it.
        """
        job = _Job(what, run, valid)
        with self._wake:
            if self.ended is not None:
                raise self.ended
            if urgent:
                self._jobs.appendleft(job)
            else:
                self._jobs.append(job)
            self._wake.notify()
        try:
            result: T = job.future.result(timeout)
        except FutureTimeout:
            error = DeviceTimeout(f"UR controller {self.address} did not take {what} within {timeout:g} s")
            self.end(error)
            raise error from None
        return result

    def speed(self, what: str, run: Callable[[RTDEControlInterface], bool], valid_for: float) -> None:
        """Begin or renew a motion by speed that the lane ends `valid_for` s from now."""
        until = time.monotonic() + valid_for

        def start(rtde: RTDEControlInterface) -> bool:
            if time.monotonic() >= until:
                return True  # a late packet
            self._speeding, self._speed_until = True, until
            return run(rtde)

        self.do(what, start)

    def do(self, what: str, run: Callable[[RTDEControlInterface], bool], **options: Any) -> None:
        """As `call`, for a command that the library answers with true or false; DeviceFault on false."""
        if not self.call(what, run, **options):
            self._check_ended_soon()
            raise DeviceFault(f"UR controller {self.address} did not accept {what}")

    def stop_motion(self, deceleration: float) -> None:
        """Stop what moves; by the dashboard, which ends the session, when the program does not react in time.

        Always the asynchronous stopL, the only one of the four that is run as what it is called: ur_rtde 1.6.5 runs a
        synchronous stopL as stopj until the first asynchronous stop, and stopJ as stopl from then on.
        """

        def stop(rtde: RTDEControlInterface) -> None:
            self._speeding = False
            rtde.stopL(deceleration, True)

        job = _Job("stop", stop, lambda: True)
        with self._wake:
            if self.ended is not None:
                return
            self._jobs.appendleft(job)
            self._wake.notify()
        try:
            job.future.result(STOP_REACTION)
        except (FutureTimeout, DeviceFault):
            self.stop_by_dashboard()
        except DeviceError as e:
            log.debug("UR %s: control ended while stopping: %s", self.address, e)

    def stop_by_dashboard(self) -> None:
        """The second path of a stop: stop the program, and with it the session."""
        try:
            self.stop_program()
        finally:
            self.end(Cancelled(f"the control program of UR {self.address} was stopped by the dashboard"))

    def set_output(self, number: int, on: bool) -> None:
        """Switch an output: 0 to 7 standard, 8 to 15 configurable, 16 and 17 of the tool."""
        io = self._io
        assert io is not None

        def switch(_: RTDEControlInterface) -> bool:
            if number < 8:
                done: bool = io.setStandardDigitalOut(number, on)
            elif number < 16:
                done = io.setConfigurableDigitalOut(number - 8, on)
            else:
                done = io.setToolDigitalOut(number - 16, on)
            return done

        self.do(f"digital output {number}", switch)

    def stop_program(self, timeout: float = 1.0) -> None:
        """Stop the controller's program by the dashboard, on a connection of its own."""
        self._stop_line.do("stop", "Stopped", timeout)

    def end(self, reason: DeviceError) -> None:
        """End the session: no further job, no further kick. The first reason counts."""
        with self._wake:
            if self.ended is None:
                self.ended = reason
                log.warning("control of UR %s ends: %s", self.address, reason)
            self._ending.set()
            self._wake.notify_all()

    def close(self, reason: DeviceError, wait: float) -> None:
        """End the session and wait for its program to be told, at most `wait` s."""
        self.end(reason)
        if threading.current_thread() is not self._lane and self._lane.is_alive():
            self._lane.join(wait)

    def _check_ended_soon(self) -> None:
        """A command answered with false mostly means that the guard is about to see why; let it."""
        if self._ending.wait(2.0 * PROGRAM_GONE) and self.ended is not None:
            raise self.ended

    # -------------------------------------------------------------------------------- the lane
    def _run(self) -> None:
        try:
            rtde = self._construct()
        except (RuntimeError, DeviceError) as e:
            error = e if isinstance(e, DeviceError) else self._named(e)
            if self._io is not None:
                self._io.disconnect()
            self.ended = error
            self._opened.set_exception(error)
            return
        try:
            self._opened.set_result(None)
            self._serve(rtde)
        finally:
            self._dispose(rtde)

    def _construct(self) -> RTDEControlInterface:
        flags = RTDEControlInterface.FLAG_UPLOAD_SCRIPT | RTDEControlInterface.FLAG_NO_EXT_FT
        if self.upper:
            flags |= RTDEControlInterface.FLAG_UPPER_RANGE_REGISTERS
        # Before the watchdog is armed: this constructor holds the interpreter for 0.1 s.
        self._io = _kept(RTDEIOInterface(self.address, False, self.upper))
        rtde = _kept(RTDEControlInterface(self.address, STREAM_FREQUENCY, flags))
        if not rtde.setWatchdog(self._watchdog):
            self._dispose(rtde)
            raise DeviceFault(f"UR controller {self.address} does not arm the watchdog of the control program")
        return rtde

    def _named(self, e: RuntimeError) -> DeviceError:
        text = str(e)
        if "in use" in text.lower() or "in_use" in text.lower():
            block = "24 to 47" if self.upper else "0 to 23"
            return NotInControl(
                f"the input registers {block} of UR controller {self.address} are used by a fieldbus or another client",
                text,
            )
        if "remote control" in text.lower():
            return NotInControl(f"UR controller {self.address} is in local control", text)
        return DeviceFault(f"UR controller {self.address} does not start the control program", text)

    def _serve(self, rtde: RTDEControlInterface) -> None:
        period = 1.0 / (KICKS_PER_PERIOD * self._watchdog)
        due = 0.0
        while True:
            with self._wake:
                if not self._jobs and self.ended is None:
                    self._wake.wait(max(due - time.monotonic(), 0.0))
                if self.ended is not None:
                    return
                job = self._jobs.popleft() if self._jobs else None
            if job is not None:
                self._carry_out(job, rtde)
            if self._speeding and time.monotonic() >= self._speed_until:
                self._speeding = False
                rtde.speedStop()
            if time.monotonic() >= due and self._healthy():
                rtde.kickWatchdog()
                due = time.monotonic() + period

    @staticmethod
    def _carry_out(job: _Job, rtde: RTDEControlInterface) -> None:
        if not job.valid():
            job.future.set_exception(Cancelled(f"{job.what} was stopped before it began"))
            return
        try:
            job.future.set_result(job.run(rtde))
        except (RuntimeError, ValueError, TypeError) as e:
            job.future.set_exception(DeviceFault(f"{job.what} failed in the control interface", str(e)))

    def _healthy(self) -> bool:
        newest = self._observer.newest()
        return newest is not None and newest.age < UNHEALTHY

    def _dispose(self, rtde: RTDEControlInterface) -> None:
        reason = self.ended or ConnectionLost(f"control of UR {self.address} has ended")
        with self._wake:
            self.ended = reason
            jobs, self._jobs = self._jobs, collections.deque()
        for job in jobs:
            job.future.set_exception(reason)
        with contextlib.suppress(RuntimeError):
            newest = self._observer.newest()
            if self._healthy() and newest is not None and program_plays(newest.runtime):
                rtde.stopScript()
        self._stop_line.close()
        for interface in (rtde, self._io):
            with contextlib.suppress(RuntimeError):
                if interface is not None:
                    interface.disconnect()

    # -------------------------------------------------------------------------------- the guard
    def _watch(self) -> None:
        gone_since = 0.0
        while not self._ending.wait(GUARD_PERIOD):
            newest = self._observer.newest()
            if newest is None or newest.age > UNHEALTHY:
                self.end(ConnectionLost(f"nothing is heard of UR controller {self.address}"))
                return
            safety = safety_of(newest.safety_mode)
            if safety not in MAY_MOVE:
                self._stopped_by_safety(safety)
                return
            if program_plays(newest.runtime):
                gone_since = 0.0
            elif gone_since == 0.0:
                gone_since = time.monotonic()
            elif time.monotonic() - gone_since > PROGRAM_GONE:
                self.end(
                    NotInControl(f"the control program was stopped at UR controller {self.address}, not by this driver")
                )
                return

    def _stopped_by_safety(self, safety: Safety) -> None:
        """End, and stop the program first: after a safeguard stop it would go on as soon as the guard closes."""
        kind = safety.value
        reason = SafetyStop(f"{kind.replace('_', ' ')} of UR {self.address}", REMEDIES.get(safety, ""), kind)
        try:
            self.stop_program()
        except DeviceError as e:
            log.warning("UR %s: the program could not be stopped by the dashboard: %s", self.address, e)
        self.end(reason)
