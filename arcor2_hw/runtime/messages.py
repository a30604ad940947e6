"""Messages between server and cell host: one tagged union per direction, msgpack with a length prefix.

Arguments and results of calls are JSON documents in bytes, exactly as in scenes, projects and events.
"""

from typing import Any, Final

import msgspec

from arcor2_hw import framing
from arcor2_hw.framing import PREFIX_SIZE as PREFIX_SIZE
from arcor2_hw.runtime.message_parts import (
    AddedBody as AddedBody,
    DeviceStop as DeviceStop,
    ErrorData as ErrorData,
    ForceStarted as ForceStarted,
    HeldPart as HeldPart,
    TypeCode as TypeCode,
)
from arcor2_hw.runtime.messages_to_host import (
    AddBody as AddBody,
    AddObject as AddObject,
    Alive as Alive,
    Calibrate as Calibrate,
    Call as Call,
    CheckpointAnswer as CheckpointAnswer,
    CloseScene as CloseScene,
    ConfirmIdentity as ConfirmIdentity,
    ConfirmParts as ConfirmParts,
    DecideHeld as DecideHeld,
    EndForce as EndForce,
    ForcePoint as ForcePoint,
    Lease as Lease,
    OpenScene as OpenScene,
    Pause as Pause,
    RemoteChanged as RemoteChanged,
    RemoteDone as RemoteDone,
    RemoteFailed as RemoteFailed,
    RemoveBodies as RemoveBodies,
    RenewForces as RenewForces,
    Resume as Resume,
    RetryObject as RetryObject,
    RunPackage as RunPackage,
    SetBreakpoints as SetBreakpoints,
    SetInterlocks as SetInterlocks,
    Step as Step,
    StopAll as StopAll,
    StopMotion as StopMotion,
    StopProgram as StopProgram,
    Stream as Stream,
    Subscribe as Subscribe,
    ToHost as ToHost,
)
from arcor2_hw.runtime.messages_to_server import (
    ActionFailed as ActionFailed,
    CallDone as CallDone,
    CallFailed as CallFailed,
    DeviceChanged as DeviceChanged,
    DeviceIdentified as DeviceIdentified,
    ForceEnded as ForceEnded,
    HandTeachingEnded as HandTeachingEnded,
    Heartbeat as Heartbeat,
    HeldChanged as HeldChanged,
    HoldEnded as HoldEnded,
    HostLost as HostLost,
    InterlocksChanged as InterlocksChanged,
    LogLine as LogLine,
    PartsChanged as PartsChanged,
    PartStep as PartStep,
    ProgramChanged as ProgramChanged,
    ProgramEvent as ProgramEvent,
    ProgramHeld as ProgramHeld,
    ReadCheckpoint as ReadCheckpoint,
    Ready as Ready,
    RemoteCall as RemoteCall,
    RemoteKind as RemoteKind,
    SceneClosed as SceneClosed,
    SceneFailed as SceneFailed,
    SceneOpened as SceneOpened,
    StoreCheckpoint as StoreCheckpoint,
    StreamEvent as StreamEvent,
    ToServer as ToServer,
)

MAX_MESSAGE: Final = 64 * 1024 * 1024
"""Maximum length of a message, bytes."""
HEARTBEAT_PERIOD: Final = 0.25
"""Period of the heartbeats of the host, s."""
SILENCE_LIMIT: Final = 1.0
"""Time without a message after which the host is reported as not answering, s."""


HostBound = (
    OpenScene
    | RetryObject
    | AddObject
    | RunPackage
    | AddBody
    | RemoveBodies
    | Calibrate
    | Call
    | RemoteDone
    | RemoteFailed
    | RemoteChanged
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
    | CheckpointAnswer
    | SetInterlocks
    | ConfirmIdentity
    | StopProgram
    | Alive
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
    | RemoteCall
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
    | ReadCheckpoint
    | StoreCheckpoint
    | InterlocksChanged
    | DeviceChanged
    | DeviceIdentified
    | LogLine
    | HostLost
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
