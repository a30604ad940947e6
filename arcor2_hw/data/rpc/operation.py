"""Arguments and answers of additional requests about devices and robots of an online scene."""

import enum
from typing import Final

from arcor2_hw.data.base import UNSET, Data, TranslatableData, Unset
from arcor2_hw.data.geometry import Pose, Position
from arcor2_hw.data.robot import Joint
from arcor2_hw.data.role import Role
from arcor2_hw.data.rpc.envelope import Rpc
from arcor2_hw.data.rpc.robots import RobotEventKind

MAX_LEASE_MS: Final = 300
"""Maximum time after which a hold that is not renewed ends, ms."""
FASTEST_STREAM: Final = 30
"""Maximum rate of a stream, Hz."""

SLOWEST_OBSERVATIONS: Final = 0.2
FASTEST_OBSERVATIONS: Final = 10.0
"""Limits of the rate of observations, Hz."""


class JogFrame(enum.StrEnum):
    """The frame whose axes are used for jogging. The moving point is always the end effector."""

    WORLD = "world"
    ROBOT = "robot"
    TOOL = "tool"
    USER = "user"


class JogRobotArgs(Data, frozen=True):
    """Arguments of JogRobot: a velocity of the end effector (`linear` m/s, `angular` rad/s), or of joints (rad/s, m/s).

    hold: number of this press of the button, larger than the previous one; renewals have the same number. sent_ms: time
    of sending by the sender's own steady clock with any origin. valid_ms: 1 to 300, duration of the velocity unless it
    is renewed; 0 ends it. object_id, pose: for the frame `user`, an object of the scene, or a pose in the world.
    retract: leave the zone in which the robot is, on its retract path, instead of a velocity.
    """

    robot_id: str
    hold: int
    sent_ms: float
    valid_ms: int
    frame: JogFrame = JogFrame.WORLD
    linear: Position | Unset = UNSET
    angular: Position | Unset = UNSET
    joints: list[Joint] | Unset = UNSET
    object_id: str | Unset = UNSET
    pose: Pose | Unset = UNSET
    end_effector_id: str | Unset = UNSET
    arm_id: str | Unset = UNSET
    retract: bool | Unset = UNSET


class JogRobotData(Data, frozen=True):
    """Answer to JogRobot: the fraction of the requested velocity that is used, less than 1 where it is limited."""

    scale: float


class HoldHandTeachingArgs(Data, frozen=True):
    """Arguments of HoldHandTeaching; `hold`, `sent_ms` and `valid_ms` as in JogRobot."""

    robot_id: str
    hold: int
    sent_ms: float
    valid_ms: int
    arm_id: str | Unset = UNSET


class StreamRobotArgs(Data, frozen=True):
    """Arguments of StreamRobot: RobotJoints or RobotEef of a robot, 1 to 30 times per second, or off."""

    robot_id: str
    what: RobotEventKind
    rate: float = float(FASTEST_STREAM)
    send: bool = True


class StreamObservationsArgs(Data, frozen=True):
    """Arguments of StreamObservations: ObjectObservations of a device, 0.2 to 10 times per second, or off."""

    object_id: str
    rate: float = 1.0
    send: bool = True


class StopKind(enum.StrEnum):
    """What a stop applies to."""

    DEVICE = "device"
    ACTION = "action"
    PROGRAM = "program"


class StopOutcome(TranslatableData, frozen=True):
    """The result of StopAll for one device, the action being executed, or the program.

    id, name: of the scene object, the action or the package. reason: why it was not stopped, with `key` and `values`.
    """

    kind: StopKind
    id: str
    name: str
    stopped: bool
    reason: str | Unset = UNSET


class StopAllData(Data, frozen=True):
    """Answer to StopAll: the result for each device, action or program that was stopped, or cannot be stopped."""

    outcomes: list[StopOutcome]


class RetryObjectArgs(Data, frozen=True):
    """Arguments of RetryObject."""

    object_id: str


class AcknowledgeStopArgs(Data, frozen=True):
    """Arguments of AcknowledgeStop: the stop or fault of a robot; with `code`, an alarm of any device."""

    object_id: str
    code: str | Unset = UNSET


OPERATION_RPCS: Final = (
    Rpc("AcknowledgeStop", AcknowledgeStopArgs, None, Role.OPERATOR, additional=True),
    Rpc("HoldHandTeaching", HoldHandTeachingArgs, None, Role.STANDARD_USER, additional=True),
    Rpc("JogRobot", JogRobotArgs, JogRobotData, Role.STANDARD_USER, additional=True),
    Rpc("StopAll", None, StopAllData, Role.OPERATOR, additional=True),
    Rpc("StreamObservations", StreamObservationsArgs, None, Role.OPERATOR, additional=True),
    Rpc("StreamRobot", StreamRobotArgs, None, Role.OPERATOR, additional=True),
)
"""Requests that operate devices."""


# Names before version 0.2.
LONGEST_LEASE_MS = MAX_LEASE_MS
