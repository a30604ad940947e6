"""Faults of the functional tester: a failing wire, late answers, a killed process."""

import socket
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import pytest
from pymodbus.client import ModbusTcpClient

from arcor2_drivers.functional_tester.functional_tester import FunctionalTester
from arcor2_drivers.functional_tester.settings import FunctionalTesterSettings
from arcor2_hw.data.device import Connection
from arcor2_hw.exceptions import (
    ConnectionLost,
    DeviceFault,
    DeviceTimeout,
    NotConnected,
    NotInControl,
    OutOfRange,
    Stale,
)
from arcor2_hw.objects import MachineCommand, MachineState
from tests.drivers.background_call import BackgroundCall
from tests.drivers.faults import (
    connect_after_invalid_answers,
    disconnect_from_silence,
    host_process,
    in_control,
    refusing_address,
)
from tests.drivers.relay import Relay
from tests.fakes.conftest import FakeProcess
from tests.waiting import wait_for

READ_INPUT_REGISTERS, WRITE_REGISTERS = 4, 16
QUICK: dict[str, Any] = {"request_timeout": 0.15, "watchdog_ms": 600}


@pytest.fixture
def quick(make: Callable[..., FunctionalTester], slow_fake: FakeProcess) -> FunctionalTester:
    """Return a driver with short time limits, in control of a tester with a board behind its closed door."""
    slow_fake.control.do("push_door", opening=True)
    slow_fake.control.do("put_board", code="B-1")
    slow_fake.control.do("push_door", opening=False)
    return in_control(make(slow_fake.ready["modbus"], **QUICK))


@contextmanager
def running_test(tester: FunctionalTester) -> Iterator[BackgroundCall]:
    """Start a test in a thread and wait for Execute."""
    doing = BackgroundCall(tester.test)
    tester.wait_for(MachineState.EXECUTE, 30.0)
    try:
        yield doing
    finally:
        doing.outcome()


# ------------------------------------------------------------------------------------------------ connecting
def test_an_unreachable_device_is_named(make: Callable[..., FunctionalTester]) -> None:
    with refusing_address() as address:
        tester = make(address)
        with pytest.raises(NotConnected, match=f"^tester at {address} "):
            tester.connect(1.0)
        assert tester.connection is Connection.FAILED
        with pytest.raises(NotConnected, match=address):
            tester.machine_state()
        with pytest.raises(NotConnected, match=address):
            tester.test()


@pytest.mark.parametrize("fault", ["silence", "half_frame", "garbage"])
def test_connecting_to_a_device_with_invalid_answers(
    fake: FakeProcess, make: Callable[..., FunctionalTester], fault: str
) -> None:
    tester = make(fake.ready["modbus"])
    connect_after_invalid_answers(fake, tester, fault, DeviceTimeout)
    assert tester.machine_state() is MachineState.STOPPED


def test_a_silent_peer_is_named(make: Callable[..., FunctionalTester]) -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        address = "{}:{}".format(*server.getsockname())
        request = "\\(reading input registers 0 to 16\\) twice"
        with pytest.raises(DeviceTimeout, match=f"{address}: no answer within .* {request}"):
            make(address).connect(0.5)


# ------------------------------------------------------------------------------------------------ connection losses
@pytest.mark.parametrize(
    ("fault", "within"), [("reset", 0.3), ("silence", 1.0), ("half_frame", 1.0), ("garbage", 1.0), ("refuse", None)]
)
def test_a_loss_during_a_test(
    slow_fake: FakeProcess, quick: FunctionalTester, wait_for: Callable[..., Any], fault: str, within: float | None
) -> None:
    with running_test(quick) as doing:
        began = time.monotonic()
        slow_fake.control.do(fault)
        if fault == "refuse":  # only new connections are refused: the test continues until this connection breaks too
            slow_fake.control.do("reset")
    assert isinstance(doing.outcome(), ConnectionLost)
    assert f"tester at {slow_fake.ready['modbus']}" in str(doing.outcome())
    assert doing.ended_at - began < (within or 0.3) + 0.3
    # The driver does not intervene until the tester has ended the test by itself, and nothing starts again.
    wait_for(slow_fake.truth, lambda truth: truth["fault"] == 105)
    slow_fake.control.do("heal")
    wait_for(lambda: quick.connection, lambda state: state is Connection.BACK)
    assert quick.machine_state() is MachineState.ABORTED
    assert quick.control_owner() is None
    with pytest.raises(NotInControl):
        quick.clear()
    quick.take_control()
    quick.clear()
    assert quick.connection is Connection.ONLINE
    truth = slow_fake.truth()
    assert (truth["state"], truth["tested"], truth["watchdog_ms"]) == ("Stopped", 0, 600)


def test_a_loss_during_a_door_motion(
    slow_fake: FakeProcess, quick: FunctionalTester, wait_for: Callable[..., Any]
) -> None:
    slow_fake.control.do("silence")
    with pytest.raises((ConnectionLost, DeviceTimeout), match=slow_fake.ready["modbus"]):
        quick.open_door()
    slow_fake.control.do("heal")
    wait_for(lambda: quick.connection, lambda state: state is Connection.BACK)
    assert slow_fake.truth()["door"] == "closed"


def test_a_late_answer_to_a_reading(relay: Relay, make: Callable[..., FunctionalTester]) -> None:
    """The reading is repeated on a new connection; the late answer is ignored; no connection loss is reported."""
    tester = in_control(make(relay.address, request_timeout=0.5))
    relay.delay_next(READ_INPUT_REGISTERS, 1.0)
    tester.open_door()
    assert relay.connections >= 2
    assert tester.connection is Connection.ONLINE
    assert tester.control_owner() == "us"
    assert tester.machine_state() is MachineState.STOPPED


def test_a_late_answer_to_a_write(
    relay: Relay, make: Callable[..., FunctionalTester], fake: FakeProcess, wait_for: Callable[..., Any]
) -> None:
    """A write is sent once; its outcome is reported as unknown; its late answer is ignored."""
    tester = in_control(make(relay.address, request_timeout=0.5))
    relay.delay_next(WRITE_REGISTERS, 1.0)
    before = relay.requests[WRITE_REGISTERS]
    with pytest.raises(DeviceTimeout, match=f"^tester at {relay.address}: .* it may have been executed$"):
        tester.open_door()
    assert relay.requests[WRITE_REGISTERS] == before + 1
    wait_for(lambda: fake.truth()["door"], lambda door: door == "open")  # it was executed
    tester.close_door()
    assert relay.connections >= 2
    assert fake.truth()["door"] == "closed"


def test_an_answer_with_another_transaction_id_is_ignored(relay: Relay, make: Callable[..., FunctionalTester]) -> None:
    tester = make(relay.address, request_timeout=0.5)
    tester.connect()
    relay.renumber_next(READ_INPUT_REGISTERS)
    assert tester.board_present() is False
    assert relay.connections >= 2


def test_state_is_stale_before_the_connection_is_lost(
    fake: FakeProcess, observed: FunctionalTester, wait_for: Callable[..., Any]
) -> None:
    assert observed.machine_state() is MachineState.STOPPED
    fake.control.do("silence")
    with pytest.raises(Stale, match=rf"tester at {fake.ready['modbus']}: the newest state is \d\.\d+ s old"):
        wait_for(observed.machine_state, lambda state: state is not MachineState.STOPPED)
    wait_for(lambda: observed.connection, lambda state: state is Connection.LOST)
    with pytest.raises(ConnectionLost, match=fake.ready["modbus"]):
        observed.machine_state()


def test_a_stopped_life_counter_makes_the_state_stale(relay: Relay, make: Callable[..., FunctionalTester]) -> None:
    """A gateway keeps answering although the tester behind it hangs."""
    tester = make(relay.address)
    tester.connect()
    assert tester.machine_state() is MachineState.STOPPED
    relay.repeat_last(READ_INPUT_REGISTERS)
    with pytest.raises(Stale, match=r"answers, but its life counter has been \d+ for \d\.\d s"):
        wait_for(tester.machine_state, lambda state: state is not MachineState.STOPPED)
    assert tester.connection is Connection.ONLINE


def test_only_observation_returns_by_itself(
    fake: FakeProcess, tester: FunctionalTester, wait_for: Callable[..., Any]
) -> None:
    fake.control.do("reset")
    wait_for(lambda: tester.connection, lambda state: state is Connection.BACK)
    assert tester.machine_state() is MachineState.STOPPED
    assert tester.control_owner() is None
    with pytest.raises(NotInControl, match="open_door is refused in state Stopped: nobody has control"):
        tester.open_door()
    tester.take_control()
    assert tester.connection is Connection.ONLINE
    tester.open_door()


def test_disconnect_is_quick_with_any_fault_of_the_wire(fake: FakeProcess, tester: FunctionalTester) -> None:
    disconnect_from_silence(fake, tester)
    assert tester.machine_state() is MachineState.STOPPED


HOST = """
import sys
from arcor2_drivers.functional_tester.functional_tester import FunctionalTester
from arcor2_drivers.functional_tester.settings import FunctionalTesterSettings
from arcor2_hw.data.geometry import Pose
host, port = sys.argv[1].rsplit(":", 1)
settings = FunctionalTesterSettings(host, int(port), watchdog_ms=500, request_timeout=0.15)
tester = FunctionalTester("id", "tester", Pose(), None, settings=settings)
tester.connect()
tester.take_control()
tester.test()
"""


def test_the_watchdog_trips_when_the_process_is_killed(slow_fake: FakeProcess, wait_for: Callable[..., Any]) -> None:
    slow_fake.control.do("push_door", opening=True)
    slow_fake.control.do("put_board", code="B-1")
    slow_fake.control.do("push_door", opening=False)
    with host_process(HOST, slow_fake.ready["modbus"]) as process:
        wait_for(slow_fake.truth, lambda truth: truth["state"] == "Execute")
        time.sleep(1.0)  # twice the watchdog's time: the driver triggers it
        assert slow_fake.truth()["state"] == "Execute"
        process.kill()
        truth = wait_for(slow_fake.truth, lambda truth: truth["state"] == "Aborted")
    assert (truth["fault"], truth["tested"]) == (105, 0)


# ----------------------------------------------------------------------------------- other hosts and devices
def test_sequence_numbers_continue_those_of_another_host(fake: FakeProcess, tester: FunctionalTester) -> None:
    host, _, port = fake.ready["modbus"].rpartition(":")
    other = ModbusTcpClient(host, port=int(port))
    try:
        other.write_registers(0, [MachineCommand.RESET, 0xFFFF], device_id=1)
        tester.wait_for(MachineState.IDLE, 30.0)
        tester.command(MachineCommand.STOP)
        tester.wait_for(MachineState.STOPPED, 30.0)
        assert other.read_holding_registers(1, count=1, device_id=1).registers == [0]
    finally:
        other.close()


def test_wrong_unit_is_refused_by_name(fake: FakeProcess, make: Callable[..., FunctionalTester]) -> None:
    with pytest.raises((DeviceFault, DeviceTimeout), match=fake.ready["modbus"]):
        make(fake.ready["modbus"], unit_id=7).connect(1.0)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("host", " "),
        ("port", 0),
        ("port", 70000),
        ("unit_id", 256),
        ("watchdog_ms", 0),
        ("watchdog_ms", 5000),
        ("request_timeout", 1.0),
        ("request_timeout", float("nan")),
        ("test_timeout", 0.0),
        ("door_timeout", float("inf")),
    ],
)
def test_settings_out_of_range_name_the_parameter(name: str, value: Any) -> None:
    with pytest.raises(OutOfRange, match=f"^{name} must be"):
        FunctionalTesterSettings(**{"host": "127.0.0.1", name: value})
