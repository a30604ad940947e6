"""The remote I/O block on an intact wire: points, edges, pulses, control; TCP and RTU."""

import termios
import time
from collections.abc import Callable
from typing import Any

import pytest
import serial.serialposix

from arcor2_drivers.remote_io.points import parse_points
from arcor2_drivers.remote_io.remote_io import RemoteIO
from arcor2_drivers.remote_io.settings import RemoteIOSettings
from arcor2_hw.data.device import Connection, Health, Quality
from arcor2_hw.exceptions import (
    Arcor2Error,
    Cancelled,
    DeviceFault,
    DeviceTimeout,
    NotConnected,
    NotInControl,
    OutOfRange,
    Refused,
)
from arcor2_hw.objects.edges import Debounced, Edge
from arcor2_hw.objects.modbus_settings import Parity
from arcor2_hw.objects.small import OnLoss, PointDirection, PointKind
from tests.drivers.background_call import BackgroundCall
from tests.drivers.remote_io.conftest import POINTS
from tests.fakes.conftest import FakeProcess


# ------------------------------------------------------------------------------------------------ settings
def test_the_point_list_is_parsed() -> None:
    points = parse_points(POINTS)
    door, lamp, speed = points["door"].io, points["lamp"].io, points["speed"].io
    assert (door.direction, door.kind, door.debounce) == (PointDirection.INPUT, PointKind.DIGITAL, 0.1)
    assert (lamp.direction, lamp.on_loss, points["lamp"].address) == (PointDirection.OUTPUT, OnLoss.OFF, "DO4")
    assert (points["valve"].io.on_loss, points["lock"].io.on_loss) == (OnLoss.HOLD, OnLoss.ON)
    assert (speed.kind, speed.unit, speed.scale) == (PointKind.ANALOG, "m/s", 0.01)
    assert points["speed"].raw(1.5) == 150


@pytest.mark.parametrize(
    ("points", "problem"),
    [
        ("", "at least one point"),
        ("lamp", r"name=\.\.\..*'lamp'"),
        ("1lamp=DO0", r"name=\.\.\."),
        ("lamp=XY0", "terminal such as DI0.*'XY0'"),
        ("lamp=DO16", "DO0 to DO15, not DO16"),
        ("a=DO1; a=DO2", "'a' is in it twice"),
        ("a=DO1; b=DO1", "DO1 is 'a' and 'b'"),
        ("a=DI1 on_loss=off", "a .DI. only debounce"),
        ("a=DO1 on_loss=maybe", "on_loss of a to hold, off, on"),
        ("a=AO1 on_loss=on", "on_loss of a to hold, off"),
        ("a=AI1 scale=x", "scale of a to a number"),
        ("a=AI1 scale=0", "scale of a to 0"),
        ("a=DI1 debounce=-1", "debounce of a to a value from 0 to 10"),
        ("a=DI1 debounce=0.1 debounce=0.2", "each once"),
    ],
)
def test_an_invalid_point_list_names_the_mistake(points: str, problem: str) -> None:
    with pytest.raises(OutOfRange, match=f"^points must .*{problem}"):
        RemoteIOSettings(host="127.0.0.1", points=points)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("host", " "),
        ("port", 0),
        ("baudrate", 1),
        ("unit_id", 256),
        ("watchdog", 4),
        ("watchdog_ms", 100),
        ("watchdog_ms", 9000),
        ("request_timeout", 0.3),
        ("request_timeout", float("nan")),
    ],
)
def test_settings_out_of_range_name_the_parameter(name: str, value: Any) -> None:
    with pytest.raises(OutOfRange, match=f"^{name} must be"):
        RemoteIOSettings(**{"host": "127.0.0.1", "points": POINTS, name: value})


def test_tcp_and_rtu_exclude_each_other() -> None:
    with pytest.raises(OutOfRange, match=r"^host must be .* or serial_port"):
        RemoteIOSettings(host="127.0.0.1", serial_port="/dev/ttyS0", points=POINTS)


# ------------------------------------------------------------------------------------------------ observing
def test_connecting_observes_and_writes_nothing(fake: FakeProcess, observed: RemoteIO) -> None:
    observed.connect()
    assert observed.read_digital("part") is False
    assert observed.connection is Connection.ONLINE
    assert observed.control_owner() is None
    with pytest.raises(NotInControl, match=f"^block at {fake.ready['modbus']}: writing lamp is refused: nobody"):
        observed.write_digital("lamp", True)
    assert fake.truth()["writes"] == 0
    identity = observed.identify()
    assert (identity.vendor, identity.model, identity.firmware) == ("Fake Field Devices", "RIO-16", "2.0")


def test_every_kind_of_point_is_read(fake: FakeProcess, observed: RemoteIO, wait_for: Callable[..., Any]) -> None:
    fake.control.do("set_input", number=0, on=True)
    fake.control.do("set_analog", number=0, raw=-250)
    assert observed.read_digital("part") is True
    wait_for(lambda: observed.shown_values, lambda values: values == {"part": 1.0, "door": 0.0})
    assert observed.read_analog("level") == pytest.approx(-0.25)
    reading = observed.read("level")
    assert reading.quality is Quality.GOOD
    assert 0.0 <= reading.age < 0.5
    fake.control.do("set_analog", number=0, raw=-32768)
    assert observed.read("level").quality is Quality.BAD
    with pytest.raises(DeviceFault, match=r"level \(AI0\) has a broken wire"):
        observed.read_analog("level")
    with pytest.raises(OutOfRange, match=r"no point 'lid'. Available: part, door"):
        observed.read("lid")
    with pytest.raises(Refused, match="level is AI0"):
        observed.read_digital("level")


def test_alarms_are_reported(fake: FakeProcess, observed: RemoteIO) -> None:
    assert observed.alarms() == []
    fake.control.do("diagnosis", supply_missing=True)
    assert [alarm.code for alarm in observed.alarms()] == ["supply_missing"]
    assert observed.health is Health.FAILURE
    fake.control.do("diagnosis")
    assert observed.alarms() == []
    assert observed.health is Health.NORMAL


def test_inputs_are_debounced() -> None:
    point = Debounced("door", 0.1)
    samples = [(0.0, 0), (0.02, 1), (0.04, 0), (0.06, 1), (0.1, 1), (0.14, 1), (0.17, 1), (0.2, 0), (0.25, 1)]
    edges = [edge for at, raw in samples if (edge := point.take(bool(raw), at)) is not None]
    assert [(edge.value, edge.monotonic) for edge in edges] == [(True, 0.06)]
    assert point.value is True


def test_edges_are_debounced_and_reported_in_order(
    fake: FakeProcess, observed: RemoteIO, wait_for: Callable[..., Any]
) -> None:
    edges: list[Edge] = []

    def broken(edge: Edge) -> None:
        raise RuntimeError("a failing listener does not affect the others")

    observed.subscribe("door", broken)
    end = observed.subscribe("door", edges.append)
    observed.subscribe("part", edges.append)
    fake.control.do("set_input", number=1, on=True)
    wait_for(lambda: len(edges), lambda count: count == 1)
    fake.control.do("set_input", number=0, on=True)
    wait_for(lambda: len(edges), lambda count: count == 2)
    end()
    fake.control.do("set_input", number=1, on=False)
    observed.wait_for("door", False, 30.0)
    assert [(edge.name, edge.value) for edge in edges] == [("door", True), ("part", True)]


def test_wait_for_returns_at_the_condition(fake: FakeProcess, observed: RemoteIO) -> None:
    observed.wait_for("part", False, 0.0)
    doing = BackgroundCall(lambda: observed.wait_for("part", True, 60.0))
    fake.control.do("set_input", number=0, on=True)
    assert doing.outcome() is None
    with pytest.raises(DeviceTimeout, match=r"part becoming off took longer than 0.05 s"):
        observed.wait_for("part", False, 0.05)
    doing = BackgroundCall(lambda: observed.wait_for("part", False, 60.0))
    while not doing.over:  # a stop from before the wait has no effect
        observed.stop()
        time.sleep(0.01)
    assert isinstance(doing.outcome(), Cancelled)


# ------------------------------------------------------------------------------------------------ outputs
def test_outputs_are_written(fake: FakeProcess, block: RemoteIO) -> None:
    assert not any(fake.truth()["outputs"])  # taking control switches nothing
    assert block.control_owner() == "us"
    block.write_digital("lamp", True)
    block.write_analog("speed", 1.5)
    block.write("pressure", -7.0)
    truth = fake.truth()
    assert [number for number, on in enumerate(truth["outputs"]) if on] == [4]
    assert truth["analog_outputs"] == [150, -7]
    assert block.read_digital("lamp") is True
    assert block.read_analog("speed") == pytest.approx(1.5)
    with pytest.raises(OutOfRange, match=r"speed must be -327.67 to 327.67 m/s, not 400.0"):
        block.write_analog("speed", 400.0)
    with pytest.raises(Refused, match=r"part is an input \(DI0\)"):
        block.write("part", True)


def test_pulse_is_timed_by_the_block(fake: FakeProcess, block: RemoteIO) -> None:
    block.pulse("lamp", 0.15)
    on, off = fake.truth()["history"]
    assert (on["output"], on["on"], off["output"], off["on"]) == (4, True, 4, False)
    assert off["time"] - on["time"] == pytest.approx(0.15, abs=0.001)
    with pytest.raises(OutOfRange, match=r"duration must be 0.01 to 60"):
        block.pulse_output("lamp", 100.0)


def test_a_stopped_pulse_switches_off(fake: FakeProcess, block: RemoteIO, wait_for: Callable[..., Any]) -> None:
    block.write_digital("valve", True)
    doing = BackgroundCall(lambda: block.pulse("lamp", 20.0))
    wait_for(lambda: fake.truth()["outputs"][4])
    with pytest.raises(Refused, match=r"pulsing lamp is refused while it is being pulsed$"):
        block.pulse("lamp", 0.05)
    block.stop()
    outputs = fake.truth()["outputs"]  # off when stop returns, at any progress of the other thread
    assert isinstance(doing.outcome(), Cancelled)
    assert (outputs[4], outputs[5]) == (False, True)  # a stop switches nothing else
    block.pulse("lamp", 0.05)


def test_control_is_refused_while_another_host_has_it(
    fake: FakeProcess, block: RemoteIO, make: Callable[..., RemoteIO]
) -> None:
    other = make(fake.ready["modbus"])
    other.connect()
    with pytest.raises(NotInControl, match=r"another host \(number \d+ on watchdog 0\) has it"):
        other.take_control()
    with pytest.raises(NotInControl):
        other.write_digital("lamp", True)
    neighbour = make(fake.ready["modbus"], watchdog=1, points="fan=DO0")
    neighbour.connect()
    neighbour.take_control()
    neighbour.write_digital("fan", True)
    block.write_digital("lamp", True)
    neighbour.disconnect()  # its output goes off, ours stays
    outputs = fake.truth()["outputs"]
    assert (outputs[0], outputs[4]) == (False, True)


def test_disconnecting_sets_safe_outputs(fake: FakeProcess, block: RemoteIO) -> None:
    block.write_digital("lamp", True)
    block.write_digital("valve", True)
    block.write_analog("speed", 1.0)
    block.write_analog("pressure", 9.0)
    block.release_control()
    truth = fake.truth()
    assert truth["outputs"][4:7] == [False, True, True]  # off, hold, on
    assert truth["analog_outputs"] == [0, 9]
    assert truth["watchdogs"][0]["state"] == "off"
    with pytest.raises(NotInControl):
        block.write_digital("lamp", True)
    block.take_control()
    block.write_digital("lamp", True)
    assert fake.truth()["outputs"][4] is True


# ------------------------------------------------------------------------------------------------ RTU
def test_the_block_works_over_rtu(
    start_fake: Callable[..., FakeProcess], make: Callable[..., RemoteIO], monkeypatch: pytest.MonkeyPatch
) -> None:
    requested: list[int] = []
    set_attributes = termios.tcsetattr

    def record(descriptor: int, when: int, attributes: Any) -> None:
        requested.append(attributes[2])  # a pty refuses a parity bit, so it is set without one
        set_attributes(descriptor, when, [*attributes[:2], attributes[2] & ~termios.PARENB, *attributes[3:]])

    monkeypatch.setattr(serial.serialposix.termios, "tcsetattr", record)
    fake = start_fake("remote_io", "--serial")
    block = make(fake.ready["modbus"], baudrate=115200, parity=Parity.ODD, stopbits=2)
    block.connect()
    wanted = termios.PARENB | termios.PARODD | termios.CSTOPB
    assert requested[-1] & wanted == wanted
    block.take_control()
    block.write_digital("lamp", True)
    fake.control.do("set_analog", number=0, raw=1234)
    assert block.read_analog("level") == pytest.approx(1.234)
    assert fake.truth()["outputs"][4] is True
    fake.control.do("silence")
    with pytest.raises(Arcor2Error, match=f"block at {fake.ready['modbus']}"):
        block.read("level")
    block.disconnect()
    assert fake.control.wait_until(lambda truth: truth["watchdogs"][0]["state"] == "expired")["outputs"][4] is False
    absent = make("/nowhere/ttyS9")
    with pytest.raises(NotConnected, match="block at /nowhere/ttyS9 cannot be reached: the port cannot be opened"):
        absent.connect(1.0)
