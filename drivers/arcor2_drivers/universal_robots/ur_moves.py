"""UrMoving: moves to joints and poses, safe ones around what stands in the scene; the controller's kinematics."""

import math
from typing import Final

from arcor2_hw.data.geometry import Orientation, Pose, Position
from arcor2_hw.data.object_type import Cylinder
from arcor2_hw.data.robot import Joint, MoveResult
from arcor2_hw.objects.safe_moves import SafeMoves, Tool
from arcor2_hw.objects.surroundings import Surroundings

from .frames import from_vector, to_vector, world_from_base
from .settings import UrSettings, within
from .ur_arm import UrArm
from .ur_observed import JOINTS

FLANGE: Final = "flange"
ROD_RADIUS: Final = 0.015
SHORT_OF_TCP: Final = 0.01
"""m by which the rod that stands for a tool ends before the TCP, which touches what is worked on."""


class UrMoving(UrArm):
    """A Universal Robots arm that is told where to go.

    What stands around it is known from the scene; of the arm itself its model is known, nominal, and the tool's centre
    point: a rod stands for the tool.
    """

    _ABSTRACT = True

    def __init__(self, obj_id: str, name: str, pose: Pose, settings: UrSettings) -> None:
        super().__init__(obj_id, name, pose, settings)
        self.safe_moves = SafeMoves(self, self._model_settings, self._rod)

    def _rod(self) -> Tool | None:
        """Give a rod from the flange to short of the TCP, which stands for the tool: of that only the TCP is known."""
        way = self._tool.tcp.position
        length = math.hypot(*way) - SHORT_OF_TCP
        if length < SHORT_OF_TCP:
            return None
        x, y, z = (value / math.hypot(*way) for value in way)
        # From the z axis to the way, about the axis across both.
        angle, across = math.atan2(math.hypot(x, y), z), math.hypot(x, y)
        turn = (
            (-y / across * angle, x / across * angle, 0.0) if across > 1e-9 else (0.0 if z > 0.0 else math.pi, 0.0, 0.0)
        )
        middle = Position(*(length / 2.0 * value for value in (x, y, z)))
        rod = Cylinder("tool", ROD_RADIUS, length)
        return Tool(FLANGE, rod, Pose(middle, Orientation.from_rotation_vector(*turn)))

    def surround(self, surroundings: Surroundings) -> None:
        """Take what tells of the things around the arm, and read its model."""
        super().surround(surroundings)
        self.safe_moves.prepare()

    def take_control(self) -> None:
        """Take control as `UrArm`; before that the arm's model is read, as the watchdog is not fed meanwhile."""
        if not self._is_ours():
            self.safe_moves.prepare()
        super().take_control()

    def _model_settings(self) -> dict[str, object]:
        """Give where the TCP is in the flange now, by the names of the settings."""
        names = ("tcp_x", "tcp_y", "tcp_z", "tcp_rx", "tcp_ry", "tcp_rz")
        return dict(zip(names, to_vector(self._tool.tcp), strict=True))

    # -------------------------------------------------------------------------------- moving
    def move_to_pose(
        self, end_effector_id: str, target_pose: Pose, speed: float, safe: bool = True, linear: bool = True
    ) -> None:
        """Move the TCP to a pose in the world: in a line, or to the joints of the controller's own kinematics.

        With `safe` a line that meets something in the scene is refused; a joint move leads around it, standing at each
        waypoint, or to another configuration that reaches the pose, or is refused. An obstacle that comes into the
        path meanwhile stops the arm.
        Raises KinematicsException, PathBlocked, OutOfRange, Refused, NotInControl, SafetyStop, Cancelled,
        DeviceTimeout.
        """
        stops = self._stops
        self._check_end_effector(end_effector_id)
        if not safe:
            self._move_pose(target_pose, linear, speed, 1.0, stops)
            return
        within(f"{self.name}: speed", speed, 0.001, 1.0)
        vector = self._controller_vector(target_pose)
        with self._moving():
            q = self._solve(self._controlled(), vector, list(self._observer.sample().q))
            if not linear:
                goal = self._free(target_pose, self._named_joints(q))
                self._go_around(goal, speed, stops)
                return
            way = self.safe_moves.line(end_effector_id, self.robot_joints(), target_pose)
            way.require_begin(self.name, self.robot_joints())
            with self.safe_moves.monitored(way):
                self._run_line(self._controlled(), self._observer.sample(), vector, speed, 1.0, stops)

    def move_to_joints(self, target_joints: list[Joint], speed: float, safe: bool = True) -> None:
        """Move to joint values, all joints arriving together; with `safe` around what stands in the way, or not at all.

        Raises as `move_to_pose`, and InvalidData for wrong joints.
        """
        stops = self._stops
        q = self._checked_joints(target_joints)
        if not safe:
            self._move_joints(q, speed, 1.0, stops)
            return
        within(f"{self.name}: speed", speed, 0.001, 1.0)
        with self._moving():
            self._controlled()
            self._go_around(self._named_joints(q), speed, stops)

    def _go_around(self, goal: list[Joint], speed: float, stops: int) -> MoveResult:
        """Plan a way and drive it, standing at each waypoint: as the checked way is straight in joint space."""
        way = self.safe_moves.to_joints(self.robot_joints(), goal, speed, stopped=lambda: self._stops != stops)
        way.require_begin(self.name, self.robot_joints())
        with self.safe_moves.monitored(way):
            for waypoint in way.waypoints[1:]:
                q = [joint.value for joint in waypoint]
                result = self._run_joints(self._controlled(), self._observer.sample(), q, speed, 1.0, stops)
        return result

    def _free(self, pose: Pose, joints: list[Joint]) -> list[Joint]:
        """Give the controller's joints for a pose in a configuration that is free: those given if they are.

        Raises KinematicsException naming what all of them are in collision with.
        """
        if not self.safe_moves.contacts(joints):
            return joints
        (end_effector,) = self.get_end_effectors_ids()
        near = self.safe_moves.inverse(end_effector, pose, joints)
        vector = self._controller_vector(pose)
        found = self._named_joints(self._solve(self._controlled(), vector, [joint.value for joint in near]))
        if hit := self.safe_moves.contacts(found):
            raise self.KinematicsException(f"{self.name} reaches the pose only in collision: {hit[0]}")
        return found

    # -------------------------------------------------------------------------------- kinematics of the controller
    def inverse_kinematics(
        self,
        end_effector_id: str,
        pose: Pose,
        start_joints: list[Joint] | None = None,
        avoid_collisions: bool = True,
    ) -> list[Joint]:
        """Give joints that reach a pose in the world, nearest to `start_joints`, by the controller's calibration.

        With `avoid_collisions` in a configuration that is free of the arm itself and of what stands in the scene.
        Raises KinematicsException when no joints reach it; needs control.
        """
        self._check_end_effector(end_effector_id)
        near = self._checked_joints(start_joints) if start_joints else list(self._observer.sample().q)
        found = self._named_joints(self._solve(self._controlled(), self._controller_vector(pose), near))
        return self._free(pose, found) if avoid_collisions else found

    def forward_kinematics(self, end_effector_id: str, joints: list[Joint]) -> Pose:
        """Give the TCP in the world for joints, by the controller's calibration; needs control."""
        self._check_end_effector(end_effector_id)
        q, tcp = self._checked_joints(joints), to_vector(self._tool.tcp)
        vector = self._controlled().ask("forward kinematics", "getForwardKinematics", q, tcp)
        return world_from_base(self._pose) * from_vector(vector)

    @staticmethod
    def _named_joints(q: list[float]) -> list[Joint]:
        return [Joint(name, value) for name, value in zip(JOINTS, q, strict=True)]
