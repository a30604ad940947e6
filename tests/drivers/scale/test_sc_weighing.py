"""The scale's driver on a fake: weighing at standstill, named refusals, no stale values, recovery."""

import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from arcor2_drivers.scale.mt_sics_scale import MtSicsScale
from arcor2_drivers.scale.settings import MtSicsScaleSettings
from arcor2_hw.data.device import Connection, Health, Identity
from arcor2_hw.exceptions import (
    Cancelled,
    ConnectionLost,
    DeviceError,
    DeviceFault,
    DeviceTimeout,
    NotConnected,
    NotFound,
    OutOfRange,
    Refused,
    Stale,
)
from tests.fakes.conftest import FakeProcess

on_both = pytest.mark.parametrize("fake", ["pty", "tcp"], indirect=True)


@on_both
def test_connecting_only_reads_and_a_cycle_weighs(
    fake: FakeProcess, scale: MtSicsScale, wait_for: Callable[..., Any]
) -> None:
    scale.connect()  # has no effect when connected
    assert scale.identify() == Identity("", "MS3002S 3.2 kg", "B021002593", "2.10 10.28.0.493.142")
    wait_for(lambda: "SI" in fake.truth()["received"])
    assert set(fake.truth()["received"]) <= {"I2", "I3", "I4", "SI", "TA"}
    assert (scale.connection, scale.health, scale.alarms()) == (Connection.ONLINE, Health.NORMAL, [])

    fake.control.do("put", kg=0.25)
    began = time.monotonic()
    reading = scale.weigh()
    assert reading.value == 0.25  # the stable value, not an intermediate one
    assert reading.monotonic >= began
    scale.tare()
    assert fake.truth()["tare"] == pytest.approx(0.25)
    fake.control.do("put", kg=0.37345)
    assert scale.weight() == 0.12345
    assert scale.weight_within(0.12345, 0.2)
    assert not scale.weight_within(0.2, 0.3)
    fake.control.do("put", kg=0.0)
    assert scale.weight() == -0.25
    scale.zero()
    assert scale.weight() == 0.0
    assert fake.truth()["tare"] == 0.0
    scale.disconnect()
    scale.disconnect()
    with pytest.raises(NotConnected, match=f"^scale at {fake.ready['port']} is not connected"):
        scale.weigh()


def test_units_are_converted_to_kilograms(fake: FakeProcess, scale: MtSicsScale) -> None:
    fake.control.do("put", kg=1.25)
    for unit in ("g", "kg", "mg"):
        fake.control.do("unit", value=unit)
        assert scale.weight() == 1.25
    fake.control.do("unit", value="lb")
    with pytest.raises(DeviceFault, match=r"weighs in lb\. Set it to kg") as raised:
        scale.weight()
    assert raised.value.fault_code == "unit"


def test_an_unstable_load_is_waited_for_and_not_tared(fake: FakeProcess, scale: MtSicsScale) -> None:
    fake.control.do("vibrate", on=True)
    for call, name in ((scale.tare, "tare"), (scale.zero, "zero")):
        with pytest.raises(Refused, match=f"{name} is refused while the load is in motion"):
            call()
    assert not {"T", "Z", "@"} & set(fake.truth()["received"])
    assert abs(scale.weigh(stable=False).value) < 0.01
    began = time.monotonic()
    with pytest.raises(DeviceTimeout, match=r"^scale at .*: the load did not become stable within 1 s"):
        scale.weigh()
    assert time.monotonic() - began > 0.95
    assert scale.connection is Connection.ONLINE
    fake.control.do("vibrate", on=False)
    assert scale.weight() == 0.0


def interrupted(fake: FakeProcess, make: Callable[..., MtSicsScale], interrupt: Callable[[MtSicsScale], None]) -> Any:
    """Interrupt a weighing that waits for a stable load; return its outcome."""
    scale = make(fake.ready["port"], stable_timeout=30.0)
    scale.connect()
    fake.control.do("vibrate", on=True)
    outcome: list[Any] = []

    def weigh() -> None:
        try:
            outcome.append(scale.weigh())
        except DeviceError as error:
            outcome.append(error)

    thread = threading.Thread(target=weigh)
    thread.start()
    fake.control.wait_until(lambda truth: truth["received"].count("SI") >= 3)
    interrupt(scale)
    thread.join(30.0)
    return outcome[0]


def test_stop_ends_a_weighing(fake: FakeProcess, make: Callable[..., MtSicsScale]) -> None:
    assert isinstance(interrupted(fake, make, MtSicsScale.stop), Cancelled)


def test_disconnecting_ends_a_weighing(fake: FakeProcess, make: Callable[..., MtSicsScale]) -> None:
    began = time.monotonic()
    assert isinstance(interrupted(fake, make, MtSicsScale.disconnect), DeviceError)
    assert time.monotonic() - began < 15.0  # the weighing waits for 30 s


def test_weights_out_of_range_are_errors(fake: FakeProcess, scale: MtSicsScale, wait_for: Callable[..., Any]) -> None:
    for kg, code in ((4.0, "overload"), (-1.0, "underload")):
        fake.control.do("put", kg=kg)
        wait_for(lambda: [alarm.code for alarm in scale.alarms()], lambda codes, code=code: codes == [code])
        assert scale.health is Health.OFF_SPEC
        with pytest.raises(DeviceFault, match=f"^scale at {fake.ready['port']}") as raised:
            scale.weigh()
        assert raised.value.fault_code == code
        with pytest.raises(Refused, match="too "):
            scale.tare()
    fake.control.do("put", kg=0.5)
    assert scale.weight() == 0.5
    with pytest.raises(Refused, match="zero is refused: too much load"):
        scale.zero()
    assert fake.truth()["zero"] == 0.0
    assert scale.alarms() == []


@pytest.mark.parametrize(("code", "words"), [("ES", "does not know"), ("ET", "damaged"), ("EL", "parameter")])
def test_errors_of_the_scale_are_reported(fake: FakeProcess, scale: MtSicsScale, code: str, words: str) -> None:
    with scale.line.held():  # otherwise the poll every 0.5 s could get the error
        fake.control.do("error", code=code)
        with pytest.raises(DeviceFault, match=words) as raised:
            scale.weigh()
    assert raised.value.fault_code == code
    assert scale.weight() == 0.0


def test_a_busy_scale(fake: FakeProcess, scale: MtSicsScale) -> None:
    fake.control.do("busy", on=True)
    with pytest.raises(Refused, match="is busy"):
        scale.weigh(stable=False)
    with pytest.raises(Refused, match="tare is refused"):
        scale.tare()
    fake.control.do("busy", on=False)
    assert scale.weight() == 0.0


def test_weighing_is_refused_after_a_restart_lost_the_tare(fake: FakeProcess, scale: MtSicsScale) -> None:
    fake.control.do("put", kg=0.25)
    scale.weigh()
    scale.tare()
    fake.control.do("power_cycle")
    with pytest.raises(Refused, match="tare of the scale was lost"):
        scale.weigh()
    assert (scale.health, [alarm.code for alarm in scale.alarms()]) == (Health.CHECK_FUNCTION, ["tare_lost"])
    with pytest.raises(NotFound):
        scale.acknowledge("overload")
    scale.acknowledge("tare_lost")
    assert scale.weight() == 0.25
    scale.tare()
    assert scale.weight() == 0.0


def test_stale_is_an_error(fake: FakeProcess, scale: MtSicsScale, wait_for: Callable[..., Any]) -> None:
    fake.control.do("put", kg=0.5)
    assert scale.weigh().value == scale.newest(1.0).value == 0.5
    fake.control.do("unplug")
    wait_for(lambda: scale.connection, lambda state: state is Connection.LOST)
    with pytest.raises(Stale, match=f"^scale at {fake.ready['port']}: the newest weight is older than 0.01 s"):
        wait_for(lambda: scale.newest(0.01), lambda _: False)


@on_both
def test_unplugging_and_reconnecting(fake: FakeProcess, scale: MtSicsScale, wait_for: Callable[..., Any]) -> None:
    fake.control.do("put", kg=0.1)
    scale.weigh()
    scale.tare()
    before = [word for word in fake.truth()["received"] if word in ("T", "Z", "@")]
    fake.control.do("unplug")
    wait_for(lambda: scale.connection, lambda state: state is Connection.LOST)
    assert scale.health is Health.FAILURE
    with pytest.raises(ConnectionLost, match=fake.ready["port"]):
        scale.weigh()
    fake.control.do("plug")
    wait_for(lambda: scale.connection, lambda state: state is Connection.BACK)
    assert scale.weight() == 0.0  # the tare still applies
    assert [word for word in fake.truth()["received"] if word in ("T", "Z", "@")] == before
    assert scale.connection is Connection.ONLINE


@on_both
@pytest.mark.parametrize("fault", ["silence", "half_frame", "garbage"])
def test_invalid_answers_of_the_device_are_typed_errors(
    fake: FakeProcess, scale: MtSicsScale, wait_for: Callable[..., Any], fault: str
) -> None:
    with scale.line.held():
        fake.control.do(fault)
        with pytest.raises(
            DeviceTimeout,
            match=f"^scale at {fake.ready['port']} (did not answer|gave no valid answer to) SI within 0.4 s",
        ):
            scale.weigh()
    fake.control.do("heal")
    wait_for(lambda: scale.connection, lambda state: state is Connection.BACK)
    assert scale.weight() == 0.0


def test_a_late_answer_is_discarded(fake: FakeProcess, scale: MtSicsScale, wait_for: Callable[..., Any]) -> None:
    with scale.line.held():
        fake.control.do("slow", seconds=1.5)  # a busy driver may wait for three times its limit of 0.4 s
        with pytest.raises(DeviceTimeout):
            scale.weigh()
        fake.control.do("heal")
        fake.control.do("put", kg=0.7)
    wait_for(lambda: scale.connection, lambda state: state is Connection.BACK)
    assert scale.weight() == 0.7  # the late zero was not used as its answer


@pytest.mark.parametrize("port", ["/dev/does-not-exist", "socket://127.0.0.1:1"])
def test_a_missing_port_is_named(make: Callable[..., MtSicsScale], port: str) -> None:
    scale = make(port)
    with pytest.raises(NotConnected, match=f"^scale at {port}: the port cannot be opened"):
        scale.connect(1.0)
    assert scale.connection is Connection.FAILED
    with pytest.raises(NotConnected, match=port):
        scale.weigh()


def test_a_used_port_and_a_partial_command(fake: FakeProcess, make: Callable[..., MtSicsScale]) -> None:
    with Path(fake.ready["port"]).open("wb", buffering=0) as line:
        line.write(b"S")
    first, second = make(fake.ready["port"]), make(fake.ready["port"])
    first.connect()
    with pytest.raises(NotConnected, match="the port is used by another program"):
        second.connect()
    assert first.weight() == 0.0


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("port", " "),
        ("baud_rate", 0),
        ("answer_timeout", 0.0),
        ("answer_timeout", float("nan")),
        ("stable_timeout", 61.0),
        ("stable_timeout", float("nan")),
    ],
)
def test_settings_out_of_range_name_the_parameter(name: str, value: Any) -> None:
    with pytest.raises(OutOfRange, match=f"^{name} must be"):
        MtSicsScaleSettings(**{"port": "/dev/ttyUSB0", name: value})
