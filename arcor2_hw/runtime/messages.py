"""What server and cell host say to each other: one tagged union per direction, length-prefixed msgpack.

Arguments and results of calls travel as JSON documents in bytes, exactly as they stand in scenes, projects and events.
"""

from typing import Any, Final, Literal

import msgspec
from msgspec import Struct, field

from arcor2_hw import framing
from arcor2_hw.data.cell import Cell
from arcor2_hw.data.device import Alarm, Connection, Health
from arcor2_hw.data.object_type import ObjectModel
from arcor2_hw.data.operation import HoldKind
from arcor2_hw.data.project import Project
from arcor2_hw.data.robot import Joint, KinematicCalibration
from arcor2_hw.data.scene import Scene, SceneObjectOverride
from arcor2_hw.data.secret import ObjectSecrets
from arcor2_hw.framing import PREFIX_SIZE as PREFIX_SIZE
from arcor2_hw.runtime.message_parts import DeviceStop as DeviceStop
from arcor2_hw.runtime.message_parts import HeldPart as HeldPart
from arcor2_hw.runtime.message_parts import PutIn as PutIn

MAX_MESSAGE: Final = 64 * 1024 * 1024
HEARTBEAT_PERIOD: Final = 0.25
"""Seconds between two heartbeats of the host."""
SILENCE_LIMIT: Final = 1.0
"""Seconds without a word after which the host is reported as not answering."""


class ErrorData(Struct, frozen=True):
    """An error as it crosses the process border: the code of its class, and the device to blame."""

    code: str
    type: str
    message: str
    detail: str = ""
    object_id: str = ""


class TypeCode(Struct, frozen=True):
    """How the host gets at an object type: entry point ("module:Class") if installed, else module and source."""

    name: str
    entry_point: str = ""
    module: str = ""
    source: str = ""


# ------------------------------------------------------------------------------------------------ server to host
class ToHost(Struct, frozen=True, tag=True):
    """Base of everything the server says."""


class OpenScene(ToHost, frozen=True):
    """Create and connect all objects at once. Answer: SceneOpened or SceneFailed.

    keep_going: an object that cannot be made or connected is told as failed by DeviceChanged, and the others come up.
    assets: files of the meshes and of robots' models that were uploaded, by id. bodies: what stands in the way besides.
    calibrations: kinematics of robots as their controllers told them, by id. secrets: values of secret settings by
    the id of the object.
    """

    scene: Scene
    types: list[TypeCode]
    models: dict[str, ObjectModel] = field(default_factory=dict)
    overrides: list[SceneObjectOverride] = field(default_factory=list)
    streaming_period: float = 0.1
    project: Project | None = None
    keep_going: bool = False
    assets: dict[str, str] = field(default_factory=dict)
    bodies: list[PutIn] = field(default_factory=list)
    calibrations: dict[str, KinematicCalibration] = field(default_factory=dict)
    secrets: dict[str, ObjectSecrets] = field(default_factory=dict)


class RetryObject(ToHost, frozen=True):
    """Make and connect an object anew that has failed. Answer: CallDone or CallFailed with this id."""

    id: int
    object_id: str


class RunPackage(ToHost, frozen=True):
    """Run script.py of a package directory. The script's life is told by ProgramChanged and ProgramEvent.

    cell: the settings of devices at this place, which win over those of the package. breakpoints: ids of action points
    and actions, which must be there. shared_breakpoints: more of them, left out where the project lacks them. assets,
    bodies, calibrations, secrets: as in OpenScene.
    """

    package_id: str
    directory: str
    start_paused: bool = False
    breakpoints: list[str] = field(default_factory=list)
    streaming_period: float = 0.1
    cell: Cell | None = None
    shared_breakpoints: list[str] = field(default_factory=list)
    assets: dict[str, str] = field(default_factory=dict)
    bodies: list[PutIn] = field(default_factory=list)
    calibrations: dict[str, KinematicCalibration] = field(default_factory=dict)
    secrets: dict[str, ObjectSecrets] = field(default_factory=dict)


class PutBody(ToHost, frozen=True):
    """Something stands in the way from now on, in place of what had that id."""

    body: PutIn


class RemoveBodies(ToHost, frozen=True):
    """What was put in under these ids is gone."""

    ids: list[str]


class Calibrate(ToHost, frozen=True):
    """Kinematics of a robot are from now on those that its controller told; None: nominal ones."""

    object_id: str
    calibration: KinematicCalibration | None


class Call(ToHost, frozen=True):
    """Call a method on its device's executor. Answer: CallDone or CallFailed with this id.

    control: take control first when it is not ours. cancel: call what the object type says cancels `method`, past what
    the device is doing. deadline: seconds; None: the method's own.
    """

    id: int
    object_id: str
    method: str
    arguments: dict[str, bytes] = field(default_factory=dict)
    control: bool = False
    cancel: bool = False
    deadline: float | None = None


class StopMotion(ToHost, frozen=True):
    """Stop one device on its stop lane. Answer: CallDone or CallFailed with this id."""

    id: int
    object_id: str


class StopAll(ToHost, frozen=True):
    """Stop the program, if one runs, and all devices, concurrently.

    Answer: CallDone with this id and a JSON list of DeviceStop.
    """

    id: int


class Subscribe(ToHost, frozen=True):
    """Send, or no longer send, joints or end effector poses of a robot at the streaming period."""

    object_id: str
    joints: bool
    eef: bool


class Stream(ToHost, frozen=True):
    """Send joints and end effector poses of a robot at these rates (Hz) from now on, each with its time."""

    object_id: str
    joints: list[float]
    eef: list[float]


class Lease(ToHost, frozen=True):
    """Let a robot be moved until a moment of the monotonic clock; 0: let go. The first of a number begins the hold.

    Answer: CallDone (`{"scale": fraction of the velocity}`) or CallFailed with this id; at its end, HoldEnded.
    A jog has either `twist` in the axes of `frame`, or `joints` with rates.
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


class Pause(ToHost, frozen=True):
    """Pause the program before its next action."""


class Resume(ToHost, frozen=True):
    """Go on."""


class Step(ToHost, frozen=True):
    """Go on for one action."""


class SetBreakpoints(ToHost, frozen=True):
    """Pause from now on where RunPackage said, and at these shared breakpoints."""

    shared_breakpoints: list[str]


class StopProgram(ToHost, frozen=True):
    """Stop lane of all devices, then an exception in the script."""


class CloseScene(ToHost, frozen=True):
    """Disconnect all objects, answer SceneClosed and exit."""


# ------------------------------------------------------------------------------------------------ host to server
class ToServer(Struct, frozen=True, tag=True):
    """Base of everything the host says."""


class Ready(ToServer, frozen=True):
    """The host is up, the common imports are done."""

    pid: int


class Heartbeat(ToServer, frozen=True):
    """Sent every HEARTBEAT_PERIOD from a thread of its own."""


class SceneOpened(ToServer, frozen=True):
    """All objects are there and connected."""


class SceneFailed(ToServer, frozen=True):
    """An object could not be created or connected; those that could are closed again. The host exits."""

    error: ErrorData


class SceneClosed(ToServer, frozen=True):
    """All objects are closed; `error` when one could not be closed cleanly."""

    error: ErrorData | None = None


class CallDone(ToServer, frozen=True):
    """The method returned; `value` is the result as JSON, empty for None."""

    id: int
    value: bytes = b""


class CallFailed(ToServer, frozen=True):
    """The method raised, was refused or ran out of time."""

    id: int
    error: ErrorData


class StreamEvent(ToServer, frozen=True):
    """RobotJoints or RobotEef of the protocol, as the whole encoded event, for subscribers (or all, from a program).

    rate: that of the Stream it is for; 0 at the streaming period.
    """

    event: str
    object_id: str
    encoded: bytes
    rate: float = 0.0


class HoldEnded(ToServer, frozen=True):
    """A hold has ended and the robot is at rest, or `error` says that it did not obey; None: it was let go."""

    object_id: str
    hold: int
    error: ErrorData | None = None


class ProgramEvent(ToServer, frozen=True):
    """PackageInfo, ActionStateBefore, ActionStateAfter, ProjectException: the whole encoded event.

    Of actions, `number` counts their calls from 1; `name` is the action's, else what is called. `time`: with
    ActionStateBefore when it was told, s since the epoch; with ActionStateAfter how long the action took, s.
    """

    event: str
    encoded: bytes
    number: int = 0
    name: str = ""
    time: float = 0.0


class ActionFailed(ToServer, frozen=True):
    """An action has ended after `duration` s in a way for which the protocol has no event: by an error.

    Without an error it is one of a program whose project knows no actions. `number`: as in ProgramEvent.
    """

    number: int
    duration: float
    error: str = ""


class ProgramChanged(ToServer, frozen=True):
    """The program is now running, pausing, paused, or has ended (`stopped`).

    With `stopped`, `finished` tells an end as meant (flow action or end of script), `error` what went wrong.
    """

    state: str
    finished: bool = False
    error: ErrorData | None = None


class HandTeachingEnded(ToServer, frozen=True):
    """Hand teaching that was switched on by a call has ended without a request; `error` says why."""

    object_id: str
    error: ErrorData
    arm_id: str | None = None


class DeviceChanged(ToServer, frozen=True):
    """A device's connection, health, alarms or owner of control changed; `reason` why the connection is lost.

    in_the_way: false for a collision object that is disabled for now. held: the parts that a robot holds.
    """

    object_id: str
    connection: Connection
    health: Health
    alarms: list[Alarm] = field(default_factory=list)
    control_owner: str | None = None
    reason: str = ""
    in_the_way: bool = True
    held: list[HeldPart] = field(default_factory=list)


class LogLine(ToServer, frozen=True):
    """A line that the script or a driver printed or logged."""

    level: str
    text: str
    object_id: str = ""


HostBound = (
    OpenScene
    | RetryObject
    | RunPackage
    | PutBody
    | RemoveBodies
    | Calibrate
    | Call
    | StopMotion
    | StopAll
    | Subscribe
    | Stream
    | Lease
    | Pause
    | Resume
    | Step
    | SetBreakpoints
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
    | HandTeachingEnded
    | ProgramEvent
    | ActionFailed
    | ProgramChanged
    | DeviceChanged
    | LogLine
)

decode_host_bound: Any = msgspec.msgpack.Decoder(HostBound).decode
decode_server_bound: Any = msgspec.msgpack.Decoder(ServerBound).decode
_encode = msgspec.msgpack.Encoder().encode


def encode(message: ToHost | ToServer) -> bytes:
    """Give a message with its length in front."""
    return framing.framed(_encode(message))


def body_length(prefix: bytes) -> int:
    """Read the length prefix; ValueError beyond MAX_MESSAGE."""
    return framing.body_length(prefix, MAX_MESSAGE)
