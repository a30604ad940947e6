"""Kinematics of both arms, computed by the controller with its calibration."""

import contextlib
import math
import threading
from typing import Final

import numpy as np

from arcor2_hw.data.geometry import Pose
from arcor2_hw.exceptions import OutOfRange
from arcor2_hw.objects import Robot

from . import nominal
from .arm_line import ArmLine, CommandRefused
from .arms import Arms
from .frames import Configuration, RobTarget, orientation_values, pose_from, position_values, to_degrees, to_radians
from .motion_lines import Code
from .nominal import Array
from .observer import Observer
from .session import ControlSession
from .settings import ARMS

COMPUTE_TIMEOUT: Final = 3.0
"""Time for the controller to compute, s."""


class Kinematics:
    """Inverse and forward kinematics. Hold `staging[arm]` from computing a target until it is used."""

    def __init__(self, arms: Arms, observer: Observer) -> None:
        self._arms, self._observer = arms, observer
        self.staging = {arm: threading.RLock() for arm in ARMS}

    def present(self, arm: str) -> Array:
        """Return the joint values of an arm."""
        return np.array(self._observer.sample().joints[arm])

    def forward(self, session: ControlSession, arm: str, joints: list[float]) -> Pose:
        """Return the TCP in the world for joint values."""
        with self.staging[arm]:
            return self._arms.pose * self._describe(session.lines[arm], joints).pose

    def _describe(self, line: ArmLine, joints: list[float]) -> RobTarget:
        """Return the robtarget of joint values: TCP in the robot's frame, configuration, arm angle."""
        line.ask(Code.STAGE_JOINTS, *to_degrees(joints))
        x, y, z, angle = line.ask(Code.FORWARD_POSITION, within=COMPUTE_TIMEOUT)
        orientation = line.ask(Code.FORWARD_ORIENTATION, within=COMPUTE_TIMEOUT)
        pose = pose_from((x, y, z), orientation[:4])
        return RobTarget(pose, Configuration(*map(int, orientation[4:8])), math.radians(angle))

    def solve(
        self, session: ControlSession, arm: str, pose: Pose, seed: list[float] | None = None
    ) -> tuple[list[float], RobTarget]:
        """Solve for a pose in the world, and stage the target.

        Nominal kinematics select one of many solutions, near the seed. The controller then returns its configuration
        and arm angle, and solves for the pose with its own calibration.

        Returns:
            Joint values, and the flange with its configuration.

        Raises:
            KinematicsException: The pose cannot be reached.
        """
        line = session.lines[arm]
        tcp = self._arms.pose.inverted() * pose
        if not all(map(math.isfinite, (*tcp.position, *tcp.orientation))):
            raise OutOfRange("{name}: the numbers of a pose must be finite.", name=self._arms.name)
        flange = tcp * self._arms.tools[arm].inverted()
        near = np.array(seed) if seed is not None else self.present(arm)
        guess, error = nominal.nearest(arm, flange.matrix(), near)
        if error <= nominal.MAX_ERROR:
            for hint in (guess, near):
                described = self._describe(line, [*map(float, hint)])
                with contextlib.suppress(CommandRefused):
                    joints = self._inverse(line, tcp, described)
                    return joints, RobTarget(flange, described.configuration, described.arm_angle)
        position = ", ".join(f"{value:.3f}" for value in tcp.position)
        raise Robot.KinematicsException(
            "The {arm} arm of {robot} cannot reach the pose.",
            f"in the robot's frame: {position}",
            arm=arm,
            robot=self._arms.name,
        )

    @staticmethod
    def _inverse(line: ArmLine, tcp: Pose, like: RobTarget) -> list[float]:
        line.ask(Code.STAGE_POSITION, *position_values(tcp), math.degrees(like.arm_angle))
        line.ask(Code.STAGE_ORIENTATION, *orientation_values(tcp), *like.configuration)
        return to_radians(line.ask(Code.INVERSE, within=COMPUTE_TIMEOUT)[:7])
