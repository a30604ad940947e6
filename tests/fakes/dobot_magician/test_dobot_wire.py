"""The fake Magician on the wire: raw bytes, their answers, and motion in time."""

import itertools
import struct
import time
from collections.abc import Callable, Iterator

import pytest
import serial

from tests.fakes.conftest import FakeProcess


class Line:
    """A host that computes its own checksums."""

    def __init__(self, port: str) -> None:
        self.serial = serial.Serial(port, 115200, timeout=30.0)

    def send(self, command: int, control: int, layout: str = "", *values: float) -> None:
        payload = bytes((command, control)) + struct.pack("<" + layout, *values)
        self.serial.write(b"\xaa\xaa" + bytes((len(payload),)) + payload + bytes((-sum(payload) & 255,)))

    def ask(self, command: int, control: int, layout: str = "", *values: float) -> bytes:
        self.send(command, control, layout, *values)
        head = self.serial.read(3)
        assert head[:2] == b"\xaa\xaa", f"no answer to {command}"
        rest = self.serial.read(head[2] + 1)
        assert sum(rest) & 255 == 0
        assert rest[:2] == bytes((command, control))
        return rest[2:-1]

    def index(self) -> int:
        return int(struct.unpack("<Q", self.ask(246, 0))[0])

    def move(self, *values: float, mode: int = 4) -> int:
        return int(struct.unpack("<Q", self.ask(84, 3, "B4f", mode, *values))[0])


@pytest.fixture
def fake(start_fake: Callable[..., FakeProcess]) -> FakeProcess:
    return start_fake("dobot_magician", "--pace", "8")


@pytest.fixture
def line(fake: FakeProcess) -> Iterator[Line]:
    line = Line(fake.ready["port"])
    yield line
    line.serial.close()


def test_frames_match_examples(line: Line) -> None:
    line.serial.write(bytes.fromhex("00 aa 17 aa aa 02 02 00 fe"))
    assert line.serial.read(9) == bytes.fromhex("aa aa 05 02 00 03 06 05 f0")
    line.serial.timeout = 0.1
    line.serial.write(bytes.fromhex("aa aa 02 0a 00 f5"))  # a wrong checksum gets no answer
    assert line.serial.read(1) == b""
    line.serial.timeout = 30.0
    x, y, z, r, *angles = struct.unpack("<8f", line.ask(10, 0))
    assert (x, y, z, r) == pytest.approx((259.104, 0.0, -8.485, 0.0), abs=0.01)
    assert angles == pytest.approx([0, 45, 45, 0])
    line.send(200, 0)  # an unknown id gets no answer either: the next answer is for the next request
    assert line.ask(20, 0) == bytes(16)


def test_the_queue_has_indices_and_survives_a_forced_stop(fake: FakeProcess, line: Line) -> None:
    line.ask(83, 1, "2f", 20.0, 100.0)
    first, second = line.move(40, 45, 45, 0), line.move(-40, 45, 45, 0)
    assert second == first + 1
    assert fake.truth()["moving"] is False  # nothing runs before the start
    line.ask(240, 1)
    path = [fake.control.wait_until(lambda truth: truth["joints"][0] > 2.0)["joints"][0] for _ in range(20)]
    assert all(a <= b for a, b in itertools.pairwise(path))
    sent = time.monotonic()
    line.ask(242, 1)
    (stamped,) = fake.control.do("stops")
    assert sent <= stamped <= time.monotonic()
    stood = fake.truth()
    assert stood["moving"] is False
    assert 2.0 < stood["joints"][0] < 40.0
    assert (stood["queued"], line.index()) == (1, 0)
    line.ask(240, 1)  # without a clear the next motion runs
    fake.control.wait_until(lambda truth: truth["index"] == second)
    assert fake.truth()["joints"][0] == pytest.approx(-40.0)
    line.move(0, 45, 45, 0)
    fake.control.wait_until(lambda truth: truth["moving"])
    line.ask(242, 1)
    line.move(10, 45, 45, 0)
    line.ask(245, 1)
    line.ask(240, 1)
    assert fake.truth()["queued"] == 0


def test_a_line_is_straight_and_a_jump_rises(fake: FakeProcess, line: Line) -> None:
    line.ask(240, 1)
    line.ask(81, 1, "4f", 200.0, 200.0, 800.0, 800.0)
    line.move(220.0, 100.0, 20.0, 0.0, mode=1)
    last = line.move(220.0, -100.0, 20.0, 0.0, mode=2)
    seen = []
    while (truth := fake.truth())["index"] < last:
        if truth["index"] == last - 1 and truth["tool"][1] < 95.0:
            seen.append(truth["tool"])
    assert len(seen) > 5
    assert all(abs(x - 220.0) < 0.05 and abs(z - 20.0) < 0.05 for x, _, z, _ in seen)
    last = line.move(220.0, 50.0, 20.0, 0.0, mode=0)
    top = 0.0
    while (truth := fake.truth())["index"] < last:
        top = max(top, truth["tool"][2])
    assert top > 35.0
    assert truth["tool"] == pytest.approx([220.0, 50.0, 20.0, 0.0], abs=0.01)


@pytest.mark.parametrize(
    ("mode", "target", "alarm"),
    [(1, (500, 0, 0, 0), 0x11), (1, (60, 0, 100, 0), 0x12), (4, (95, 45, 45, 0), 0x40), (4, (0, 45, -20, 0), 0x45)],
)
def test_exceeded_limits_are_alarms(
    start_fake: Callable[..., FakeProcess], mode: int, target: tuple[float, ...], alarm: int
) -> None:
    fake = start_fake("dobot_magician")
    line = Line(fake.ready["port"])
    line.ask(240, 1)
    line.move(*target, mode=mode)
    truth = fake.control.wait_until(lambda truth: truth["alarms"])
    assert truth["alarms"] == [alarm]
    bits = int.from_bytes(line.ask(20, 0), "little")
    assert bits == 1 << alarm
    assert (truth["moving"], truth["motions"]) == (False, 0)
    line.serial.close()


@pytest.mark.parametrize("clear", ["aa aa 02 14 01 eb", "aa aa 02 15 01 ea"], ids=["DobotDll", "pydobot"])
def test_alarms_are_cleared_by_the_frames_in_use(fake: FakeProcess, line: Line, clear: str) -> None:
    fake.control.do("alarm", code=0x51)
    assert line.ask(20, 0) == bytes(10) + b"\x02" + bytes(5)
    line.serial.write(bytes.fromhex(clear))
    assert line.serial.read(6) == bytes.fromhex(clear)  # an empty answer with the same id and control
    assert line.ask(20, 0) == bytes(16)
    line.ask(240, 1)
    line.move(10, 45, 45, 0)
    fake.control.wait_until(lambda truth: truth["index"] == 1)


@pytest.mark.parametrize("reserved", ["", "00 00 00 00"], ids=["pydobot", "DobotDll"])
def test_homing_uses_the_stored_position(fake: FakeProcess, line: Line, reserved: str) -> None:
    line.ask(240, 1)
    payload = bytes.fromhex("1f 03" + reserved)
    line.serial.write(b"\xaa\xaa" + bytes((len(payload),)) + payload + bytes((-sum(payload) & 255,)))
    assert line.serial.read(14) == bytes.fromhex("aa aa 0a 1f 03 01 00 00 00 00 00 00 00 dd")
    truth = fake.control.wait_until(lambda truth: truth["homed"])
    assert truth["tool"] == pytest.approx([259.1, 0.0, -8.5, 0.0], abs=0.1)  # in its factory state
    line.ask(30, 3, "4f", 220.0, 40.0, 10.0, 0.0)
    second = struct.unpack("<Q", line.ask(31, 3))[0]
    truth = fake.control.wait_until(lambda truth: truth["index"] == second)
    assert truth["tool"] == pytest.approx([220.0, 40.0, 10.0, 0.0], abs=0.1)


def test_outputs_and_parameters_are_stored(fake: FakeProcess, line: Line) -> None:
    line.ask(62, 1, "2B", 1, 1)
    line.ask(63, 1, "2B", 1, 0)
    line.ask(135, 1, "BBi", 1, 1, -5000)
    truth = fake.truth()
    assert (truth["suction"], truth["gripper"], truth["steppers"]["1"]) == ([1, 1], [1, 0], [True, -5000])
    line.ask(60, 1, "3f", 70.0, 0.0, -20.0)
    x, _, z, *_ = struct.unpack("<8f", line.ask(10, 0))
    assert (x, z) == pytest.approx((269.404, -28.485), abs=0.01)
    line.send(60, 1, "2f", 1.0, 2.0)  # too short: not answered, not stored
    assert struct.unpack("<3f", line.ask(60, 0)) == (70.0, 0.0, -20.0)
