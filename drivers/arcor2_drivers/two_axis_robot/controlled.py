"""TwoAxisControlled: taking control of a two-axis robot, stopping it, hand teaching, reboot after a hardware error."""

import contextlib
import logging
import math
import time
from collections.abc import Iterator
from typing import ClassVar, Final

from arcor2_hw.data.device import LossReaction
from arcor2_hw.data.geometry import Pose
from arcor2_hw.exceptions import DeviceError, DeviceFault, DeviceTimeout, InvalidData, NotInControl, Refused
from arcor2_hw.keep_alive import FROZEN_AFTER, TOO_SLOW

from . import registers as reg
from .bus import Bus
from .observed import TwoAxisObserved
from .observer import Snapshot
from .settings import LONGEST_WATCHDOG, TwoAxisRobotSettings

POLL: Final = 0.005
REST_WITHIN: Final = 1.0
ANSWERS_WITHIN: Final = 2.0
"""s a servo may be away after a reboot."""
ANSWERS_EVERY: Final = 0.05
GOALS: Final = reg.PROFILE_ACCELERATION.address
"""Profile acceleration, profile velocity and goal lie side by side from here on."""

log = logging.getLogger(__name__)


class TwoAxisControlled(TwoAxisObserved):
    """A two-axis robot under control."""

    _ABSTRACT = True
    loss_reaction: ClassVar[LossReaction] = LossReaction.stops_within(FROZEN_AFTER + LONGEST_WATCHDOG + 0.1)

    def __init__(self, obj_id: str, name: str, pose: Pose, settings: TwoAxisRobotSettings) -> None:
        super().__init__(obj_id, name, pose, settings)
        self._ours = False
        self._teaching = False
        self._stops = 0
        self._why_not = ""

    # -------------------------------------------------------------------------------- control
    def disconnect(self) -> None:
        """Give control back and close; harmless when closed."""
        with contextlib.suppress(DeviceError):  # it is gone; its watchdog deals with that
            self._release(timeout=0.3)
        self._drop("it was given back")
        super().disconnect()

    def _on_loss(self, error: DeviceError) -> None:
        self._drop(f"the connection was lost: {error}")

    def _drop(self, why: str) -> None:
        if self._ours:
            self._why_not = why
        self._ours = self._teaching = False
        self._observer.end_keep_alive()

    def control_owner(self) -> str | None:
        """Tell whether we have control. A port has one user: nobody else can have it while we are connected."""
        return "us" if self._ours else None

    def take_control(self) -> None:
        """Set the servos up, arm their bus watchdog, then switch torque on where the joints are. Nothing moves.

        Raises DeviceFault naming a hardware error, NotInControl while the arm moves, Refused naming what is missing.
        """
        if self._ours:
            return
        self.safe_moves.prepare()  # before the watchdog is armed: it is not fed meanwhile
        snapshot = self._observer.fresh()
        self._check_faults(snapshot)
        if not snapshot.standing:
            raise NotInControl(f"{self.name} is moving, and not by us; wait until it stands")
        for number, setup in zip(self._axes.ids, self._observer.setups, strict=True):
            if setup.operating_mode != reg.POSITION_CONTROL:
                raise Refused(
                    f"{self._observer.bus.servo(number)} is in operating mode {setup.operating_mode}; "
                    f"set it to position control ({reg.POSITION_CONTROL})"
                )
        losses = self._observer.losses
        self._observer.do(self._set_up)
        self._observer.do(self._enable)
        snapshot = self._observer.fresh()
        for number, servo in zip(self._axes.ids, snapshot.servos, strict=True):
            if not servo.torque or servo.watchdog != self._watchdog():
                raise Refused(f"{self._observer.bus.servo(number)} did not keep its watchdog and torque")
        if self._observer.losses != losses:
            raise NotInControl(f"control of {self.name} was lost while it was taken")
        self._ours = True
        self._why_not = ""
        self._observer.observing.settled()

    def _watchdog(self) -> int:
        return round(self._axes.watchdog / reg.WATCHDOG)

    def _set_up(self, bus: Bus) -> None:
        setups = list(self._observer.setups)
        for joint, number in enumerate(self._axes.ids):
            setup = setups[joint]
            has = {reg.HOMING_OFFSET: setup.homing_offset, reg.CURRENT_LIMIT: setup.current_limit}
            for register, value in reg.wanted_setup(self._axes, joint).items():
                if has[register] == value:
                    continue  # the memory wears
                bus.write(number, register, value)
            setups[joint] = reg.decode_setup(bus.read(number, reg.EEPROM))
            self._observer.setups = tuple(setups)

    def _enable(self, bus: Bus) -> None:
        self._observer.begin_keep_alive()
        for number, block in zip(self._axes.ids, bus.sync_read(self._axes.ids, reg.STATE), strict=True):
            bus.write(number, reg.BUS_WATCHDOG, 0)  # a tripped one refuses goals
            bus.write(number, reg.GOAL, reg.decode(block).position)  # else the joint would jump
            bus.write(number, reg.BUS_WATCHDOG, self._watchdog())
            bus.write(number, reg.TORQUE, 1)

    def release_control(self) -> None:
        """Stop and give control back; the joints hold, without a watchdog. Harmless when it is not ours."""
        self._release(timeout=1.0)
        self._drop("it was given back")

    def _release(self, timeout: float) -> None:
        if not self._ours:
            return
        self._stops += 1
        newest = self._observer.newest()
        if newest is not None and not newest.standing:
            self._observer.do(self._brake, urgent=True, timeout=timeout)
            self._wait_rest(timeout)

        def disarm(bus: Bus) -> None:
            for number in self._axes.ids:
                bus.write(number, reg.BUS_WATCHDOG, 0)

        self._observer.do(disarm, timeout=timeout)

    def _check_faults(self, snapshot: Snapshot) -> None:
        if any(servo.hardware_error for servo in snapshot.servos):
            self._drop("a servo has a hardware error")
            alarms = self.alarms()
            texts = "; ".join(f"{alarm.text} ({alarm.remedy})" for alarm in alarms)
            raise DeviceFault(f"{self._observer.who}: {texts}", fault_code=",".join(alarm.code for alarm in alarms))

    def _require_control(self) -> None:
        snapshot = self._observer.current()
        self._check_faults(snapshot)
        if self._ours:
            for number, servo in zip(self._axes.ids, snapshot.servos, strict=True):
                if servo.watchdog == reg.TRIPPED:
                    self._drop(f"the bus watchdog of servo {number} has tripped: {TOO_SLOW.format('robot')}")
                elif servo.watchdog != self._watchdog() or servo.torque == self._teaching:
                    self._drop(f"servo {number} was switched by somebody else, or lost its supply")
        if not self._ours:
            why = f": {self._why_not}" if self._why_not else ""
            raise NotInControl(f"control of {self.name} is not taken{why}")

    @contextlib.contextmanager
    def _moving(self) -> Iterator[None]:
        if not self._move_lock.acquire(blocking=False):
            raise Refused(f"{self.name} is moving already")
        self._observer.busy = True
        try:
            yield
        finally:
            self._observer.busy = False
            self._move_lock.release()

    # -------------------------------------------------------------------------------- stopping
    def stop(self) -> None:
        """Stop what we move and return when it stands; called past everything else. It is no safety function.

        Raises ConnectionLost, DeviceTimeout when the arm does not come to rest.
        """
        self._stops += 1
        if not self._ours or self._teaching:
            return
        self._observer.do(self._brake, urgent=True)
        self._wait_rest(REST_WITHIN)

    def _brake(self, bus: Bus) -> None:
        """Give each servo that moves the goal at which it can stand soonest."""
        blocks = {}
        asked = time.monotonic()
        for joint, block in enumerate(bus.sync_read(self._axes.ids, reg.STATE)):
            servo = reg.decode(block)
            velocity = servo.velocity * reg.VELOCITY
            late = time.monotonic() - asked  # what it goes on until it hears of this
            way = round((velocity**2 / (2.0 * self._axes.stop_deceleration) + abs(velocity) * late) / reg.TICK)
            setup = self._observer.setups[joint]
            goal = servo.position + int(math.copysign(way, velocity))
            goal = max(setup.min_position, min(setup.max_position, goal))
            hard, _ = reg.profile(1.0, self._axes.stop_deceleration)
            fast = max(servo.profile_velocity, 1)
            blocks[self._axes.ids[joint]] = b"".join(v.to_bytes(4, "little", signed=True) for v in (hard, fast, goal))
        bus.sync_write(GOALS, blocks)

    def _wait_rest(self, timeout: float) -> None:
        until = time.monotonic() + timeout
        while self._ours and not self._observer.fresh().standing:
            if time.monotonic() > until:
                raise DeviceTimeout(f"{self.name} did not come to rest within {timeout:g} s of a stop")
            time.sleep(POLL)

    # -------------------------------------------------------------------------------- hand teaching
    def get_hand_teaching_mode(self) -> bool:
        """Tell whether torque is off so that the arm can be moved by hand."""
        return self._teaching

    def set_hand_teaching_mode(self, enabled: bool) -> None:
        """Switch torque off, or on again where the joints are then. Raises Refused while the arm moves."""
        if enabled == self._teaching:
            return
        with self._moving():
            self._require_control()
            if enabled:
                self._observer.do(self._relax)
            else:
                self._observer.do(self._enable)
            self._observer.fresh()  # an older state would look as if somebody else had switched torque
            self._teaching = enabled

    def _relax(self, bus: Bus) -> None:
        for number in self._axes.ids:
            bus.write(number, reg.TORQUE, 0)

    # -------------------------------------------------------------------------------- hardware errors
    def restart_safety(self, confirmed_by: str) -> None:
        """Reboot the servos that have a hardware error; `confirmed_by` is the person who looked. Control is dropped.

        Raises InvalidData without a person, Refused without an error, DeviceTimeout when a servo does not come back,
        DeviceFault when the error stands again.
        """
        if not confirmed_by.strip():
            raise InvalidData("confirmed_by must name the person who looked at the robot")
        failed = [
            number
            for number, servo in zip(self._axes.ids, self._observer.fresh().servos, strict=True)
            if servo.hardware_error
        ]
        if not failed:
            raise Refused(f"{self.name} has no hardware error")
        self._stops += 1
        self._drop("a servo was rebooted")

        def reboot(bus: Bus) -> None:
            for number in failed:
                bus.reboot(number)
            until = time.monotonic() + ANSWERS_WITHIN
            for number in failed:
                while True:
                    time.sleep(ANSWERS_EVERY)
                    try:
                        bus.ping(number)
                        break
                    except DeviceTimeout:
                        if time.monotonic() > until:
                            raise

        self._observer.do(reboot, timeout=2.0 * ANSWERS_WITHIN)
        log.warning("%s: servos %s rebooted, confirmed by %s", self.name, failed, confirmed_by)
        self._check_faults(self._observer.fresh())
