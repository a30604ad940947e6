"""Picking and placing with a gripper on a digital output, and a part sensor on a digital input."""

from typing import Final

from arcor2_hw.actions import action
from arcor2_hw.data.geometry import Pose, Position
from arcor2_hw.exceptions import DeviceFault, Refused
from arcor2_hw.keep_alive import once_within
from arcor2_hw.objects import HoldsParts
from arcor2_hw.objects.arm import StopGuard

from .digital_io import DigitalIO
from .motion import Motion
from .settings import UrSettings
from .timing import POLL_INTERVAL

NOTHING_HELD: Final = "nothing_held"
PART_LOST: Final = "part_lost"
PART_STICKS: Final = "part_sticks"


class DigitalGripper(HoldsParts, DigitalIO):
    """Mixin of an arm that switches a gripper by a digital output."""

    _ur: UrSettings
    _motion: Motion

    @action(takes_from="pose")
    def pick(
        self, pose: Pose, approach: float = 0.1, speed: float = 0.5, slow_speed: float = 0.1, *, an: str | None = None
    ) -> None:
        """Pick a part: open the gripper, approach along the tool, grip, wait until the part is held, retreat.

        It is refused while the sensor detects a part in the gripper.

        :param pose: where the part is gripped
        :param approach: distance of the approach, m
        :param speed: fraction of the maximum before the approach
        :param slow_speed: fraction of the maximum at the part
        """
        assert 0.0 <= approach <= 0.5
        assert 0.01 <= speed <= 1.0
        assert 0.01 <= slow_speed <= 1.0
        output, guard, above = self._gripper_output(), self._control.stops.guard(), _behind(pose, approach)
        if self.part_present():
            raise Refused("{name} cannot pick: its gripper holds a part already.", name=self.name)
        self._switch(output, False)  # the gripper is closed after a part was lost
        self._motion.to_pose(above, False, speed, 0.5, guard)
        self._motion.to_pose(pose, True, slow_speed, 0.5, guard)
        self._switch(output, True)
        held = self._await_part(True, guard)
        if held:
            self.attach_part()
        self._motion.to_pose(above, True, slow_speed, 0.5, guard)
        if not held:
            self._switch(output, False)
            raise DeviceFault(
                "{name} picked nothing.", f"input {self._ur.part_sensor_input}", NOTHING_HELD, name=self.name
            )
        self._check_part_held("on the way up")

    @action(puts_to="pose")
    def place(
        self, pose: Pose, approach: float = 0.1, speed: float = 0.5, slow_speed: float = 0.1, *, an: str | None = None
    ) -> None:
        """Place the gripped part: approach along the tool, release, retreat.

        :param pose: where the part is released
        :param approach: distance of the approach, m
        :param speed: fraction of the maximum before the approach
        :param slow_speed: fraction of the maximum at the place
        """
        assert 0.0 <= approach <= 0.5
        assert 0.01 <= speed <= 1.0
        assert 0.01 <= slow_speed <= 1.0
        output, guard, above = self._gripper_output(), self._control.stops.guard(), _behind(pose, approach)
        self._motion.to_pose(above, False, speed, 0.5, guard)
        self._check_part_held("on the way")
        self._motion.to_pose(pose, True, slow_speed, 0.5, guard)
        self._check_part_held("on the way down")
        self._switch(output, False)
        released = self._await_part(False, guard)
        self._motion.to_pose(above, True, slow_speed, 0.5, guard)
        if not released:
            raise DeviceFault("The part sticks to the gripper of {name}.", fault_code=PART_STICKS, name=self.name)

    def _gripper_output(self) -> int:
        if self._ur.gripper_output < 0:
            raise Refused("{name} has no gripper: gripper_output is not set.", name=self.name)
        return self._ur.gripper_output

    def part_present(self) -> bool | None:
        """Return whether the sensor detects a part; None without a sensor."""
        number = self._ur.part_sensor_input
        return self.get_digital_input(number) if number >= 0 else None

    def _await_part(self, held: bool, guard: StopGuard) -> bool:
        """Wait until the sensor detects or loses the part; without a sensor, for the time that the gripper takes."""

        def seen() -> bool:
            guard.check(f"The gripper of {self.name}")
            return self.part_present() is held

        return once_within(seen, self._ur.gripper_time, POLL_INTERVAL) or self.part_present() is None

    def _check_part_held(self, when: str) -> None:
        if self.part_present() is False:
            self.detach_part()
            raise DeviceFault("{name} lost the part {when}.", fault_code=PART_LOST, name=self.name, when=when)

    def _on_switched(self, output: int, value: bool) -> None:
        if output == self._ur.gripper_output and not value:
            self.detach_part()


def _behind(pose: Pose, distance: float) -> Pose:
    """Return the pose `distance` m before another along the tool's axis."""
    return pose * Pose(Position(0.0, 0.0, -distance))
