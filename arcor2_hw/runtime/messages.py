"""Messages between server and cell host: one tagged union per direction, msgpack with a length prefix.

Arguments and results of calls are JSON documents in bytes, exactly as in scenes, projects and events.
"""

from typing import Any, Final, Literal

import msgspec
from msgspec import Struct, field

from arcor2_hw import framing
from arcor2_hw.data.cell import Cell
from arcor2_hw.data.device import Alarm, Connection, Health, Identity
from arcor2_hw.data.held import HeldData, HoldChoice
from arcor2_hw.data.interlocks import Interlock, InterlockState
from arcor2_hw.data.object_type import ObjectModel
from arcor2_hw.data.operation import HoldKind
from arcor2_hw.data.parts import ConfirmedPart, PartBooks
from arcor2_hw.data.position import MAIN_BRANCH, Frame, ProgramStep
from arcor2_hw.data.project import Project
from arcor2_hw.data.robot import Joint, KinematicCalibration
from arcor2_hw.data.scene import Scene, SceneObjectOverride
from arcor2_hw.data.secret import ObjectSecrets
from arcor2_hw.framing import PREFIX_SIZE as PREFIX_SIZE
from arcor2_hw.messages import Message
from arcor2_hw.runtime.message_parts import AddedBody as AddedBody
from arcor2_hw.runtime.message_parts import DeviceStop as DeviceStop
from arcor2_hw.runtime.message_parts import HeldPart as HeldPart

MAX_MESSAGE: Final = 64 * 1024 * 1024
"""Maximum length of a message, bytes."""
HEARTBEAT_PERIOD: Final = 0.25
"""Period of the heartbeats of the host, s."""
SILENCE_LIMIT: Final = 1.0
"""Time without a message after which the host is reported as not answering, s."""


class ErrorData(Struct, frozen=True):
    """An error on its way between processes: code and name of its class, texts, and the device that raised it.

    fault: code of the device's fault, or kind of the safety stop. stamp: when it was raised, on the monotonic clock, s.
    object_name, object_type: of the device, in the error that ended a program.
    """

    code: str
    type: str
    message: Message
    detail: str = ""
    object_id: str = ""
    fault: str = ""
    stamp: float = 0.0
    object_name: str = ""
    object_type: str = ""


class TypeCode(Struct, frozen=True):
    """Where the host finds an object type: entry point ("module:Class") if installed, else module and source code.

    modules: sources of the modules that belong to this type only, by name.
    """

    name: str
    entry_point: str = ""
    module: str = ""
    source: str = ""
    modules: dict[str, str] = {}


# ------------------------------------------------------------------------------------------------ server to host
class ToHost(Struct, frozen=True, tag=True):
    """Base of the messages from the server to the host."""


class OpenScene(ToHost, frozen=True):
    """Create and connect all objects concurrently. Answer: SceneOpened or SceneFailed.

    keep_going: whether the scene opens without objects that cannot be created or connected; DeviceChanged reports them.
    assets: files of uploaded meshes and robot models, by id. bodies: obstacles that are not objects of the scene.
    calibrations: kinematics read from robot controllers, by object id. secrets: secret settings, by object id.
    identities: the confirmed identities, by object id; another device is not commanded.
    """

    scene: Scene
    types: list[TypeCode]
    models: dict[str, ObjectModel] = field(default_factory=dict)
    overrides: list[SceneObjectOverride] = field(default_factory=list)
    streaming_period: float = 0.1
    project: Project | None = None
    keep_going: bool = False
    assets: dict[str, str] = field(default_factory=dict)
    bodies: list[AddedBody] = field(default_factory=list)
    calibrations: dict[str, KinematicCalibration] = field(default_factory=dict)
    secrets: dict[str, ObjectSecrets] = field(default_factory=dict)
    identities: dict[str, Identity] = field(default_factory=dict)


class RetryObject(ToHost, frozen=True):
    """Create and connect a failed object again. Answer: CallDone or CallFailed with this id."""

    id: int
    object_id: str


class AddObject(ToHost, frozen=True):
    """Create and connect the only object of `opening` in addition to the present ones. Answer as to RetryObject."""

    id: int
    opening: OpenScene


class RunPackage(ToHost, frozen=True):
    """Run script.py of a package directory. ProgramChanged and ProgramEvent report its progress.

    cell: settings of devices in this cell, which override those of the package. breakpoints: ids of action points and
    actions, all of which must exist. shared_breakpoints: further ids; those that the project lacks are ignored. assets,
    bodies, calibrations, secrets, identities: as in OpenScene. hold_on_error: whether a failed action holds the
    program, see ProgramHeld. run: number of the run. records: directory of the books of parts and of checkpoints; empty
    to store nothing. checkpoints: whether the state is stored before and after each action. continues: whether the
    program continues where it was interrupted. continue_at: how many actions of its cycle are not repeated. values:
    values of constants and variables of the project by their ids, JSON in a string, which replace those of the package.
    recordings: directory in which the host stores the recording of a run that the end of the server interrupts; empty
    to store nothing.
    """

    package_id: str
    directory: str
    start_paused: bool = False
    breakpoints: list[str] = field(default_factory=list)
    streaming_period: float = 0.1
    cell: Cell | None = None
    shared_breakpoints: list[str] = field(default_factory=list)
    assets: dict[str, str] = field(default_factory=dict)
    bodies: list[AddedBody] = field(default_factory=list)
    calibrations: dict[str, KinematicCalibration] = field(default_factory=dict)
    secrets: dict[str, ObjectSecrets] = field(default_factory=dict)
    hold_on_error: bool = False
    run: int = 0
    records: str = ""
    checkpoints: bool = True
    continues: bool = False
    continue_at: int | None = None
    values: dict[str, str] = field(default_factory=dict)
    identities: dict[str, Identity] = field(default_factory=dict)
    recordings: str = ""


class AddBody(ToHost, frozen=True):
    """Add an obstacle, replacing the one with the same id."""

    body: AddedBody


class RemoveBodies(ToHost, frozen=True):
    """Remove added obstacles."""

    ids: list[str]


class Calibrate(ToHost, frozen=True):
    """Set the kinematics that the controller of a robot reported; None for the nominal kinematics."""

    object_id: str
    calibration: KinematicCalibration | None


class Call(ToHost, frozen=True):
    """Call a method of a device. Answer: CallDone or CallFailed with this id.

    control: whether to take control first. cancel: whether to call the method that cancels `method`, without waiting
    for the running call. deadline: s; None for the deadline of the method.
    """

    id: int
    object_id: str
    method: str
    arguments: dict[str, bytes] = field(default_factory=dict)
    control: bool = False
    cancel: bool = False
    deadline: float | None = None


class StopMotion(ToHost, frozen=True):
    """Stop one device without waiting for its running call. Answer: CallDone or CallFailed with this id."""

    id: int
    object_id: str


class StopAll(ToHost, frozen=True):
    """Stop the running program and all devices. Answer: CallDone with this id and a JSON list of DeviceStop."""

    id: int


class Subscribe(ToHost, frozen=True):
    """Select whether joints and end effector poses of a robot are sent at the streaming period."""

    object_id: str
    joints: bool
    eef: bool


class Stream(ToHost, frozen=True):
    """Set the rates, Hz, at which joints, end effector poses, observations and points are sent with timestamps."""

    object_id: str
    joints: list[float]
    eef: list[float]
    observations: list[float] = field(default_factory=list)
    points: list[float] = field(default_factory=list)


class ForcePoint(ToHost, frozen=True):
    """Force an output until a time of the monotonic clock, s. Answer: CallDone with ForceStarted, or CallFailed.

    force: number of the force. ForceEnded reports its end.
    """

    id: int
    object_id: str
    point: str
    force: int
    value: bool | float
    until: float


class RenewForces(ToHost, frozen=True):
    """Extend forces until a time of the monotonic clock, s. Those that have ended are ignored."""

    forces: list[int]
    until: float


class EndForce(ToHost, frozen=True):
    """End a force. Answer: CallDone or CallFailed with this id when the output has its value from before."""

    id: int
    force: int


class Lease(ToHost, frozen=True):
    """Start, renew or end hold-to-run of a robot. Answer: CallDone or CallFailed with this id; at the end HoldEnded.

    hold: number of the hold; the first lease with a number starts it. until: time of the monotonic clock at which the
    robot is stopped unless the lease is renewed; 0 ends the hold. A jog has either `twist` (m/s, rad/s) in the axes of
    `frame`, or `joints` with velocities (rad/s, m/s), or `retract` to leave a zone. The value of CallDone is
    `{"scale": fraction of the velocity}`.
    """

    id: int
    object_id: str
    hold: int
    kind: HoldKind
    until: float
    twist: tuple[float, float, float, float, float, float] | None = None
    frame: Literal["world", "base", "tool"] = "world"
    joints: list[Joint] | None = None
    end_effector_id: str | None = None
    arm_id: str | None = None
    retract: bool = False


class Pause(ToHost, frozen=True):
    """Pause the program before its next action."""


class Resume(ToHost, frozen=True):
    """Continue the program."""


class Step(ToHost, frozen=True):
    """Continue the program for one action, over or into functions, or until the present function is left.

    branch: id of the branch; empty for the one that waits longest.
    """

    mode: ProgramStep = ProgramStep.OVER
    branch: str = ""


class SetBreakpoints(ToHost, frozen=True):
    """Replace the shared breakpoints. Those of RunPackage remain."""

    shared_breakpoints: list[str]


class DecideHeld(ToHost, frozen=True):
    """Continue a held program. Answer: CallDone or CallFailed with this id, before the program continues.

    number: of the action at which it is held. results: each as JSON, for the choice `result`. exit_id: id of the logic
    item, for the choice `error_exit`; empty for the first one.
    """

    id: int
    number: int
    choice: HoldChoice
    results: list[str] = field(default_factory=list)
    exit_id: str = ""


class ConfirmParts(ToHost, frozen=True):
    """Record where a person has found parts. Answer: CallDone or CallFailed with this id."""

    id: int
    parts: list[ConfirmedPart]


class ConfirmIdentity(ToHost, frozen=True):
    """Accept an identity of a device from now on."""

    object_id: str
    identity: Identity


class SetInterlocks(ToHost, frozen=True):
    """Replace the interlocks of the open scene. Those of a program are in its package."""

    interlocks: list[Interlock]


class StopProgram(ToHost, frozen=True):
    """Stop all devices, then end the script by an exception."""


class CloseScene(ToHost, frozen=True):
    """Disconnect all objects, answer SceneClosed and exit."""


# ------------------------------------------------------------------------------------------------ host to server
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
    """The method returned. `value`: the result as JSON, empty for None."""

    id: int
    value: bytes = b""


class CallFailed(ToServer, frozen=True):
    """The method raised an error, was refused or exceeded its deadline."""

    id: int
    error: ErrorData


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


class ForceStarted(Struct, frozen=True):
    """The value of CallDone for ForcePoint. before: value of the output before. unit: of both values."""

    before: bool | float
    unit: str


class ForceEnded(ToServer, frozen=True):
    """A force has ended without EndForce, or as it requested. `error`: why, or why the output was not switched back."""

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

    finished: whether the script reached its end or a flow action finished it. error: why it failed.
    """

    state: str
    finished: bool = False
    error: ErrorData | None = None


class ProgramHeld(ToServer, frozen=True):
    """The program is held at an action; `run` is not set. ProgramChanged reports `paused` when no action runs."""

    held: HeldData
    error: ErrorData


class HeldChanged(ToServer, frozen=True):
    """Other choices are possible in the present hold."""

    held: HeldData


class PartsChanged(ToServer, frozen=True):
    """The books of parts have changed."""

    books: PartBooks


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
    values: what the device reports of what one can see (`Generic.shown_values`). stamp: when the connection changed, on
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

    name, object_type: of the object. identity: None if it cannot be read; problem: why. parameters, restores: whether
    the type can read its parameters, and write them.
    """

    object_id: str
    name: str
    object_type: str
    identity: Identity | None = None
    problem: Message | None = None
    parameters: bool = False
    restores: bool = False


class LogLine(ToServer, frozen=True):
    """A line that the script or a driver printed or logged."""

    level: str
    text: str
    object_id: str = ""


HostBound = (
    OpenScene
    | RetryObject
    | AddObject
    | RunPackage
    | AddBody
    | RemoveBodies
    | Calibrate
    | Call
    | StopMotion
    | StopAll
    | Subscribe
    | Stream
    | ForcePoint
    | RenewForces
    | EndForce
    | Lease
    | Pause
    | Resume
    | Step
    | SetBreakpoints
    | DecideHeld
    | ConfirmParts
    | SetInterlocks
    | ConfirmIdentity
    | StopProgram
    | CloseScene
)
ServerBound = (
    Ready
    | Heartbeat
    | SceneOpened
    | SceneFailed
    | SceneClosed
    | CallDone
    | CallFailed
    | StreamEvent
    | HoldEnded
    | ForceEnded
    | HandTeachingEnded
    | ProgramEvent
    | ActionFailed
    | ProgramChanged
    | ProgramHeld
    | HeldChanged
    | PartsChanged
    | PartStep
    | InterlocksChanged
    | DeviceChanged
    | DeviceIdentified
    | LogLine
)

decode_host_bound: Any = msgspec.msgpack.Decoder(HostBound).decode
decode_server_bound: Any = msgspec.msgpack.Decoder(ServerBound).decode
_encode = msgspec.msgpack.Encoder().encode


def encode(message: ToHost | ToServer) -> bytes:
    """Encode a message with its length prefix."""
    return framing.framed(_encode(message))


def body_length(prefix: bytes) -> int:
    """Return the length that a prefix declares. Raises ValueError beyond MAX_MESSAGE."""
    return framing.body_length(prefix, MAX_MESSAGE)
