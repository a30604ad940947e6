"""Faults of the remote I/O block: a failing wire, late answers, a killed process."""

import contextlib
import itertools
import time
from collections.abc import Callable, Iterator
from types import SimpleNamespace
from typing import Any

import pytest
from pymodbus.client import ModbusTcpClient

from arcor2_drivers.remote_io.remote_io import RemoteIO
from arcor2_hw.data.device import Connection
from arcor2_hw.exceptions import (
    ConnectionLost,
    DeviceError,
    DeviceFault,
    DeviceTimeout,
    NotConnected,
    NotInControl,
)
from arcor2_hw.objects import modbus_device
from arcor2_hw.objects.modbus_link import ModbusLink
from tests.drivers.background_call import BackgroundCall
from tests.drivers.faults import (
    connect_after_invalid_answers,
    disconnect_from_silence,
    host_process,
    in_control,
    refusing_address,
)
from tests.drivers.relay import Relay
from tests.drivers.remote_io.conftest import POINTS
from tests.fakes.conftest import FakeProcess

READ_IMAGE, WRITE_COIL = 4, 5
QUICK: dict[str, Any] = {"request_timeout": 0.1, "watchdog_ms": 400}


@pytest.fixture
def quick(fake: FakeProcess, make: Callable[..., RemoteIO]) -> RemoteIO:
    """Return a driver with short time limits, in control, with all outputs different from their states after a loss."""
    block = in_control(make(fake.ready["modbus"], **QUICK))
    block.write_digital("lamp", True)
    block.write_digital("valve", True)
    return block


def expired(truth: dict[str, Any]) -> bool:
    return bool(truth["watchdogs"][0]["state"] == "expired")


# ------------------------------------------------------------------------------------------------ connecting
def test_importing_pymodbus_does_not_count_as_response_time(
    fake: FakeProcess, make: Callable[..., RemoteIO], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The import takes seconds on a busy computer. Requests are limited to a quarter of the remaining time."""
    imports, limits = 0.0, []

    def load(_: ModbusLink) -> None:
        nonlocal imports
        imports = 100.0

    @contextlib.contextmanager
    def limited(_: ModbusLink, timeout: float) -> Iterator[None]:
        limits.append(timeout)
        yield

    monkeypatch.setattr(ModbusLink, "load", load)
    monkeypatch.setattr(ModbusLink, "limited", limited)
    monkeypatch.setattr(modbus_device, "time", SimpleNamespace(monotonic=lambda: time.monotonic() + imports))
    make(fake.ready["modbus"]).connect(60.0)
    assert 5.0 < limits[0] <= 15.0


def test_an_unreachable_device_is_named(make: Callable[..., RemoteIO]) -> None:
    with refusing_address() as address:
        block = make(address)
        with pytest.raises(NotConnected, match=f"^block at {address} cannot be reached"):
            block.connect(1.0)
        assert block.connection is Connection.FAILED
        for call in (lambda: block.read("part"), lambda: block.write("lamp", True), block.take_control, block.identify):
            with pytest.raises(NotConnected, match=address):
                call()


@pytest.mark.parametrize("fault", ["silence", "half_frame", "garbage"])
def test_connecting_to_a_device_with_invalid_answers(
    fake: FakeProcess, make: Callable[..., RemoteIO], fault: str
) -> None:
    block = make(fake.ready["modbus"])
    connect_after_invalid_answers(fake, block, fault, DeviceError)
    assert block.read_digital("part") is False


def test_wrong_unit_is_refused_by_name(fake: FakeProcess, make: Callable[..., RemoteIO]) -> None:
    with pytest.raises((DeviceFault, DeviceTimeout), match=fake.ready["modbus"]):
        make(fake.ready["modbus"], unit_id=7).connect(1.0)


# ------------------------------------------------------------------------------------------------ connection losses
@pytest.mark.parametrize("fault", ["reset", "silence", "half_frame", "garbage"])
def test_a_loss_and_its_recovery(fake: FakeProcess, quick: RemoteIO, wait_for: Callable[..., Any], fault: str) -> None:
    edges: list[Any] = []
    quick.subscribe("part", edges.append)
    doing = BackgroundCall(lambda: quick.wait_for("part", True, 20.0))
    began = time.monotonic()
    fake.control.do(fault)
    if fault == "reset":
        fake.control.do("refuse")  # the next test covers a connection that returns at once
    outcome = doing.outcome()
    assert isinstance(outcome, ConnectionLost)
    assert fake.ready["modbus"] in str(outcome)
    assert doing.ended_at - began < 1.5
    with pytest.raises(ConnectionLost):
        quick.write_digital("lamp", False)
    # The block itself sets the outputs to their safe state, and nothing restores them.
    truth = wait_for(fake.truth, expired)
    assert truth["outputs"][4:7] == [False, True, True]
    fake.control.do("heal")
    wait_for(lambda: quick.connection, lambda state: state is Connection.BACK)
    with pytest.raises(NotInControl, match="writing lamp is refused: control ended when the connection was lost"):
        quick.write_digital("lamp", True)
    assert fake.truth()["outputs"][4:7] == [False, True, True]
    quick.take_control()
    assert quick.connection is Connection.ONLINE
    assert fake.truth()["outputs"][4:7] == [False, True, True]
    quick.write_digital("lamp", True)
    fake.control.do("set_input", number=0, on=True)
    wait_for(lambda: len(edges), lambda count: count == 1)  # subscriptions survive a connection loss


def test_control_does_not_come_back_after_a_short_loss(
    fake: FakeProcess, quick: RemoteIO, wait_for: Callable[..., Any]
) -> None:
    fake.control.do("reset")
    wait_for(lambda: quick.connection, lambda state: state is Connection.BACK)
    with pytest.raises(NotInControl):
        quick.write_digital("lamp", False)
    quick.take_control()  # at once: the number on the running watchdog is our own
    quick.write_digital("lamp", False)


def test_a_power_cycle_of_the_block_ends_control(
    start_fake: Callable[..., FakeProcess], make: Callable[..., RemoteIO], wait_for: Callable[..., Any]
) -> None:
    """On a serial line nothing disconnects; the stopped watchdog reveals it."""
    fake = start_fake("remote_io", "--serial")
    block = make(fake.ready["modbus"], baudrate=115200)
    block.connect()
    block.take_control()
    block.write_digital("lamp", True)
    fake.control.do("power_cycle")
    wait_for(block.control_owner, lambda owner: owner is None)
    with pytest.raises(
        NotInControl, match=r"writing lamp is refused: watchdog 0 does not run \(input register 9 is 0\)"
    ):
        block.write_digital("lamp", True)
    assert block.connection is Connection.ONLINE
    assert fake.truth()["outputs"][4] is False


@pytest.mark.parametrize("watchdog", [0, 2])
def test_a_block_whose_watchdog_does_not_start_is_not_controlled(
    fake: FakeProcess, make: Callable[..., RemoteIO], watchdog: int
) -> None:
    """No output is switched on that the block could not switch off by itself."""
    block = make(fake.ready["modbus"], watchdog=watchdog)
    block.connect()
    fake.control.do("watchdogs_start", on=False)
    register = rf"watchdog {watchdog} does not run \(input register {9 + watchdog} is 0\)"
    with pytest.raises(DeviceFault, match=rf"^block at {fake.ready['modbus']}: control is refused: {register}"):
        block.take_control()
    for write in (lambda: block.write_digital("lamp", True), lambda: block.pulse("lamp", 0.1)):
        with pytest.raises(NotInControl, match=f"^block at {fake.ready['modbus']}: .* is refused: {register}"):
            write()
    truth = fake.truth()
    assert not any(truth["outputs"])
    assert truth["history"] == []
    assert {dog["state"] for dog in truth["watchdogs"]} == {"off"}
    fake.control.do("watchdogs_start", on=True)
    block.take_control()
    block.write_digital("lamp", True)
    assert fake.truth()["outputs"][4] is True


def test_a_watchdog_that_stops_ends_control(fake: FakeProcess, quick: RemoteIO, wait_for: Callable[..., Any]) -> None:
    fake.control.do("watchdogs_start", on=False)  # from the next trigger on
    wait_for(quick.control_owner, lambda owner: owner is None)
    with pytest.raises(NotInControl, match=r"watchdog 0 does not run \(input register 9 is 0\)"):
        quick.write_digital("lamp", True)


def test_a_pulse_ends_during_a_connection_loss(
    fake: FakeProcess, make: Callable[..., RemoteIO], wait_for: Callable[..., Any]
) -> None:
    block = make(fake.ready["modbus"], watchdog_ms=5000)  # the pulse ends long before the watchdog expires
    block.connect()
    block.take_control()
    doing = BackgroundCall(lambda: block.pulse("valve", 2.0))
    wait_for(lambda: fake.truth()["outputs"][5])
    fake.control.do("reset")
    assert isinstance(doing.outcome(), ConnectionLost)
    history = wait_for(lambda: fake.truth()["history"], lambda history: len(history) == 2)
    assert history[1]["time"] - history[0]["time"] == pytest.approx(2.0, abs=0.001)


def test_a_late_answer_to_a_reading(relay: Relay, make: Callable[..., RemoteIO]) -> None:
    """The reading is repeated on a new connection; the late answer is ignored; no connection loss is reported."""
    block = in_control(make(relay.address, request_timeout=0.2))
    relay.delay_next(READ_IMAGE, 0.4)
    assert block.read_digital("part") is False
    block.read_digital("part")
    assert relay.connections == 2
    assert block.connection is Connection.ONLINE
    assert block.control_owner() == "us"


def test_a_late_answer_to_a_write(relay: Relay, make: Callable[..., RemoteIO], fake: FakeProcess) -> None:
    """A write is sent once; its outcome is reported as unknown; its late answer is ignored."""
    block = in_control(make(relay.address, request_timeout=0.2))
    relay.delay_next(WRITE_COIL, 0.4)
    with pytest.raises(DeviceTimeout, match=f"^block at {relay.address}: .*coil 4 on.* it may have been executed$"):
        block.write_digital("lamp", True)
    assert relay.requests[WRITE_COIL] == 1
    assert fake.truth()["outputs"][4] is True  # it was executed
    block.write_digital("lamp", False)
    assert fake.truth()["outputs"][4] is False
    assert block.control_owner() == "us"


def test_another_host_taking_the_watchdog_ends_control(
    fake: FakeProcess, quick: RemoteIO, wait_for: Callable[..., Any]
) -> None:
    host, _, port = fake.ready["modbus"].rpartition(":")
    client = ModbusTcpClient(host, port=int(port))
    try:
        for number in itertools.count(1):  # repeat until a write falls between two triggers of the driver
            client.write_register(65, number, device_id=1)
            if quick.control_owner() != "us":
                break
            assert number < 2000
    finally:
        client.close()
    with pytest.raises(NotInControl, match=r"another host \(number \d+ on watchdog 0\) has control"):
        quick.write_digital("lamp", False)


def test_disconnect_is_quick_with_any_fault_of_the_wire(fake: FakeProcess, quick: RemoteIO) -> None:
    disconnect_from_silence(fake, quick)
    assert quick.read_digital("part") is False


HOST = """
import sys, time
from arcor2_drivers.remote_io.remote_io import RemoteIO
from arcor2_drivers.remote_io.settings import RemoteIOSettings
host, port = sys.argv[1].rsplit(":", 1)
settings = RemoteIOSettings(host, int(port), watchdog_ms=400, request_timeout=0.1, points=sys.argv[2])
block = RemoteIO("id", "block", settings)
block.connect()
block.take_control()
block.write_digital("lamp", True)
block.write_digital("valve", True)
block.write_analog("speed", 1.0)
time.sleep(60)
"""


def test_outputs_become_safe_when_the_process_is_killed(
    fake: FakeProcess, make: Callable[..., RemoteIO], wait_for: Callable[..., Any]
) -> None:
    watcher = make(fake.ready["modbus"])  # requests of another client must not feed the watchdog
    watcher.connect()
    with host_process(HOST, fake.ready["modbus"], POINTS) as process:
        wait_for(fake.truth, lambda truth: truth["analog_outputs"][0] == 100)
        time.sleep(1.0)  # more than twice the watchdog's time: the driver triggers it
        assert fake.truth()["outputs"][4:7] == [True, True, False]
        process.kill()
        truth = wait_for(fake.truth, expired)
    assert truth["outputs"][4:7] == [False, True, True]
    assert truth["analog_outputs"][0] == 0
    assert watcher.connection is Connection.ONLINE
