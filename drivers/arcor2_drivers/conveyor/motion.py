"""Motion: enable, move and stop the drive by the state machine of CiA 402."""

import contextlib
import threading
from collections.abc import Callable
from typing import Final

from arcor2_hw.exceptions import DeviceError, DeviceFault, DeviceTimeout, Refused
from arcor2_hw.messages import Message
from arcor2_hw.objects.observing import GoOn

from . import cia402
from .cia402 import FAULTY, Mode, Power, State
from .emergencies import fault_of
from .observer import Observer
from .settings import ConveyorSettings

STEP: Final = 1.0
"""Time limit for a step of the state machine, s."""
MARGIN: Final = 2.0
"""Time a motion may take beyond the time computed from its speed and ramps, s."""
STANDSTILL: Final = 0.001
"""Velocity below which the belt counts as stopped, m/s: a measured velocity is never exactly 0."""


class Motion:
    """Moves the belt, one motion at a time."""

    def __init__(self, observer: Observer, settings: ConveyorSettings) -> None:
        self._observer, self._link, self._settings = observer, observer.link, settings
        self._who = observer.who
        self._one_step = threading.Lock()
        self._standstill = max(settings.rate(STANDSTILL), 1)

    def control(self, word: int, go_on: GoOn) -> None:
        """Write the control word, unless the work was cancelled. Steps do not overtake each other."""
        with self._one_step:
            go_on()
            self._link.write(cia402.CONTROLWORD, word)

    def is_stopped(self, now: State) -> bool:
        """Return whether the belt is stopped."""
        return abs(now.velocity) <= self._standstill

    def fault(self, now: State, operation: str) -> DeviceFault:
        """Return the error for a drive in fault."""
        code = now.error_code or self._observer.emergency
        fault = fault_of(code)
        return DeviceFault(
            "{device}: {what}: fault {code:04X}h, {text}; {remedy}",
            fault_code=f"{code:04X}h",
            device=self._who,
            what=operation,
            code=code,
            text=Message.of(fault.text),
            remedy=Message.of(fault.remedy),
        )

    def _enabled(self, now: State, operation: str) -> None:
        if now.power in FAULTY:
            raise self.fault(now, f"{operation} ended")
        if now.power is not Power.ENABLED:
            emergency = self._observer.emergency
            why = f": {fault_of(emergency).text} ({emergency:04X}h)" if emergency else ""
            raise DeviceFault(
                "{device}: {what} ended: the drive went to {power}{reason}",
                device=self._who,
                what=operation,
                power=now.power,
                reason=why,
            )

    # -------------------------------------------------------------------------------- enabling
    def enable(self, mode: Mode, operation: str, go_on: GoOn) -> None:
        """Enable the drive in a mode, at standstill. Raises DeviceFault, DeviceTimeout, Cancelled."""
        now = self._observer.fresh().value
        if now.power in FAULTY:
            raise self.fault(now, f"{operation} is refused in state {now.power}")
        if now.power is Power.QUICK_STOP:
            now = self._observer.wait(
                lambda s: s.power is not Power.QUICK_STOP, STEP, f"{operation}: leaving quick stop"
            ).value
        if now.power is Power.ENABLED and now.mode == mode:
            return
        self._link.write(cia402.TARGET_VELOCITY, 0)
        self._link.write(cia402.MODE, mode)
        self._step(lambda s: s.mode == mode, f"{operation}: changing to {mode.name.lower()}", go_on)
        if now.power is Power.ENABLED:
            return
        if now.power is not Power.SWITCHED_ON:
            self.control(cia402.CW_SHUTDOWN, go_on)
            self._step(lambda s: s.power is Power.READY, f"{operation}: getting ready to switch on", go_on)
            self.control(cia402.CW_SWITCH_ON, go_on)
            self._step(lambda s: s.power is Power.SWITCHED_ON, f"{operation}: switching on", go_on)
        self.control(cia402.CW_ENABLE, go_on)
        self._step(lambda s: s.power is Power.ENABLED, f"{operation}: enabling", go_on)

    def make_ready(self, operation: str, go_on: GoOn) -> None:
        """Enable the drive in profile velocity mode, at standstill."""
        self.enable(Mode.PROFILE_VELOCITY, operation, go_on)
        self.control(cia402.CW_ENABLE, go_on)

    def _step(self, arrived: Callable[[State], bool], operation: str, go_on: GoOn) -> State:
        def holds(now: State) -> bool:
            go_on()
            if now.power in FAULTY:
                raise self.fault(now, f"{operation} ended")
            return arrived(now)

        return self._observer.wait(holds, STEP, operation).value

    def _reach(self, arrived: Callable[[State], bool], timeout: float, operation: str, go_on: GoOn) -> State:
        """Wait for a state while the drive is enabled; halt the belt after a timeout."""

        def holds(now: State) -> bool:
            go_on()
            self._enabled(now, operation)
            return arrived(now)

        try:
            return self._observer.wait(holds, timeout, operation).value
        except DeviceTimeout:
            with contextlib.suppress(DeviceError):  # the drive monitors our heartbeat
                self.halt()
            raise

    # -------------------------------------------------------------------------------- motions
    def home(self, operation: str, go_on: GoOn) -> None:
        """Home as configured in the settings. Raises DeviceFault when it fails."""
        s, write = self._settings, self._link.write
        write(cia402.HOMING_METHOD, s.homing_method)
        write(cia402.HOMING_SPEED_SEARCH, s.rate(s.homing_speed))
        write(cia402.HOMING_SPEED_ZERO, s.rate(s.homing_speed))
        write(cia402.HOMING_ACCELERATION, s.rate(s.acceleration))
        self.enable(Mode.HOMING, operation, go_on)
        self.control(cia402.CW_ENABLE, go_on)
        self.control(cia402.CW_ENABLE | cia402.CW_START, go_on)

        def homed(now: State) -> bool:
            if now.statusword & cia402.HOMING_ERROR:
                raise DeviceFault(
                    "{device}: {what} ended with a homing error (method {homing_method})",
                    device=self._who,
                    what=operation,
                    homing_method=s.homing_method,
                )
            wanted = cia402.HOMING_ATTAINED | cia402.TARGET_REACHED
            return now.statusword & wanted == wanted and self.is_stopped(now)

        self._reach(homed, s.homing_timeout, operation, go_on)
        self.control(cia402.CW_ENABLE, go_on)

    def move(self, target: int, relative: bool, speed: int, expected: int, operation: str, go_on: GoOn) -> None:
        """Move to `target`, or by it, counts; `expected` is the end position, counts."""
        s, write = self._settings, self._link.write
        self.enable(Mode.PROFILE_POSITION, operation, go_on)
        before = self._observer.fresh().value
        self.control(cia402.CW_ENABLE, go_on)
        write(cia402.PROFILE_VELOCITY, speed)
        write(cia402.TARGET_POSITION, target)
        self._step(lambda now: not now.statusword & cia402.SETPOINT_ACKNOWLEDGE, f"{operation}: being free", go_on)
        start = cia402.CW_ENABLE | cia402.CW_START | cia402.CW_AT_ONCE | (cia402.CW_RELATIVE if relative else 0)
        self.control(start, go_on)
        acknowledged = cia402.SETPOINT_ACKNOWLEDGE
        self._reach(lambda now: bool(now.statusword & acknowledged), STEP, f"{operation}: taking the set-point", go_on)
        self.control(cia402.CW_ENABLE, go_on)
        self._reach(lambda now: not now.statusword & acknowledged, STEP, f"{operation}: ending the handshake", go_on)
        takes = abs(expected - before.position) / speed + 2.0 * speed / s.rate(s.acceleration)
        after = self._reach(
            lambda now: bool(now.statusword & cia402.TARGET_REACHED) and self.is_stopped(now),
            takes + MARGIN,
            operation,
            go_on,
        )
        if abs(after.position - expected) > s.rate(s.tolerance):
            reached, wanted = s.metres(after.position), s.metres(expected)
            raise DeviceFault(
                "{device}: {what} ended at {reached:.4f} m instead of {wanted:.4f} m",
                device=self._who,
                what=operation,
                reached=reached,
                wanted=wanted,
            )

    def run(self, speed: int, operation: str, go_on: GoOn) -> None:
        """Run with a velocity; return when it is reached."""
        s = self._settings
        self.enable(Mode.PROFILE_VELOCITY, operation, go_on)
        self.control(cia402.CW_ENABLE, go_on)
        with self._one_step:
            go_on()
            self._link.write(cia402.TARGET_VELOCITY, speed)
        near = max(self._standstill, abs(speed) // 20)
        ramp = 2.0 * s.max_speed / s.acceleration
        self._reach(
            lambda now: bool(now.statusword & cia402.TARGET_REACHED) and abs(now.velocity - speed) <= near,
            ramp + MARGIN,
            operation,
            go_on,
        )

    # -------------------------------------------------------------------------------- stopping
    def halt(self) -> None:
        """Stop the belt and wait for standstill. The set-point is discarded, also by the drive."""
        s = self._settings
        with self._one_step:
            power = cia402.power(self._link.read(cia402.STATUSWORD))
            if power is Power.ENABLED:
                self._link.write(cia402.CONTROLWORD, cia402.CW_ENABLE | cia402.CW_HALT)
                self._link.write(cia402.TARGET_VELOCITY, 0)
        self._observer.wait(self.is_stopped, s.max_speed / s.acceleration + MARGIN, "halting")
        if power is not Power.ENABLED:
            return
        with self._one_step:
            if cia402.power(self._link.read(cia402.STATUSWORD)) is Power.ENABLED:
                # If only the halt bit were cleared, the drive would continue to its set-point.
                self._link.write(cia402.CONTROLWORD, cia402.CW_SWITCH_ON)
        self._observer.wait(lambda now: now.power is not Power.ENABLED, STEP, "leaving Operation enabled")

    def quick_stop(self) -> None:
        """Stop on the quick stop ramp; wait for standstill. The torque is off then."""
        with self._one_step:
            if cia402.power(self._link.read(cia402.STATUSWORD)) is Power.ENABLED:
                self._link.write(cia402.CONTROLWORD, cia402.CW_QUICK_STOP)
        self._observer.wait(
            lambda now: now.power not in (Power.ENABLED, Power.QUICK_STOP) and self.is_stopped(now),
            MARGIN,
            "quick stop",
        )

    def fault_reset(self, go_on: GoOn) -> None:
        """Reset a fault. Raises Refused while its cause is present."""
        now = self._observer.wait(
            lambda s: s.power is not Power.FAULT_REACTION, MARGIN, "the reaction to the fault"
        ).value
        if now.power is not Power.FAULT:
            return
        self.control(cia402.CW_DISABLE_VOLTAGE, go_on)
        self.control(cia402.CW_FAULT_RESET, go_on)
        try:
            self._observer.wait(lambda s: s.power is not Power.FAULT, STEP, "resetting the fault")
        except DeviceTimeout as error:
            text = str(self.fault(now, "its cause is still present"))
            raise Refused("{device}: fault_reset is refused in state Fault", text, device=self._who) from error
        self.control(cia402.CW_DISABLE_VOLTAGE, go_on)
