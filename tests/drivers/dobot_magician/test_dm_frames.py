"""Codec, alarms and kinematics of the Magician: pure functions."""

import math
import random

import pytest

from arcor2_drivers.dobot_magician import alarms
from arcor2_drivers.dobot_magician.frames import Command, Frame, FrameBuffer, encode
from arcor2_drivers.dobot_magician.kinematics import Unreachable, forward, inverse, tool_of
from arcor2_hw.data.geometry import Pose

FRAMES = [
    # Written by hand from the protocol's format, not by the code under test.
    (Frame(10, 0, b""), "aa aa 02 0a 00 f6"),
    (Frame(20, 0, b""), "aa aa 02 14 00 ec"),
    (Frame(20, 1, b""), "aa aa 02 14 01 eb"),
    (Frame(31, 3, b"\0\0\0\0"), "aa aa 06 1f 03 00 00 00 00 de"),
    (Frame(62, 1, b"\x01\x01"), "aa aa 04 3e 01 01 01 bf"),
    (Frame(63, 1, b"\x01\x00"), "aa aa 04 3f 01 01 00 bf"),
    (Frame(83, 1, b"\0\0\x48\x42\0\0\x48\x42"), "aa aa 0a 53 01 00 00 48 42 00 00 48 42 98"),
    (Frame(240, 1, b""), "aa aa 02 f0 01 0f"),
    (Frame(242, 1, b""), "aa aa 02 f2 01 0d"),
    (Frame(245, 1, b""), "aa aa 02 f5 01 0a"),
    (Frame(246, 0, b"\x05\0\0\0\0\0\0\0"), "aa aa 0a f6 00 05 00 00 00 00 00 00 00 05"),
]


@pytest.mark.parametrize(("frame", "octets"), FRAMES, ids=lambda value: "")
def test_frames_match_examples(frame: Frame, octets: str) -> None:
    assert encode(*frame) == bytes.fromhex(octets)
    assert FrameBuffer().feed(bytes.fromhex(octets)) == [frame]


def test_garbage_yields_only_complete_frames() -> None:
    generator = random.Random(7)
    for _ in range(300):
        sent, line = [], b""
        for _ in range(generator.randrange(1, 6)):
            noise = bytes(generator.choice((0x00, 0x55, 0xFE)) for _ in range(generator.randrange(4)))
            frame = Frame(
                generator.randrange(256), generator.randrange(4), generator.randbytes(generator.randrange(40))
            )
            sent.append(frame)
            line += noise + encode(*frame)
        buffer, got, at = FrameBuffer(), [], 0
        while at < len(line):
            step = generator.randrange(1, 9)
            got += buffer.feed(line[at : at + step])
            at += step
        assert got == sent
    # A damaged frame is lost, and only that one.
    whole = encode(Command.POSE, 0, bytes(32))
    for place in range(2, len(whole)):
        spoiled = bytearray(whole)
        spoiled[place] ^= 0x10
        buffer = FrameBuffer()
        got = buffer.feed(bytes(spoiled) + encode(Command.NAME, 0, b"x") + encode(1, 0, b"y") * 80)
        assert Frame(Command.POSE, 0, bytes(32)) not in got
        assert got[-1] == Frame(1, 0, b"y")
    assert FrameBuffer().feed(generator.randbytes(20000)) is not None
    with pytest.raises(ValueError, match="at most 253"):
        encode(1, 1, bytes(254))


def test_alarm_bits_are_decoded() -> None:
    assert alarms.codes(bytes(16)) == frozenset()
    bits = bytearray(16)
    bits[0], bits[2], bits[8], bits[10] = 0x01, 0x02, 0x80, 0x02
    assert alarms.codes(bytes(bits)) == {0x00, 0x11, 0x47, 0x51}
    assert str(alarms.describe(0x47)[0]) == "joint 4 is at its negative limit"
    assert "7Fh" in str(alarms.describe(0x7F)[0])


def test_inverse_kinematics_inverts_forward_kinematics() -> None:
    tool = forward((0.0, math.pi / 4, math.pi / 4, 0.0), 0.0597, 0.0)
    assert tool == pytest.approx((0.2591, 0.0, -0.0085, 0.0), abs=1e-4)  # the pose of a homed arm, folded at 45°
    generator = random.Random(3)
    for _ in range(500):
        q = (
            math.radians(generator.uniform(-90, 90)),
            math.radians(generator.uniform(0, 85)),
            math.radians(generator.uniform(-10, 90)),
            math.radians(generator.uniform(-90, 90)),
        )
        if q[1] - q[2] > math.radians(89):  # forearm and rear arm in a line: the linkage cannot reach this
            continue
        tool = forward(q, 0.06, -0.07)
        assert inverse(tool, 0.06, -0.07) == pytest.approx(q, abs=1e-9)
        again = tool_of(tool.pose)
        assert again[:3] == pytest.approx(tool[:3], abs=1e-12)
        assert math.remainder(again.r - tool.r, 2 * math.pi) == pytest.approx(0.0, abs=1e-9)


def test_a_pose_that_does_not_point_down_is_refused() -> None:
    with pytest.raises(Unreachable, match=r"tilted by 180\.0°"):
        tool_of(Pose())
