"""The functional tester's driver on a fake without faults: observing, commands and refusals."""

from collections.abc import Callable
from typing import Any

import pytest

from arcor2_drivers.functional_tester.functional_tester import FunctionalTester
from arcor2_hw.data.device import Connection, Health, Identity
from arcor2_hw.exceptions import Cancelled, DeviceFault, DeviceTimeout, NotFound, NotInControl, Refused, SafetyStop
from arcor2_hw.objects import MachineCommand, MachineState, UnitMode
from tests.drivers.background_call import BackgroundCall
from tests.fakes.conftest import FakeProcess

READS = {2, 3, 4, 43}
"""Function codes that only read."""


def functions(fake: FakeProcess) -> set[int]:
    """Return the function codes of the last requests on the wire."""
    return {int(frame["hex"][14:16], 16) for frame in fake.truth()["frames"] if not frame["to_host"]}


def test_connecting_observes_and_writes_nothing(fake: FakeProcess, observed: FunctionalTester) -> None:
    observed.connect()  # has no effect when connected
    assert observed.connection is Connection.ONLINE
    assert observed.identify() == Identity("Fake Test Systems", "FT-100", "", "1.2")
    assert observed.machine_state() is MachineState.STOPPED
    assert observed.unit_mode() is UnitMode.PRODUCE
    assert observed.health is Health.NORMAL
    assert not observed.board_present()
    assert observed.control_owner() is None
    with pytest.raises(NotInControl, match=f"tester at {fake.ready['modbus']}: open_door is refused in state Stopped"):
        observed.open_door()
    observed.stop()  # without control, stop sends nothing
    truth = fake.truth()
    assert functions(fake) <= READS
    assert (truth["watchdog_ms"], truth["last_command"], truth["door"]) == (0, None, "closed")


def test_a_complete_cycle(fake: FakeProcess, tester: FunctionalTester) -> None:
    assert tester.control_owner() == "us"
    assert fake.truth()["watchdog_ms"] == 2000
    for number, (code, defect, passes) in enumerate(
        [("B-1", None, True), ("B-2", "short", False), ("B-3", None, True)], start=1
    ):
        tester.open_door()
        assert fake.truth()["door"] == "open"
        if number > 1:
            fake.control.do("take_board")
        fake.control.do("put_board", code=code, defect=defect)
        tester.close_door()
        assert fake.truth()["door"] == "closed"
        assert tester.board_present()
        assert tester.test(number) is passes
        result = fake.truth()["results"][-1]
        assert (result["number"], result["code"], result["program"]) == (number, code, number)
        for name in ("supply_voltage", "supply_current", "contact_resistance"):
            assert getattr(tester, name)() == pytest.approx(result["measured"][name], rel=1e-6)
    assert tester.counters() == {"tested": 3, "passed": 2, "failed": 1}
    assert tester.machine_state() is MachineState.COMPLETE
    tester.disconnect()
    assert tester.connection is Connection.OFFLINE
    assert fake.truth()["watchdog_ms"] == 0


def test_the_same_board_twice_gives_two_results(fake: FakeProcess, loaded: FunctionalTester) -> None:
    assert loaded.test()
    assert loaded.test()
    assert fake.truth()["tested"] == 2


def test_measured_values_need_a_test(tester: FunctionalTester) -> None:
    with pytest.raises(Refused, match="supply_voltage is refused in state Stopped: nothing was tested"):
        tester.supply_voltage()


@pytest.mark.parametrize("program", [0, 10])
def test_program_out_of_range_sends_nothing(fake: FakeProcess, loaded: FunctionalTester, program: int) -> None:
    before = fake.truth()["last_command"]
    with pytest.raises(AssertionError):
        loaded.test(program)
    assert fake.truth()["last_command"] == before


# ------------------------------------------------------------------------------------------------ refusals
def test_start_is_refused_without_board_or_with_the_door_open(fake: FakeProcess, tester: FunctionalTester) -> None:
    with pytest.raises(Refused, match="start is refused in state Idle: the fixture is empty"):
        tester.test()
    tester.open_door()
    assert dict(tester.permissives())["door closed"] is False
    with pytest.raises(Refused, match="start is refused in state Idle: the door is not closed"):
        tester.test()
    assert fake.truth()["tested"] == 0


def test_refused_commands_name_command_and_state(tester: FunctionalTester) -> None:
    address = "tester at 127.0.0.1:"
    with pytest.raises(Refused, match=f"^{address}.*hold is refused in state Stopped: this state does not allow it"):
        tester.command(MachineCommand.HOLD)
    with pytest.raises(Refused, match="clear is refused in state Stopped"):
        tester.clear()
    with pytest.raises(Refused, match="suspend is refused in state Stopped: it has no such command"):
        tester.command(MachineCommand.SUSPEND)


def test_hold_and_door_during_a_test(fake: FakeProcess, loaded: FunctionalTester, wait_for: Callable[..., Any]) -> None:
    doing = BackgroundCall(loaded.test)
    wait_for(lambda: fake.truth()["state"], lambda state: state == "Execute")
    loaded.command(MachineCommand.HOLD)
    loaded.wait_for(MachineState.HELD, 30.0)
    with pytest.raises(Refused, match="open_door is refused in state Held"):
        loaded.open_door()
    with pytest.raises(Refused, match="release_control is refused in state Held"):
        loaded.release_control()
    with pytest.raises(Refused, match="start is refused in state Held"):
        loaded.test()
    with pytest.raises(DeviceTimeout, match=r"reaching Idle took longer than 0\.1 s"):
        loaded.wait_for(MachineState.IDLE, 0.1)
    loaded.command(MachineCommand.UNHOLD)
    assert doing.outcome() is True
    assert fake.truth()["door"] == "closed"


def test_the_key_switch_ends_control(fake: FakeProcess, tester: FunctionalTester, wait_for: Callable[..., Any]) -> None:
    fake.control.do("mode", mode="manual")
    with pytest.raises(NotInControl, match=r"open_door is refused in state Stopped: the key switch .*\(manual\)"):
        tester.open_door()
    with pytest.raises(NotInControl, match="control is refused: the key switch"):
        tester.take_control()
    assert tester.health is Health.CHECK_FUNCTION
    fake.control.do("mode", mode="produce")
    tester.open_door()


def test_control_is_refused_during_another_hosts_test(
    start_fake: Callable[..., FakeProcess], make: Callable[..., FunctionalTester], wait_for: Callable[..., Any]
) -> None:
    fake = start_fake("functional_tester", "--test-time", "1.0")
    fake.control.do("push_door", opening=True)
    fake.control.do("put_board", code="B")
    fake.control.do("push_door", opening=False)
    fake.control.do("command", name="reset")
    wait_for(lambda: fake.truth()["state"], lambda state: state == "Idle")
    fake.control.do("command", name="start")
    tester = make(fake.ready["modbus"])
    tester.connect()
    with pytest.raises(NotInControl, match="another client, which started a test"):
        tester.take_control()
    tester.stop()
    wait_for(lambda: fake.truth()["state"], lambda state: state == "Complete")
    assert fake.truth()["watchdog_ms"] == 0


# ------------------------------------------------------------------------------------------------ stop and faults
def test_stop_ends_a_test_without_result(
    fake: FakeProcess, loaded: FunctionalTester, wait_for: Callable[..., Any]
) -> None:
    doing = BackgroundCall(loaded.test)
    wait_for(lambda: fake.truth()["state"], lambda state: state == "Execute")
    loaded.stop()
    assert fake.truth()["state"] == "Stopped"
    assert isinstance(doing.outcome(), Cancelled)
    assert fake.truth()["tested"] == 0
    loaded.stop()  # has no effect when stopped
    assert loaded.test() is True


def test_a_stop_at_the_station_cancels_the_test(
    fake: FakeProcess, loaded: FunctionalTester, wait_for: Callable[..., Any]
) -> None:
    doing = BackgroundCall(loaded.test)
    wait_for(lambda: fake.truth()["state"], lambda state: state == "Execute")
    fake.control.do("command", name="stop")
    outcome = doing.outcome()
    assert isinstance(outcome, Cancelled)
    assert "stopped at the station" in str(outcome)


def test_a_test_that_takes_too_long_is_stopped(
    start_fake: Callable[..., FakeProcess], make: Callable[..., FunctionalTester]
) -> None:
    fake = start_fake("functional_tester", "--test-time", "20")
    fake.control.do("push_door", opening=True)
    fake.control.do("put_board", code="B")
    fake.control.do("push_door", opening=False)
    tester = make(fake.ready["modbus"], test_timeout=1.0)
    tester.connect()
    tester.take_control()
    with pytest.raises(DeviceTimeout, match="test with program 1 took longer than 1 s"):
        tester.test()
    assert fake.truth()["state"] == "Stopped"


@pytest.mark.parametrize(
    ("code", "text", "health"),
    [
        (101, "board lost during the test; put the board in, then acknowledge", Health.CHECK_FUNCTION),
        (102, "door opened during the test; close the door, then acknowledge", Health.CHECK_FUNCTION),
        (
            103,
            "no contact to the board; clean the pins, check the position of the board, then acknowledge",
            Health.MAINTENANCE_REQUIRED,
        ),
        (104, "supply overload; take the board out, then acknowledge", Health.OFF_SPEC),
        (105, "host lost; check the network, then acknowledge", Health.CHECK_FUNCTION),
        (106, "emergency stop; release the button, then acknowledge", Health.CHECK_FUNCTION),
    ],
)
def test_each_fault_is_named_with_its_remedy_and_cleared(
    fake: FakeProcess, loaded: FunctionalTester, code: int, text: str, health: Health
) -> None:
    fake.control.do("fault", code=code, armed=True)
    kind = SafetyStop if code == 106 else DeviceFault
    with pytest.raises(kind, match=f"^tester at .*test with program 1 ended: fault {code}, {text}$") as raised:
        loaded.test()
    if isinstance(raised.value, DeviceFault):
        assert raised.value.fault_code == code
    loaded.wait_for(MachineState.ABORTED, 30.0)
    [alarm] = loaded.alarms()
    assert (alarm.code, f"{alarm.text}; {alarm.remedy}") == (str(code), text)
    assert loaded.health is health
    assert loaded.stop_reason() == f"fault {code}: {text.split(';')[0]}"
    with pytest.raises(kind, match="test is refused in state Aborted"):
        loaded.test()
    with pytest.raises(NotFound, match="no alarm 99"):
        loaded.acknowledge("99")
    if code == 106:
        with pytest.raises(Refused, match="clear is refused in state Aborted: the emergency stop is pressed"):
            loaded.acknowledge("106")
        with pytest.raises(SafetyStop, match="open_door is refused in state Aborted: the emergency stop is pressed"):
            loaded.open_door()
        fake.control.do("emergency_stop", pressed=False)
    if code == 102:
        fake.control.do("push_door", opening=False)
    loaded.acknowledge(str(code))
    assert loaded.alarms() == []
    assert loaded.health is Health.NORMAL
    assert fake.truth()["state"] == "Stopped"
    assert loaded.test() is True


def test_abort_and_clear(fake: FakeProcess, tester: FunctionalTester) -> None:
    tester.abort()
    assert fake.truth()["state"] == "Aborted"
    assert tester.stop_reason() == "aborted by command"
    tester.clear()
    tester.reset()
    assert fake.truth()["state"] == "Idle"
