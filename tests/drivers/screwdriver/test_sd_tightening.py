"""The screwdriver's driver on its fake: programs, jobs, tightenings and alarms."""

from collections.abc import Callable
from typing import Any

import pytest

from arcor2_drivers.screwdriver.screwdriver import OpenProtocolScrewdriver
from arcor2_drivers.screwdriver.settings import OpenProtocolScrewdriverSettings
from arcor2_hw.data.device import Connection, Health, Identity, Severity
from arcor2_hw.exceptions import (
    Cancelled,
    DeviceFault,
    DeviceTimeout,
    NotFound,
    NotInControl,
    OutOfRange,
    Refused,
)
from tests.drivers.background_call import BackgroundCall
from tests.fakes.conftest import FakeProcess

OBSERVING = {"0001", "0060", "0070", "0062", "0072", "0075", "0077", "9999", "0003"}
"""Messages that change nothing at the controller."""


def test_connecting_only_subscribes(
    fake: FakeProcess, make: Callable[..., OpenProtocolScrewdriver], wait_for: Callable[..., Any]
) -> None:
    screwdriver = make(fake.ready["open_protocol"])
    screwdriver.connect()
    screwdriver.connect()  # it does nothing when connected
    assert screwdriver.connection is Connection.ONLINE
    assert screwdriver.health is Health.NORMAL
    assert screwdriver.ready()
    assert screwdriver.identify() == Identity("FKE", "Fake controller", "SN00012345", "1.4.0")
    for refused in (screwdriver.enable_tool, screwdriver.tighten, lambda: screwdriver.select_program(2)):
        with pytest.raises(NotInControl, match="nobody has control"):
            refused()
    screwdriver.disconnect()
    wait_for(lambda: fake.truth()["clients"] == 0)
    assert fake.truth()["received"][:3] == ["0001", "0060", "0070"]
    assert set(fake.truth()["received"]) <= OBSERVING


def test_selecting_a_program_and_a_job(fake: FakeProcess, screwdriver: OpenProtocolScrewdriver) -> None:
    screwdriver.select_program(7)
    screwdriver.select_job(3)
    assert (fake.truth()["program"], fake.truth()["job"]) == (7, 3)
    with pytest.raises(Refused, match=r"refused MID 0018 \(select program\): this program does not exist \(error 2\)"):
        screwdriver.select_program(11)
    for job in (6, 1234):  # two digits in revision 1, four in revision 2
        with pytest.raises(Refused, match=r"MID 0038 \(select job\): this job does not exist \(error 17\)"):
            screwdriver.select_job(job)
    screwdriver.select_job(0)
    assert (fake.truth()["program"], fake.truth()["job"]) == (7, 0)


@pytest.mark.parametrize(
    ("planned", "expected"),
    [
        ([(12.34, 56)], (True, 12.34, 56.0)),
        ([(3.1, 12)], (False, 3.1, 12.0)),
        ([(12.0, 50), (99.99, 50), (11.5, 89)], (False, 11.5, 89.0)),
        ([(12.0, 50), (12.5, 60), (11.5, 89)], (True, 11.5, 89.0)),
    ],
)
def test_tightening_returns_ok_torque_and_angle(
    fake: FakeProcess,
    screwdriver: OpenProtocolScrewdriver,
    planned: list[tuple[float, int]],
    expected: tuple[bool, float, float],
) -> None:
    for torque, angle in planned:
        fake.control.do("plan", torque=torque, angle=angle)
    fake.control.do("pull", times=len(planned))
    assert screwdriver.tighten(len(planned)) == expected
    assert screwdriver.last_result()[1:] == expected[1:]
    truth = fake.truth()
    assert (truth["enabled"], truth["made"]) == (False, len(planned))


def test_the_tool_is_disabled_after_the_wanted_number(fake: FakeProcess, screwdriver: OpenProtocolScrewdriver) -> None:
    fake.control.do("pull", times=5)
    screwdriver.tighten(2)
    truth = fake.truth()
    assert not truth["enabled"]
    assert truth["made"] in (2, 3)  # the third may have started before the tool was disabled


def test_results_count_from_the_call_on(
    fake: FakeProcess, screwdriver: OpenProtocolScrewdriver, wait_for: Callable[..., Any]
) -> None:
    with pytest.raises(Refused, match="has reported no result yet"):
        screwdriver.last_result()
    fake.control.do("plan", torque=1.0, angle=1)
    fake.control.do("tighten")
    wait_for(lambda: fake.truth()["made"] == 1 and not fake.truth()["unacknowledged"])
    assert screwdriver.last_result() == (False, 1.0, 1.0)
    fake.control.do("plan", torque=12.0, angle=55)
    fake.control.do("pull")
    assert screwdriver.tighten() == (True, 12.0, 55.0)


def test_the_tool_is_enabled_and_disabled(fake: FakeProcess, screwdriver: OpenProtocolScrewdriver) -> None:
    screwdriver.enable_tool()
    assert fake.truth()["enabled"]
    screwdriver.disable_tool()
    assert not fake.truth()["enabled"]


@pytest.mark.parametrize("leave", ["release_control", "disconnect", "stop"])
def test_leaving_disables_an_enabled_tool(
    fake: FakeProcess, screwdriver: OpenProtocolScrewdriver, wait_for: Callable[..., Any], leave: str
) -> None:
    screwdriver.enable_tool()
    getattr(screwdriver, leave)()
    wait_for(lambda: not fake.truth()["enabled"])


def test_releasing_control_of_a_disabled_tool_sends_nothing(
    fake: FakeProcess, screwdriver: OpenProtocolScrewdriver
) -> None:
    screwdriver.release_control()
    assert set(fake.truth()["received"]) <= OBSERVING


# ------------------------------------------------------------------------------------------------ stop and time limit
def test_stop_disables_the_tool_and_cancels(
    fake: FakeProcess, screwdriver: OpenProtocolScrewdriver, wait_for: Callable[..., Any]
) -> None:
    call = BackgroundCall(screwdriver.tighten, 1, 30.0)
    wait_for(lambda: fake.truth()["enabled"])
    screwdriver.stop()
    assert not fake.truth()["enabled"]
    with pytest.raises(Cancelled, match="tighten was stopped"):
        call.result()


def test_the_result_of_a_stopped_tightening_does_not_count_for_the_next(
    start_fake: Callable[..., FakeProcess], make: Callable[..., OpenProtocolScrewdriver], wait_for: Callable[..., Any]
) -> None:
    fake = start_fake("screwdriver", "--duration", "0.3", "--evaluation", "0.5")
    screwdriver = make(fake.ready["open_protocol"])
    screwdriver.connect()
    screwdriver.take_control()
    fake.control.do("pull")
    call = BackgroundCall(screwdriver.tighten, 1, 30.0)
    wait_for(lambda: fake.truth()["running"])
    screwdriver.stop()
    with pytest.raises(Cancelled):
        call.result()
    fake.control.do("plan", torque=12.0, angle=55)
    fake.control.do("pull")
    assert screwdriver.tighten() == (True, 12.0, 55.0)
    assert fake.truth()["made"] == 2


def test_missing_tightenings_end_with_a_timeout(fake: FakeProcess, screwdriver: OpenProtocolScrewdriver) -> None:
    fake.control.do("pull")
    with pytest.raises(DeviceTimeout, match=r"^screwdriver at 127.0.0.1:\d+: 3 tightenings took longer than 1 s$"):
        screwdriver.tighten(3, 1.0)
    assert not fake.truth()["enabled"]
    assert screwdriver.connection is Connection.ONLINE


# ------------------------------------------------------------------------------------------------ alarms
def test_an_alarm_ends_a_tightening_and_is_acknowledged(
    fake: FakeProcess, screwdriver: OpenProtocolScrewdriver, wait_for: Callable[..., Any]
) -> None:
    call = BackgroundCall(screwdriver.tighten, 1, 30.0)
    wait_for(lambda: fake.truth()["enabled"])
    fake.control.do("alarm", code="E404", text="Tool overheated")
    with pytest.raises(DeviceFault, match="one tightening is not possible: alarm E404 Tool overheated") as caught:
        call.result()
    assert caught.value.fault_code == "E404"
    assert not fake.truth()["enabled"]
    [alarm] = screwdriver.alarms()
    assert (alarm.code, alarm.severity, alarm.text) == ("E404", Severity.ERROR, "Tool overheated")
    assert screwdriver.alarms() == [alarm]  # with the same time
    assert screwdriver.health is Health.FAILURE
    assert not screwdriver.ready()
    with pytest.raises(DeviceFault, match="E404"):
        screwdriver.enable_tool()
    assert not fake.truth()["enabled"]
    with pytest.raises(NotFound, match="has no alarm E405"):
        screwdriver.acknowledge("E405")
    screwdriver.acknowledge("E404")
    assert fake.truth()["alarm"] is None
    assert screwdriver.alarms() == []
    assert screwdriver.health is Health.NORMAL
    assert {"0072", "0075"} <= set(fake.truth()["received"])


def test_a_warning_does_not_end_a_tightening(
    fake: FakeProcess, screwdriver: OpenProtocolScrewdriver, wait_for: Callable[..., Any]
) -> None:
    call = BackgroundCall(screwdriver.tighten, 1, 30.0)
    wait_for(lambda: fake.truth()["enabled"])
    fake.control.do("alarm", code="W010", text="Service due", tool_ready=True)
    wait_for(lambda: screwdriver.health is Health.CHECK_FUNCTION)
    [alarm] = screwdriver.alarms()
    assert alarm.severity is Severity.WARNING
    assert screwdriver.ready()
    fake.control.do("pull")
    assert call.result()[0]
    fake.control.do("clear_alarm")  # by the operator
    wait_for(lambda: screwdriver.health is Health.NORMAL)


@pytest.mark.parametrize(
    ("revision", "text"), [("2", "alarm E404 of the controller"), ("1", "alarm E404 of the controller")]
)
def test_an_alarm_from_before_the_connection_is_reported(
    start_fake: Callable[..., FakeProcess],
    make: Callable[..., OpenProtocolScrewdriver],
    wait_for: Callable[..., Any],
    revision: str,
    text: str,
) -> None:
    fake = start_fake("screwdriver", "--alarm-revision", revision)
    fake.control.do("alarm")
    screwdriver = make(fake.ready["open_protocol"])
    screwdriver.connect()
    [alarm] = wait_for(screwdriver.alarms)
    assert (alarm.code, alarm.text) == ("E404", text)
    wait_for(lambda: "0077" in fake.truth()["received"])


def test_a_controller_without_alarms_can_be_used(
    start_fake: Callable[..., FakeProcess], make: Callable[..., OpenProtocolScrewdriver]
) -> None:
    fake = start_fake("screwdriver", "--alarm-revision", "0", "--start-revision", "1")
    screwdriver = make(fake.ready["open_protocol"])
    screwdriver.connect()
    assert screwdriver.identify() == Identity("", "Fake controller", "", "")
    assert screwdriver.alarms() == []
    assert fake.truth()["received"].count("0001") == 6  # one for each revision


# ------------------------------------------------------------------------------------------------ revisions
@pytest.mark.parametrize("options", [("--result-revision", "1"), ("--result-revision", "2"), ("--binary",)])
def test_results_of_each_revision(
    start_fake: Callable[..., FakeProcess], make: Callable[..., OpenProtocolScrewdriver], options: tuple[str, ...]
) -> None:
    fake = start_fake("screwdriver", "--duration", "0.1", *options)
    screwdriver = make(fake.ready["open_protocol"])
    screwdriver.connect()
    screwdriver.take_control()
    for torque, angle in ((12.5, 33), (13.9, 1)):
        fake.control.do("plan", torque=torque, angle=angle)
    fake.control.do("pull", times=2)
    assert screwdriver.tighten(2) == (False, 13.9, 1.0)


def test_a_job_number_above_99_needs_revision_2(
    start_fake: Callable[..., FakeProcess], make: Callable[..., OpenProtocolScrewdriver]
) -> None:
    fake = start_fake("screwdriver", "--job-revision", "1")
    screwdriver = make(fake.ready["open_protocol"])
    screwdriver.connect()
    screwdriver.take_control()
    screwdriver.select_job(5)
    with pytest.raises(Refused, match="it does not support this revision of the message"):
        screwdriver.select_job(100)
    assert fake.truth()["job"] == 5


# ------------------------------------------------------------------------------------------------ refusals
def test_disabled_commands_are_named(fake: FakeProcess, screwdriver: OpenProtocolScrewdriver) -> None:
    fake.control.do("disable_commands")
    owner = "an input of the controller, which disables commands of Open Protocol, has control"
    with pytest.raises(NotInControl, match=rf"refused MID 0043 \(enable tool\): {owner} \(error 92\)"):
        screwdriver.tighten()
    assert not fake.truth()["enabled"]


def test_a_program_is_not_selected_during_a_tightening(
    fake: FakeProcess, screwdriver: OpenProtocolScrewdriver, wait_for: Callable[..., Any]
) -> None:
    fake.control.do("pull", times=20)
    call = BackgroundCall(screwdriver.tighten, 20, 30.0)
    wait_for(lambda: fake.truth()["running"])
    with pytest.raises(Refused, match="the program cannot be selected now"):
        screwdriver.select_program(2)
    with pytest.raises(Refused, match=r"is busy \(tighten\)"):
        screwdriver.tighten()
    screwdriver.stop()
    with pytest.raises(Cancelled):
        call.result()


@pytest.mark.parametrize(
    ("name", "value"),
    [("host", ""), ("port", 0), ("answer_timeout", 0.0), ("keep_alive", 14.0), ("keep_alive", float("nan"))],
)
def test_settings_out_of_range_name_the_parameter(name: str, value: Any) -> None:
    with pytest.raises(OutOfRange, match=f"^{name} must be"):
        OpenProtocolScrewdriverSettings(**{"host": "10.0.0.7", name: value})


@pytest.mark.parametrize(
    "call",
    [
        lambda device: device.select_program(0),
        lambda device: device.select_program(1000),
        lambda device: device.select_job(10_000),
        lambda device: device.tighten(0),
        lambda device: device.tighten(1, 0.0),
    ],
)
def test_parameters_out_of_range_send_nothing(
    fake: FakeProcess, screwdriver: OpenProtocolScrewdriver, call: Callable[[OpenProtocolScrewdriver], object]
) -> None:
    with pytest.raises(AssertionError):
        call(screwdriver)
    assert set(fake.truth()["received"]) <= OBSERVING


@pytest.mark.parametrize("revision", [2, 1])
def test_the_counters_of_the_tool_are_read(
    fake: FakeProcess, screwdriver: OpenProtocolScrewdriver, wait_for: Callable[..., Any], revision: int
) -> None:
    fake.control.do("tool_data_revision", revision=revision)
    assert screwdriver.counters()["tightenings"] == 0
    for made in (1, 2):
        fake.control.do("tighten")
        wait_for(lambda made=made: screwdriver.counters()["tightenings"] == made)
        if made == 1:
            fake.control.do("service")
    assert screwdriver.counters().get("tightenings since service") == (1 if revision == 2 else None)
    fake.control.do("tool_data_revision", revision=0)
    assert screwdriver.counters() == {}  # a controller without this message
    assert screwdriver.connection is Connection.ONLINE
