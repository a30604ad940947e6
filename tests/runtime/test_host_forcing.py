"""Forced outputs in the cell host, on a fake I/O block: leases, refusals, and the end of processes."""

import time
from collections.abc import Iterator
from typing import Any

import msgspec
import pytest

from arcor2_hw.runtime import messages as m
from tests.fakes.conftest import FakeProcess
from tests.waiting import wait_for

from .conftest import HostProcess, open_scene, scene_object

TYPES = [
    m.TypeCode("RemoteIO", "arcor2_drivers.remote_io.remote_io:RemoteIO"),
    m.TypeCode("TowerLight", "arcor2_drivers.remote_io.tower_light:TowerLight"),
]
POINTS = "part=DI0 debounce=0.02; valve=DO4; clamp=DO5 on_loss=hold; lock=DO6 on_loss=on; speed=AO0 scale=0.01 unit=m/s"
LONG = 300.0


@pytest.fixture(scope="module")
def one_block() -> Iterator[FakeProcess]:
    with FakeProcess("remote_io") as fake:
        yield fake


@pytest.fixture
def block(one_block: FakeProcess, host: HostProcess) -> FakeProcess:
    """Connect an I/O object and a tower light to the block."""
    one_block.control.do("renew")
    address, _, port = one_block.ready["modbus"].rpartition(":")
    where = {"host": address, "port": int(port), "watchdog_ms": 400, "request_timeout": 0.1}
    io = scene_object("io", "RemoteIO", **where, points=POINTS)
    tower = scene_object("tower", "TowerLight", **where, watchdog=1, red="DO0", green="DO2", on_loss="red")
    host.send(open_scene(TYPES, io, tower))
    host.expect(m.SceneOpened)
    return one_block


def force(host: HostProcess, point: str, value: Any, number: int = 1, lasting: float = LONG, of: str = "io") -> Any:
    host.send(m.ForcePoint(1000 + number, f"obj_{of}", point, number, value, time.monotonic() + lasting))
    return host.answer(1000 + number)


def outputs(block: FakeProcess) -> dict[str, Any]:
    truth = block.truth()
    on = truth["outputs"]
    return {"red": on[0], "green": on[2], "valve": on[4], "lock": on[6], "speed": truth["analog_outputs"][0]}


def wait_for_outputs(block: FakeProcess, **wanted: Any) -> None:
    wait_for(lambda: outputs(block), lambda found: wanted.items() <= found.items())


def assert_refused(host: HostProcess, text: str, *arguments: Any, **more: Any) -> None:
    error = force(host, *arguments, **more)
    assert isinstance(error, m.ErrorData)
    assert text in error.message.text


def test_a_forced_output_keeps_its_value_and_is_switched_back(host: HostProcess, block: FakeProcess) -> None:
    assert host.call("obj_io", "take_control") is None
    assert host.call("obj_io", "write_digital", name="valve", value=True) is None
    assert force(host, "valve", False, 1) == {"before": True, "unit": ""}
    assert force(host, "speed", 1.5, 2) == {"before": 0.0, "unit": "m/s"}
    wait_for_outputs(block, valve=False, speed=150)
    for method, value in (("write_digital", {"value": True}), ("pulse", {"duration": 0.1})):
        error = host.call("obj_io", method, name="valve", **value)
        assert error.message.text.endswith("valve is forced. End the force first.")
    assert_refused(host, "forced already", "valve", True, 3)

    host.send(m.EndForce(50, 1))
    assert host.answer(50) is None
    wait_for_outputs(block, valve=True, speed=150)
    assert host.call("obj_io", "write_digital", name="valve", value=False) is None
    host.send(m.EndForce(51, 1))  # it has ended
    assert host.answer(51) is None


def test_a_force_ends_unless_it_is_renewed(host: HostProcess, block: FakeProcess) -> None:
    force(host, "valve", True, 1, lasting=1.0)
    force(host, "lock", True, 2, lasting=1.0)
    host.send(m.RenewForces([2, 77], time.monotonic() + LONG))
    ended = host.expect(m.ForceEnded)
    assert ended.force == 1
    assert ended.error is not None
    assert ended.error.message.text == "io: the force of valve was not renewed in time"
    wait_for_outputs(block, valve=False, lock=True)
    time.sleep(0.3)  # the first lease of the other force has expired too
    assert outputs(block)["lock"] is True


def test_forces_of_other_points_and_with_invalid_values_are_refused(host: HostProcess, block: FakeProcess) -> None:
    assert_refused(host, "part is not an output", "part", True, 1)
    assert_refused(host, "clamp cannot be forced, because the device would keep the value", "clamp", True, 2)
    assert_refused(host, "has no point 'missing'", "missing", True, 3)
    assert_refused(host, "valve is digital", "valve", 1.0, 4)
    assert_refused(host, "speed is analogue", "speed", True, 5)
    assert_refused(host, "must be", "speed", 1e9, 6)
    force(host, "valve", True, 7)
    host.begin("obj_io", "wait_for", name="part", value=True, timeout=60.0)
    host.send(m.EndForce(60, 7))
    assert host.answer(60) is None  # also while an action runs
    assert outputs(block) == {"red": False, "green": False, "valve": False, "lock": False, "speed": 0}


def test_a_lamp_is_forced_while_the_tower_shows_a_state(host: HostProcess, block: FakeProcess) -> None:
    assert host.call("obj_tower", "take_control") is None
    assert force(host, "green", True, 1, of="tower") == {"before": False, "unit": ""}
    assert host.call("obj_tower", "show", color="red") is None
    wait_for_outputs(block, green=True, red=True)
    assert host.call("obj_tower", "show", color="green") is None
    assert host.call("obj_tower", "show", color="red") is None
    assert outputs(block)["green"] is True
    host.send(m.EndForce(70, 1))
    assert host.answer(70) is None
    wait_for_outputs(block, green=False, red=True)


def test_forces_end_with_the_server(host: HostProcess, block: FakeProcess) -> None:
    host.call("obj_io", "take_control")
    force(host, "valve", True, 1)
    wait_for_outputs(block, valve=True)
    host.socket.close()  # as when the server is killed
    assert host.gone(5.0) == 0
    wait_for_outputs(block, valve=False)
    switched = [each["on"] for each in block.truth()["history"] if each["output"] == 4]
    assert switched == [True, False]


def test_forces_end_with_the_host(host: HostProcess, block: FakeProcess) -> None:
    force(host, "valve", True, 1)
    force(host, "lock", False, 2)
    force(host, "red", False, 3, of="tower")
    wait_for_outputs(block, valve=True)
    host.process.kill()
    wait_for_outputs(block, valve=False, lock=True, red=True)  # by the watchdogs of the block


def test_forces_end_with_the_connection(host: HostProcess, block: FakeProcess) -> None:
    force(host, "valve", True, 1)
    block.control.do("silence")
    ended = host.expect(m.ForceEnded)
    assert ended.error is not None
    assert ended.error.code in ("connection_lost", "not_in_control")
    wait_for_outputs(block, valve=False)
    block.control.do("heal")
    host.expect(m.DeviceChanged, lambda change: change.object_id == "obj_io" and change.connection.value == "back")
    assert outputs(block)["valve"] is False


def test_points_are_streamed(host: HostProcess, block: FakeProcess) -> None:
    host.send(m.Stream("obj_io", [], [], [], [5.0]))
    block.control.do("set_input", number=0, on=True)

    def read(where: Any = lambda _: True) -> dict[str, Any]:
        message = host.expect(m.StreamEvent, lambda each: where({one["name"]: one for one in _points(each)}))
        return {one["name"]: one for one in _points(message)}

    points = read(lambda found: found["part"]["value"] is True)
    assert list(points) == ["part", "valve", "clamp", "lock", "speed"]
    assert {name: (one["use"], one.get("force")) for name, one in points.items()} == {
        "part": ("input", None),
        "valve": ("output", "digital"),
        "clamp": ("output", None),
        "lock": ("output", "digital"),
        "speed": ("output", "analog"),
    }
    assert points["speed"] | {"age": 0} == {
        "name": "speed", "use": "output", "value": 0.0, "unit": "m/s", "quality": "good", "age": 0, "force": "analog",
    }  # fmt: skip
    assert all(one["age"] < 1.0 for one in points.values())
    block.control.do("silence")
    points = read(lambda found: found["part"]["quality"] == "not_connected")
    assert points["part"]["value"] is True, "the last known value is shown"
    block.control.do("heal")


def _points(message: m.StreamEvent) -> list[dict[str, Any]]:
    assert message.event == "ObjectPoints"
    points: list[dict[str, Any]] = msgspec.json.decode(message.encoded)["data"]["points"]
    return points
