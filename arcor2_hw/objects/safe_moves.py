"""SafeMoves: kinematics and collision-free paths of a robot with a URDF. Poses are in the world.

Pinocchio and coal come with the extra `kinematics` and are imported on first use.
"""

import contextlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Final

from arcor2_hw.data.geometry import Pose
from arcor2_hw.data.robot import Joint
from arcor2_hw.objects.motion_path import MotionPath
from arcor2_hw.objects.obstacle_snapshot import ObstacleSnapshot
from arcor2_hw.objects.path_monitor import PathMonitor, PlannedPath
from arcor2_hw.objects.robot import Robot
from arcor2_hw.objects.robot_kinematics import RobotKinematics, Tool as Tool

if TYPE_CHECKING:
    from arcor2_hw.collision.sweep import Sweep
    from arcor2_hw.collision.world import CollisionWorld
    from arcor2_hw.kinematics.arm import Arm
    from arcor2_hw.kinematics.shapes import Array
    from arcor2_hw.planning.timing import Trajectory

RESOLUTION: Final = 0.01
"""Maximum travel of any point of the robot between two checked configurations, m."""
PLANNING_TIMEOUT: Final = 2.0
"""Time limit of planning, s."""
MAX_TIME_FACTOR: Final = 4
"""Maximum factor of the time limit after repeated failures."""
MAX_REMEMBERED_FAILURES: Final = 100
"""Maximum number of goals whose failures are remembered; the oldest is dropped."""
TCP_RAMP: Final = 4.0
"""Acceleration along a line divided by the speed along it, 1/s."""

Stopped = Callable[[], bool]
Way = MotionPath  # object types in older packages use this name


class SafeMoves(RobotKinematics):
    """Safe moves of one robot, and its kinematics: plan paths that are free of obstacles, and monitor them.

    If no path to a goal is found within PLANNING_TIMEOUT, each repeat searches twice as long and with another seed, at
    most MAX_TIME_FACTOR times PLANNING_TIMEOUT.
    """

    def __init__(
        self,
        robot: Robot,
        settings: Callable[[], Mapping[str, object]] | None = None,
        tool: Callable[[], Tool | None] = lambda: None,
    ) -> None:
        super().__init__(robot, settings, tool)
        self._failures: dict[tuple[str, bytes], int] = {}

    # -------------------------------------------------------------------------------- paths
    def to_joints(
        self,
        now: Sequence[Joint],
        goal: Sequence[Joint],
        speed: float = 1.0,
        *,
        safe: bool = True,
        stopped: Stopped | None = None,
    ) -> MotionPath:
        """Plan a path to joint values: straight in joint space if that is free, otherwise around obstacles.

        Args:
            now: Present joint values.
            goal: Joint values at the end.
            speed: Fraction of the maximum joint velocities.
            safe: Whether obstacles are considered.
            stopped: Returns whether planning is to be cancelled.

        Raises:
            KinematicsException: Start or goal is in collision, or no path was found; the message names a contact.
            InvalidData: A value is beyond a limit.
            Refused: The surroundings are unknown.
            Cancelled: `stopped` returned true.
        """
        with self._own_errors():
            arm = self._arm_with_most(goal)
            if not safe:
                return self._way(arm, [arm.values(now), arm.values(goal)], speed)

            def planned(world: "CollisionWorld", around: ObstacleSnapshot) -> MotionPath:
                search = self._planner(world, arm).to_joints
                way = self._search(search, arm, arm.values(now), arm.values(goal), stopped)
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
    ) -> MotionPath:
        """Plan the shortest path to any joint values of a pose. Raises as `to_joints`, also NotFound."""
        with self._own_errors():
            tools = self._tools()
            arm, target = tools.arm(end_effector), self._target(pose)
            start = arm.values(now)
            if not safe:
                return self._way(arm, [start, tools.inverse(end_effector).solve(target, start)], speed)

            def planned(world: "CollisionWorld", around: ObstacleSnapshot) -> MotionPath:
                way = self._search(self._planner(world, arm).to_pose, arm, start, target, stopped)
                return self._way(arm, way, speed, around, world.margin)

            return self._with_margin(now, planned)

    def line(
        self, end_effector: str, now: Sequence[Joint], pose: Pose, speed: float = 1.0, *, safe: bool = True
    ) -> MotionPath:
        """Plan a straight line of an end effector to a pose.

        Raises:
            KinematicsException: The line is interrupted or, with `safe`, in collision; the message says where.
            NotFound: The end effector does not exist.
        """
        with self._own_errors():
            from arcor2_hw.kinematics.errors import StartInCollision
            from arcor2_hw.planning.paths import require_free, straight_line

            arm = self._tools().arm(end_effector)
            way = straight_line(arm, arm.values(now), self._target(pose), self._robot.name)

            def checked(world: "CollisionWorld", around: ObstacleSnapshot) -> MotionPath:
                sweep = self._sweep(world, arm)
                if world.margin and not (sweep.is_free(way[0]) and sweep.is_free(way[-1])):
                    raise StartInCollision
                require_free(sweep, way, self._robot.name)
                return self._way(arm, way, speed, around, world.margin, line=True)

            return self._with_margin(now, checked) if safe else self._way(arm, way, speed, line=True)

    @contextlib.contextmanager
    def monitored(self, way: MotionPath) -> Iterator[None]:
        """Monitor the surroundings while the robot follows a safe path, and stop the robot if they block the path.

        After `stop` of the robot, the motion in this context has to raise Cancelled.

        Raises:
            PathBlocked: The robot was stopped. The message names the obstacle.
        """
        if way._planned is None:
            yield
            return
        tools = way._planned.tools
        with PathMonitor(self._robot, way._planned, lambda others: self._take_snapshot(tools, others)):
            yield

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
    ) -> MotionPath:
        """Return a path through points.

        Args:
            arm: The arm.
            points: Waypoints.
            speed: Fraction of the maximum joint velocities.
            around: Surroundings for which the path was checked; None for an unsafe path.
            margin: Margin of the check, m.
            line: Whether the path is a straight line.
        """

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
        return MotionPath([arm.named(q) for q in points], speed, line, timed, planned)

    def _search(
        self, search: "Callable[..., list[Array]]", arm: "Arm", start: "Array", goal: "Array", stopped: Stopped | None
    ) -> "list[Array]":
        """Search a path, with more time and another seed after each failure to find one to the same goal."""
        from arcor2_hw.kinematics.errors import NoPath

        key = (arm.end_effector.link, goal.tobytes())
        failures = self._failures.get(key, 0)
        within = PLANNING_TIMEOUT * min(2**failures, MAX_TIME_FACTOR)
        try:
            return search(start, goal, within=within, seed=failures, stopped=stopped)
        except NoPath:
            self._failures[key] = failures + 1
            if len(self._failures) > MAX_REMEMBERED_FAILURES:
                self._failures.pop(next(iter(self._failures)), None)
            raise

    def _planner(self, world: "CollisionWorld", arm: "Arm") -> Any:
        from arcor2_hw.planning.planner import Planner

        return Planner(self._sweep(world, arm), self._robot.name)

    def _sweep(self, world: "CollisionWorld", arm: "Arm") -> "Sweep":
        from arcor2_hw.collision.sweep import Sweep

        return Sweep(world, self._robot.name, arm, RESOLUTION)

    def _arm_with_most(self, goal: Sequence[Joint]) -> "Arm":
        """Return the chain that contains most of the joints."""
        tools = self._tools()
        names = {joint.name for joint in goal}
        arms = [tools.arm(name) for name in tools.model.end_effectors]
        return max(arms, key=lambda arm: len(names.intersection(arm.joint_names)))


# Names before version 0.2.
FAILURES, MOST_TIME, WITHIN = MAX_REMEMBERED_FAILURES, MAX_TIME_FACTOR, PLANNING_TIMEOUT
