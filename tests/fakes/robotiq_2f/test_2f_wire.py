"""The fake gripper: raw bytes on its ASCII port, and fingers in simulated time."""

import socket
import time
from collections.abc import Callable, Iterator

import pytest

from arcor2_fakes.control import ControlError, parse_address
from arcor2_fakes.robotiq_2f.gripper import Gripper, Mechanics
from tests.fakes.conftest import FakeProcess


class Wire:
    """A client: one request, one answer."""

    def __init__(self, address: str) -> None:
        self.socket = socket.create_connection(parse_address(address), 2.0)

    def ask(self, text: bytes) -> bytes:
        self.socket.sendall(text)
        return self.socket.recv(100)


@pytest.fixture
def fake(start_fake: Callable[..., FakeProcess]) -> FakeProcess:
    return start_fake("robotiq_2f", "--time-scale", "8")


@pytest.fixture
def wire(fake: FakeProcess) -> Iterator[Wire]:
    wire = Wire(fake.ready["ascii"])
    yield wire
    wire.socket.close()


def test_answers_byte_for_byte(wire: Wire, wait_for: Callable[..., object]) -> None:
    assert wire.ask(b"GET STA\n") == b"STA 0\n"
    assert wire.ask(b"GET ACT\r\n") == b"ACT 0\n"
    assert wire.ask(b"GET SID\n") == b"[9]\n"
    for unknown in (b"GET XYZ\n", b"HELLO\n", b"\n", b"GET\n", b"SET POS\n", b"\xff\xfe\n"):
        assert wire.ask(unknown) == b"?\n"
    for wrong in (b"SET POS 256\n", b"SET ACT 2\n", b"SET STA 3\n", b"SET POS -1\n"):
        assert wire.ask(wrong) == b"nack"
    assert wire.ask(b"SET GTO 1\n") == b"ack"
    wait_for(lambda: wire.ask(b"GET FLT\n") == b"FLT 7\n")
    assert wire.ask(b"SET ACT 1 GTO 0\n") == b"ack"
    wait_for(lambda: wire.ask(b"GET STA\n") == b"STA 1\n")
    wait_for(lambda: wire.ask(b"GET STA\n") == b"STA 3\n")
    wire.ask(b"SET GTO 1 POS 255 SPE 255 FOR 255\n")
    wait_for(lambda: wire.ask(b"GET PRE\n") == b"PRE 255\n")
    wait_for(lambda: wire.ask(b"GET OBJ\n") == b"OBJ 3\n")
    assert wire.ask(b"GET POS\n") == b"POS 230\n"


def test_requests_that_end_a_motion_have_a_time_stamp(fake: FakeProcess, wire: Wire) -> None:
    wire.ask(b"SET GTO 1 POS 100\n")
    assert fake.control.do("stops") == []
    sent = time.monotonic()
    wire.ask(b"SET GTO 0\n")
    (stamped,) = fake.control.do("stops")
    assert sent <= stamped <= time.monotonic()


def test_an_endless_line_is_cut_off(wire: Wire) -> None:
    assert wire.ask(b"A" * 1000) == b""


def test_the_control_channel_refuses_invalid_commands(fake: FakeProcess) -> None:
    for command, arguments in (("put_part", {"width": 0.2}), ("fault", {"code": 3}), ("put_part", {})):
        with pytest.raises(ControlError):
            fake.control.do(command, **arguments)


@pytest.fixture
def clock() -> list[float]:
    return [0.0]


@pytest.fixture
def fingers(clock: list[float]) -> Gripper:
    gripper = Gripper(lambda: clock[0], Mechanics(latency=0.01))
    gripper.request({"ACT": 1})
    clock[0] += 10.0
    assert gripper.registers()["STA"] == 3
    return gripper


def test_fingers_move_in_time(fingers: Gripper, clock: list[float]) -> None:
    fingers.request({"POS": 230, "SPE": 0, "GTO": 1})  # 20 mm/s for 85 mm: 4.25 s
    clock[0] += 0.005
    assert fingers.registers()["PRE"] == 0
    clock[0] += 0.005 + 2.125
    registers = fingers.registers()
    assert (registers["PRE"], registers["OBJ"]) == (230, 0)
    assert registers["POS"] == pytest.approx(116.5, abs=1.0)
    clock[0] += 2.0
    assert fingers.registers()["OBJ"] == 0
    clock[0] += 0.2
    assert (fingers.registers()["OBJ"], fingers.registers()["POS"]) == (3, 230)


def test_a_part_stops_the_fingers_until_it_is_removed(fingers: Gripper, clock: list[float]) -> None:
    fingers.put_part(0.0425)
    fingers.request({"POS": 255, "SPE": 255, "GTO": 1})
    clock[0] += 5.0
    assert (fingers.registers()["OBJ"], fingers.truth()["gripped"]) == (2, True)
    fingers.remove_part()
    assert fingers.registers()["OBJ"] == 0
    clock[0] += 5.0
    assert (fingers.registers()["OBJ"], fingers.registers()["POS"]) == (3, 230)
    fingers.block()
    fingers.request({"POS": 0})
    clock[0] += 5.0
    assert fingers.registers()["OBJ"] == 1


def test_faults_and_their_reset(fingers: Gripper, clock: list[float]) -> None:
    fingers.fault(14)
    fingers.request({"POS": 255, "GTO": 1})
    clock[0] += 5.0
    assert (fingers.registers()["FLT"], fingers.registers()["POS"]) == (14, 3)
    fingers.request({"ACT": 0, "GTO": 0})
    clock[0] += 1.0
    assert (fingers.registers()["FLT"], fingers.registers()["STA"]) == (0, 0)
    fingers.put_part(0.02)
    fingers.request({"ACT": 1})
    clock[0] += 5.0
    assert (fingers.registers()["FLT"], fingers.registers()["STA"]) == (13, 1)
