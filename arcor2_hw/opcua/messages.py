"""The messages between the server and the process of its OPC UA server. This module does not import asyncua."""

from typing import Any, Final

import msgspec
from msgspec import Struct

from arcor2_hw import framing
from arcor2_hw.data.alarms import AlarmRecord
from arcor2_hw.data.device import Connection, Health, Identity

MAX_MESSAGE: Final = 16 * 1024 * 1024
"""Maximum size of a message, bytes."""
BEAT_PERIOD: Final = 1.0
"""Maximum time between two messages of the server, s. Values count as old if it is exceeded several times."""


class Setup(Struct, frozen=True, tag=True):
    """The first message.

    listener: file descriptor of the bound socket. host, port: address that clients connect to. machine: name of this
    machine, which is part of the application URI. hosts: names and addresses for the certificate. folder: for
    certificate, key and trusted certificates. cell: name of the cell. version: of the product. anonymous: whether
    clients without a user may read. unencrypted: whether the endpoint without encryption exists.
    """

    listener: int
    host: str
    port: int
    machine: str
    hosts: list[str]
    folder: str
    cell: str
    version: str
    anonymous: bool
    unencrypted: bool


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
    """

    devices: list[DeviceInfo] | None = None
    states: dict[str, DeviceState] = {}
    streams: list[bytes] = []
    unit: UnitData | None = None
    alarms: list[AlarmRecord] = []


class User(Struct, frozen=True):
    """A user who has logged on. key: id of the person or token."""

    name: str
    key: str


class LogOnAnswer(Struct, frozen=True, tag=True):
    """Answer to LogOn; user is None if it is refused."""

    number: int
    user: User | None


class CallAnswer(Struct, frozen=True, tag=True):
    """Answer to Command and Acknowledge. result: as in the Modbus block, 0 if executed. text: why it is refused."""

    number: int
    result: int
    text: str = ""


class Started(Struct, frozen=True, tag=True):
    """The process accepts connections. fingerprint: SHA-256 of its certificate."""

    fingerprint: str


class LogOn(Struct, frozen=True, tag=True):
    """Check a user. secret: the PIN of a person, or a token."""

    number: int
    name: str
    secret: str
    address: str


class Command(Struct, frozen=True, tag=True):
    """Execute a command of PackML.

    request: identifies the request; the same request is executed once. Empty: no identification. job: for Start.
    """

    number: int
    command: int
    job: int
    request: str
    user: User
    address: str


class Acknowledge(Struct, frozen=True, tag=True):
    """Acknowledge an alarm."""

    number: int
    alarm: int
    note: str
    user: User
    address: str


ToProcess = Setup | Update | LogOnAnswer | CallAnswer
FromProcess = Started | LogOn | Command | Acknowledge

decode_to_process: Any = msgspec.msgpack.Decoder(ToProcess).decode
decode_from_process: Any = msgspec.msgpack.Decoder(FromProcess).decode
_encode = msgspec.msgpack.Encoder().encode


def encode(message: ToProcess | FromProcess) -> bytes:
    """Return a message with its length prefix."""
    return framing.framed(_encode(message))
