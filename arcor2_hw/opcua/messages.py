"""The messages between the server and the process of its OPC UA server. This module does not import asyncua."""

from typing import Any

import msgspec
from msgspec import Struct

from arcor2_hw.plant.messages import Update


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


class User(Struct, frozen=True):
    """A user who has logged on. key: id of the person or token."""

    name: str
    key: str


class LogOnAnswer(Struct, frozen=True, tag=True):
    """Answer to LogOn; user is None if it is refused."""

    number: int
    user: User | None


class CallAnswer(Struct, frozen=True, tag=True):
    """Answer to Command, SetMode and Acknowledge.

    result: as in the Modbus block, 0 if executed. text: why it is refused.
    """

    number: int
    result: int
    text: str = ""


class Started(Struct, frozen=True, tag=True):
    """The process accepts connections. fingerprint: SHA-256 of its certificate."""

    fingerprint: str


class Clients(Struct, frozen=True, tag=True):
    """The number of connections of clients has changed."""

    count: int


class Watch(Struct, frozen=True, tag=True):
    """Send the points and joints of these devices, and of no others."""

    devices: list[str]


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


class SetMode(Struct, frozen=True, tag=True):
    """Change the mode of the cell. mode: number of PackML."""

    number: int
    mode: int
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
FromProcess = Started | Clients | Watch | LogOn | Command | SetMode | Acknowledge

decode_to_process: Any = msgspec.msgpack.Decoder(ToProcess).decode
decode_from_process: Any = msgspec.msgpack.Decoder(FromProcess).decode
