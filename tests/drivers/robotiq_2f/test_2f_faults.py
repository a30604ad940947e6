"""Faults of the 2F gripper's wire: absent, silent, reset, half a frame, garbage, slow; connection loss and recovery."""

import socket
from collections.abc import Callable
from typing import Any

import pytest

from arcor2_drivers.robotiq_2f.robotiq_2f import Robotiq2F
from arcor2_hw.data.device import Connection, Health
from arcor2_hw.exceptions import ConnectionLost, DeviceError, DeviceTimeout, NotConnected, NotInControl
from arcor2_hw.objects.small import GripperState
from tests.drivers.background_call import BackgroundCall
from tests.drivers.robotiq_2f.conftest import make_ready
from tests.fakes.conftest import FakeProcess


def test_a_closed_port(make: Callable[..., Robotiq2F]) -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        address = f"127.0.0.1:{taken.getsockname()[1]}"
        gripper = make(address)
        with pytest.raises(NotConnected, match=f"gripper at {address}: the port cannot be opened"):
            gripper.connect(1.0)
        assert gripper.connection is Connection.FAILED
        with pytest.raises(NotConnected):
            gripper.state()


def test_a_server_that_does_not_answer(fake: FakeProcess, make: Callable[..., Robotiq2F]) -> None:
    fake.control.do("silence")
    gripper = make(fake.ready["ascii"], request_timeout=0.2)
    with pytest.raises(DeviceTimeout, match=r"gripper at 127\.0\.0\.1:\d+ did not answer GET ACT within 0\.2 s"):
        gripper.connect(1.0)
    fake.control.do("heal")
    gripper.connect(30.0)


@pytest.mark.parametrize("fault", ["silence", "reset", "half_frame", "garbage", "slow"])
def test_a_wire_fault_during_a_grip_is_a_loss_and_recovers(
    fake: FakeProcess, make: Callable[..., Robotiq2F], wait_for: Callable[..., Any], fault: str
) -> None:
    gripper = make(fake.ready["ascii"], request_timeout=0.15)
    gripper.connect()
    make_ready(fake, gripper)
    fake.control.do("put_part", width=0.03)
    doing = BackgroundCall(lambda: gripper.grip(0.0, speed=0.02))
    wait_for(gripper.state, lambda state: state is GripperState.MOVING)
    fake.control.do(fault, seconds=0.4)
    outcome = doing.outcome()
    assert isinstance(outcome, ConnectionLost)
    assert "gripper at 127.0.0.1" in str(outcome)
    if fault != "reset":
        wait_for(lambda: gripper.connection is Connection.LOST)
        assert gripper.health is Health.FAILURE
        with pytest.raises(ConnectionLost):
            gripper.state()
    fake.control.do("heal")
    fake.control.do("pace", factor=50.0)
    wait_for(lambda: gripper.connection is Connection.BACK)

    wait_for(lambda: fake.truth()["registers"]["OBJ"] == 2)  # it completes the command and holds
    commands = fake.truth()["count"]
    wait_for(gripper.state, lambda state: state is GripperState.HOLDING)
    with pytest.raises(NotInControl):
        gripper.release()
    assert fake.truth()["count"] == commands
    gripper.take_control()
    gripper.release()
    assert gripper.connection is Connection.ONLINE


def test_invalid_answers_are_typed_errors(make: Callable[..., Robotiq2F]) -> None:
    """A listener that answers each request with the next wrong answer of a list."""
    for answer in (b"POS 3\n", b"ACT 999\n", b"?\n", b"\xff\xff\xff\n", b"A" * 200, b"ACT x\n", b"ACT"):
        with socket.create_server(("127.0.0.1", 0)) as server:
            server.settimeout(5.0)

            def serve(server: socket.socket = server, answer: bytes = answer) -> None:
                client, _ = server.accept()
                with client:
                    client.settimeout(5.0)
                    client.recv(100)
                    client.sendall(answer)
                    client.recv(100)  # until the driver closes it

            doing = BackgroundCall(serve)
            gripper = make(f"127.0.0.1:{server.getsockname()[1]}", request_timeout=0.1)
            with pytest.raises(DeviceError, match=r"gripper at 127\.0\.0\.1"):
                gripper.connect(1.0)
            gripper.disconnect()
            doing.outcome()


def test_disconnecting_ends_a_waiting_call(fake: FakeProcess, gripper: Robotiq2F, wait_for: Callable[..., Any]) -> None:
    doing = BackgroundCall(lambda: gripper.grip(0.0, speed=0.02))
    wait_for(gripper.state, lambda state: state is GripperState.MOVING)
    gripper.disconnect()
    assert isinstance(doing.outcome(), DeviceError)
    fake.control.do("pace", factor=50.0)
    wait_for(lambda: fake.truth()["registers"]["OBJ"] == 3)  # it completes the motion and holds
