"""UrdfRobot: a robot whose controller only drives joints; everything else is computed from its URDF."""

import abc
import math
from collections.abc import Callable
from typing import Final

from arcor2_hw.data.geometry import Pose
from arcor2_hw.data.robot import Joint
from arcor2_hw.exceptions import Cancelled, NotFound, OutOfRange
from arcor2_hw.objects.arm import exclusive_motion, joint_values
from arcor2_hw.objects.motion_path import MotionPath
from arcor2_hw.objects.robot import Robot
from arcor2_hw.objects.safe_moves import SafeMoves, Stopped
from arcor2_hw.objects.settings import Settings
from arcor2_hw.objects.surroundings import Surroundings

LIMIT_TOLERANCE: Final = 1e-4
"""Rounding error that is tolerated beyond a joint limit, rad or m."""


class UrdfRobot(Robot):
    """A robot with one arm and a URDF.

    A type declares `urdf_package_name`, with the URDF in `urdf/` next to its module, and implements `robot_joints`,
    `follow` and `stop`. This class provides end effectors and their poses, forward and inverse kinematics, joint
    limits, and moves to poses and joints, linear or not, optionally safe: around obstacles of the scene, or refused. A
    driver can use `safe_moves` for more.
    """

    _ABSTRACT = True

    def __init__(self, obj_id: str, name: str, pose: Pose, settings: Settings | None = None) -> None:
        super().__init__(obj_id, name, pose, settings)
        self.safe_moves = SafeMoves(self)
        self._stops = 0

    def surround(self, surroundings: Surroundings) -> None:
        """Receive the surroundings of the robot, and load its model."""
        super().surround(surroundings)
        self.safe_moves.prepare()

    # -------------------------------------------------------------------------------- for each driver
    @abc.abstractmethod
    def follow(self, way: MotionPath) -> None:
        """Drive the joints along a path, and return when the robot is at standstill at its end.

        Move from waypoint to waypoint so that all joints arrive together, or as `way.timed` defines. It is called while
        `move_in_progress`.

        Raises:
            Cancelled: `stop` was called.
            DeviceError: The robot cannot reach the end.
        """

    @abc.abstractmethod
    def stop(self) -> None:
        """Stop at once. An override calls `super().stop()` first, so that a move being planned does not start."""
        self._stops += 1

    # -------------------------------------------------------------------------------- poses and kinematics
    def get_end_effectors_ids(self) -> set[str]:
        """Return the end effectors of the URDF."""
        return set(self.safe_moves.end_effectors())

    def get_end_effector_pose(self, end_effector: str) -> Pose:
        """Return the pose of an end effector in the world at the present joint values.

        Raises:
            NotFound: The end effector does not exist.
            Stale: No recent joint values are known.
        """
        return self.forward_kinematics(end_effector, self.robot_joints())

    def grippers(self) -> set[str]:
        """Return an empty set."""
        return set()

    def suctions(self) -> set[str]:
        """Return an empty set."""
        return set()

    def joint_limits(self) -> dict[str, tuple[float, float]]:
        """Return the lower and upper limit of each joint, rad or (prismatic) m."""
        return self.safe_moves.joint_limits()

    def forward_kinematics(self, end_effector_id: str, joints: list[Joint]) -> Pose:
        """Compute the pose in the world for joint values.

        Raises:
            NotFound: The end effector does not exist.
            InvalidData: Joints are missing.
        """
        self._check_end_effector(end_effector_id)
        return self.safe_moves.forward(end_effector_id, joints)

    def inverse_kinematics(
        self, end_effector_id: str, pose: Pose, start_joints: list[Joint] | None = None, avoid_collisions: bool = True
    ) -> list[Joint]:
        """Compute joint values that reach a pose in the world, nearest to `start_joints`.

        Raises:
            KinematicsException: The pose cannot be reached; the message says why.
            NotFound: The end effector does not exist.
            InvalidData: A value is not finite.
        """
        self._check_end_effector(end_effector_id)
        near = start_joints if start_joints is not None else self.robot_joints()
        return self.safe_moves.inverse(end_effector_id, pose, near, avoid_collisions)

    # -------------------------------------------------------------------------------- moving
    def move_to_pose(
        self, end_effector_id: str, target_pose: Pose, speed: float, safe: bool = True, linear: bool = True
    ) -> None:
        """Move an end effector to a pose in the world, in a straight line or on any path.

        With `safe`, a line through an obstacle is refused, and other paths avoid obstacles. The robot stops when an
        obstacle comes into its path.

        Raises:
            KinematicsException: No path was found; the message says why.
            PathBlocked: An obstacle came into the path; the message names it.
            OutOfRange: `speed` is out of range.
            Refused: The robot is moving already.
            Cancelled: The move was stopped.
        """
        self._check_end_effector(end_effector_id)

        def way(now: list[Joint], stopped: Stopped) -> MotionPath:
            moves = self.safe_moves
            if linear:
                return moves.line(end_effector_id, now, target_pose, speed, safe=safe)
            return moves.to_pose(end_effector_id, now, target_pose, speed, safe=safe, stopped=stopped)

        self._go(way, speed)

    def move_to_joints(self, target_joints: list[Joint], speed: float, safe: bool = True) -> None:
        """Move to joint values, with `safe` around obstacles. Raises as `move_to_pose`."""
        joint_values(self.name, target_joints, self.joint_limits(), LIMIT_TOLERANCE)

        def way(now: list[Joint], stopped: Stopped) -> MotionPath:
            return self.safe_moves.to_joints(now, target_joints, speed, safe=safe, stopped=stopped)

        self._go(way, speed)

    def _go(self, plan: Callable[[list[Joint], Stopped], MotionPath], speed: float) -> None:
        if not (math.isfinite(speed) and 0.0 < speed <= 1.0):
            raise OutOfRange("{name}: speed must be above 0 and at most 1, not {speed!r}", name=self.name, speed=speed)
        stops = self._stops
        self.check_if_ready_to_move()
        with exclusive_motion(self._move_lock, self.name):
            way = plan(self.robot_joints(), lambda: self._stops != stops)
            if self._stops != stops:
                raise Cancelled("The move of {name} was stopped before it started.", name=self.name)
            way.require_begin(self.name, self.robot_joints())
            with self.safe_moves.monitored(way):
                self.follow(way)

    # -------------------------------------------------------------------------------- checks
    def _check_end_effector(self, end_effector: str) -> None:
        if end_effector not in (known := self.safe_moves.end_effectors()):
            raise NotFound(
                "{name} has no end effector {end_effector!r}. Available: {known}",
                name=self.name,
                end_effector=end_effector,
                known=", ".join(known),
            )


# Names before version 0.2.
SLACK = LIMIT_TOLERANCE
