"""Safe motion: moves around obstacles of the scene, and joints that are free of collisions."""

import math
from typing import Final

from arcor2_hw.data.geometry import Orientation, Pose, Position
from arcor2_hw.data.object_type import Cylinder
from arcor2_hw.data.robot import Joint
from arcor2_hw.objects import Robot
from arcor2_hw.objects.arm import TCP, StopGuard, named_joints
from arcor2_hw.objects.safe_moves import SafeMoves, Tool
from arcor2_hw.objects.single_arm import move_around_obstacles, on_free_line

from .arm import Arm
from .control import Control
from .geometry import JOINTS, to_vector
from .motion import Motion
from .observer import Observer

FLANGE: Final = "flange"
ROD_RADIUS: Final = 0.015
"""Radius of the rod that models the tool, m."""
ROD_GAP: Final = 0.01
"""Distance from the end of the rod to the TCP, which touches the parts, m."""


class SafeMotion:
    """Moves the arm around obstacles. The arm is its nominal model; a rod from flange to TCP models the tool."""

    def __init__(self, robot: Robot, arm: Arm, observer: Observer, control: Control, motion: Motion) -> None:
        self._robot, self._arm, self._observer, self._control, self._motion = robot, arm, observer, control, motion
        self.moves = SafeMoves(robot, self._model_settings, self._rod)

    def to_pose(self, target: Pose, linear: bool, speed: float, guard: StopGuard) -> None:
        """Move the TCP to a pose in the world. Raise PathBlocked if no path is free of collisions."""
        self._arm.check_speed(speed)
        vector = self._arm.vector(target)
        with self._motion.exclusive():
            session = self._control.current()
            self._motion.end_jog(session)
            q = self._motion.solve(session, vector, self._observer.sample().q)
            if not linear:
                self._go_around(self._free(target, named_joints(JOINTS, q)), speed, guard)
                return
            with on_free_line(self._robot, self.moves, target):
                self._motion.run(self._control.current(), self._motion.line(vector, speed), guard)

    def to_joints(self, q: list[float], speed: float, guard: StopGuard) -> None:
        """Move to joint values. Raise PathBlocked if no path is free of collisions."""
        self._arm.check_speed(speed)
        with self._motion.exclusive():
            self._motion.end_jog(self._control.current())
            self._go_around(named_joints(JOINTS, q), speed, guard)

    def inverse(self, pose: Pose, near: list[float], avoid_collisions: bool) -> list[Joint]:
        """Return the joints for a pose in the world, nearest to `near`, by the controller's calibration."""
        q = self._motion.solve(self._control.current(), self._arm.vector(pose), near)
        joints = named_joints(JOINTS, q)
        return self._free(pose, joints) if avoid_collisions else joints

    def _go_around(self, goal: list[Joint], speed: float, guard: StopGuard) -> None:
        """Move to joint values around obstacles."""

        def move(waypoint: list[Joint]) -> None:
            command = self._motion.joints([joint.value for joint in waypoint], speed)
            self._motion.run(self._control.current(), command, guard)

        move_around_obstacles(self._robot, self.moves, goal, speed, guard, move)

    def _free(self, pose: Pose, joints: list[Joint]) -> list[Joint]:
        """Return joints for a pose without collision; the given joints if they are free.

        Raises:
            KinematicsException: Every configuration collides.
        """
        if not self.moves.contacts(joints):
            return joints
        near = [joint.value for joint in self.moves.inverse(TCP, pose, joints)]
        found = named_joints(JOINTS, self._motion.solve(self._control.current(), self._arm.vector(pose), near))
        if hit := self.moves.contacts(found):
            raise Robot.KinematicsException(
                "{name} reaches the pose only in collision: {hit}", name=self._arm.name, hit=hit[0]
            )
        return found

    def _rod(self) -> Tool | None:
        """Return the rod that models the tool, of which only the TCP is known; None for a TCP at the flange."""
        tip = self._control.stated_tool.tcp.position
        length = math.hypot(*tip) - ROD_GAP
        if length < ROD_GAP:
            return None
        x, y, z = (value / math.hypot(*tip) for value in tip)
        sine = math.hypot(x, y)
        angle = math.atan2(sine, z)
        turn = (-y / sine * angle, x / sine * angle, 0.0) if sine > 1e-9 else (0.0 if z > 0.0 else math.pi, 0.0, 0.0)
        middle = Position(*(length / 2.0 * value for value in (x, y, z)))
        pose = Pose(middle, Orientation.from_rotation_vector(*turn))
        return Tool(FLANGE, Cylinder("tool", ROD_RADIUS, length), pose)

    def _model_settings(self) -> dict[str, object]:
        """Return the settings of the model: the TCP in the flange."""
        names = ("tcp_x", "tcp_y", "tcp_z", "tcp_rx", "tcp_ry", "tcp_rz")
        return dict(zip(names, to_vector(self._control.stated_tool.tcp), strict=True))
