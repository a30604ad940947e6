"""The belt as a PackML machine, its state by PDO, the bus over socketcand, and a foreign NMT master."""

import socket
import threading
import time
from collections.abc import Callable
from typing import Any

import can
import pytest

from arcor2_drivers.conveyor.conveyor import Conveyor
from arcor2_drivers.conveyor.settings import CanInterface, ConveyorSettings
from arcor2_drivers.conveyor.socketcand import SocketcandBus
from arcor2_hw.data.device import Connection
from arcor2_hw.exceptions import (
    Cancelled,
    DeviceFault,
    DeviceTimeout,
    NotConnected,
    NotInControl,
    OutOfRange,
    Refused,
)
from arcor2_hw.objects import MachineCommand, MachineState
from tests.drivers.conveyor.test_conveyor_cycle import under_way
from tests.fakes.conftest import FakeProcess
from tests.waiting import wait_for

S = MachineState


# ------------------------------------------------------------------------------------------------ PackML
def test_a_belt_runs_as_a_packml_machine(fake: FakeProcess, belt: Conveyor) -> None:
    seen = [belt.machine_state()]
    for act in (belt.reset, belt.start, belt.hold, belt.unhold, belt.stop, belt.reset, belt.abort, belt.clear):
        act()
        seen.append(belt.machine_state())
        speed = fake.truth()["velocity"]
        assert speed == pytest.approx(2000 if seen[-1] is S.EXECUTE else 0), act.__name__
    assert seen == [
        S.STOPPED,
        S.IDLE,
        S.EXECUTE,
        S.HELD,
        S.EXECUTE,
        S.STOPPED,
        S.IDLE,
        S.ABORTED,
        S.STOPPED,
    ]
    assert set(seen) <= belt.states


def test_transitional_states_are_reported(fake: FakeProcess, make: Callable[..., Conveyor]) -> None:
    belt = make(fake.ready["can"], acceleration=0.5)
    belt.connect()
    belt.take_control()
    belt.reset()
    seen: list[MachineState] = []
    over = threading.Event()

    def watch() -> None:
        while not over.is_set():
            state = belt.machine_state()
            if seen[-1:] != [state]:
                seen.append(state)
            time.sleep(0.002)

    thread = threading.Thread(target=watch)
    thread.start()
    try:
        belt.start()
        time.sleep(0.05)
        belt.hold()
        time.sleep(0.05)
        belt.command(MachineCommand.STOP)
    finally:
        over.set()
        thread.join()
    assert seen[:5] == [S.IDLE, S.STARTING, S.EXECUTE, S.HOLDING, S.HELD]
    assert belt.machine_state() is S.STOPPED


def test_refused_commands_name_command_and_state(fake: FakeProcess, belt: Conveyor) -> None:
    with pytest.raises(Refused, match=r"^belt at \S+ node 5: start is refused in state Stopped: this state"):
        belt.start()
    with pytest.raises(Refused, match="suspend is refused in state Stopped: a belt has no such command"):
        belt.command(MachineCommand.SUSPEND)
    belt.reset()
    with pytest.raises(Refused, match="reset is refused in state Idle"):
        belt.reset()
    with under_way(fake, lambda: belt.move_by(5.0, 0.3)) as doing:
        assert belt.machine_state() is S.EXECUTE
        with pytest.raises(Refused, match="hold is refused in state Execute: a move cannot be held"):
            belt.hold()
        belt.command(MachineCommand.STOP)
    assert isinstance(doing.outcome(), Cancelled)


def test_an_aborted_belt_runs_only_after_clear(fake: FakeProcess, belt: Conveyor) -> None:
    belt.run(0.2)
    belt.abort()
    assert belt.stop_reason().endswith("aborted by command")
    assert ("no fault is active", False) in belt.permissives()
    for act in (lambda: belt.run(0.1), lambda: belt.move_by(0.1), belt.home):
        with pytest.raises(Refused, match="is refused in state Aborted: clear it first"):
            act()
    assert fake.truth()["velocity"] == 0.0
    belt.clear()
    assert belt.stop_reason() == ""
    belt.run(0.1)


def test_a_fault_aborts_and_is_cleared(fake: FakeProcess, belt: Conveyor) -> None:
    belt.reset()
    belt.start()
    thread_errors: list[Any] = []

    def wait() -> None:
        try:
            belt.wait_for(S.STOPPED, 30.0)
        except DeviceFault as error:
            thread_errors.append(error)

    thread = threading.Thread(target=wait)
    thread.start()
    fake.control.do("emergency", code=0x3210)
    thread.join(30.0)
    assert "fault 3210h, overvoltage of the DC link" in str(thread_errors[0])
    belt.wait_for(S.ABORTED, 30.0)
    assert "fault 3210h" in belt.stop_reason()
    belt.clear()
    assert belt.machine_state() is S.STOPPED
    with pytest.raises(DeviceTimeout, match=r"becoming execute took longer than 0\.2 s"):
        belt.wait_for(S.EXECUTE, 0.2)


def test_without_control_a_machine_is_only_observed(fake: FakeProcess, observed: Conveyor) -> None:
    assert observed.machine_state() is S.STOPPED
    with pytest.raises(NotInControl):
        observed.reset()
    with pytest.raises(NotInControl):
        observed.command(MachineCommand.ABORT)
    assert fake.truth()["writes"] == []
    assert dict(observed.permissives())["control is taken"] is False


# ------------------------------------------------------------------------------------------------ PDO
def test_the_state_arrives_by_pdo_during_control(fake: FakeProcess, belt: Conveyor) -> None:
    """The mapping is written when control is taken (CiA 301, 7.5.2.37: invalid, count 0, entries, count, valid)."""
    writes = [
        (w["index"], w["subindex"], w["data"])
        for w in fake.truth()["writes"]
        if 0x1800 <= w["index"] < 0x1B00 and w["index"] & 1
    ]
    assert writes == [
        (0x1801, 1, "85020080"),
        (0x1A01, 0, "00"),
        (0x1A01, 1, "20006460"),  # 6064h:00, 32 bits
        (0x1A01, 2, "20006c60"),
        (0x1A01, 0, "02"),
        (0x1801, 2, "ff"),
        (0x1801, 5, "0a00"),
        (0x1801, 1, "85020000"),
    ]
    belt.run(0.2)

    def polls() -> int:
        return sum(f["from_host"] and f["data"].startswith("404160") for f in fake.truth()["frames"])

    def nothing_is_polled() -> bool:
        """Return whether 100 PDOs arrived without a poll in between, which a late PDO would cause."""
        before, received = polls(), belt._observer.pdos.received
        wait_for(lambda: belt._observer.pdos.received - received >= 100)
        return polls() == before

    wait_for(nothing_is_polled)
    assert belt.velocity().value == pytest.approx(0.2, abs=0.001)


def test_a_drive_without_pdos_is_polled(fake: FakeProcess, belt: Conveyor) -> None:
    belt.reset()
    for number in (0, 1):
        belt._observer.link.write(_entry(0x1800 + number, 5, "<H"), 0)  # the event timer
    time.sleep(0.3)
    newest = belt._observer.pdos.newest
    assert newest < time.monotonic() - 0.1
    assert belt.position().monotonic > newest
    belt.move_by(0.01, 0.3)
    assert belt.connection is Connection.ONLINE


def test_the_driver_works_without_pdos(fake: FakeProcess, make: Callable[..., Conveyor]) -> None:
    belt = make(fake.ready["can"], pdo_period_ms=0)
    belt.connect()
    belt.take_control()
    assert not [w for w in fake.truth()["writes"] if 0x1800 <= w["index"] < 0x1B00]
    belt.move_by(0.02, 0.3)
    assert belt._observer.pdos.received == 0


def test_a_foreign_nmt_command_ends_control(fake: FakeProcess, belt: Conveyor, wait_for: Callable[..., Any]) -> None:
    """NMT has no owner. The drive reacts as 6007h says; the driver notices and does not retake control."""
    belt.run(0.2)
    foreign = can.Bus(channel=f"socket://{fake.ready['can']}", interface="slcan", bitrate=500000, sleep_after_open=0.0)
    try:
        foreign.send(can.Message(arbitration_id=0, data=[128, 5], is_extended_id=False))  # enter Pre-operational
        fake.control.wait_until(lambda t: t["velocity"] == 0.0)
        wait_for(lambda: belt.control_owner() != "us")
    finally:
        foreign.shutdown()
    with pytest.raises(NotInControl):
        belt.run(0.1)


def _entry(at: int, subindex: int, form: str) -> Any:
    from arcor2_drivers.conveyor.cia402 import Entry

    return Entry(at, subindex, form, "test")


# ------------------------------------------------------------------------------------------------ socketcand
def test_a_belt_runs_over_socketcand(fake: FakeProcess, make: Callable[..., Conveyor]) -> None:
    belt = make(f"{fake.ready['socketcand']}/can0", interface=CanInterface.SOCKETCAND)
    belt.connect()
    assert belt.identify().serial == "1005"
    belt.take_control()
    belt.home()
    belt.move_to(0.05, 0.3)
    assert fake.truth()["position"] == 500
    assert belt._observer.pdos.received > 10
    belt.disconnect()


def test_socketcand_disconnects_and_reconnects(
    fake: FakeProcess, make: Callable[..., Conveyor], wait_for: Callable[..., Any]
) -> None:
    belt = make(f"{fake.ready['socketcand']}/can0", interface=CanInterface.SOCKETCAND)
    belt.connect()
    fake.control.do("reset", wire="socketcand")
    wait_for(lambda: belt.connection, lambda state: state is Connection.BACK)
    assert belt.belt_position() == 0.0


def test_a_bus_refused_by_socketcand_is_reported(fake: FakeProcess, make: Callable[..., Conveyor]) -> None:
    belt = make(f"{fake.ready['socketcand']}/can7", interface=CanInterface.SOCKETCAND)
    with pytest.raises(NotConnected, match="the CAN adapter cannot be reached") as refused:
        belt.connect(1.0)
    assert "could not open bus" in refused.value.detail


def test_a_silent_socketcand_server_times_out(make: Callable[..., Conveyor]) -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        belt = make("{}:{}/can0".format(*server.getsockname()), interface=CanInterface.SOCKETCAND)
        with pytest.raises(DeviceTimeout, match=r"cannot be reached within 0\.4 s"):
            belt.connect(0.4)


def test_socketcand_frames_byte_for_byte() -> None:
    """Protocol messages in one stream, split anywhere (from general knowledge of it, see the driver's module)."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        sent: list[bytes] = []
        done = threading.Event()

        def serve() -> None:
            connection, _ = server.accept()
            with connection:
                connection.sendall(b"< hi >")
                for _ in range(2):
                    sent.append(connection.recv(100))
                    connection.sendall(b"< ok >")
                connection.sendall(b"< frame 185 1.5 37020100")
                time.sleep(0.02)
                connection.sendall(b"00 >< frame 705 2.000000 7F >< frame 18FF1234 2.5  >")
                sent.append(connection.recv(100))
                done.wait(30.0)

        thread = threading.Thread(target=serve)
        thread.start()
        bus = SocketcandBus("can0", *server.getsockname(), timeout=30.0)
        try:
            frames = [bus.recv(2.0) for _ in range(3)]
            bus.send(can.Message(arbitration_id=0x605, data=bytes.fromhex("4041600000000000"), is_extended_id=False))
            assert bus.recv(0.05) is None
        finally:
            done.set()
            thread.join()
            bus.shutdown()
    assert [(f.arbitration_id, bytes(f.data), f.is_extended_id) for f in frames if f is not None] == [
        (0x185, bytes.fromhex("3702010000"), False),
        (0x705, b"\x7f", False),
        (0x18FF1234, b"", True),
    ]
    assert sent == [b"< open can0 >", b"< rawmode >", b"< send 605 8 40 41 60 0 0 0 0 0 >"]


@pytest.mark.parametrize("channel", ["can0", "socket://127.0.0.1:29536", "socket://127.0.0.1/can0"])
def test_socketcand_channels_are_parsed(channel: str) -> None:
    with pytest.raises(OutOfRange, match=r"^channel must be socket://host:port"):
        ConveyorSettings(channel, interface=CanInterface.SOCKETCAND)
