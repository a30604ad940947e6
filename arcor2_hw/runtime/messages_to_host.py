"""Messages from the server to the cell host."""

from typing import Literal

from msgspec import Struct, field

from arcor2_hw.data.cell import Cell
from arcor2_hw.data.device import Connection, Health, Identity
from arcor2_hw.data.held import HoldChoice
from arcor2_hw.data.interlocks import Interlock
from arcor2_hw.data.object_type import ObjectModel
from arcor2_hw.data.operation import HoldKind
from arcor2_hw.data.parts import ConfirmedPart, PartInventory
from arcor2_hw.data.position import ProgramStep
from arcor2_hw.data.project import Project
from arcor2_hw.data.robot import Joint, KinematicCalibration
from arcor2_hw.data.scene import Scene, SceneObjectOverride
from arcor2_hw.data.secret import ObjectSecrets
from arcor2_hw.messages import Message
from arcor2_hw.runtime.message_parts import AddedBody, ErrorData, TypeCode


class ToHost(Struct, frozen=True, tag=True):
    """Base of the messages from the server to the host."""


class OpenScene(ToHost, frozen=True):
    """Create and connect all objects concurrently. Answer: SceneOpened or SceneFailed.

    keep_going: whether the scene opens without objects that cannot be created or connected; DeviceChanged reports them.
    assets: files of uploaded meshes and robot models, by id. bodies: obstacles that are not objects of the scene.
    calibrations: kinematics read from robot controllers, by object id. secrets: secret settings, by object id.
    identities: the confirmed identities, by object id; another device is not commanded. remote: the computers of the
    objects that another host has, by object id. main: whether this host calls the objects of the others.
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
    remote: dict[str, Message] = field(default_factory=dict)
    main: bool = True


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

    A host that is not `main` opens the objects of the package for the main host instead, and answers as to OpenScene.

    cell: settings of devices in this cell, which override those of the package. breakpoints: ids of action points and
    actions, all of which must exist. shared_breakpoints: further ids; those that the project lacks are ignored. assets,
    bodies, calibrations, secrets, identities: as in OpenScene. hold_on_error: whether a failed action holds the
    program, see ProgramHeld. run: number of the run. records: directory of the part inventory and of checkpoints; empty
    to store nothing. checkpoints: whether the state is stored before and after each action. continues: whether the
    program continues where it was interrupted. continue_at: how many actions of its cycle are not repeated. values:
    values of constants and variables of the project by their ids, JSON in a string, which replace those of the package.
    recordings: directory in which the host stores the recording of a run that the end of the server interrupts; empty
    to store nothing. records_at_server: whether the host reads and stores checkpoints by messages, because it runs on
    another computer; `records` is empty then. remote, main:
    as in OpenScene.
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
    remote: dict[str, Message] = field(default_factory=dict)
    main: bool = True
    records_at_server: bool = False


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


class RemoteDone(ToHost, frozen=True):
    """A RemoteCall returned. `value`: the result as JSON, empty for None. stamp: as in CallDone."""

    id: int
    value: bytes = b""
    stamp: float = 0.0


class RemoteFailed(ToHost, frozen=True):
    """A RemoteCall failed."""

    id: int
    error: ErrorData


class RemoteChanged(ToHost, frozen=True):
    """The state of an object of another host has changed. The fields are those of DeviceChanged."""

    object_id: str
    connection: Connection
    health: Health
    reason: Message | None = None
    in_the_way: bool = True
    values: dict[str, float] = field(default_factory=dict)


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
    """End a force. Answer: CallDone or CallFailed with this id when the output has its previous value again."""

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


class CheckpointAnswer(ToHost, frozen=True):
    """Answer to ReadCheckpoint or StoreCheckpoint. A checkpoint is on disk when its answer is sent.

    number: of the request. inventory: the newest checkpoint; None if there is none. problem: why the request failed.
    """

    number: int
    inventory: PartInventory | None = None
    problem: Message | None = None


class ConfirmIdentity(ToHost, frozen=True):
    """Accept an identity of a device from now on."""

    object_id: str
    identity: Identity


class SetInterlocks(ToHost, frozen=True):
    """Replace the interlocks of the open scene. Those of a program are in its package."""

    interlocks: list[Interlock]


class StopProgram(ToHost, frozen=True):
    """Stop all devices, then end the script by an exception."""


class Alive(ToHost, frozen=True):
    """The sender is not hanging. Without any message for `silence` s after it, the host acts as if the socket closed.

    The service of a node sends it. A server on the same computer does not: its hosts wait for the end of the socket.
    """

    silence: float


class CloseScene(ToHost, frozen=True):
    """Disconnect all objects, answer SceneClosed and exit."""
