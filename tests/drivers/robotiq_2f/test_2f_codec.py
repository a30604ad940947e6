"""Modbus RTU compared with the 2F manual's own example frames (activate, grip, open), byte for byte.

The frames are quoted from general knowledge of the manual, which was not available; their CRCs are valid.
"""

import os
import select
import time
from collections.abc import Callable

import pytest

from arcor2_drivers.robotiq_2f.rtu_link import decode, encode
from arcor2_drivers.robotiq_2f.status import Activation, Command, Object
from tests.fakes.conftest import FakeProcess
from tests.waiting import WITHIN

CLEAR = "09 10 03 E8 00 03 06 00 00 00 00 00 00 73 30"
ACTIVATE = "09 10 03 E8 00 03 06 01 00 00 00 00 00 72 E1"
WRITTEN = "09 10 03 E8 00 03 01 30"
ASK_ACTIVATION = "09 03 07 D0 00 01 85 CF"
ACTIVATING = "09 03 02 11 00 55 D5"
ACTIVATED = "09 03 02 31 00 4C 15"
CLOSE = "09 10 03 E8 00 03 06 09 00 00 FF FF FF 42 29"
ASK_STATUS = "09 03 07 D0 00 03 04 0E"
GRIPPED = "09 03 06 B9 00 00 FF BD 00 1D 7C"
OPEN = "09 10 03 E8 00 03 06 09 00 00 00 FF FF 72 19"
OPENED = "09 03 06 F9 00 00 00 0D 00 56 4C"
QUOTED = (CLEAR, ACTIVATE, WRITTEN, ASK_ACTIVATION, ACTIVATING, ACTIVATED, CLOSE, ASK_STATUS, GRIPPED, OPEN, OPENED)


def crc(data: bytes) -> bytes:
    value = 0xFFFF
    for byte in data:
        value ^= byte
        for _ in range(8):
            value = value >> 1 ^ (0xA001 if value & 1 else 0)
    return value.to_bytes(2, "little")


def words(data: bytes) -> list[int]:
    return [int.from_bytes(data[i : i + 2], "big") for i in range(0, len(data), 2)]


@pytest.mark.parametrize("frame", QUOTED)
def test_the_example_frames_have_valid_checksums(frame: str) -> None:
    data = bytes.fromhex(frame)
    assert crc(data[:-2]) == data[-2:]


@pytest.mark.parametrize(
    ("command", "frame"),
    [
        (Command(act=False, go_to=False), CLEAR),
        (Command(act=True, go_to=False), ACTIVATE),
        (Command(position=255, speed=255, force=255), CLOSE),
        (Command(position=0, speed=255, force=255), OPEN),
    ],
)
def test_the_driver_writes_the_example_frames(command: Command, frame: str) -> None:
    assert encode(command, [0, 0, 0]) == words(bytes.fromhex(frame)[7:-2])


def test_the_example_answers_are_decoded() -> None:
    gripped = decode(words(bytes.fromhex(GRIPPED)[3:-2]))
    assert (gripped.act, gripped.go_to, gripped.activation) == (True, True, Activation.ACTIVE)
    assert (gripped.object, gripped.fault, gripped.echo, gripped.position) == (Object.CONTACT_CLOSING, 0, 0xFF, 0xBD)
    opened = decode(words(bytes.fromhex(OPENED)[3:-2]))
    assert (opened.object, opened.echo, opened.position) == (Object.ARRIVED, 0, 0x0D)
    for frame, activation in ((ACTIVATING, Activation.ACTIVATING), (ACTIVATED, Activation.ACTIVE)):
        status = decode([*words(bytes.fromhex(frame)[3:-2]), 0, 0])
        assert (status.activation, status.active) == (activation, activation is Activation.ACTIVE)


def test_the_fake_answers_as_in_the_example_of_the_manual(fake: FakeProcess, wait_for: Callable[..., object]) -> None:
    descriptor = os.open(fake.ready["rtu"], os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)

    def ask(frame: str, length: int) -> str:
        os.write(descriptor, bytes.fromhex(frame))
        answer, until = b"", time.monotonic() + WITHIN
        while len(answer) < length and time.monotonic() < until:
            if select.select([descriptor], [], [], 0.1)[0]:
                answer += os.read(descriptor, 64)
        return answer.hex(" ").upper()

    try:
        assert ask(CLEAR, 8) == WRITTEN
        assert ask(ACTIVATE, 8) == WRITTEN
        wait_for(lambda: ask(ASK_ACTIVATION, 7), lambda answer: answer == ACTIVATING)
        # gOBJ, the upper two bits, counts only after a motion command.
        wait_for(
            lambda: int(ask(ASK_ACTIVATION, 7)[9:11], 16) & 0x3F, lambda status: status == int(ACTIVATED[9:11], 16)
        )
        fake.control.do("put_part", width=0.0153)  # BDh
        assert ask(CLOSE, 8) == WRITTEN
        fake.control.wait_until(lambda truth: truth["registers"]["OBJ"] == 2)
        answer = bytes.fromhex(ask(ASK_STATUS, 11))
        assert answer[:8].hex(" ").upper() == GRIPPED[:23], "gCU, the current, differs from the manual"
    finally:
        os.close(descriptor)
