"""Points: types, units, time stamps and quality; edges in order; missing and read-only points."""

import time
from collections.abc import Callable
from datetime import UTC, datetime
from typing import Any

import pytest

from arcor2_drivers.opcua_plc.opcua_plc import OpcUaPlc
from arcor2_drivers.opcua_plc.points import parse_handshake, parse_points
from arcor2_drivers.opcua_plc.settings import OpcUaPlcSettings
from arcor2_hw.data.device import Connection, Health, Quality
from arcor2_hw.exceptions import Cancelled, DeviceFault, DeviceTimeout, OutOfRange, Refused
from arcor2_hw.objects.edges import Edge
from tests.drivers.opcua_plc.conftest import HANDSHAKE, BackgroundCall
from tests.fakes.conftest import FakeProcess

URL = "opc.tcp://127.0.0.1:4840"


def test_connecting_writes_nothing_and_reads_the_identity(fake: FakeProcess, make: Callable[..., OpcUaPlc]) -> None:
    before = fake.truth()["writes"]
    plc = make(fake.ready["url"])
    plc.connect()
    identity = plc.identify()
    assert (identity.vendor, identity.model, identity.firmware) == ("ARCOR2-HW", "Fake PLC 1500", "2.9")
    assert plc.control_owner() is None
    plc.disconnect()
    assert fake.truth()["writes"] == before


def test_each_kind_is_read_and_written_in_its_unit_and_type(fake: FakeProcess, plc: OpcUaPlc) -> None:
    assert plc.read_digital("door") is True
    assert plc.read_analog("level") == pytest.approx(0.5)
    assert plc.read_analog("temperature") == pytest.approx(21.5)
    plc.write_digital("lamp", True)
    plc.write_analog("speed", 1.25)
    plc.write_analog("pressure", -2.5e5)
    points = fake.truth()["points"]
    assert (points["Lamp"], points["Speed"], points["Pressure"]) == (True, 125, -2.5e5)
    assert plc.read_analog("speed") == pytest.approx(1.25)
    fake.control.do("set", name="Level", value=-7)
    assert plc.read_analog("level") == pytest.approx(-0.007)
    assert {point.name: point.unit for point in plc.points()}["speed"] == "m/s"


def test_values_carry_the_source_time(fake: FakeProcess, observed: OpcUaPlc) -> None:
    before = datetime.now(UTC)
    fake.control.do("set", name="Level", value=123)
    after = datetime.now(UTC)
    time.sleep(3.0)
    reading = observed.read("level")
    assert before <= datetime.fromisoformat(reading.stamp) <= after
    assert reading.age < 2.9, "the age counts from the request, not from the change"
    assert reading.quality is Quality.GOOD


@pytest.mark.parametrize(
    ("status", "quality"),
    [
        ("UncertainLastUsableValue", Quality.UNCERTAIN),
        ("UncertainSensorNotAccurate", Quality.UNCERTAIN),
        ("BadSensorFailure", Quality.BAD),
        ("BadOutOfService", Quality.BAD),
    ],
)
def test_quality_comes_from_the_status(
    fake: FakeProcess, observed: OpcUaPlc, wait_for: Any, status: str, quality: Quality
) -> None:
    fake.control.do("quality", name="Level", status=status)
    try:
        if quality is Quality.BAD:  # a server sends no value then
            with pytest.raises(DeviceFault, match=f"plc at opc.tcp.*level has no value: {status}") as fault:
                observed.read_analog("level")
            assert fault.value.fault_code == status
            wait_for(lambda: [alarm.code for alarm in observed.alarms()], lambda codes: codes == ["bad_level"])
            assert observed.health is Health.CHECK_FUNCTION
        else:
            assert observed.read("level").quality is quality
            assert observed.read_analog("level") == pytest.approx(0.5)
            assert observed.alarms() == []
    finally:
        fake.control.do("quality", name="Level", status="Good")
    wait_for(observed.alarms, lambda alarms: alarms == [])


def test_edges_are_reported_once_and_in_order(fake: FakeProcess, observed: OpcUaPlc, wait_for: Any) -> None:
    edges: list[Edge] = []
    end = observed.subscribe("part", edges.append)
    other: list[Edge] = []
    observed.subscribe("door", other.append)
    for number, value in enumerate((True, False, True, False, True), 1):
        fake.control.do("set", name="PartPresent", value=value)
        wait_for(lambda number=number: len(edges) >= number)
    assert [edge.value for edge in edges] == [True, False, True, False, True]
    assert [edge.stamp for edge in edges] == sorted(edge.stamp for edge in edges)
    assert other == []
    end()
    fake.control.do("set", name="PartPresent", value=False)
    observed.wait_for("part", False, 30.0)
    assert len(edges) == 5


def test_wait_for_returns_at_the_condition(fake: FakeProcess, observed: OpcUaPlc) -> None:
    observed.wait_for("door", True, 0.0)
    with pytest.raises(DeviceTimeout, match=r"plc at opc.tcp.*part becoming on took longer"):
        observed.wait_for("part", True, 0.1)
    waiting = BackgroundCall(lambda: observed.wait_for("part", True, 10.0))
    time.sleep(0.1)
    fake.control.do("set", name="PartPresent", value=True)
    assert waiting.outcome() is None
    waiting = BackgroundCall(lambda: observed.wait_for("part", False, 30.0))
    time.sleep(0.1)
    observed.stop()
    assert isinstance(waiting.outcome(), Cancelled)


def test_unwritable_points_are_refused(fake: FakeProcess, plc: OpcUaPlc) -> None:
    before = [each for each in fake.truth()["written"] if each[0].startswith("Cell.")]
    with pytest.raises(Refused, match="part is an input"):
        plc.write_digital("part", True)
    with pytest.raises(Refused, match="level is analogue"):
        plc.write_digital("level", True)
    with pytest.raises(Refused, match="lamp is digital"):
        plc.read_analog("lamp")
    with pytest.raises(OutOfRange, match=r"speed must be 0 to 655.35 m/s"):
        plc.write_analog("speed", -0.01)
    with pytest.raises(OutOfRange, match="pressure must be a finite number"):
        plc.write_analog("pressure", float("nan"))
    with pytest.raises(OutOfRange, match=r"no point 'lamb'. Available: part"):
        plc.write_digital("lamb", True)
    assert [each for each in fake.truth()["written"] if each[0].startswith("Cell.")] == before


def test_a_read_only_variable_is_named(fake: FakeProcess, make: Callable[..., OpcUaPlc]) -> None:
    plc = make(fake.ready["url"], points="part=DO ns=2;s=Cell.PartPresent")
    plc.connect()
    plc.take_control()
    with pytest.raises(Refused, match=r"writing part \(ns=2;s=Cell.PartPresent\): BadUserAccessDenied"):
        plc.write_digital("part", True)


@pytest.mark.parametrize(
    ("points", "problem"),
    [
        ("lamp=DO ns=2;s=Cell.Lamb", r"lamp \(ns=2;s=Cell.Lamb\) does not exist: BadNodeIdUnknown"),
        ("level=DI ns=2;s=Cell.Level", r"level \(ns=2;s=Cell.Level\) is Int16, not Boolean"),
        ("recipe=AI ns=2;s=Cell.Recipe", "is String, not a number"),
    ],
)
def test_a_node_that_is_missing_or_of_another_type_is_named(
    fake: FakeProcess, make: Callable[..., OpcUaPlc], points: str, problem: str
) -> None:
    plc = make(fake.ready["url"], points=points)
    with pytest.raises(DeviceFault, match=f"plc at opc.tcp.*{problem}"):
        plc.connect()
    assert plc.connection is Connection.FAILED


def test_control_requires_a_handshake(fake: FakeProcess, make: Callable[..., OpcUaPlc]) -> None:
    plc = make(fake.ready["url"], handshake="")
    plc.connect()
    with pytest.raises(Refused, match="the setting handshake is empty"):
        plc.take_control()
    plc.write_digital("valve", True)
    assert fake.truth()["points"]["Valve"] is True
    with pytest.raises(Refused, match="handshake is empty"):
        plc.run_job(1)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "part",
        "part=DI",
        "part=XX ns=2;s=A",
        "part=DI Cell",
        "part=DI ns=2;s=A | part=DI ns=2;s=B",
        "1part=DI ns=2;s=A",
        "part=DI ns=2;s=A scale=2",
        "level=AI ns=2;s=A scale=0",
        "level=AI ns=2;s=A scale=nan",
        "lamp=DO ns=2;s=A on_loss=maybe",
    ],
)
def test_invalid_points_are_refused(text: str) -> None:
    with pytest.raises(OutOfRange, match="points must"):
        parse_points(text)


def test_node_ids_of_each_kind() -> None:
    ids = (
        "i=85",
        "ns=3;i=7",
        'ns=3;s="DB1"."Part"',
        "g=09087e75-8e5e-499b-954f-f2a9603db28a",
        "ns=1;b=M/RbKBsRVkePCePcx24oRA==",
    )
    for node in ids:
        assert parse_points(f"p=DI {node}")["p"].node == node


@pytest.mark.parametrize("without", ["owner", "code", "plc_life"])
def test_a_handshake_is_complete_or_empty(without: str) -> None:
    assert parse_handshake("") == {}
    parts = [part for part in HANDSHAKE.split(" | ") if not part.startswith(f"{without}=")]
    with pytest.raises(OutOfRange, match=f"handshake must give {without} too"):
        parse_handshake(" | ".join(parts))


@pytest.mark.parametrize(
    ("settings", "named"),
    [
        ({"url": "http://x"}, "url"),
        ({"url": "opc.tcp://me:word@x"}, "url"),
        ({"host_number": 0}, "host_number"),
        ({"plc_patience": 3.0}, "plc_patience"),
        ({"life_timeout": 0.0}, "life_timeout"),
        ({"request_timeout": 1.5, "plc_patience": 1.0}, "request_timeout"),
        ({"user": "me"}, "password_file"),
        ({"security": "basic256sha256_sign"}, "client_certificate"),
        ({"server_certificate": "x"}, "server_certificate"),
    ],
)
def test_an_invalid_setting_is_named(settings: dict[str, Any], named: str) -> None:
    with pytest.raises(OutOfRange, match=named):
        OpcUaPlcSettings(**{"url": URL, "points": "p=DI i=1", **settings})
