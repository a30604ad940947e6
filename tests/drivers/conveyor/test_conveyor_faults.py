"""Faults of the conveyor: a failing bus, late answers, a reset drive, a killed process."""

import os
import subprocess
import sys
import time
import tty
from collections.abc import Callable
from typing import Any

import pytest

from arcor2_drivers.conveyor.conveyor import Conveyor
from arcor2_drivers.conveyor.settings import ConveyorSettings
from arcor2_drivers.conveyor.slcan import SlcanBus
from arcor2_hw.data.device import Connection, Health
from arcor2_hw.exceptions import ConnectionLost, DeviceError, DeviceTimeout, NotConnected, NotInControl
from tests.drivers.background_call import BackgroundCall
from tests.drivers.faults import refusing_address
from tests.drivers.stall import BUSY, stall
from tests.fakes.conftest import FakeProcess

QUICK: dict[str, Any] = {"sdo_timeout": 0.15, "heartbeat_ms": 600}


def test_an_unreachable_device_is_named(make: Callable[..., Conveyor]) -> None:
    with refusing_address() as address:
        belt = make(address)
        with pytest.raises(NotConnected, match=f"^belt at socket://{address} node 5: the CAN adapter"):
            belt.connect(1.0)
        assert belt.connection is Connection.FAILED
        with pytest.raises(NotConnected, match=address):
            belt.position()
        with pytest.raises(NotConnected, match=address):
            belt.home()


def test_a_missing_drive_is_named(fake: FakeProcess, make: Callable[..., Conveyor]) -> None:
    belt = make(fake.ready["can"], node_id=6, **QUICK)
    with pytest.raises(DeviceTimeout, match=r"node 6 does not answer within 0\.[45] s"):
        belt.connect(0.5)


@pytest.mark.parametrize("fault", ["silence", "half_frame", "garbage"])
def test_connecting_to_a_device_with_invalid_answers(
    fake: FakeProcess, make: Callable[..., Conveyor], fault: str
) -> None:
    fake.control.do(fault)
    belt = make(fake.ready["can"], **QUICK)
    with pytest.raises(DeviceError, match=f"^belt at socket://{fake.ready['can']} node 5"):
        belt.connect(0.5)
    fake.control.do("heal")
    belt.connect()
    belt.connect()  # has no effect when connected
    assert belt.position().value == 0.0
    belt.disconnect()
    belt.disconnect()
    assert belt.connection is Connection.OFFLINE


@pytest.mark.parametrize("fault", ["mute", "reset", "garbage"])
def test_a_loss_during_a_run_stops_the_belt_and_only_observation_returns(
    fake: FakeProcess, make: Callable[..., Conveyor], wait_for: Callable[..., Any], fault: str
) -> None:
    belt = make(fake.ready["can"], **QUICK)
    belt.connect()
    belt.take_control()
    belt.home()
    moving = BackgroundCall(belt.move_to, 20.0, 0.4)
    fake.control.wait_until(lambda t: t["velocity"] > 3900)  # after the handshake of the motion
    fake.control.do(fault)
    error = moving.outcome()
    assert isinstance(error, ConnectionLost)
    assert f"belt at socket://{fake.ready['can']} node 5" in str(error)
    truth = fake.control.wait_until(lambda t: t["velocity"] == 0.0)
    assert truth["state"] == "switch_on_disabled"
    fake.control.do("heal")
    fake.control.do("mute", on=False)
    wait_for(lambda: belt.connection, lambda state: state is Connection.BACK)
    assert not belt.homed
    with pytest.raises(NotInControl, match="the connection was lost"):
        belt.run(0.1)
    assert fake.truth()["velocity"] == 0.0
    belt.take_control()
    assert belt.connection is Connection.ONLINE
    belt.move_by(0.01)


def test_a_power_cycle_loses_the_homing(fake: FakeProcess, belt: Conveyor, wait_for: Callable[..., Any]) -> None:
    belt.home()
    fake.control.do("power_cycle")
    wait_for(lambda: belt.connection, lambda state: state is Connection.BACK)
    assert not belt.homed
    assert belt.control_owner() is None
    assert fake.truth()["consumer"] == 0
    belt.take_control()
    assert fake.truth()["consumer"] == 127 << 16 | 1000  # the monitor is armed again


def test_late_answers_are_ignored(
    fake: FakeProcess, make: Callable[..., Conveyor], wait_for: Callable[..., Any]
) -> None:
    belt = make(fake.ready["can"], **QUICK)
    belt.connect()
    fake.control.do("slow", seconds=0.4)
    wait_for(lambda: belt.connection, lambda state: state is Connection.LOST)
    assert belt.health is Health.FAILURE
    with pytest.raises(ConnectionLost, match="lost"):
        belt.position()
    fake.control.do("heal")
    wait_for(lambda: belt.connection, lambda state: state is Connection.BACK)
    assert belt.belt_position() == 0.0


def test_stop_halts_a_running_belt(fake: FakeProcess, belt: Conveyor) -> None:
    belt.run(0.3)
    belt.stop()
    assert fake.truth()["velocity"] == 0.0
    assert [f for f in fake.truth()["frames"] if f["from_host"] and f["data"].startswith("2b4060000f01")]


OWNER = """
import sys, time
from arcor2_drivers.conveyor.conveyor import Conveyor
from arcor2_drivers.conveyor.settings import ConveyorSettings
belt = Conveyor("id", "belt", ConveyorSettings(sys.argv[1], heartbeat_ms=600))
belt.connect()
belt.take_control()
belt.run(0.3)
print("runs", flush=True)
time.sleep(60)
"""


def test_the_drive_stops_when_the_process_is_killed(fake: FakeProcess) -> None:
    owner = subprocess.Popen(
        [sys.executable, "-c", OWNER, f"socket://{fake.ready['can']}"], stdout=subprocess.PIPE, text=True
    )
    try:
        assert owner.stdout is not None
        assert owner.stdout.readline() == "runs\n"
        began = time.monotonic()
        while time.monotonic() - began < 0.7:  # longer than the heartbeat's limit, while the process lives
            assert fake.truth()["velocity"] == pytest.approx(3000)
            time.sleep(0.05)
        owner.kill()
        truth = fake.control.wait_until(lambda t: t["velocity"] == 0.0)
        assert truth["state"] == "switch_on_disabled"
        emergencies = [f["data"] for f in truth["frames"] if f["id"] == 0x85]
        assert emergencies
        assert emergencies[-1].startswith("3081")
    finally:
        owner.kill()
        owner.wait(30.0)
        assert owner.stdout is not None
        owner.stdout.close()


def test_a_stall_of_half_a_second_does_not_stop_a_belt(fake: FakeProcess, make: Callable[..., Conveyor]) -> None:
    default = ConveyorSettings("/dev/ttyACM0")
    belt = make(fake.ready["can"], heartbeat_ms=default.heartbeat_ms, sdo_timeout=default.sdo_timeout)
    belt.connect()
    belt.take_control()
    belt.run(0.2)
    stall(BUSY)
    assert fake.truth()["velocity"] == pytest.approx(2000)
    assert belt.velocity().value == pytest.approx(0.2)
    belt.run(0.1)
    belt.stop()
    assert belt.control_owner() == "us"


def test_an_adapter_is_read_in_chunks(monkeypatch: pytest.MonkeyPatch) -> None:
    """With reads of single bytes, a process with a computing action would lag behind the state of the drive."""
    adapter, line = os.openpty()
    tty.setraw(line)
    bus = SlcanBus(os.ttyname(line), sleep_after_open=0.0)
    try:
        with monkeypatch.context() as patched:
            patched.setattr(bus.serialPortOrig, "read", pytest.fail)
            os.write(adapter, b"t1851AA\rt7051")
            frame = bus.recv(1.0)
            assert frame is not None
            assert (frame.arbitration_id, frame.data) == (0x185, b"\xaa")
            os.write(adapter, b"7F\rt7050\r")
            found = [frame.arbitration_id for frame in (bus.recv(1.0), bus.recv(1.0)) if frame is not None]
            assert found == [0x705, 0x705]
            assert bus.recv(0.0) is None
    finally:
        bus.shutdown()
        os.close(adapter)
        os.close(line)


def test_the_heartbeat_ends_when_the_drive_is_silent(fake: FakeProcess, belt: Conveyor) -> None:
    belt.run(0.1)
    fake.control.do("mute")
    fake.control.wait_until(lambda t: t["velocity"] == 0.0)
    silent_since = time.monotonic()
    beats = [f["time"] for f in fake.truth()["frames"] if f["id"] == 0x77F]
    assert silent_since - max(beats) > 0.5


def test_disconnecting_stops_a_running_belt(fake: FakeProcess, belt: Conveyor) -> None:
    belt.run(0.2)
    belt.disconnect()
    fake.control.wait_until(lambda t: t["velocity"] == 0.0 and t["state"] == "switch_on_disabled")
