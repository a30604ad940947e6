"""Properties of the messages between server and cell host that nodes and relays need: lane, age and times."""

from collections.abc import Callable
from typing import Any, Final

import msgspec
from msgspec.structs import replace

from arcor2_hw.runtime import messages as m

STOPS: Final = frozenset({"StopAll", "StopMotion", "StopProgram"})
"""Messages that overtake calls."""
PASSIVE: Final = frozenset(
    {
        "AddBody", "Calibrate", "CheckpointAnswer", "CloseScene", "ConfirmIdentity", "EndForce", "Pause",
        "RemoteChanged", "RemoteDone", "RemoteFailed", "RemoveBodies", "RenewForces", "SetBreakpoints",
        "SetInterlocks", "Stream", "Subscribe",
    }
)  # fmt: skip
"""Messages that start nothing at a device."""
TIMED: Final = frozenset({"ForcePoint", "Lease", "RenewForces"})
"""Messages to the host with the time until which they are valid."""
LARGE: Final = 64 * 1024
"""Size from which results and streamed values are sent on the lane of frames, bytes."""
FRAMES: Final = frozenset({"CallDone", "StreamEvent"})
"""Messages of the host that may overtake, or be overtaken by, any other one."""
STAMPED: Final = frozenset(
    {
        "CallFailed", "DeviceChanged", "ForceEnded", "HandTeachingEnded", "HoldEnded", "ProgramChanged", "ProgramHeld",
        "SceneClosed", "SceneFailed",
    }
)  # fmt: skip
_encode = msgspec.msgpack.encode


class MessageOutline(msgspec.Struct, frozen=True):
    """The fields of a message that decide how it is passed on."""

    type: str
    id: int = 0
    object_id: str = ""
    deadline: float | None = None
    until: float | None = None

    @property
    def passive(self) -> bool:
        """Whether the message starts nothing at a device, so its age does not matter. The end of a hold is passive."""
        return self.type in PASSIVE or self.until == 0.0


outline: Callable[[bytes], MessageOutline] = msgspec.msgpack.Decoder(MessageOutline).decode


def for_host(kind: str, body: bytes, local_time: Callable[[float], float]) -> bytes:
    """Return a message of the server with its times on the clock of this computer.

    Args:
        kind: type of the message.
        body: the encoded message.
        local_time: converts a time of the server's clock.
    """
    if kind not in TIMED:
        return body
    message = m.decode_host_bound(body)
    return _encode(replace(message, until=local_time(message.until))) if message.until else body


def for_server(kind: str, body: bytes, local_time: Callable[[float], float]) -> bytes:
    """Return a message of a cell host with its times on the clock of this computer. See `for_host`."""
    if kind not in STAMPED:
        return body
    message = m.decode_server_bound(body)
    changed: dict[str, Any] = {}
    if isinstance(message, m.DeviceChanged):
        changed["stamp"] = local_time(message.stamp)
        changed["raised"] = {code: local_time(moment) for code, moment in message.raised.items()}
    elif message.error is not None and message.error.stamp:
        changed["error"] = replace(message.error, stamp=local_time(message.error.stamp))
    return _encode(replace(message, **changed)) if changed else body
