"""SafeMoves: kinematics, and ways around obstacles, of a robot of which there is a URDF. Poses are in the world.

What computes, Pinocchio and coal, comes with the extra `kinematics` and is imported on first use.
"""

import contextlib
import dataclasses
import logging
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Final, NamedTuple, TypeVar

from arcor2_hw.data.geometry import Pose
from arcor2_hw.data.object_type import Models
from arcor2_hw.data.robot import Joint
from arcor2_hw.exceptions import Arcor2Error, KinematicsError, NotFound, Refused
from arcor2_hw.objects.obstacle_snapshot import JOINT_TOLERANCE, ObstacleSnapshot, Others, build_world
from arcor2_hw.objects.path_monitor import PathMonitor, PlannedPath
from arcor2_hw.objects.robot import Robot
from arcor2_hw.objects.robot_tools import RobotTools, package_of, settings_of
from arcor2_hw.objects.surroundings import Attachment, HeldPart, Obstacle

if TYPE_CHECKING:
    from arcor2_hw.collision.sweep import Sweep
    from arcor2_hw.collision.world import CollisionWorld
    from arcor2_hw.kinematics.arm import Arm
    from arcor2_hw.kinematics.shapes import Array
    from arcor2_hw.planning.timing import Trajectory

MARGIN: Final = 0.005
"""m by which a way keeps away from what is around, half of the resolution: so nothing is missed between two checks.
Where the robot stands, or shall stand, nearer than that, the way has to be free without it."""
RESOLUTION: Final = 0.01
"""m that no point of the robot travels farther between two configurations that are looked at."""
WITHIN: Final = 2.0
"""s that is searched for a way."""
TCP_RAMP: Final = 4.0
"""1/s: acceleration along a line, by the speed along it."""

log = logging.getLogger(__name__)

Stopped = Callable[[], bool]
T = TypeVar("T")


@dataclasses.dataclass(frozen=True)
class Way:
    """Where a robot is to be led: from waypoint to waypoint, all joints in proportion between two of them.

    waypoints: joint values, first those where it stands. line: an end effector is led in a straight line so, and the
    waypoints are near each other. speed: fraction of the maxima.
    """

    waypoints: list[list[Joint]]
    speed: float
    line: bool
    _timed: "Callable[[float | None], Trajectory]" = dataclasses.field(repr=False)
    _planned: PlannedPath | None = dataclasses.field(default=None, repr=False)

    def require_begin(self, name: str, now: Sequence[Joint]) -> None:
        """Raise Refused unless the robot `name` still stands where the way begins: planning takes time."""
        present = {joint.name: joint.value for joint in now}
        for joint in self.waypoints[0]:
            if abs(present[joint.name] - joint.value) > JOINT_TOLERANCE:
                raise Refused(f"{name} was moved while its way was planned")

    def timed(self, tcp_speed: float | None = None) -> "Trajectory":
        """Give joint values and velocities by time, for a controller that is led by these: see `Trajectory.sampled`.

        The limits are those of the URDF, times `speed`. A line is passed through at `tcp_speed` m/s at most (None: as
        fast as the joints can); at the waypoints of other ways the robot stands, as nothing beside them was looked at.
        """
        return self._timed(tcp_speed)


class Tool(NamedTuple):
    """What stands for the shape of a tool: the link that it sits on, and where in that link's frame."""

    link: str
    shape: Models
    in_link: Pose


class SafeMoves:
    """Answers for one robot. It may be asked on several threads; each has what it computes with.

    Its URDF is the package that the type's `urdf_package_name` names: in `urdf/` beside the module of the class that
    does, unless one of that name was uploaded. Joints that the robot tells beside those of the URDF, a gripper's, are
    passed over. `settings` gives what the URDF follows, by name; left out, the settings of the object. `tool` gives the
    shape of a tool that the URDF does not have.
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
        self._here = threading.local()

    def prepare(self) -> None:
        """Import and read what is needed, on this thread; what cannot be is told to who needs it first.

        To be called before control is taken of anything: for some tenths of a second nothing else of this process runs,
        and no watchdog is fed.
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
        """Give the names of the end effectors. Raises Refused without a URDF, ModelError for one that is not right."""
        return list(self._tools().model.end_effectors)

    def joint_limits(self) -> dict[str, tuple[float, float]]:
        """Give lower and upper limit of each joint, rad, m where it slides. Raises as `end_effectors`."""
        return {joint.name: (joint.lower, joint.upper) for joint in self._tools().model.joints}

    def forward(self, end_effector: str, joints: Sequence[Joint]) -> Pose:
        """Give the pose that joints lead to.

        Raises NotFound for the end effector, ModelError (InvalidData) for joints that are missing or no numbers.
        """
        arm = self._tools().arm(end_effector)
        return self._robot.pose * arm.pose(arm.values(joints))

    def inverse(
        self, end_effector: str, pose: Pose, near: Sequence[Joint], avoid_collisions: bool = True
    ) -> list[Joint]:
        """Give joints that reach a pose, of those that are free the nearest to `near`.

        With `avoid_collisions`: free of the robot itself, and of what is around it. Raises KinematicsException naming
        why there are none, NotFound, InvalidData.
        """
        with self._named():
            tools = self._tools()
            arm, target = tools.arm(end_effector), self._target(pose)
            if not avoid_collisions:
                return arm.named(tools.inverse(end_effector).solve(target, arm.values(near)))
            from arcor2_hw.collision.world import collision_check

            def solved(world: "CollisionWorld", _: ObstacleSnapshot) -> list[Joint]:
                blocked = collision_check(world, self._robot.name, arm)
                return arm.named(tools.inverse(end_effector).solve(target, arm.values(near), blocked))

            return self._with_margin(near, solved)

    # -------------------------------------------------------------------------------- ways
    def to_joints(
        self,
        now: Sequence[Joint],
        goal: Sequence[Joint],
        speed: float = 1.0,
        *,
        safe: bool = True,
        stopped: Stopped | None = None,
    ) -> Way:
        """Give a way to joint values: straight in joint space where that is free, else around what is in the way.

        With `safe` false what is in the way does not count. Raises KinematicsException naming what is met where it
        stands or at the goal, or that no way was found; InvalidData beyond limits, Refused, Cancelled once `stopped`.
        """
        with self._named():
            arm = self._widest(goal)
            if not safe:
                return self._way(arm, [arm.values(now), arm.values(goal)], speed)

            def planned(world: "CollisionWorld", around: ObstacleSnapshot) -> Way:
                planner = self._planner(world, arm)
                way = planner.to_joints(arm.values(now), arm.values(goal), within=WITHIN, stopped=stopped)
                return self._way(arm, way, speed, around, world.margin)

            return self._with_margin(now, planned)

    def to_pose(
        self,
        end_effector: str,
        now: Sequence[Joint],
        pose: Pose,
        speed: float = 1.0,
        *,
        safe: bool = True,
        stopped: Stopped | None = None,
    ) -> Way:
        """Give a way to a pose, to whichever of its joint values it is shortest. Raises as `to_joints`, NotFound."""
        with self._named():
            tools = self._tools()
            arm, target = tools.arm(end_effector), self._target(pose)
            start = arm.values(now)
            if not safe:
                return self._way(arm, [start, tools.inverse(end_effector).solve(target, start)], speed)

            def planned(world: "CollisionWorld", around: ObstacleSnapshot) -> Way:
                way = self._planner(world, arm).to_pose(start, target, within=WITHIN, stopped=stopped)
                return self._way(arm, way, speed, around, world.margin)

            return self._with_margin(now, planned)

    def line(
        self, end_effector: str, now: Sequence[Joint], pose: Pose, speed: float = 1.0, *, safe: bool = True
    ) -> Way:
        """Give a straight line of an end effector to a pose; never another way.

        Raises KinematicsException naming where the line breaks, or, with `safe`, what it meets where; NotFound.
        """
        with self._named():
            from arcor2_hw.kinematics.errors import StartInCollision
            from arcor2_hw.planning.paths import require_free, straight_line

            arm = self._tools().arm(end_effector)
            way = straight_line(arm, arm.values(now), self._target(pose), self._robot.name)

            def checked(world: "CollisionWorld", around: ObstacleSnapshot) -> Way:
                sweep = self._sweep(world, arm)
                if world.margin and not (sweep.is_free(way[0]) and sweep.is_free(way[-1])):
                    raise StartInCollision
                require_free(sweep, way, self._robot.name)
                return self._way(arm, way, speed, around, world.margin, line=True)

            return self._with_margin(now, checked) if safe else self._way(arm, way, speed, line=True)

    def contacts(self, joints: Sequence[Joint]) -> list[str]:
        """Give what the robot would be in collision with in joints: pairs of names, none when it is free."""
        with self._named():
            world = build_world(self._robot, self._tools(), joints, self._snapshot(), 0.0)
            return [str(contact) for contact in world.contacts(self._robot.name, self._q(joints))]

    @contextlib.contextmanager
    def monitored(self, way: Way) -> Iterator[None]:
        """Watch the surroundings while the robot follows a safe way, and stop it when they block the rest of that.

        The robot's `stop` is called, after which the motion in the context has to raise Cancelled.

        Raises:
            PathBlocked: The robot was stopped. The message names the obstacle.
        """
        if way._planned is None:
            yield
            return
        tools = way._planned.tools
        with PathMonitor(self._robot, way._planned, lambda others: self._look(tools, others)):
            yield

    # -------------------------------------------------------------------------------- what is held
    def hold(self, name: str, link: str, joints: Sequence[Joint]) -> None:
        """Attach a collision object of the scene to a link of the robot, with the pose that both have now.

        Args:
            name: The object.
            link: Link of the robot's model; the object may touch it.
            joints: Present joint values.

        Raises:
            NotFound: The object is no obstacle, or the model has no such link.
            Refused: A robot holds the object already.
        """
        obstacle = next((each for each in self._robot.surroundings.obstacles() if each.name == name), None)
        if obstacle is None:
            raise NotFound(f"{self._robot.name} cannot hold {name}: it is no collision object of the scene")
        if obstacle.attachment is not None:
            raise Refused(f"{self._robot.name} cannot hold {name}: {obstacle.attachment.robot} holds it")
        self._robot.hold_part(HeldPart(name, link, self._link_pose(link, joints).inverted() * obstacle.pose))

    def release(self, name: str, joints: Sequence[Joint]) -> Pose:
        """Detach an object and return its present pose. Raises NotFound when the robot does not hold it."""
        part = self._robot.drop_part(name)
        if part is None:
            raise NotFound(f"{self._robot.name} does not hold {name}")
        return self._link_pose(part.link, joints) * part.in_link

    def _link_pose(self, link: str, joints: Sequence[Joint]) -> Pose:
        frames = self._tools().model.link_poses(self._q(joints))
        if link not in frames:
            raise NotFound(f"{self._robot.name} has no link {link!r}; there are {', '.join(frames)}")
        return self._robot.pose * Pose.from_matrix(frames[link])

    # -------------------------------------------------------------------------------- inside
    def _way(
        self,
        arm: "Arm",
        points: "list[Array]",
        speed: float,
        around: ObstacleSnapshot | None = None,
        margin: float = 0.0,
        *,
        line: bool = False,
    ) -> Way:
        """Return a way through points; `around` is what it was checked against, None for an unsafe one."""

        def timed(tcp_speed: float | None) -> "Trajectory":
            from arcor2_hw.planning.timing import MotionLimits, along_line, with_stops

            limits = MotionLimits.of(arm, speed)
            if not line:
                return with_stops(points, limits)
            begin = points[0]
            first = arm.pose(begin).position
            lengths = [first.distance_to(arm.pose(q).position) for q in points]
            fastest = 100.0 if tcp_speed is None else tcp_speed
            return along_line(points, limits, lengths, fastest, TCP_RAMP * fastest)

        planned = None if around is None else PlannedPath(self._tools(), arm, points, around, margin)
        return Way([arm.named(q) for q in points], speed, line, timed, planned)

    def _planner(self, world: "CollisionWorld", arm: "Arm") -> Any:
        from arcor2_hw.planning.planner import Planner

        return Planner(self._sweep(world, arm), self._robot.name)

    def _sweep(self, world: "CollisionWorld", arm: "Arm") -> "Sweep":
        from arcor2_hw.collision.sweep import Sweep

        return Sweep(world, self._robot.name, arm, RESOLUTION)

    def _with_margin(self, now: Sequence[Joint], ask: "Callable[[CollisionWorld, ObstacleSnapshot], T]") -> T:
        """Ask with the margin; where the start or the goal is too near to something for that, without."""
        from arcor2_hw.kinematics.errors import GoalInCollision, OnlyInCollision, StartInCollision

        around, tools = self._snapshot(), self._tools()
        try:
            return ask(build_world(self._robot, tools, now, around, MARGIN), around)
        except (GoalInCollision, OnlyInCollision, StartInCollision):
            return ask(build_world(self._robot, tools, now, around, 0.0), around)

    def _snapshot(self) -> ObstacleSnapshot:
        return self._look(self._tools(), self._robot.surroundings.robots())

    def _look(self, tools: RobotTools, others: Others) -> ObstacleSnapshot:
        with_model = [(other, joints) for other, joints in others if tools.other(other) is not None]
        return ObstacleSnapshot.take(self._robot, with_model, _tool_of)

    def _q(self, joints: Sequence[Joint]) -> "Array":
        model = self._tools().model
        return model.values(joints, model.neutral())

    def _widest(self, goal: Sequence[Joint]) -> "Arm":
        """Give the chain that moves all of the joints: that of the end effector with the most of them."""
        tools = self._tools()
        names = {joint.name for joint in goal}
        arms = [tools.arm(name) for name in tools.model.end_effectors]
        return max(arms, key=lambda arm: len(names.intersection(arm.joint_names)))

    def _target(self, pose: Pose) -> "Array":
        target: Array = (self._robot.pose.inverted() * pose).matrix()
        return target

    @contextlib.contextmanager
    def _named(self) -> Iterator[None]:
        """Give errors of kinematics as the robot's own."""
        try:
            yield
        except KinematicsError as error:
            if isinstance(error, self._robot.KinematicsException):
                raise
            raise self._robot.KinematicsException(str(error), error.detail or error.code) from error

    def _tools(self) -> RobotTools:
        """Give what the present thread computes with, made anew when settings, model or calibration have changed."""
        robot = self._robot
        made_of = dict(self._settings()), package_of(robot), robot.surroundings.calibration(robot.id)
        found: RobotTools | None = getattr(self._here, "tools", None)
        if found is None or found.made_of != made_of:
            found = self._here.tools = RobotTools(robot, *made_of)
        return found


def _tool_of(robot: Robot) -> Obstacle | None:
    """Return the tool of a robot that its model does not contain."""
    moves = getattr(robot, "safe_moves", None)
    tool = moves.tool() if isinstance(moves, SafeMoves) else None
    if tool is None:
        return None
    return Obstacle(f"tool of {robot.name}", tool.shape, tool.in_link, Attachment(robot.name, tool.link))
