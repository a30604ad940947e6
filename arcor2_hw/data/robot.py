"""Robots: joints, types, features, and our extended state."""

import enum

from msgspec import field

from arcor2_hw.data.base import UNSET, Data, MutableData, Unset
from arcor2_hw.data.geometry import Pose


class Joint(MutableData):
    """The value of a joint, rad, m where prismatic."""

    name: str
    value: float


class RobotType(enum.StrEnum):
    """Types of robot."""

    ARTICULATED = "articulated"
    CARTESIAN = "cartesian"
    SCARA = "scara"


class RobotFeatures(Data, frozen=True):
    """Optional methods that a robot type implements; the last three are not in ARCOR2."""

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
    """Metadata of a robot type."""

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
    """Request for joint values that reach a pose, as older object types send it to a service of their own."""

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
    """State of the drives' power."""

    OFF = "off"
    IDLE_BRAKED = "idle_braked"
    OPERATIONAL = "operational"


class Safety(enum.StrEnum):
    """State of the controller's safety system."""

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
    """State of the controller's program; foreign: a program of another source."""

    STOPPED = "stopped"
    PLAYING = "playing"
    PAUSED = "paused"
    FOREIGN = "foreign"


class Control(enum.StrEnum):
    """Who may command the robot: the pendant or a remote client."""

    LOCAL = "local"
    REMOTE = "remote"


class RobotState(Data, frozen=True):
    """The complete state of a robot at one instant; `not_ready_because` is empty when it accepts commands."""

    mode: Mode
    power: Power
    safety: Safety
    program: ProgramState
    control: Control
    moving: bool
    speed_override: float
    not_ready_because: list[str] = field(default_factory=list)


class DhParameters(Data, frozen=True):
    """Denavit-Hartenberg parameters of one joint: theta and alpha in rad, d and a in m (classic convention)."""

    theta: float
    d: float
    a: float
    alpha: float


class KinematicCalibration(Data, frozen=True):
    """Calibrated kinematics of this robot from the base to the flange; `checksum` identifies the robot."""

    joints: list[DhParameters]
    checksum: str


class MoveEnd(enum.StrEnum):
    """How a motion ended."""

    DONE = "done"
    STOPPED = "stopped"
    SAFETY = "safety"


class MoveResult(Data, frozen=True):
    """Result of a move: reached pose (world), used fraction of the speed, duration in s, outcome."""

    pose: Pose
    speed: float
    duration: float
    end: MoveEnd


class RobotMaxima(Data, frozen=True):
    """The maxima at speed 1 that the settings of a robot state; 0: not stated.

    Attributes:
        joint_speed: rad/s.
        joint_acceleration: rad/s².
        tcp_speed: m/s.
        tcp_acceleration: m/s².
    """

    joint_speed: float = 0.0
    joint_acceleration: float = 0.0
    tcp_speed: float = 0.0
    tcp_acceleration: float = 0.0
