"""The fake servos on the wire: frames of the manual, the vendor's library, motion in time.

The frames are quoted from general knowledge of the e-Manual, which was not available. Their CRCs are valid.
"""

import contextlib
import os
import select
import time
from collections.abc import Callable, Iterator
from typing import Any

import pytest
from dynamixel_sdk import COMM_RX_CORRUPT, COMM_RX_TIMEOUT, COMM_SUCCESS, PacketHandler, PortHandler
from hypothesis import given, strategies as st

from arcor2_fakes.two_axis_robot.packet import BadCrc, Instruction, Receiver, packet, status
from arcor2_fakes.two_axis_robot.servo import Servo
from tests.fakes.conftest import FakeProcess, start_fake, wait_for

__all__ = ["start_fake", "wait_for"]

# The examples of the protocol's document (ROBOTIS e-Manual, Protocol 2.0, "Instruction Details"), see above.
QUOTED = [
    ("ping", packet(1, 0x01, b""), "FF FF FD 00 01 03 00 01 19 4E"),
    ("ping, status", status(1, 0, bytes.fromhex("06 04 26")), "FF FF FD 00 01 07 00 55 00 06 04 26 65 5D"),
    ("read", packet(1, 0x02, bytes.fromhex("84 00 04 00")), "FF FF FD 00 01 07 00 02 84 00 04 00 1D 15"),
    ("read, status", status(1, 0, bytes.fromhex("A6 00 00 00")), "FF FF FD 00 01 08 00 55 00 A6 00 00 00 8C C0"),
    ("write", packet(1, 0x03, bytes.fromhex("74 00 00 02 00 00")), "FF FF FD 00 01 09 00 03 74 00 00 02 00 00 CA 89"),
    ("write, status", status(1, 0), "FF FF FD 00 01 04 00 55 00 A1 0C"),
    ("ping to all", packet(0xFE, 0x01, b""), "FF FF FD 00 FE 03 00 01 31 42"),
    ("ping, second status", status(2, 0, bytes.fromhex("06 04 26")), "FF FF FD 00 02 07 00 55 00 06 04 26 6F 6D"),
    (
        "reg write",
        packet(1, 0x04, bytes.fromhex("68 00 C8 00 00 00")),
        "FF FF FD 00 01 09 00 04 68 00 C8 00 00 00 AE 8E",
    ),
    ("action", packet(1, 0x05, b""), "FF FF FD 00 01 03 00 05 02 CE"),
    ("factory reset", packet(1, 0x06, b"\x01"), "FF FF FD 00 01 04 00 06 01 A1 E6"),
    ("reboot", packet(1, 0x08, b""), "FF FF FD 00 01 03 00 08 2F 4E"),
    ("clear", packet(1, 0x10, bytes.fromhex("01 44 58 4C 22")), "FF FF FD 00 01 08 00 10 01 44 58 4C 22 B1 DC"),
    (
        "sync write",
        packet(0xFE, 0x83, bytes.fromhex("74 00 04 00 01 96 00 00 00 02 AA 00 00 00")),
        "FF FF FD 00 FE 11 00 83 74 00 04 00 01 96 00 00 00 02 AA 00 00 00 82 87",
    ),
    (
        "sync read, second status",
        status(2, 0, bytes.fromhex("1F 08 00 00")),
        "FF FF FD 00 02 08 00 55 00 1F 08 00 00 BA BE",
    ),
    (
        "sync read",
        packet(0xFE, 0x82, bytes.fromhex("84 00 04 00 01 02")),
        "FF FF FD 00 FE 09 00 82 84 00 04 00 01 02 CE FA",
    ),
]


@pytest.mark.parametrize(("made", "quoted"), [row[1:] for row in QUOTED], ids=[row[0] for row in QUOTED])
def test_frames_match_the_examples_of_the_manual(made: bytes, quoted: str) -> None:
    frame = bytes.fromhex(quoted)
    assert made == frame
    by_the_vendor = PacketHandler(2.0).updateCRC(0, list(frame), len(frame) - 2)
    assert by_the_vendor == int.from_bytes(frame[-2:], "little")


@given(st.lists(st.sampled_from([0xFF, 0xFD, 0x00, 0x55]), max_size=40).map(bytes), st.binary(max_size=8))
def test_stuffing_is_reversible(parameters: bytes, before: bytes) -> None:
    made = packet(3, 0x03, parameters)
    assert b"\xff\xff\xfd\x00" not in made[4:]
    noise = before.replace(b"\xff", b"\x00")
    halves = noise + made
    receiver = Receiver()
    found = [*receiver.feed(halves[:5]), *receiver.feed(halves[5:])]
    assert found == [Instruction(3, 0x03, parameters)]


def test_a_damaged_packet_is_detected() -> None:
    made = packet(3, 0x03, b"\x40\x00\x01")
    damaged = made[:-3] + b"\x00" + made[-2:]
    assert list(Receiver().feed(damaged + made)) == [BadCrc(3), Instruction(3, 0x03, b"\x40\x00\x01")]


@pytest.mark.parametrize("seconds", [0.3, 1.0])
def test_a_servo_moves_under_its_profile_and_stops_when_the_bus_is_silent(seconds: float) -> None:
    now = [0.0]
    servo = Servo(1, lambda: now[0])
    assert servo.write(108, (20).to_bytes(4, "little") + (100).to_bytes(4, "little")) == 0
    assert servo.write(116, (2048).to_bytes(4, "little")) == 0
    assert servo.write(98, b"\x05") == 0
    assert servo.write(64, b"\x01") == 0
    servo.restart_watchdog()
    assert servo.write(116, (3548).to_bytes(4, "little")) == 0
    fastest = 0.0
    while now[0] < seconds:
        now[0] += 0.01
        servo.restart_watchdog()
        fastest = max(fastest, servo.speed)
    assert 2048 < servo.position < 3548
    assert fastest <= 100 * 0.229 * 4096 / 60 + 1
    now[0] += 0.5  # without a message it stops after 0.1 s
    servo.advance()
    assert servo.speed == 0.0
    assert servo["watchdog"] == 0xFF
    assert servo.write(116, (2048).to_bytes(4, "little")) == 4
    stood = servo.position
    now[0] += 1.0
    servo.advance()
    assert servo.position == stood


def test_a_goal_at_the_present_tick_does_not_move_the_shaft() -> None:
    now = [0.0]
    servo = Servo(1, lambda: now[0], position=2047.6)
    for write in ((116, (2048).to_bytes(4, "little")), (64, b"\x01"), (116, (2048).to_bytes(4, "little"))):
        assert servo.write(*write) == 0
        now[0] += 0.001
        servo.advance()
        assert (servo.position, servo.speed) == (2047.6, 0.0)


@pytest.fixture
def fake(start_fake: Callable[..., FakeProcess]) -> FakeProcess:
    return start_fake("two_axis_robot")


class PatientPort(PortHandler):  # type: ignore[misc]
    """Wait longer than the library's 34 ms: the fake's process may have to wait for a core."""

    def setPacketTimeout(self, _length: int) -> None:  # noqa: N802 - the library's name
        self.setPacketTimeoutMillis(500.0)


@pytest.fixture
def port(fake: FakeProcess) -> Iterator[Any]:
    port = PatientPort(fake.ready["port"])
    assert port.openPort()
    yield port
    with contextlib.suppress(OSError):
        port.closePort()


def test_the_vendors_library_works_with_the_fake(fake: FakeProcess, port: Any) -> None:
    speak = PacketHandler(2.0)
    assert speak.ping(port, 1) == (1020, COMM_SUCCESS, 0)
    assert speak.ping(port, 9)[1] == COMM_RX_TIMEOUT
    assert speak.write4ByteTxRx(port, 1, 20, 0x00FDFFFF) == (COMM_SUCCESS, 6)  # stuffed, and beyond the limit
    assert speak.write4ByteTxRx(port, 1, 132, 0) == (COMM_SUCCESS, 7)
    assert speak.write4ByteTxRx(port, 1, 116, 2048) == (COMM_SUCCESS, 0)
    assert speak.write1ByteTxRx(port, 1, 64, 1) == (COMM_SUCCESS, 0)
    assert speak.write4ByteTxRx(port, 1, 20, 1) == (COMM_SUCCESS, 7)  # EEPROM under torque
    assert speak.write4ByteTxRx(port, 1, 116, 3000) == (COMM_SUCCESS, 0)
    fake.control.wait_until(lambda t: t["servos"]["1"]["ticks"] == 3000)
    assert speak.read4ByteTxRx(port, 1, 132) == (3000, COMM_SUCCESS, 0)
    sent = time.monotonic()
    assert speak.syncWriteTxOnly(port, 116, 4, [1, *(2900).to_bytes(4, "little")], 5) == COMM_SUCCESS
    fake.control.wait_until(lambda t: t["servos"]["1"]["goal"] == 2900)
    (stamped,) = fake.control.do("sync_writes")
    assert sent <= stamped <= time.monotonic()
    fake.control.do("wrong_crc")
    assert speak.ping(port, 1)[1] == COMM_RX_CORRUPT
    fake.control.do("status_error", servo=2, error=1)
    assert speak.write1ByteTxRx(port, 2, 64, 1) == (COMM_SUCCESS, 1)
    fake.control.do("hardware_error", servo=2, bits=0x20)
    assert speak.read1ByteTxRx(port, 2, 70) == (0x20, COMM_SUCCESS, 0x80)
    assert speak.write1ByteTxRx(port, 2, 64, 1) == (COMM_SUCCESS, 0x87)
    assert speak.reboot(port, 2)[0] == COMM_SUCCESS
    assert speak.ping(port, 2)[1] == COMM_RX_TIMEOUT
    deadline = time.monotonic() + 3.0
    while speak.ping(port, 2)[1] != COMM_SUCCESS:
        assert time.monotonic() < deadline
    assert speak.read1ByteTxRx(port, 2, 70) == (0, COMM_SUCCESS, 0)


def test_half_a_frame_and_silence_on_the_line(fake: FakeProcess) -> None:
    line = os.open(fake.ready["port"], os.O_RDWR | os.O_NOCTTY)
    try:

        def received(within: float) -> bytes:
            found = b""
            while select.select([line], [], [], within)[0]:
                found += os.read(line, 1024)
                within = 0.05
            return found

        fake.control.do("half_frame")
        os.write(line, packet(1, 0x01, b""))
        assert received(2.0) == status(1, 0, b"\xfc\x03\x2d")[:7]
        os.write(line, packet(1, 0x01, b""))
        assert received(0.1) == b""
        fake.control.do("heal")
        os.write(line, b"\x00\xff\xff" + packet(1, 0x01, b""))
        assert received(2.0) == status(1, 0, b"\xfc\x03\x2d")
    finally:
        os.close(line)


def test_the_process_ends_on_sigterm_and_refuses_invalid_arguments(fake: FakeProcess) -> None:
    with pytest.raises(Exception, match="servo 7 does not exist"):
        fake.control.do("hardware_error", servo=7)
    assert fake.terminate() == 0
