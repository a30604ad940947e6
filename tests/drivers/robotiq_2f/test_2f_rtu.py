"""The 2F gripper on Modbus RTU: registers, a complete cycle, line faults, unplugging."""

import os
import pty
import tty
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from pymodbus.framer import FramerRTU

from arcor2_drivers.robotiq_2f.robotiq_2f import Robotiq2F
from arcor2_drivers.robotiq_2f.rtu_link import decode, encode
from arcor2_drivers.robotiq_2f.settings import Robotiq2FSettings, Wire
from arcor2_drivers.robotiq_2f.status import Activation, Command, Object, Status
from arcor2_hw.data.device import Connection
from arcor2_hw.exceptions import ConnectionLost, DeviceError, DeviceTimeout, NotConnected, NotInControl
from arcor2_hw.objects.small import GripperState
from tests.drivers.background_call import BackgroundCall
from tests.drivers.robotiq_2f.conftest import make_ready
from tests.fakes.conftest import FakeProcess
from tests.waiting import wait_for


@pytest.fixture(scope="module")
def running(tmp_path_factory: pytest.TempPathFactory) -> Iterator[FakeProcess]:
    link = tmp_path_factory.mktemp("2f") / "ttyGRIPPER"
    with FakeProcess("robotiq_2f", "--time-scale", "6", "--link", str(link)) as fake:
        yield fake


@pytest.fixture
def make_rtu() -> Iterator[Callable[..., Robotiq2F]]:
    made: list[Robotiq2F] = []

    def build(port: str, **settings: Any) -> Robotiq2F:
        settings = {"request_timeout": 0.2, **settings}
        chosen = Robotiq2FSettings(wire=Wire.MODBUS_RTU, serial_port=port, **settings)
        gripper = Robotiq2F("gripper_id", "gripper", chosen)
        made.append(gripper)
        return gripper

    yield build
    for gripper in made:
        gripper.disconnect()


@pytest.fixture
def rtu(fake: FakeProcess, make_rtu: Callable[..., Robotiq2F]) -> Robotiq2F:
    gripper = make_rtu(fake.ready["rtu"])
    gripper.connect()
    return gripper


def test_registers() -> None:
    """The meaning of each bit, according to the table in docs/devices/robotiq-2f.md."""
    assert encode(Command(act=False, go_to=False), [0, 0, 0]) == [0x0000, 0x0000, 0x0000]
    assert encode(Command(go_to=False), [0, 0, 0]) == [0x0100, 0x0000, 0x0000]
    assert encode(Command(position=255, speed=255, force=255), [0, 0, 0]) == [0x0900, 0x00FF, 0xFFFF]
    assert encode(Command(position=1, speed=2, force=3), [0, 9, 9]) == [0x0900, 0x0001, 0x0203]
    assert encode(Command(go_to=False), [0x0900, 0x0001, 0x0203]) == [0x0100, 0x0001, 0x0203]
    assert decode([0x1100, 0, 0]) == Status(True, False, Activation.ACTIVATING, Object.MOVING, 0, 0, 0)
    assert decode([0x3900, 0x00FF, 0x0E0A]) == Status(True, True, Activation.ACTIVE, Object.MOVING, 0, 255, 14)
    assert decode([0xB900, 0x0DFF, 0xBD00]) == Status(
        True, True, Activation.ACTIVE, Object.CONTACT_CLOSING, 13, 255, 189
    )
    for wrong in ([], [0x2000, 0, 0], [0, 0, 0, 0]):
        with pytest.raises(ValueError, match=r"regist|valid"):
            decode(wrong)


def test_a_complete_cycle(fake: FakeProcess, rtu: Robotiq2F) -> None:
    commands = fake.truth()["count"]
    assert rtu.state() is GripperState.INACTIVE
    rtu.take_control()
    assert fake.truth()["count"] == commands
    rtu.activate()
    fake.control.do("put_part", width=0.04)
    assert rtu.grip(0.01, force=235.0, speed=0.15) == (True, pytest.approx(0.04, abs=0.0002))
    assert fake.truth()["writes"][-1] == [0x0900, 203, 0xFFFF]
    assert rtu.part_held()
    rtu.release()
    assert rtu.width() == pytest.approx(0.085)


def test_stop(fake: FakeProcess, rtu: Robotiq2F, wait_for: Callable[..., Any]) -> None:
    make_ready(fake, rtu)
    doing = BackgroundCall(lambda: rtu.grip(0.0, speed=0.02))
    wait_for(rtu.state, lambda state: state is GripperState.MOVING)
    rtu.stop()
    outcome = doing.outcome()
    assert outcome.code == "cancelled"
    assert 3 < fake.truth()["position"] < 230


def test_a_missing_port_and_a_wrong_unit_are_named(
    fake: FakeProcess, make_rtu: Callable[..., Robotiq2F], tmp_path: Path
) -> None:
    with pytest.raises(NotConnected, match=r"gripper at .*ttyNONE unit 9 cannot be reached: the port cannot be opened"):
        make_rtu(str(tmp_path / "ttyNONE")).connect(1.0)
    with pytest.raises(DeviceTimeout, match=r"unit 8: no answer within 0\.2 s"):
        make_rtu(fake.ready["rtu"], unit_id=8).connect(1.0)


@pytest.mark.parametrize("fault", ["silence", "half_frame", "garbage", "reset"])
def test_a_line_fault_during_a_grip_is_a_loss_and_recovers(
    fake: FakeProcess, rtu: Robotiq2F, wait_for: Callable[..., Any], fault: str
) -> None:
    make_ready(fake, rtu)
    fake.control.do("put_part", width=0.03)
    doing = BackgroundCall(lambda: rtu.grip(0.0, speed=0.02))
    wait_for(rtu.state, lambda state: state is GripperState.MOVING)
    fake.control.do(fault)
    outcome = doing.outcome()
    assert isinstance(outcome, ConnectionLost)
    assert "unit 9" in str(outcome)
    fake.control.do("heal")
    fake.control.do("pace", factor=50.0)
    wait_for(lambda: rtu.connection is Connection.BACK)
    wait_for(lambda: fake.truth()["gripped"])
    wait_for(rtu.state, lambda state: state is GripperState.HOLDING)
    commands = fake.truth()["count"]
    with pytest.raises(NotInControl):
        rtu.release()
    assert fake.truth()["count"] == commands


def test_disconnecting_from_a_silent_line_ends_the_request(make_rtu: Callable[..., Robotiq2F]) -> None:
    ours, hosts = pty.openpty()
    tty.setraw(hosts)
    try:
        gripper = make_rtu(os.ttyname(hosts), request_timeout=5.0)
        doing = BackgroundCall(gripper.connect)
        os.read(ours, 100)  # the request has arrived
        gripper._gripper.close()
        assert isinstance(doing.outcome(), DeviceError)
    finally:
        os.close(ours)
        os.close(hosts)


def test_fake_answers_byte_for_byte(fake: FakeProcess) -> None:
    """Raw frames; their checksums are computed by the library's framer, in another process than the fake."""
    port = os.open(fake.ready["rtu"], os.O_RDWR | os.O_NOCTTY)

    def framed(body: bytes) -> bytes:
        return body + FramerRTU.compute_CRC(body).to_bytes(2, "big")

    def ask(body: bytes, length: int) -> bytes:
        os.write(port, framed(body))
        came = b""
        while len(came) < length:
            came += os.read(port, 100)
        return came

    try:
        written = ask(bytes.fromhex("091003E80003060100 00000000".replace(" ", "")), 8)
        assert written == framed(bytes.fromhex("091003E80003"))
        wait_for(
            lambda: ask(bytes.fromhex("090307D00001"), 7), lambda status: status == framed(bytes.fromhex("090302F100"))
        )
        assert ask(bytes.fromhex("090307D00003"), 11) == framed(bytes.fromhex("090306F10000000300"))
        assert ask(bytes.fromhex("090300000001"), 5) == framed(bytes.fromhex("098302"))
    finally:
        os.close(port)
