"""Messages from the cell host to the server."""

from enum import StrEnum, auto

from msgspec import Struct, field

from arcor2_hw.data.device import Alarm, Connection, Health, Identity
from arcor2_hw.data.held import HeldData
from arcor2_hw.data.interlocks import InterlockState
from arcor2_hw.data.parts import PartInventory
from arcor2_hw.data.position import MAIN_BRANCH, Frame
from arcor2_hw.messages import Message
from arcor2_hw.runtime.message_parts import ErrorData, HeldPart


class RemoteKind(StrEnum):
    """Kind of a RemoteCall."""

    CALL = auto()
    CANCEL = auto()
    """Call the method that cancels `method`, without waiting for the running call."""
    STOP = auto()
    """Stop the object without waiting for its running call."""


class ToServer(Struct, frozen=True, tag=True):
    """Base of the messages from the host to the server."""


class Ready(ToServer, frozen=True):
    """The host has started and imported the common modules."""

    pid: int


class Heartbeat(ToServer, frozen=True):
    """Sent every HEARTBEAT_PERIOD from the thread of the clock."""


class SceneOpened(ToServer, frozen=True):
    """All objects are connected, except those reported by DeviceChanged."""


class SceneFailed(ToServer, frozen=True):
    """An object could not be created or connected. The host closes the others and exits."""

    error: ErrorData


class SceneClosed(ToServer, frozen=True):
    """All objects are closed. `error`: of the first that could not be closed cleanly."""

    error: ErrorData | None = None


class CallDone(ToServer, frozen=True):
    """The method returned. `value`: the result as JSON, empty for None. stamp: when, on the host's own clock, s."""

    id: int
    value: bytes = b""
    stamp: float = 0.0


class CallFailed(ToServer, frozen=True):
    """The method raised an error, was refused or exceeded its deadline."""

    id: int
    error: ErrorData


class RemoteCall(ToServer, frozen=True):
    """Call a method of an object of another host. Answer: RemoteDone or RemoteFailed with this id.

    stops: number of stops that the sender has received. A call is not executed if its device was stopped after it.
    deadline: s; None for the deadline of the method.
    """

    id: int
    object_id: str
    method: str
    arguments: dict[str, bytes] = field(default_factory=dict)
    kind: RemoteKind = RemoteKind.CALL
    deadline: float | None = None
    stops: int = 0


class StreamEvent(ToServer, frozen=True):
    """An encoded RobotJoints, RobotEef, ObjectObservations or ObjectPoints event.

    The first two are for subscribers, or for all clients while a program runs, the others are for subscribers.

    rate: of the Stream to which it belongs, Hz; 0 for the streaming period.
    """

    event: str
    object_id: str
    encoded: bytes
    rate: float = 0.0


class HoldEnded(ToServer, frozen=True):
    """A hold has ended. `error`: why the hold ended or the robot did not stop; None if the user released the button."""

    object_id: str
    hold: int
    error: ErrorData | None = None


class ForceEnded(ToServer, frozen=True):
    """A force has ended, with or without EndForce. `error`: the reason, or why the output was not switched back."""

    force: int
    error: ErrorData | None = None


class ProgramEvent(ToServer, frozen=True):
    """An encoded event: PackageInfo, ActionStateBefore, ActionStateAfter or ProjectException.

    number: counts the calls of actions from 1. name: of the action, or device and method if it has no name. time: start
    of the action, s since the epoch (ActionStateBefore); its duration, s (ActionStateAfter). device: id of the object
    (ActionStateBefore). waited: time between ActionStateBefore and the start of the action, s, for which the program
    was paused (ActionStateAfter). call: number of the call of the function that contains the action, 0 for the program
    itself. frames: the position of the program (ActionStateBefore). branch: the branch, or thread, of the script.
    attempt: number of the attempt of an action that is retried, from 1 (ActionStateBefore).
    """

    event: str
    encoded: bytes
    number: int = 0
    name: str = ""
    time: float = 0.0
    device: str = ""
    waited: float = 0.0
    call: int = 0
    frames: list[Frame] = []
    branch: str = MAIN_BRANCH
    attempt: int = 1


class ActionFailed(ToServer, frozen=True):
    """An action has ended without an event: it failed, or (`error` None) the project declares no actions.

    number, waited: as in ProgramEvent. duration: s.
    """

    number: int
    duration: float
    error: Message | None = None
    waited: float = 0.0


class ProgramChanged(ToServer, frozen=True):
    """The state of the program: running, pausing, paused, or stopped when it has ended.

    finished: whether the script reached its end or a flow action finished it. error: reason of a failure.
    """

    state: str
    finished: bool = False
    error: ErrorData | None = None


class ProgramHeld(ToServer, frozen=True):
    """The program is held at an action; `run` is not set. ProgramChanged reports `paused` when no action runs."""

    held: HeldData
    error: ErrorData


class HeldChanged(ToServer, frozen=True):
    """The choices of the present hold have changed."""

    held: HeldData


class PartsChanged(ToServer, frozen=True):
    """The part inventory has changed."""

    inventory: PartInventory


class ReadCheckpoint(ToServer, frozen=True):
    """Read the newest checkpoint of the scene of the run. Answer: CheckpointAnswer with this number."""

    number: int


class StoreCheckpoint(ToServer, frozen=True):
    """Store a checkpoint of the run. Answer: CheckpointAnswer with this number."""

    number: int
    inventory: PartInventory


class PartStep(ToServer, frozen=True):
    """An action that ends now concerned a part: the number of the action, and the part by its number or serial number.

    order: id of the order, if the action names one. verdict: its result, if it has tested the part.
    """

    action: int
    part: int = 0
    serial: str = ""
    order: str = ""
    verdict: bool | None = None


class InterlocksChanged(ToServer, frozen=True):
    """The states of all interlocks, after a change."""

    states: list[InterlockState]


class HandTeachingEnded(ToServer, frozen=True):
    """A robot has left hand teaching mode without a request. `error`: the reason."""

    object_id: str
    error: ErrorData
    arm_id: str | None = None


class DeviceChanged(ToServer, frozen=True):
    """The connection, health, alarms, control owner or shown values of a device have changed.

    reason: of a lost connection. in_the_way: false for a disabled collision object. held: the parts that a robot holds.
    values: visible state that the device reports (`Generic.shown_values`). stamp: when the connection changed, on
    the monotonic clock, s. raised: when each alarm became active, by code, on the same clock.
    """

    object_id: str
    connection: Connection
    health: Health
    alarms: list[Alarm] = field(default_factory=list)
    control_owner: str | None = None
    reason: Message | None = None
    in_the_way: bool = True
    held: list[HeldPart] = field(default_factory=list)
    values: dict[str, float] = field(default_factory=dict)
    stamp: float = 0.0
    raised: dict[str, float] = field(default_factory=dict)


class DeviceIdentified(ToServer, frozen=True):
    """The identity of a device was read after it connected.

    name, object_type: of the object. identity: None if it cannot be read; problem: why. counters: of the device; None
    if it has none. parameters, restores: whether the type can read its parameters, and write them.
    """

    object_id: str
    name: str
    object_type: str
    identity: Identity | None = None
    problem: Message | None = None
    counters: dict[str, int] | None = None
    parameters: bool = False
    restores: bool = False


class LogLine(ToServer, frozen=True):
    """A line that the script or a driver printed or logged."""

    level: str
    text: str
    object_id: str = ""


class HostLost(ToServer, frozen=True):
    """The relay of a host on another computer reports why the host has ended or cannot be reached. The last message."""

    reason: Message
