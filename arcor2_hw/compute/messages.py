"""Messages between server and compute worker: a tagged union per direction, msgpack, with a length prefix.

The server sends one task at a time. World descriptions are sent as changes; a new worker process gets all of them
again.
"""

from typing import Any, Final

import msgspec
from msgspec import Struct

from arcor2_hw import framing
from arcor2_hw.collision.description import WorldItem
from arcor2_hw.compute.tasks import AnyTask
from arcor2_hw.messages import Message

MAX_MESSAGE: Final = 512 * 1024 * 1024
"""Maximum size of a message, bytes. The images of a camera calibration are sent together."""


class RunTask(Struct, frozen=True, tag=True):
    """Run a task. The answer is Done or Failed.

    Attributes:
        task: The task.
        within: Time limit in s, after which the worker ends itself.
        place: Name of the world in which it runs, if it needs one.
    """

    task: AnyTask
    within: float
    place: str = ""


class ChangeWorld(Struct, frozen=True, tag=True):
    """Change a world: remove items, and add items, replacing those of the same id.

    An item that cannot be used fails every task in this world until it is removed. Caches belong to a world, so
    tasks about different sets of items use separate worlds.

    Attributes:
        place: Name of the world.
        put: Items to add or replace.
        remove: Ids of items to remove.
    """

    place: str
    put: list[WorldItem]
    remove: list[str]


class ForgetWorld(Struct, frozen=True, tag=True):
    """Drop a world and its caches."""

    place: str


ToWorker = RunTask | ChangeWorld | ForgetWorld


class Done(Struct, frozen=True, tag=True):
    """The result, in msgpack."""

    value: bytes


class Failed(Struct, frozen=True, tag=True):
    """An error.

    Attributes:
        codes: Codes of its class and of the base classes, most specific first.
        message: Message for the user.
        detail: Detail for the technician.
        reason: Reason, where the error has one.
    """

    codes: list[str]
    message: Message
    detail: str = ""
    reason: str = ""


class Progress(Struct, frozen=True, tag=True):
    """Progress of the present task: share (0 to 1) and activity."""

    share: float
    message: str


FromWorker = Done | Failed | Progress

decode_to_worker: Any = msgspec.msgpack.Decoder(ToWorker).decode
decode_from_worker: Any = msgspec.msgpack.Decoder(FromWorker).decode
_encoder = msgspec.msgpack.Encoder()
encode_value = _encoder.encode


def encode(message: ToWorker | FromWorker) -> bytearray:
    """Return a message with its length prefix.

    Raises:
        ValueError: The message is longer than MAX_MESSAGE.
    """
    buffer = bytearray(framing.PREFIX_SIZE)
    _encoder.encode_into(message, buffer, framing.PREFIX_SIZE)  # images are large, so they are copied only once
    size = len(buffer) - framing.PREFIX_SIZE
    if size > MAX_MESSAGE:
        raise ValueError(f"a message of {size} bytes is longer than the maximum of {MAX_MESSAGE}")
    buffer[: framing.PREFIX_SIZE] = framing.prefix(size)
    return buffer


def body_length(prefix: bytes) -> int:
    """Read the length prefix.

    Raises:
        ValueError: The length exceeds MAX_MESSAGE.
    """
    return framing.body_length(prefix, MAX_MESSAGE)
