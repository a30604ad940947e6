"""Arguments about robots of an online scene."""

import enum
from typing import Final

from arcor2_hw.data.base import UNSET, Data, Unset
from arcor2_hw.data.geometry import Orientation, Pose, Position
from arcor2_hw.data.robot import Joint, RobotMeta
from arcor2_hw.data.role import Role
from arcor2_hw.data.rpc.envelope import Rpc


class CalibrateRobotArgs(Data, frozen=True):
    """Arguments of CalibrateRobot."""

    robot_id: str
    camera_id: str | Unset = UNSET
    move_to_calibration_pose: bool = True


class ForwardKinematicsArgs(Data, frozen=True):
    """Arguments of ForwardKinematics."""

    robot_id: str
    end_effector_id: str
    joints: list[Joint]
    arm_id: str | Unset = UNSET


class GetEndEffectorPoseArgs(Data, frozen=True):
    """Arguments of GetEndEffectorPose."""

    robot_id: str
    end_effector_id: str
    arm_id: str | Unset = UNSET


class GetEndEffectorsArgs(Data, frozen=True):
    """Arguments of GetEndEffectors."""

    robot_id: str
    arm_id: str | Unset = UNSET


class GetGrippersArgs(Data, frozen=True):
    """Arguments of GetGrippers."""

    robot_id: str
    arm_id: str | Unset = UNSET


class GetRobotArmsArgs(Data, frozen=True):
    """Arguments of GetRobotArms."""

    robot_id: str


class GetRobotJointsArgs(Data, frozen=True):
    """Arguments of GetRobotJoints."""

    robot_id: str
    arm_id: str | Unset = UNSET


class GetSuctionsArgs(Data, frozen=True):
    """Arguments of GetSuctions."""

    robot_id: str
    arm_id: str | Unset = UNSET


class HandTeachingModeArgs(Data, frozen=True):
    """Arguments of HandTeachingMode."""

    robot_id: str
    enable: bool
    arm_id: str | Unset = UNSET


class InverseKinematicsArgs(Data, frozen=True):
    """Arguments of InverseKinematics."""

    robot_id: str
    end_effector_id: str
    pose: Pose
    start_joints: list[Joint] | Unset = UNSET
    avoid_collisions: bool = True
    arm_id: str | Unset = UNSET


class MoveToActionPointArgs(Data, frozen=True):
    """Arguments of MoveToActionPoint."""

    robot_id: str
    speed: float
    end_effector_id: str | Unset = UNSET
    orientation_id: str | Unset = UNSET
    joints_id: str | Unset = UNSET
    safe: bool = True
    linear: bool = False
    arm_id: str | Unset = UNSET


class MoveToJointsArgs(Data, frozen=True):
    """Arguments of MoveToJoints."""

    robot_id: str
    speed: float
    joints: list[Joint]
    safe: bool = True
    arm_id: str | Unset = UNSET


class MoveToPoseArgs(Data, frozen=True):
    """Arguments of MoveToPose."""

    robot_id: str
    end_effector_id: str
    speed: float
    position: Position | Unset = UNSET
    orientation: Orientation | Unset = UNSET
    safe: bool = True
    linear: bool = False
    arm_id: str | Unset = UNSET


class RobotEventKind(enum.StrEnum):
    """Values of RegisterEnum in RegisterForRobotEvent."""

    EEF_POSE = "eef_pose"
    JOINTS = "joints"


class RegisterForRobotEventArgs(Data, frozen=True):
    """Arguments of RegisterForRobotEvent."""

    robot_id: str
    what: RobotEventKind
    send: bool


class SetEefPerpendicularToWorldArgs(Data, frozen=True):
    """Arguments of SetEefPerpendicularToWorld."""

    robot_id: str
    end_effector_id: str
    safe: bool = True
    speed: float = 0.25
    linear: bool = True
    arm_id: str | Unset = UNSET


class StepAxis(enum.StrEnum):
    """Values of Axis in StepRobotEef."""

    X = "x"
    Y = "y"
    Z = "z"


class StepWhat(enum.StrEnum):
    """Values of What in StepRobotEef."""

    POSITION = "position"
    ORIENTATION = "orientation"


class StepMode(enum.StrEnum):
    """Values of Mode in StepRobotEef."""

    WORLD = "world"
    ROBOT = "robot"
    USER = "user"
    RELATIVE = "relative"


class StepRobotEefArgs(Data, frozen=True):
    """Arguments of StepRobotEef."""

    robot_id: str
    end_effector_id: str
    axis: StepAxis
    what: StepWhat
    mode: StepMode
    step: float
    safe: bool = True
    pose: Pose | Unset = UNSET
    speed: float = 0.25
    linear: bool = True
    arm_id: str | Unset = UNSET


class StopRobotArgs(Data, frozen=True):
    """Arguments of StopRobot."""

    robot_id: str


ROBOT_RPCS: Final = (
    Rpc("CalibrateRobot", CalibrateRobotArgs, None, Role.TECHNICIAN),
    Rpc("ForwardKinematics", ForwardKinematicsArgs, Pose, Role.STANDARD_USER),
    Rpc("GetEndEffectorPose", GetEndEffectorPoseArgs, Pose, Role.OPERATOR),
    Rpc("GetEndEffectors", GetEndEffectorsArgs, set[str], Role.OPERATOR),
    Rpc("GetGrippers", GetGrippersArgs, set[str], Role.OPERATOR),
    Rpc("GetRobotArms", GetRobotArmsArgs, set[str], Role.OPERATOR),
    Rpc("GetRobotJoints", GetRobotJointsArgs, list[Joint], Role.OPERATOR),
    Rpc("GetRobotMeta", None, list[RobotMeta], Role.OPERATOR),
    Rpc("GetSuctions", GetSuctionsArgs, set[str], Role.OPERATOR),
    Rpc("HandTeachingMode", HandTeachingModeArgs, None, Role.STANDARD_USER, dry_run=True),
    Rpc("InverseKinematics", InverseKinematicsArgs, list[Joint], Role.STANDARD_USER),
    Rpc("MoveToActionPoint", MoveToActionPointArgs, None, Role.STANDARD_USER),
    Rpc("MoveToJoints", MoveToJointsArgs, None, Role.STANDARD_USER),
    Rpc("MoveToPose", MoveToPoseArgs, None, Role.STANDARD_USER),
    Rpc("RegisterForRobotEvent", RegisterForRobotEventArgs, set[str], Role.OPERATOR),
    Rpc("SetEefPerpendicularToWorld", SetEefPerpendicularToWorldArgs, None, Role.STANDARD_USER, dry_run=True),
    Rpc("StepRobotEef", StepRobotEefArgs, None, Role.STANDARD_USER, dry_run=True),
    Rpc("StopRobot", StopRobotArgs, None, Role.OPERATOR),
)
"""Requests about robots."""
