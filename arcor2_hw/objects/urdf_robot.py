"""UrdfRobot: a robot whose controller only drives joints; all else about its moves comes from its URDF."""

import abc
import contextlib
import math
from collections.abc import Callable, Iterator
from typing import Final

from arcor2_hw.data.geometry import Pose
from arcor2_hw.data.robot import Joint
from arcor2_hw.exceptions import Cancelled, InvalidData, NotFound, OutOfRange, Refused
from arcor2_hw.objects.robot import Robot
from arcor2_hw.objects.safe_moves import SafeMoves, Stopped, Way
from arcor2_hw.objects.settings import Settings
from arcor2_hw.objects.surroundings import Surroundings

SLACK: Final = 1e-4
"""rad, or m, that a joint may be beyond its limit: what rounding adds to one that stands at it."""


class UrdfRobot(Robot):
    """A robot with one arm that has a URDF, and a way to drive its joints.

    A type declares `urdf_package_name`, with the URDF in `urdf/` beside its module, and writes `robot_joints`, `follow`
    and `stop`. From here come end effectors and their poses, forward and inverse kinematics, joint limits, moves to
    poses and joints, in a line or not, and, where asked for, safe: around what stands in the scene, or refused.
    `safe_moves` answers what more a driver wants to know.
    """

    _ABSTRACT = True

    def __init__(self, obj_id: str, name: str, pose: Pose, settings: Settings | None = None) -> None:
        super().__init__(obj_id, name, pose, settings)
        self.safe_moves = SafeMoves(self)
        self._stops = 0

    def surround(self, surroundings: Surroundings) -> None:
        """Take what tells of the things around the robot, and read its model."""
        super().surround(surroundings)
        self.safe_moves.prepare()

    # -------------------------------------------------------------------------------- to be written for each robot
    @abc.abstractmethod
    def follow(self, way: Way) -> None:
        """Drive the joints along a way and give back when the robot stands at its end.

        Point to point from waypoint to waypoint where all joints arrive together, or as `way.timed` says. Raises
        Cancelled once `stop` was called, and what keeps the robot from getting there. Called while `move_in_progress`.
        """

    @abc.abstractmethod
    def stop(self) -> None:
        """Stop at once. A type's own calls `super().stop()` first: so nothing that is being planned begins after it."""
        self._stops += 1

    # -------------------------------------------------------------------------------- what is where
    def get_end_effectors_ids(self) -> set[str]:
        """Give the end effectors of the URDF."""
        return set(self.safe_moves.end_effectors())

    def get_end_effector_pose(self, end_effector: str) -> Pose:
        """Give the pose of an end effector in the world, of the present joints. Raises NotFound, Stale."""
        return self.forward_kinematics(end_effector, self.robot_joints())

    def grippers(self) -> set[str]:
        """Give none."""
        return set()

    def suctions(self) -> set[str]:
        """Give none."""
        return set()

    def joint_limits(self) -> dict[str, tuple[float, float]]:
        """Give lower and upper limit of each joint, rad, m where it slides."""
        return self.safe_moves.joint_limits()

    def forward_kinematics(self, end_effector_id: str, joints: list[Joint]) -> Pose:
        """Give the pose in the world that joints lead to. Raises NotFound, InvalidData for joints that are missing."""
        self._check_end_effector(end_effector_id)
        return self.safe_moves.forward(end_effector_id, joints)

    def inverse_kinematics(
        self,
        end_effector_id: str,
        pose: Pose,
        start_joints: list[Joint] | None = None,
        avoid_collisions: bool = True,
    ) -> list[Joint]:
        """Give joints that reach a pose in the world, of those that are free the nearest to `start_joints`.

        Raises KinematicsException naming why there are none, NotFound, InvalidData.
        """
        self._check_end_effector(end_effector_id)
        near = start_joints if start_joints is not None else self.robot_joints()
        return self.safe_moves.inverse(end_effector_id, pose, near, avoid_collisions)

    # -------------------------------------------------------------------------------- moving
    def move_to_pose(
        self, end_effector_id: str, target_pose: Pose, speed: float, safe: bool = True, linear: bool = True
    ) -> None:
        """Move an end effector to a pose in the world: in a line, else on a way that may be any.

        With `safe` a line that meets something is refused, and another way leads around; the robot stops when an
        obstacle comes into its path meanwhile. Raises KinematicsException naming why there is no path, PathBlocked
        naming the obstacle, OutOfRange, Refused, Cancelled, and what `follow` does.
        """
        self._check_end_effector(end_effector_id)

        def way(now: list[Joint], stopped: Stopped) -> Way:
            moves = self.safe_moves
            if linear:
                return moves.line(end_effector_id, now, target_pose, speed, safe=safe)
            return moves.to_pose(end_effector_id, now, target_pose, speed, safe=safe, stopped=stopped)

        self._go(way, speed)

    def move_to_joints(self, target_joints: list[Joint], speed: float, safe: bool = True) -> None:
        """Move to joint values; with `safe` around what stands in the way. Raises as `move_to_pose`."""
        self._check_joints(target_joints)

        def way(now: list[Joint], stopped: Stopped) -> Way:
            return self.safe_moves.to_joints(now, target_joints, speed, safe=safe, stopped=stopped)

        self._go(way, speed)

    def _go(self, plan: Callable[[list[Joint], Stopped], Way], speed: float) -> None:
        if not (math.isfinite(speed) and 0.0 < speed <= 1.0):
            raise OutOfRange(f"{self.name}: speed must be above 0 and at most 1, not {speed!r}")
        stops = self._stops
        self.check_if_ready_to_move()
        with self._moving():
            way = plan(self.robot_joints(), lambda: self._stops != stops)
            if self._stops != stops:
                raise Cancelled(f"a move of {self.name} was stopped before it began")
            way.require_begin(self.name, self.robot_joints())
            with self.safe_moves.monitored(way):
                self.follow(way)

    @contextlib.contextmanager
    def _moving(self) -> Iterator[None]:
        if not self._move_lock.acquire(blocking=False):
            raise Refused(f"{self.name} is moving already")
        try:
            yield
        finally:
            self._move_lock.release()

    # -------------------------------------------------------------------------------- checks
    def _check_end_effector(self, end_effector: str) -> None:
        if end_effector not in (known := self.safe_moves.end_effectors()):
            raise NotFound(f"{self.name} has no end effector {end_effector!r}; there are {', '.join(known)}")

    def _check_joints(self, joints: list[Joint]) -> None:
        limits = self.joint_limits()
        given = {joint.name: joint.value for joint in joints}
        if len(given) != len(joints) or given.keys() != limits.keys():
            raise InvalidData(f"the joints of {self.name} are {', '.join(limits)}; given: {', '.join(given)}")
        for name, value in given.items():
            low, high = limits[name]
            if not low - SLACK <= value <= high + SLACK:
                raise OutOfRange(f"{name} of {self.name} must be {low:.3f} to {high:.3f}, not {value!r}")
