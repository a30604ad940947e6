"""The data of the cell that the server sends to the processes for plant systems."""

from typing import Any, Final

import msgspec
from msgspec import Struct

from arcor2_hw import framing
from arcor2_hw.data.alarms import AlarmRecord
from arcor2_hw.data.device import Connection, Health, Identity
from arcor2_hw.data.units import Unit

MAX_MESSAGE: Final = 16 * 1024 * 1024
"""Maximum size of a message, bytes."""
BEAT_PERIOD: Final = 1.0
"""Maximum time between two messages of the server, s."""
STALE_AFTER: Final = 3.0
"""Time without new values of a device, or without a message of the server, after which values are stale, s."""


class DeviceInfo(Struct, frozen=True):
    """A device. robot_type: of a robot, such as "articulated"; empty for other devices."""

    id: str
    name: str
    type: str
    robot_type: str = ""
    identity: Identity = Identity()


class DeviceState(Struct, frozen=True):
    """The state of a device. alarms: codes of its active alarms. executing: whether a program uses it."""

    connection: Connection = Connection.OFFLINE
    health: Health = Health.NORMAL
    alarms: tuple[str, ...] = ()
    answering: bool = True
    executing: bool = False


class UnitData(Struct, frozen=True):
    """The cell as a unit.

    state, mode: numbers of PackML. authority: who may start programs. job: number of the plant's running job, 0 for
    none. last_job, job_end: the last one and how it ended, "running" until then. program: name of the running or last
    program. loaded: whether it is running. recipe: product and revision. good, bad, rejected: units that left the cell
    since it exists.
    """

    state: int = 2
    mode: int = 1
    authority: str = "hub"
    job: int = 0
    last_job: int = 0
    job_end: str = "none"
    program: str = ""
    loaded: bool = False
    recipe: str = ""
    good: int = 0
    bad: int = 0
    rejected: int = 0


class Update(Struct, frozen=True, tag=True):
    """What has changed since the last message; empty as a sign of life.

    devices: all devices, None if unchanged. states: by id. streams: encoded ObjectPoints and RobotJoints events.
    alarms: changed records. left: units that have left the cell.
    """

    devices: list[DeviceInfo] | None = None
    states: dict[str, DeviceState] = {}
    streams: list[bytes] = []
    unit: UnitData | None = None
    alarms: list[AlarmRecord] = []
    left: list[Unit] = []


_encode = msgspec.msgpack.Encoder().encode


def encode(message: Any) -> bytes:
    """Return a message with its length prefix."""
    return framing.framed(_encode(message))
