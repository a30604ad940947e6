"""HoldsParts: attaches a gripped part to the robot in the collision world and detaches it on release."""

import logging
from collections.abc import Callable
from typing import Final, NamedTuple

from arcor2_hw.actions import action
from arcor2_hw.data.geometry import Pose, Position
from arcor2_hw.data.object_type import Box
from arcor2_hw.exceptions import Arcor2Error, NotFound
from arcor2_hw.objects.generic import CollisionObject, Generic
from arcor2_hw.objects.robot import MultiArmRobot, Robot
from arcor2_hw.objects.settings import Settings
from arcor2_hw.objects.surroundings import HeldPart

CLEARANCE: Final = 0.002
"""Distance by which the model of a gripped part is smaller on every side, m.

So the part may touch a surface when it is picked or placed at inaccurately taught poses.
"""
LARGEST: Final = 2.0
"""Maximum edge length of a part, m."""

log = logging.getLogger(__name__)


class PartSize(NamedTuple):
    """Edges of a part along the axes of the tool, m, and the shift of its centre along the tool's z axis, m."""

    x: float
    y: float
    z: float
    offset: float = 0.0

    @property
    def known(self) -> bool:
        """Return whether all edges are known."""
        return min(self.x, self.y, self.z) > 0.0


class _Holding(NamedTuple):
    robot: Robot
    part: HeldPart
    object: CollisionObject | None


class HoldsParts:
    """Mixin of object types that grip parts: grippers, suction cups, and robots that control their own gripper.

    A driver calls `attach_part` when a part is gripped and `detach_part` when it is released or lost. The size of the
    part comes from the action `set_part`, or from the settings `part_size_x`, `part_size_y`, `part_size_z` and
    `part_offset_z`; the setting `robot` names the robot that carries the gripper. While a part is attached, safe moves
    and reachability keep it clear of obstacles. A part of unknown size is not attached.
    """

    name: str
    _settings: Settings | None
    _find_object: Callable[[str], Generic] | None = None
    _find_robot: Callable[[str], Robot] | None = None
    _part_size: PartSize | None = None
    _part_object: CollisionObject | None = None
    _holding: _Holding | None = None

    def mount(self, find_object: Callable[[str], Generic], find_robot: Callable[[str], Robot]) -> None:
        """Receive the functions that find objects of the scene; called once before `connect`.

        Args:
            find_object: Returns an object by its name or id.
            find_robot: Returns a robot by its name or id; for an empty name the only robot of the scene.
        """
        self._find_object, self._find_robot = find_object, find_robot

    # -------------------------------------------------------------------------------- actions
    @action
    def set_part(
        self, size_x: float, size_y: float, size_z: float, offset_z: float = 0.0, *, an: str | None = None
    ) -> None:
        """Set the size of the parts that are gripped from now on, so that safe moves keep them clear of obstacles.

        :param size_x: size along the x axis of the tool, m; 0: unknown, the part is not considered
        :param size_y: size along the y axis of the tool, m
        :param size_z: size along the z axis of the tool, m
        :param offset_z: shift of the part along the z axis of the tool, m
        """
        assert 0.0 <= size_x <= 2.0
        assert 0.0 <= size_y <= 2.0
        assert 0.0 <= size_z <= 2.0
        assert -1.0 <= offset_z <= 1.0
        self._part_size = PartSize(size_x, size_y, size_z, offset_z)

    @action
    def set_part_object(self, object_name: str, *, an: str | None = None) -> None:
        """Set the collision object of the scene that is gripped next; it moves with the tool until it is released.

        :param object_name: name of the collision object
        """
        found = None if self._find_object is None else self._find_object(object_name)
        if not isinstance(found, CollisionObject):
            raise NotFound(
                "{name} cannot grip {object_name}: the scene has no collision object of that name",
                name=self.name,
                object_name=object_name,
            )
        self._part_object = found

    # -------------------------------------------------------------------------------- for drivers
    def attach_part(self, size: PartSize | None = None, *, hanging: bool = False) -> None:
        """Attach the part that was just gripped to the end effector of the robot. Errors are only logged.

        Args:
            size: Size to assume if neither an action nor the settings define one.
            hanging: Whether the part hangs below the tool centre point, as on a suction cup, instead of around it.
        """
        try:
            self._attach(size, hanging)
        except Arcor2Error as error:
            log.warning("%s: safe moves do not consider the gripped part: %s", self.name, error)

    def detach_part(self) -> None:
        """Detach the part. A collision object of the scene gets its present pose. Errors are only logged."""
        holding, self._holding = self._holding, None
        if holding is None:
            return
        robot, part, gripped = holding
        try:
            if gripped is not None:
                gripped.set_pose(robot.get_end_effector_pose(part.link) * part.in_link)
        except Arcor2Error as error:
            log.warning("%s: the pose of %s is unknown: %s", self.name, part.name, error)
        robot.drop_part(part.name)

    def _attach(self, size: PartSize | None, hanging: bool) -> None:
        self.detach_part()
        gripped, self._part_object = self._part_object, None
        robot = self._carrying_robot()
        stated = self._stated_size()
        used = stated if stated.known else size
        if robot is None or isinstance(robot, MultiArmRobot) or (gripped is None and used is None):
            return
        link = min(robot.get_end_effectors_ids())
        if gripped is not None:
            in_link = robot.get_end_effector_pose(link).inverted() * gripped.pose
            part = HeldPart(gripped.name, link, in_link)
        else:
            assert used is not None
            middle = used.offset + (used.z / 2.0 if hanging and used is stated else 0.0)
            edges = (edge - 2.0 * min(CLEARANCE, edge / 4.0) for edge in used[:3])
            name = f"part of {self.name}"
            part = HeldPart(name, link, Pose(Position(0.0, 0.0, middle)), Box(name, *edges))
        self._holding = _Holding(robot, part, gripped)
        robot.hold_part(part)

    def _carrying_robot(self) -> Robot | None:
        """Return the robot that carries the gripper, or None if there is none."""
        if isinstance(self, Robot):
            return self
        if self._find_robot is None:
            return None
        return self._find_robot(getattr(self._settings, "robot", ""))

    def _stated_size(self) -> PartSize:
        if self._part_size is not None:
            return self._part_size
        names = ("part_size_x", "part_size_y", "part_size_z", "part_offset_z")
        return PartSize(*(getattr(self._settings, name, 0.0) for name in names))


def check_part_size(settings: Settings, within: Callable[[str, float, float, float], None]) -> None:
    """Check the settings that state the size of a part.

    Args:
        settings: The settings.
        within: The driver's function that checks a range.
    """
    for axis in "xyz":
        name = f"part_size_{axis}"
        within(name, getattr(settings, name), 0.0, LARGEST)
    within("part_offset_z", getattr(settings, "part_offset_z", 0.0), -1.0, 1.0)
