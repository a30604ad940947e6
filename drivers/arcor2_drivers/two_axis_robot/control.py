"""Control: taking and releasing control, stopping, hand teaching, and reboot after a hardware error."""

import contextlib
import logging
import math
import time
from functools import partial
from typing import Final

from arcor2_hw.data.base import now
from arcor2_hw.data.device import Alarm, Severity
from arcor2_hw.exceptions import DeviceError, DeviceFault, DeviceTimeout, NotInControl, Refused, WatchdogTripped
from arcor2_hw.keep_alive import TOO_SLOW, once_within
from arcor2_hw.messages import Message, Phrase, translatable
from arcor2_hw.objects.arm import StopCounter, check_confirmed

from . import registers as reg
from .bus import Bus
from .observer import Observer, State
from .settings import TwoAxisRobotSettings

POLL: Final = 0.005
STANDSTILL_TIMEOUT: Final = 1.0
"""Time after which stopped joints must be at standstill, s."""
ANSWER_TIMEOUT: Final = 2.0
"""Time a servo may take to reboot, s."""
ANSWER_POLL: Final = 0.05
GOALS: Final = reg.PROFILE_ACCELERATION.address
"""Address of profile acceleration, profile velocity and goal, which are adjacent."""

log = logging.getLogger(__name__)


class Control:
    """Control of both servos: watchdog, torque, stops and hardware errors."""

    def __init__(self, name: str, observer: Observer, settings: TwoAxisRobotSettings) -> None:
        self.name = name
        self._observer, self._settings = observer, settings
        self._ids = settings.ids
        self.stops = StopCounter()
        self.ours = False
        self.teaching = False
        self._why_not: str = Phrase.of("Take control first.")
        self._tripped = False
        self._since: dict[str, str] = {}

    # -------------------------------------------------------------------------------- taking and releasing
    def take(self) -> None:
        """Set the servos up, arm their bus watchdog, and enable torque at the present position, unless we have control.

        Raises:
            DeviceFault: A servo has a hardware error.
            NotInControl: The arm moves.
            Refused: A servo is not in position control, or did not accept a value.
        """
        if self.ours:
            return
        state = self._observer.fresh().value
        self.check_faults(state)
        if not state.standing:
            raise NotInControl(
                "{name} is being moved by hand or by another client. Wait until it stops.", name=self.name
            )
        for number, setup in zip(self._ids, self._observer.setups, strict=True):
            if setup.operating_mode != reg.POSITION_CONTROL:
                raise Refused(
                    "{servo} is in operating mode {operating_mode}. Set it to position control ({position_control}).",
                    servo=self._observer.bus.servo(number),
                    operating_mode=setup.operating_mode,
                    position_control=reg.POSITION_CONTROL,
                )
        losses = self._observer.losses
        self._observer.do(self._set_up)
        self._observer.do(self._enable)
        for number, servo in zip(self._ids, self._observer.fresh().value.servos, strict=True):
            if not servo.torque or servo.watchdog != self._watchdog():
                raise Refused("{servo} did not keep its watchdog and torque.", servo=self._observer.bus.servo(number))
        if self._observer.losses != losses:
            raise NotInControl("Control of {name} was lost while it was taken.", name=self.name)
        self.ours = True
        self._observer.observing.settled()

    def _watchdog(self) -> int:
        return round(self._settings.watchdog / reg.WATCHDOG)

    def _set_up(self, bus: Bus) -> None:
        setups = list(self._observer.setups)
        for joint, number in enumerate(self._ids):
            setup = setups[joint]
            has = {reg.HOMING_OFFSET: setup.homing_offset, reg.CURRENT_LIMIT: setup.current_limit}
            for register, value in reg.wanted_setup(self._settings, joint).items():
                if has[register] != value:  # each write wears the memory
                    bus.write(number, register, value)
            setups[joint] = reg.decode_setup(bus.again(partial(bus.read, number, reg.EEPROM)))
            self._observer.setups = tuple(setups)

    def _enable(self, bus: Bus) -> None:
        self._observer.start_keep_alive()
        state = bus.again(partial(bus.sync_read, self._ids, reg.STATE))
        for number, block in zip(self._ids, state, strict=True):
            bus.write(number, reg.BUS_WATCHDOG, 0)  # a tripped watchdog refuses goals
            bus.write(number, reg.GOAL, reg.decode(block).position)  # otherwise the joint would jump
            bus.write(number, reg.BUS_WATCHDOG, self._watchdog())
            bus.write(number, reg.TORQUE, 1)

    def release(self, timeout: float = 1.0) -> None:
        """Stop, disarm the watchdog and release control, if we have it. The joints hold."""
        if self.ours:
            self.stops.request()
            newest = self._observer.newest()
            if newest is not None and not newest.standing:
                self._observer.do(self.brake, urgent=True, timeout=timeout)
                self.wait_rest(timeout)
            self._observer.do(partial(self._write_all, reg.BUS_WATCHDOG, 0), timeout=timeout)
        self.drop(Phrase.of("it was released."))

    def _write_all(self, register: reg.Register, value: int, bus: Bus) -> None:
        for number in self._ids:
            bus.write(number, register, value)

    def leave(self) -> None:
        """Release control because we disconnect."""
        with contextlib.suppress(DeviceError):  # the servo cannot be reached: its watchdog stops it
            self.release(timeout=0.3)
        self.drop(Phrase.of("it was released."))

    def drop(self, reason: str) -> None:
        """Record that control has ended."""
        if self.ours:
            self._why_not, self._tripped = reason, False
        self.ours = self.teaching = False
        self._observer.end_keep_alive()

    def require(self) -> None:
        """Raise NotInControl unless we have control and the servos confirm it, or DeviceFault."""
        state = self._observer.current().value
        self.check_faults(state)
        if self.ours:
            for number, servo in zip(self._ids, state.servos, strict=True):
                if servo.watchdog == reg.TRIPPED:
                    tripped = "the bus watchdog of servo {number} has tripped: {reason}"
                    self.drop(Phrase.of(tripped, number=number, reason=TOO_SLOW))
                    self._tripped = True
                elif servo.watchdog != self._watchdog() or servo.torque == self.teaching:
                    switched = "servo {number} was switched by another client, or lost its supply."
                    self.drop(Phrase.of(switched, number=number))
        if not self.ours:
            error = NotInControl("Control of {name} is not taken: {why_not}", name=self.name, why_not=self._why_not)
            raise WatchdogTripped(error.message) if self._tripped else error

    def require_motion(self) -> None:
        """Raise what prevents motions: no control, or hand teaching."""
        self.require()
        if self.teaching:
            raise Refused("{name} is in hand teaching mode.", name=self.name)

    # -------------------------------------------------------------------------------- stopping
    def stop(self) -> None:
        """Stop and wait for standstill. Raise ConnectionLost or DeviceTimeout."""
        self.stops.request()
        if not self.ours or self.teaching:
            return
        self._observer.do(self.brake, urgent=True)
        self.wait_rest(STANDSTILL_TIMEOUT)

    def brake(self, bus: Bus) -> None:
        """Set the goal of each moving servo to the nearest position where it can stop."""
        blocks = {}
        asked = time.monotonic()
        for joint, block in enumerate(bus.sync_read(self._ids, reg.STATE)):
            servo = reg.decode(block)
            velocity = servo.velocity * reg.VELOCITY
            delay = time.monotonic() - asked  # the servo moves on until it receives the goal
            way = round((velocity**2 / (2.0 * self._settings.stop_deceleration) + abs(velocity) * delay) / reg.TICK)
            setup = self._observer.setups[joint]
            goal = servo.position + int(math.copysign(way, velocity))
            goal = max(setup.min_position, min(setup.max_position, goal))
            hard, _ = reg.profile(1.0, self._settings.stop_deceleration)
            blocks[self._ids[joint]] = goal_block(hard, max(servo.profile_velocity, 1), goal)
        bus.sync_write(GOALS, blocks)

    def wait_rest(self, timeout: float) -> None:
        """Wait for standstill. Raise DeviceTimeout."""
        if not once_within(lambda: not self.ours or self._observer.fresh().value.standing, timeout, POLL):
            raise DeviceTimeout(
                "{name} did not come to a standstill within {timeout:g} s of a stop.", name=self.name, timeout=timeout
            )

    # -------------------------------------------------------------------------------- hand teaching
    def set_teaching(self, enabled: bool) -> None:
        """Switch torque off, or on again at the present position."""
        self.require()
        self._observer.do(partial(self._write_all, reg.TORQUE, 0) if enabled else self._enable)
        self._observer.fresh()  # an older state would look as if another client had switched torque
        self.teaching = enabled

    # -------------------------------------------------------------------------------- hardware errors
    def alarms(self) -> list[Alarm]:
        """Return the active hardware errors, by servo and bit."""
        newest = self._observer.newest()
        found = {}
        for number, servo in zip(self._ids, newest.servos if newest else (), strict=False):
            for bit in range(8):
                if servo.hardware_error >> bit & 1:
                    unknown = f"hardware error bit {bit}", translatable("See the manual of the servo")
                    text, remedy = map(Message.of, reg.HARDWARE_ERRORS.get(bit, unknown))
                    code = f"{number}:{bit}"
                    since = self._since.get(code, now())
                    remedy = Message.of("{remedy}, then call restart_safety.", remedy=remedy)
                    text = Message.of("servo {number}: {text}", number=number, text=text)
                    found[code] = Alarm.of(code, Severity.ERROR, text, remedy, since)
        self._since = {code: alarm.since for code, alarm in found.items()}
        return list(found.values())

    def check_faults(self, state: State) -> None:
        """Raise DeviceFault if a servo has a hardware error."""
        if any(servo.hardware_error for servo in state.servos):
            self.drop(Phrase.of("a servo has a hardware error."))
            alarms = self.alarms()
            texts = "; ".join(f"{alarm.text} ({alarm.remedy})" for alarm in alarms)
            raise DeviceFault(
                "{device}: {texts}",
                fault_code=",".join(alarm.code for alarm in alarms),
                device=self._observer.who,
                texts=texts,
            )

    def reboot(self, confirmed_by: str) -> None:
        """Reboot the servos with a hardware error."""
        check_confirmed(confirmed_by)
        servos = self._observer.fresh().value.servos
        failed = [number for number, servo in zip(self._ids, servos, strict=True) if servo.hardware_error]
        if not failed:
            raise Refused("{name} has no hardware error.", name=self.name)
        self.stops.request()
        self.drop(Phrase.of("a servo was rebooted."))

        def reboot(bus: Bus) -> None:
            for number in failed:
                bus.reboot(number)
            until = time.monotonic() + ANSWER_TIMEOUT
            for number in failed:
                while True:
                    time.sleep(ANSWER_POLL)
                    try:
                        bus.ping(number)
                        break
                    except DeviceTimeout:
                        if time.monotonic() > until:
                            raise

        self._observer.do(reboot, timeout=2.0 * ANSWER_TIMEOUT)
        log.warning("%s: servos %s rebooted, confirmed by %s", self.name, failed, confirmed_by)
        self.check_faults(self._observer.fresh().value)


def goal_block(acceleration: int, velocity: int, goal: int) -> bytes:
    """Return profile acceleration, profile velocity and goal, as they are written to a servo."""
    return b"".join(value.to_bytes(4, "little", signed=True) for value in (acceleration, velocity, goal))
