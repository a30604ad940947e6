"""What server and compute worker say to each other: a tagged union per direction, framed, msgpack.

The server asks one thing at a time. What the worker knows of the world it was told by messages before; a worker that
was started anew knows nothing, and is told again.
"""

from typing import Any, Final

import msgspec
from msgspec import Struct

from arcor2_hw import framing
from arcor2_hw.collision.description import WorldItem
from arcor2_hw.compute.tasks import AnyTask

MAX_MESSAGE: Final = 512 * 1024 * 1024
"""Bytes; the pictures of an intrinsic calibration, or of a hand-eye one, come together."""


class Work(Struct, frozen=True, tag=True):
    """Compute something. within: seconds, after which the worker ends itself. Answer: Done or Failed.

    place: the name of the world in which it is asked, where it needs one.
    """

    task: AnyTask
    within: float
    place: str = ""


class ChangeWorld(Struct, frozen=True, tag=True):
    """Take things out, and put others in, in place of those of the same ids. One that cannot be used fails the Works
    that need the world, until it goes.

    place: the name of the world. What is kept of a world is worth keeping while the same things stand in it, so
    questions about different things have worlds of their own.
    """

    place: str
    put: list[WorldItem]
    remove: list[str]


class ForgetWorld(Struct, frozen=True, tag=True):
    """Drop a world, and what is kept of it."""

    place: str


ToWorker = Work | ChangeWorld | ForgetWorld


class Done(Struct, frozen=True, tag=True):
    """The answer, in msgpack."""

    value: bytes


class Failed(Struct, frozen=True, tag=True):
    """An error. codes: of its class and those that it derives from, the nearest first; reason: where it has one."""

    codes: list[str]
    message: str
    detail: str = ""
    reason: str = ""


class Progress(Struct, frozen=True, tag=True):
    """How far the computation is: 0..1, and what it does."""

    share: float
    message: str


FromWorker = Done | Failed | Progress

decode_to_worker: Any = msgspec.msgpack.Decoder(ToWorker).decode
decode_from_worker: Any = msgspec.msgpack.Decoder(FromWorker).decode
_encoder = msgspec.msgpack.Encoder()
encode_value = _encoder.encode


def encode(message: ToWorker | FromWorker) -> bytearray:
    """Give a message with its length in front; ValueError for one that is too long."""
    buffer = bytearray(framing.PREFIX_SIZE)
    _encoder.encode_into(message, buffer, framing.PREFIX_SIZE)  # pictures are large: they are copied but once
    size = len(buffer) - framing.PREFIX_SIZE
    if size > MAX_MESSAGE:
        raise ValueError(f"a message of {size} bytes is longer than {MAX_MESSAGE}")
    buffer[: framing.PREFIX_SIZE] = framing.prefix(size)
    return buffer


def body_length(prefix: bytes) -> int:
    """Read the length prefix; ValueError beyond MAX_MESSAGE."""
    return framing.body_length(prefix, MAX_MESSAGE)
