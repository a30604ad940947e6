"""Arguments and answers of the requests, beside the protocol, about devices and robots in operation."""

import enum
from typing import Final

from arcor2_hw.data.base import UNSET, Data, Unset
from arcor2_hw.data.geometry import Pose, Position
from arcor2_hw.data.robot import Joint
from arcor2_hw.data.rpc.robots import RobotEventKind

LONGEST_LEASE_MS: Final = 300
"""A hold that is not renewed ends after that long at the latest."""
FASTEST_STREAM: Final = 30
"""Hz."""


class JogFrame(enum.StrEnum):
    """The frame in whose axes a jog is given; the point that moves is always the end effector's."""

    WORLD = "world"
    ROBOT = "robot"
    TOOL = "tool"
    USER = "user"


class JogRobotArgs(Data, frozen=True):
    """Arguments of JogRobot: a velocity of the end effector (`linear` m/s, `angular` rad/s), or of joints (rad/s, m/s).

    hold: a number for this press of the button, larger than that of the one before; renewals carry the same.
    sent_ms: when this was sent, by the sender's own steady clock; where it begins does not matter.
    valid_ms: 1 to 300, for how long the velocity holds unless it is renewed; 0 lets go.
    object_id, pose: for the frame `user`: an object of the scene, or a pose in the world.
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


class JogRobotData(Data, frozen=True):
    """What JogRobot answers: the fraction of the asked velocity that the robot was given, less than 1 where capped."""

    scale: float


class HoldHandTeachingArgs(Data, frozen=True):
    """Arguments of HoldHandTeaching; `hold`, `sent_ms` and `valid_ms` as in JogRobot."""

    robot_id: str
    hold: int
    sent_ms: float
    valid_ms: int
    arm_id: str | Unset = UNSET


class StreamRobotArgs(Data, frozen=True):
    """Arguments of StreamRobot: RobotJoints or RobotEef of a robot, 1 to 30 times a second, or no longer."""

    robot_id: str
    what: RobotEventKind
    rate: float = float(FASTEST_STREAM)
    send: bool = True


class StopKind(enum.StrEnum):
    """What a stop applies to."""

    DEVICE = "device"
    ACTION = "action"
    PROGRAM = "program"


class StopOutcome(Data, frozen=True):
    """The result of StopAll for one device, the action that is being tried, or the program.

    id, name: of the scene object, the action or the package. reason: why it was not stopped.
    """

    kind: StopKind
    id: str
    name: str
    stopped: bool
    reason: str | Unset = UNSET


class StopAllData(Data, frozen=True):
    """Answer of StopAll: an outcome for everything to which a stop was sent, or which cannot be stopped."""

    outcomes: list[StopOutcome]


class RetryObjectArgs(Data, frozen=True):
    """Arguments of RetryObject."""

    object_id: str


class AcknowledgeStopArgs(Data, frozen=True):
    """Arguments of AcknowledgeStop: the stop or fault of a robot; with `code`, an alarm of any device."""

    object_id: str
    code: str | Unset = UNSET
