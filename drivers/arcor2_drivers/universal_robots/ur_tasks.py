"""UrTasks: the actions that a Universal Robots arm offers to programs."""

import time
from collections.abc import Callable
from typing import ClassVar, Final

from arcor2_hw.actions import StrEnum, action
from arcor2_hw.data.base import now
from arcor2_hw.data.device import Reading
from arcor2_hw.data.geometry import Pose, Position
from arcor2_hw.data.project import ProjectRobotJoints
from arcor2_hw.exceptions import Cancelled, DeviceFault, DeviceTimeout, OutOfRange, Refused
from arcor2_hw.objects import HoldsParts
from arcor2_hw.objects.small import IOPoint, OnLoss, PointDirection, PointKind

from .ur_paths import UrPathed

POLL: Final = 0.005
OUTPUT_WITHIN: Final = 0.5
"""Seconds after which a switched output must be seen switched: some ten of the controller's cycles, and the network."""
NOTHING_HELD: Final = "nothing_held"
PART_LOST: Final = "part_lost"
PART_STICKS: Final = "part_sticks"


_GROUPS: Final = (("digital", 0, 8), ("config", 8, 8), ("tool", 16, 2))
NUMBERS: Final = {
    f"{group}_{direction}[{i}]": first + i
    for direction in ("in", "out")
    for group, first, count in _GROUPS
    for i in range(count)
}
"""The number of each point among the inputs or the outputs."""
POINTS: Final = {
    name: IOPoint(name, PointDirection.OUTPUT, PointKind.DIGITAL, on_loss=OnLoss.HOLD)
    if "_out" in name
    else IOPoint(name, PointDirection.INPUT, PointKind.DIGITAL)
    for name in NUMBERS
}


class MoveType(StrEnum):
    """How the TCP gets to its target."""

    LINEAR = "linear"
    JOINT = "joint"


def behind(pose: Pose, distance: float) -> Pose:
    """Give the pose `distance` m behind another along the tool's axis."""
    return pose * Pose(Position(0.0, 0.0, -distance))


class UrTasks(HoldsParts, UrPathed):
    """A Universal Robots arm at work."""

    _ABSTRACT = True
    CANCEL_MAPPING: ClassVar[dict[str, str]] = {
        "move": "stop",
        "move_to": "stop",
        "move_through": "stop",
        "move_to_contact": "stop",
        "move_carefully": "stop",
        "pick": "stop",
        "place": "stop",
        "wait_for_input": "stop",
    }

    @action
    def move(
        self,
        pose: Pose,
        move_type: MoveType = MoveType.LINEAR,
        speed: float = 0.25,
        acceleration: float = 0.5,
        *,
        an: str | None = None,
    ) -> None:
        """Move the TCP to a pose.

        :param pose: where to
        :param move_type: in a line, or all joints together
        :param speed: fraction of the configured maximum
        :param acceleration: fraction of the configured maximum
        """
        assert 0.01 <= speed <= 1.0
        assert 0.01 <= acceleration <= 1.0
        self._move_pose(pose, move_type is MoveType.LINEAR, speed, acceleration, self._stops)

    @action
    def move_to(
        self, joints: ProjectRobotJoints, speed: float = 0.25, acceleration: float = 0.5, *, an: str | None = None
    ) -> None:
        """Move to stored joint values, all joints arriving together.

        :param joints: where to
        :param speed: fraction of the configured maximum
        :param acceleration: fraction of the configured maximum
        """
        assert 0.01 <= speed <= 1.0
        assert 0.01 <= acceleration <= 1.0
        self._move_joints(self._checked_joints(joints.joints), speed, acceleration, self._stops)

    @action
    def move_through(
        self,
        via: Pose,
        pose: Pose,
        blend: float = 0.05,
        move_type: MoveType = MoveType.LINEAR,
        speed: float = 0.25,
        *,
        an: str | None = None,
    ) -> None:
        """Move the TCP past a pose to another one without standing on the way.

        :param via: pose on the way
        :param pose: where to
        :param blend: how near the TCP comes to the pose on the way, m; 0: it stands there
        :param move_type: in lines, or all joints together
        :param speed: fraction of the configured maximum
        """
        assert 0.0 <= blend <= 0.5
        assert 0.01 <= speed <= 1.0
        self._path([via, pose], blend, move_type is MoveType.LINEAR, speed, self._stops)

    @action
    def move_to_contact(
        self, force: float = 10.0, max_distance: float = 0.1, speed: float = 0.02, *, an: str | None = None
    ) -> None:
        """Move along the tool's axis until it touches something, and stop there; it is an error to meet nothing.

        :param force: force at which it stops, N
        :param max_distance: how far at most, m
        :param speed: fraction of the configured maximum
        """
        assert 1.0 <= force <= 100.0
        assert 0.001 <= max_distance <= 1.0
        assert 0.001 <= speed <= 0.25
        here = self._world(self._observer.sample())
        axis = Position(0.0, 0.0, 1.0).rotated(here.orientation)
        self.move_until_contact((axis.x, axis.y, axis.z), force, max_distance, speed)

    @action
    def move_carefully(self, pose: Pose, force: float = 20.0, speed: float = 0.1, *, an: str | None = None) -> None:
        """Move the TCP in a line to a pose, and stop with an error where a force acts on it.

        :param pose: where to
        :param force: force at which it stops, N
        :param speed: fraction of the configured maximum
        """
        assert 1.0 <= force <= 100.0
        assert 0.01 <= speed <= 1.0
        self.move_force_limited(pose, force, speed)

    @action
    def pick(
        self, pose: Pose, approach: float = 0.1, speed: float = 0.5, slow_speed: float = 0.1, *, an: str | None = None
    ) -> None:
        """Pick a part: approach along the tool, grip, wait until it is held, retreat.

        :param pose: where the part is gripped
        :param approach: distance from which it is approached, m
        :param speed: fraction of the maximum on the way there
        :param slow_speed: fraction of the maximum at the part
        """
        assert 0.0 <= approach <= 0.5
        assert 0.01 <= speed <= 1.0
        assert 0.01 <= slow_speed <= 1.0
        output, stops = self._gripper_output(), self._stops
        above = behind(pose, approach)
        self._move_pose(above, False, speed, 0.5, stops)
        self._move_pose(pose, True, slow_speed, 0.5, stops)
        self._switch(output, True)
        held = self._part_comes(True, stops)
        if held:
            self.attach_part()
        self._move_pose(above, True, slow_speed, 0.5, stops)
        if not held:
            self._switch(output, False)
            raise DeviceFault(f"{self.name} picked nothing", f"input {self._ur.part_sensor_input}", NOTHING_HELD)
        if self._senses_part() and not self.get_digital_input(self._ur.part_sensor_input):
            self.detach_part()
            raise DeviceFault(f"{self.name} lost the part on the way up", fault_code=PART_LOST)

    @action
    def place(
        self, pose: Pose, approach: float = 0.1, speed: float = 0.5, slow_speed: float = 0.1, *, an: str | None = None
    ) -> None:
        """Place the part that is held: approach along the tool, let go, retreat.

        :param pose: where the part is let go
        :param approach: distance from which it is approached, m
        :param speed: fraction of the maximum on the way there
        :param slow_speed: fraction of the maximum at the place
        """
        assert 0.0 <= approach <= 0.5
        assert 0.01 <= speed <= 1.0
        assert 0.01 <= slow_speed <= 1.0
        output, stops = self._gripper_output(), self._stops
        above = behind(pose, approach)
        self._move_pose(above, False, speed, 0.5, stops)
        if self._senses_part() and not self.get_digital_input(self._ur.part_sensor_input):
            self.detach_part()
            raise DeviceFault(f"{self.name} lost the part on the way", fault_code=PART_LOST)
        self._move_pose(pose, True, slow_speed, 0.5, stops)
        self._switch(output, False)
        gone = self._part_comes(False, stops)
        self._move_pose(above, True, slow_speed, 0.5, stops)
        if not gone:
            raise DeviceFault(f"the part sticks to the gripper of {self.name}", fault_code=PART_STICKS)

    @action
    def set_digital_output(self, output: int, value: bool, *, an: str | None = None) -> None:
        """Switch a digital output and see it switched; it keeps its state when the robot loses the hub.

        :param output: 0 to 7 standard, 8 to 15 configurable, 16 and 17 at the tool
        :param value: on or off
        """
        assert 0 <= output <= 17
        self._switch(output, value)

    @action
    def get_digital_input(self, number: int, *, an: str | None = None) -> bool:
        """Read a digital input.

        :param number: 0 to 7 standard, 8 to 15 configurable, 16 and 17 at the tool
        """
        assert 0 <= number <= 17
        return bool(self._observer.sample().inputs >> number & 1)

    @action(deadline=None)
    def wait_for_input(self, number: int, value: bool, timeout: float = 10.0, *, an: str | None = None) -> None:
        """Wait until a digital input has a value.

        :param number: 0 to 7 standard, 8 to 15 configurable, 16 and 17 at the tool
        :param value: on or off
        :param timeout: seconds after which it fails
        """
        assert 0 <= number <= 17
        assert 0.0 <= timeout <= 3600.0
        stops = self._stops

        def seen() -> bool:
            if self._stops != stops:
                raise Cancelled(f"waiting for input {number} of {self.name} was stopped")
            return self.get_digital_input(number) is value

        if not self._within(timeout, seen):
            raise DeviceTimeout(f"input {number} of {self.name} was not {'on' if value else 'off'} in {timeout:g} s")

    # -------------------------------------------------------------------------------- points, for others in the scene
    def points(self) -> list[IOPoint]:
        """Give the digital inputs and outputs by the names that they have at the pendant; outputs hold on a loss."""
        return list(POINTS.values())

    def read(self, name: str) -> Reading[bool | float]:
        """Read a point, from any thread. Raises OutOfRange for an unknown name, NotConnected, ConnectionLost, Stale."""
        point, sample = self._point(name), self._observer.sample()
        bits = sample.inputs if point.direction is PointDirection.INPUT else sample.outputs
        return Reading[bool | float](bool(bits >> NUMBERS[name] & 1), now(), sample.monotonic)

    def write(self, name: str, value: bool | float) -> None:
        """Switch an output, from any thread, beside a motion. Raises OutOfRange, Refused for an input, NotInControl."""
        if self._point(name).direction is PointDirection.INPUT:
            raise Refused(f"{name} of {self.name} is an input")
        self._switch(NUMBERS[name], bool(value))

    def _point(self, name: str) -> IOPoint:
        if name not in POINTS:
            raise OutOfRange(f"{self.name} has no point {name!r}; there are {', '.join(POINTS)}")
        return POINTS[name]

    # -------------------------------------------------------------------------------- gripper and outputs
    def _gripper_output(self) -> int:
        if self._ur.gripper_output < 0:
            raise Refused(f"{self.name} has no gripper: gripper_output is not set")
        return self._ur.gripper_output

    def _senses_part(self) -> bool:
        return self._ur.part_sensor_input >= 0

    def _part_comes(self, held: bool, stops: int) -> bool:
        """Wait for the gripper: for the sensor's word if there is one, else for the time it takes."""
        number = self._ur.part_sensor_input
        seconds = self._ur.gripper_time

        def seen() -> bool:
            if self._stops != stops:
                raise Cancelled(f"the gripper's work on {self.name} was stopped")
            return self._senses_part() and self.get_digital_input(number) is held

        return self._within(seconds, seen) or not self._senses_part()

    def _switch(self, output: int, value: bool) -> None:
        if not 0 <= output <= 17:
            raise OutOfRange(f"{self.name}: output must be 0 to 17, not {output}")
        self._controlled().set_output(output, value)
        if output == self._ur.gripper_output and not value:
            self.detach_part()
        if not self._within(OUTPUT_WITHIN, lambda: bool(self._observer.sample().outputs >> output & 1) is value):
            raise DeviceFault(f"output {output} of {self.name} did not switch {'on' if value else 'off'}")

    @staticmethod
    def _within(seconds: float, holds: Callable[[], bool]) -> bool:
        until = time.monotonic() + seconds
        while not holds():
            if time.monotonic() > until:
                return False
            time.sleep(POLL)
        return True
