"""Snapshot of the obstacles around a robot, and the collision world built from it.

Pinocchio and coal come with the extra `kinematics` and are imported on first use.
"""

import dataclasses
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Final

from msgspec.structs import replace

from arcor2_hw.data.geometry import Orientation, Pose, Position
from arcor2_hw.data.robot import Joint
from arcor2_hw.exceptions import Refused
from arcor2_hw.objects.robot import Robot
from arcor2_hw.objects.surroundings import Attachment, Obstacle

if TYPE_CHECKING:
    from arcor2_hw.collision.world import CollisionWorld
    from arcor2_hw.kinematics.model import RobotModel
    from arcor2_hw.kinematics.shapes import Shape
    from arcor2_hw.objects.robot_tools import RobotTools

JOINT_TOLERANCE: Final = 0.01
"""Change of a joint value, rad or m, below which a robot counts as unmoved."""

Others = list[tuple[Robot, list[Joint]]]
"""Other robots, each with its joint values."""


def other_robots(robot: Robot) -> Others:
    """Return the other robots around a robot, with their present joint values.

    Raises:
        Refused: The joints of a robot are unknown; the message names it.
    """
    return [(other, joints) for other, joints in robot.surroundings.robots() if isinstance(other, Robot)]


@dataclasses.dataclass(frozen=True)
class ObstacleSnapshot:
    """Obstacles by name, and other robots by name with their joint values, at one moment.

    Tools of robots and gripped parts are obstacles with an attachment.
    """

    obstacles: dict[str, Obstacle]
    robots: dict[str, tuple[Robot, list[Joint]]]

    @classmethod
    def take(cls, robot: Robot, others: Others, tool: Callable[[Robot], Obstacle | None]) -> "ObstacleSnapshot":
        """Take a snapshot of the surroundings of a robot.

        Args:
            robot: The robot whose surroundings count.
            others: The other robots that have a model.
            tool: Returns the tool of a robot that its model does not contain.
        """
        # Copies, because programs may change poses and joints in place.
        obstacles = {each.name: replace(each, pose=_copied(each.pose)) for each in robot.surroundings.obstacles()}
        for each in (robot, *(other for other, _ in others)):
            if (attached := tool(each)) is not None:
                obstacles[attached.name] = attached
            for part in each.parts.values():
                attachment, known = Attachment(each.name, part.link), obstacles.get(part.name)
                if part.model is not None:
                    obstacles[part.name] = Obstacle(part.name, part.model, part.in_link, attachment)
                elif known is not None:
                    obstacles[part.name] = replace(known, pose=part.in_link, attachment=attachment)
        robots = {other.name: (other, [Joint(joint.name, joint.value) for joint in joints]) for other, joints in others}
        return cls(obstacles, robots)

    def settled(self, before: "ObstacleSnapshot") -> "ObstacleSnapshot":
        """Return this snapshot with the joint values of `before` for robots that have not moved since."""
        robots = dict(self.robots)
        for name, (robot, joints) in self.robots.items():
            known = before.robots.get(name)
            if known is not None and not _differ(known[1], joints):
                robots[name] = robot, known[1]
        return ObstacleSnapshot(self.obstacles, robots)

    def changed_since(self, before: "ObstacleSnapshot", robot: str) -> "ObstacleSnapshot":
        """Return the obstacles that appeared or moved since `before`, and the parts that `robot` holds.

        If the robot holds a new part, return the whole snapshot, because the part may collide with any obstacle.
        """
        obstacles = {name: one for name, one in self.obstacles.items() if before.obstacles.get(name) != one}
        if any(one.attachment is not None and one.attachment.robot == robot for one in obstacles.values()):
            return self
        robots = {name: one for name, one in self.robots.items() if before.robots.get(name) != one}
        if not obstacles and not robots:
            return ObstacleSnapshot({}, {})
        carriers = {robot, *robots}
        obstacles |= {
            name: one
            for name, one in self.obstacles.items()
            if one.attachment is not None and one.attachment.robot in carriers
        }
        for one in obstacles.values():
            if one.attachment is not None and one.attachment.robot in self.robots:
                robots[one.attachment.robot] = self.robots[one.attachment.robot]
        return ObstacleSnapshot(obstacles, robots)

    @property
    def empty(self) -> bool:
        """Return whether there are no obstacles and robots."""
        return not self.obstacles and not self.robots


def build_world(
    robot: Robot, tools: "RobotTools", now: Sequence[Joint], around: ObstacleSnapshot, margin: float
) -> "CollisionWorld":
    """Create the collision world of a robot.

    Args:
        robot: The robot.
        tools: Models and shapes.
        now: Joint values of the robot.
        around: Its surroundings.
        margin: Margin of the world, m.

    Raises:
        Refused: Joint values of another robot, a mesh or the robot that holds a part are unknown.
    """
    from arcor2_hw.collision.world import CollisionWorld

    world = CollisionWorld(margin=margin)
    world.add_robot(robot.name, tools.model, robot.pose, tools.model.values(now, tools.model.neutral()))
    for other, joints in around.robots.values():
        model = tools.other(other)
        if model is not None:
            _require_all_joints(other, model, joints)
            world.add_robot(other.name, model, other.pose, model.values(joints, model.neutral()))
    for obstacle in around.obstacles.values():
        shape = tools.shape(obstacle)
        if obstacle.attachment is None:
            world.put(obstacle.name, shape, obstacle.pose)
        else:
            _attach(world, obstacle.name, shape, obstacle.attachment, obstacle.pose)
    return world


def _attach(world: "CollisionWorld", name: str, shape: "Shape", attachment: Attachment, in_link: Pose) -> None:
    if attachment.robot not in world.robots:
        raise Refused(
            "The pose of {name} is unknown, because the joints of {robot}, which holds it, are unknown.",
            name=name,
            robot=attachment.robot,
        )
    holder = world.robot(attachment.robot)
    frames = holder.link_frames(holder.q)
    if attachment.link not in frames:
        raise Refused(
            "{name} is attached to {link}, which is not a link of {robot}",
            name=name,
            link=attachment.link,
            robot=attachment.robot,
        )
    world.put(name, shape, Pose.from_matrix(frames[attachment.link]) * in_link)
    world.attach(name, attachment.robot, attachment.link, touching=attachment.touching)


def _require_all_joints(robot: Robot, model: "RobotModel", joints: Sequence[Joint]) -> None:
    """Require the values of all joints that lead to the robot's end effectors.

    Raises:
        Refused: A joint value is missing.
    """
    given = {joint.name for joint in joints}
    for name in model.end_effectors:
        for joint in model.arm(name).joint_names:
            if joint not in given:
                raise Refused(
                    "The position of {name} is unknown, because it does not report the joint {joint}.",
                    name=robot.name,
                    joint=joint,
                )


def _copied(pose: Pose) -> Pose:
    position, rotation = pose.position, pose.orientation
    return Pose(
        Position(position.x, position.y, position.z), Orientation(rotation.x, rotation.y, rotation.z, rotation.w)
    )


def _differ(one: Sequence[Joint], other: Sequence[Joint]) -> bool:
    values = {joint.name: joint.value for joint in one}
    return len(one) != len(other) or any(
        abs(values.get(joint.name, float("inf")) - joint.value) > JOINT_TOLERANCE for joint in other
    )
