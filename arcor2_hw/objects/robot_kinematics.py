"""RobotKinematics: kinematics and contacts of a robot with a URDF, and its held parts. Poses are in the world.

Pinocchio and coal come with the extra `kinematics` and are imported on first use.
"""

import contextlib
import logging
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Final, NamedTuple, TypeVar

from arcor2_hw.data.geometry import Pose
from arcor2_hw.data.object_type import Models
from arcor2_hw.data.robot import Joint
from arcor2_hw.exceptions import Arcor2Error, KinematicsError, NotFound, Refused
from arcor2_hw.objects.obstacle_snapshot import ObstacleSnapshot, Others, build_world, other_robots
from arcor2_hw.objects.robot import Robot
from arcor2_hw.objects.robot_tools import RobotTools, package_of, settings_of
from arcor2_hw.objects.surroundings import Attachment, HeldPart, Obstacle

if TYPE_CHECKING:
    from arcor2_hw.collision.world import CollisionWorld
    from arcor2_hw.kinematics.shapes import Array

MARGIN: Final = 0.005
"""Distance of a path from obstacles, m.

It is half of the resolution, so that no collision between two checks is missed. If the start or the goal is nearer to
an obstacle, the path is checked without a margin.
"""

log = logging.getLogger(__name__)
T = TypeVar("T")


class Tool(NamedTuple):
    """A tool that the URDF does not contain: the link it is mounted on, its shape, and its pose in that link."""

    link: str
    shape: Models
    in_link: Pose


class RobotKinematics:
    """Kinematics and contacts of one robot. It may be used by several threads; each has its own models.

    The URDF is the package named by `urdf_package_name` of the type: an uploaded asset of that name, or in `urdf/` next
    to the module of the class. Joints that the URDF lacks, such as those of a gripper, are ignored.

    Args:
        robot: The robot.
        settings: Returns the settings that the URDF depends on, by name; default: the settings of the object.
        tool: Returns the tool that the URDF does not contain, or None.
    """

    def __init__(
        self,
        robot: Robot,
        settings: Callable[[], Mapping[str, object]] | None = None,
        tool: Callable[[], Tool | None] = lambda: None,
    ) -> None:
        self._robot = robot
        self.tool = tool
        self._settings = settings or (lambda: settings_of(robot))
        self._local = threading.local()

    def prepare(self) -> None:
        """Import the libraries and load the models on this thread. Errors are only logged; moves raise them again.

        Call it before any device is controlled, because it blocks other threads for some tenths of a second, also those
        that feed watchdogs.
        """
        try:
            from arcor2_hw.planning import planner  # noqa: F401

            tool = _tool_of(self._robot)
            alone = ObstacleSnapshot({} if tool is None else {tool.name: tool}, {})
            build_world(self._robot, self._tools(), [], alone, 0.0)
        except (ImportError, Arcor2Error) as error:
            log.info("%s: no safe moves: %s", self._robot.name, error)

    # -------------------------------------------------------------------------------- kinematics
    def end_effectors(self) -> list[str]:
        """Return the names of the end effectors.

        Raises:
            Refused: The robot has no URDF.
            ModelError: The URDF cannot be used.
        """
        return list(self._tools().model.end_effectors)

    def joint_limits(self) -> dict[str, tuple[float, float]]:
        """Return the lower and upper limit of each joint, rad or (prismatic) m. Raises as `end_effectors`."""
        return {joint.name: (joint.lower, joint.upper) for joint in self._tools().model.joints}

    def forward(self, end_effector: str, joints: Sequence[Joint]) -> Pose:
        """Compute the pose for joint values.

        Raises:
            NotFound: The end effector does not exist.
            ModelError: Joints are missing or not finite.
        """
        arm = self._tools().arm(end_effector)
        return self._robot.pose * arm.pose(arm.values(joints))

    def inverse(
        self, end_effector: str, pose: Pose, near: Sequence[Joint], avoid_collisions: bool = True
    ) -> list[Joint]:
        """Compute joint values that reach a pose, nearest to `near`.

        Args:
            end_effector: The end effector.
            pose: The pose.
            near: Joint values to which the solution is nearest.
            avoid_collisions: Whether solutions in collision are skipped.

        Raises:
            KinematicsException: The pose cannot be reached; the message says why.
            NotFound: The end effector does not exist.
            InvalidData: A value is not finite.
        """
        with self._own_errors():
            tools = self._tools()
            arm, target = tools.arm(end_effector), self._target(pose)
            if not avoid_collisions:
                return arm.named(tools.inverse(end_effector).solve(target, arm.values(near)))
            from arcor2_hw.collision.world import collision_check

            def solved(world: "CollisionWorld", _: ObstacleSnapshot) -> list[Joint]:
                blocked = collision_check(world, self._robot.name, arm)
                return arm.named(tools.inverse(end_effector).solve(target, arm.values(near), blocked))

            return self._with_margin(near, solved)

    def contacts(self, joints: Sequence[Joint]) -> list[str]:
        """Return the contacts of the robot at joint values, as pairs of names."""
        with self._own_errors():
            world = build_world(self._robot, self._tools(), joints, self._snapshot(), 0.0)
            return [str(contact) for contact in world.contacts(self._robot.name, self._q(joints))]

    # -------------------------------------------------------------------------------- held parts
    def hold(self, name: str, link: str, joints: Sequence[Joint]) -> None:
        """Attach a collision object of the scene to a link of the robot at their present poses.

        Args:
            name: The object.
            link: Link of the robot's model; the object may touch it.
            joints: Present joint values.

        Raises:
            NotFound: The scene has no such collision object, or the model no such link.
            Refused: A robot holds the object already.
        """
        obstacle = next((each for each in self._robot.surroundings.obstacles() if each.name == name), None)
        if obstacle is None:
            raise NotFound(
                "{name} cannot hold {other_name}: the scene has no collision object of that name",
                name=self._robot.name,
                other_name=name,
            )
        if obstacle.attachment is not None:
            raise Refused(
                "{name} cannot hold {other_name}: {robot} holds it",
                name=self._robot.name,
                other_name=name,
                robot=obstacle.attachment.robot,
            )
        self._robot.hold_part(HeldPart(name, link, self._link_pose(link, joints).inverted() * obstacle.pose))

    def release(self, name: str, joints: Sequence[Joint]) -> Pose:
        """Detach an object and return its present pose. Raises NotFound when the robot does not hold it."""
        part = self._robot.drop_part(name)
        if part is None:
            raise NotFound("{name} does not hold {other_name}", name=self._robot.name, other_name=name)
        return self._link_pose(part.link, joints) * part.in_link

    def _link_pose(self, link: str, joints: Sequence[Joint]) -> Pose:
        frames = self._tools().model.link_poses(self._q(joints))
        if link not in frames:
            raise NotFound(
                "{name} has no link {link!r}. Its links: {frames}",
                name=self._robot.name,
                link=link,
                frames=", ".join(frames),
            )
        return self._robot.pose * Pose.from_matrix(frames[link])

    # -------------------------------------------------------------------------------- inside
    def _with_margin(self, now: Sequence[Joint], plan: "Callable[[CollisionWorld, ObstacleSnapshot], T]") -> T:
        """Plan with the margin, or without it if the start or the goal is too near to an obstacle."""
        from arcor2_hw.kinematics.errors import GoalInCollision, OnlyInCollision, StartInCollision

        around, tools = self._snapshot(), self._tools()
        try:
            return plan(build_world(self._robot, tools, now, around, MARGIN), around)
        except (GoalInCollision, OnlyInCollision, StartInCollision):
            return plan(build_world(self._robot, tools, now, around, 0.0), around)

    def _snapshot(self) -> ObstacleSnapshot:
        return self._take_snapshot(self._tools(), other_robots(self._robot))

    def _take_snapshot(self, tools: RobotTools, others: Others) -> ObstacleSnapshot:
        with_model = [(other, joints) for other, joints in others if tools.other(other) is not None]
        return ObstacleSnapshot.take(self._robot, with_model, _tool_of)

    def _q(self, joints: Sequence[Joint]) -> "Array":
        model = self._tools().model
        return model.values(joints, model.neutral())

    def _target(self, pose: Pose) -> "Array":
        target: Array = (self._robot.pose.inverted() * pose).matrix()
        return target

    @contextlib.contextmanager
    def _own_errors(self) -> Iterator[None]:
        """Convert kinematics errors to the KinematicsException of the robot."""
        try:
            yield
        except KinematicsError as error:
            if isinstance(error, self._robot.KinematicsException):
                raise
            raise self._robot.KinematicsException(error.message, error.detail or error.code) from error

    def _tools(self) -> RobotTools:
        """Return the models of this thread. Load them again if settings, package or calibration have changed."""
        robot = self._robot
        made_of = dict(self._settings()), package_of(robot), robot.surroundings.calibration(robot.id)
        found: RobotTools | None = getattr(self._local, "tools", None)
        if found is None or found.made_of != made_of:
            found = self._local.tools = RobotTools(robot, *made_of)
        return found


def _tool_of(robot: Robot) -> Obstacle | None:
    """Return the tool of a robot that its model does not contain, or None."""
    moves = getattr(robot, "safe_moves", None)
    tool = moves.tool() if isinstance(moves, RobotKinematics) else None
    if tool is None:
        return None
    return Obstacle(f"tool of {robot.name}", tool.shape, tool.in_link, Attachment(robot.name, tool.link))
