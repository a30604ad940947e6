"""YumiKinematics: inverse and forward kinematics by the controller, with its calibration, and the tools of the arms."""

import contextlib
import math
import threading
from typing import Final

import numpy as np

from arcor2_hw.data.geometry import Pose
from arcor2_hw.data.robot import Joint
from arcor2_hw.exceptions import OutOfRange, Refused

from . import nominal
from .arm_line import ArmLine, Unwilling
from .clearance import Clearance, other_arm
from .frames import Configuration, RobTarget, orientation_values, pose_from, position_values, to_degrees, to_radians
from .motion_lines import Code
from .nominal import Array
from .session import ControlSession
from .settings import ARMS, MAX_PAYLOAD, YumiSettings
from .yumi_control import YumiControl
from .yumi_observed import JOINTS

COMPUTE_WITHIN: Final = 3.0


class YumiKinematics(YumiControl):
    """A YuMi that is asked where its arms would be."""

    _ABSTRACT = True

    def __init__(self, obj_id: str, name: str, pose: Pose, settings: YumiSettings) -> None:
        super().__init__(obj_id, name, pose, settings)
        self._staging = {arm: threading.RLock() for arm in ARMS}
        self._clearance = Clearance(name, dict(self._tools), settings.clearance)

    def _present(self, arm: str) -> Array:
        return np.array(self._observer.sample().joints[arm])

    # -------------------------------------------------------------------------------- kinematics of the controller
    def inverse_kinematics(
        self,
        end_effector_id: str,
        pose: Pose,
        start_joints: list[Joint] | None = None,
        avoid_collisions: bool = True,
        arm_id: str | None = None,
    ) -> list[Joint]:
        """Give joints of an arm that reach a pose in the world, near `start_joints` or where it stands.

        The seventh axis is left near the seed's. With `avoid_collisions` joints too close to the other arm's present
        ones are refused. Raises KinematicsException when no joints reach it; needs control.
        """
        self._check_end_effector(end_effector_id)
        arm = self._arm(arm_id)
        seed = self._checked_joints(start_joints, arm) if start_joints else None
        with self._staging[arm]:
            joints, _ = self._solve(self._controlled(), arm, pose, seed)
        if avoid_collisions:
            self._clearance.judge_stand(arm, np.array(joints), self._present(other_arm(arm)))
        return [Joint(name, value) for name, value in zip(JOINTS[arm], joints, strict=True)]

    def forward_kinematics(self, end_effector_id: str, joints: list[Joint], arm_id: str | None = None) -> Pose:
        """Give an arm's TCP in the world for joints, by the controller's calibration; needs control."""
        self._check_end_effector(end_effector_id)
        arm = self._arm(arm_id)
        values = self._checked_joints(joints, arm)
        with self._staging[arm]:
            return self._pose * self._described(self._controlled().lines[arm], values).pose

    def _described(self, line: ArmLine, joints: list[float]) -> RobTarget:
        """Ask for the robtarget of joints: TCP in the robot's frame, configuration, arm angle."""
        line.ask(Code.STAGE_JOINTS, *to_degrees(joints))
        x, y, z, angle = line.ask(Code.FORWARD_POSITION, within=COMPUTE_WITHIN)
        told = line.ask(Code.FORWARD_ORIENTATION, within=COMPUTE_WITHIN)
        pose = pose_from((x, y, z), told[:4])
        return RobTarget(pose, Configuration(*map(int, told[4:8])), math.radians(angle))

    def _solve(
        self, session: ControlSession, arm: str, pose: Pose, seed: list[float] | None
    ) -> tuple[list[float], RobTarget]:
        """Give joints for a pose in the world, and the flange with its configuration; the target stays staged.

        Which of the many solutions is meant is found by nominal kinematics from the seed; the controller then says
        which configuration and arm angle these are, and solves the pose exactly, with its own calibration.
        """
        line = session.lines[arm]
        tcp = self._pose.inverted() * pose
        if not all(map(math.isfinite, (*tcp.position, *tcp.orientation))):
            raise OutOfRange(f"{self.name}: the numbers of a pose must be finite")
        flange = tcp * self._tools[arm].inverted()
        near = np.array(seed) if seed is not None else self._present(arm)
        guess, missed = nominal.nearest(arm, flange.matrix(), near)
        if missed <= nominal.LOST:
            for hint in (guess, near):
                described = self._described(line, [*map(float, hint)])
                with contextlib.suppress(Unwilling):
                    joints = self._inverse(line, tcp, described)
                    return joints, RobTarget(flange, described.configuration, described.arm_angle)
        position = ", ".join(f"{value:.3f}" for value in tcp.position)
        raise self.KinematicsException(
            f"the {arm} arm of {self.name} cannot reach the pose", f"in the robot's frame: {position}"
        )

    @staticmethod
    def _inverse(line: ArmLine, tcp: Pose, like: RobTarget) -> list[float]:
        line.ask(Code.STAGE_POSITION, *position_values(tcp), math.degrees(like.arm_angle))
        line.ask(Code.STAGE_ORIENTATION, *orientation_values(tcp), *like.configuration)
        return to_radians(line.ask(Code.INVERSE, within=COMPUTE_WITHIN)[:7])

    # -------------------------------------------------------------------------------- tool
    def set_tool(
        self,
        tcp: Pose,
        mass: float,
        cog: tuple[float, float, float],
        inertia: tuple[float, ...] | None = None,
        arm_id: str | None = None,
    ) -> None:
        """Tell an arm's server of its tool: TCP in the flange, mass kg, centre of gravity m; inertia is left out."""
        arm = self._arm(arm_id)
        self._within("mass", mass, 0.001, MAX_PAYLOAD)
        for axis, value in zip("xyz", cog, strict=True):
            self._within(f"cog {axis}", value, -0.5, 0.5)
        if inertia is not None:
            raise Refused(f"{self.name}: an inertia cannot be set through this driver")
        self._controlled().tell_tool(arm, tcp, (mass, cog))
        self._tools[arm], self._loads[arm] = tcp, (mass, cog)
        self._clearance.set_tool(arm, tcp)
