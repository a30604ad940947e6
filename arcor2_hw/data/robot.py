"""Robots: joints, kinds, features, and our fuller state."""

import enum

from msgspec import field

from arcor2_hw.data.base import UNSET, Data, MutableData, Unset
from arcor2_hw.data.geometry import Pose


class Joint(MutableData):
    """A joint's value: rad, m where prismatic."""

    name: str
    value: float


class RobotType(enum.StrEnum):
    """Kinds of arm."""

    ARTICULATED = "articulated"
    CARTESIAN = "cartesian"
    SCARA = "scara"


class RobotFeatures(Data, frozen=True):
    """Which optional methods a robot type implements; the last three are ours, beside the protocol."""

    move_to_pose: bool = False
    move_to_joints: bool = False
    stop: bool = False
    forward_kinematics: bool = False
    inverse_kinematics: bool = False
    hand_teaching: bool = False
    jog: bool | Unset = UNSET
    acknowledge_stop: bool | Unset = UNSET
    kinematic_calibration: bool | Unset = UNSET


class RobotMeta(Data, frozen=True):
    """What clients know of a robot type."""

    type: str
    robot_type: RobotType
    multi_arm: bool = False
    features: RobotFeatures = RobotFeatures()
    urdf_package_filename: str | Unset = UNSET


class EefPose(Data, frozen=True):
    """Pose of one end effector in the world."""

    end_effector_id: str
    pose: Pose
    arm_id: str | Unset = UNSET


class RobotArg(Data, frozen=True):
    """Names a robot's end effector."""

    robot_id: str
    end_effector: str
    arm_id: str | Unset = UNSET


class InverseKinematicsRequest(MutableData):
    """A question for joints that reach a pose, as older object types put it to a service of their own."""

    pose: Pose
    start_joints: list[Joint] | None = None
    avoid_collisions: bool = True


class Mode(enum.StrEnum):
    """Operating mode of a robot controller (ISO 10218-1)."""

    OTHER = "other"
    MANUAL_REDUCED_SPEED = "manual_reduced_speed"
    MANUAL_HIGH_SPEED = "manual_high_speed"
    AUTOMATIC = "automatic"
    AUTOMATIC_EXTERNAL = "automatic_external"


class Power(enum.StrEnum):
    """Drive power."""

    OFF = "off"
    IDLE_BRAKED = "idle_braked"
    OPERATIONAL = "operational"


class Safety(enum.StrEnum):
    """What the safety system of the controller says."""

    NORMAL = "normal"
    REDUCED = "reduced"
    PROTECTIVE_STOP = "protective_stop"
    SAFEGUARD_STOP = "safeguard_stop"
    EMERGENCY_STOP = "emergency_stop"
    ENABLING_STOP = "enabling_stop"
    RECOVERY = "recovery"
    VIOLATION = "violation"
    FAULT = "fault"


class ProgramState(enum.StrEnum):
    """What the controller runs; foreign is a program that is not ours."""

    STOPPED = "stopped"
    PLAYING = "playing"
    PAUSED = "paused"
    FOREIGN = "foreign"


class Control(enum.StrEnum):
    """Who may command: the pendant or a remote client."""

    LOCAL = "local"
    REMOTE = "remote"


class RobotState(Data, frozen=True):
    """The whole state of a robot at one instant; `not_ready_because` is empty when it takes commands."""

    mode: Mode
    power: Power
    safety: Safety
    program: ProgramState
    control: Control
    moving: bool
    speed_override: float
    not_ready_because: list[str] = field(default_factory=list)


class DhParameters(Data, frozen=True):
    """One joint by Denavit and Hartenberg: theta and alpha in rad, d and a in m (classic convention)."""

    theta: float
    d: float
    a: float
    alpha: float


class KinematicCalibration(Data, frozen=True):
    """What a controller knows of the very arm at it, from the base to the flange; checksum tells arms apart."""

    joints: list[DhParameters]
    checksum: str


class MoveEnd(enum.StrEnum):
    """How a motion ended."""

    DONE = "done"
    STOPPED = "stopped"
    SAFETY = "safety"


class MoveResult(Data, frozen=True):
    """What a move really did: pose reached (world), fraction of speed used, duration in s, how it ended."""

    pose: Pose
    speed: float
    duration: float
    end: MoveEnd
