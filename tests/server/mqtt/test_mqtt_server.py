"""A real server that publishes its cell to mosquitto, and a host that knows only the specification."""

import asyncio
import json
import os
import signal
from collections.abc import AsyncIterator, Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
import pytest_asyncio

from arcor2_hw.data.role import Role
from arcor2_server.access.tokens import TokenFile
from tests.fakes.conftest import FakeProcess
from tests.runtime.conftest import Package, scene_object
from tests.server.cell.test_execution import LAMP, OBJ, PROJECT
from tests.server.core.serving import RawConnection, ServerProcess, talking
from tests.server.mqtt.brokers import Mosquitto
from tests.server.mqtt.host import Host, Message

pytestmark = pytest.mark.asyncio(loop_scope="module")

ARM = "from arcor2_drivers.two_axis_robot.two_axis_robot import TwoAxisRobot"
BODY = f"""
    import time
    lamp = res.objects["{OBJ}"]
    while True:
        lamp.blink(1, an="a")
        time.sleep(0.05)
"""
NODE = "plant/cell-7"
PREFIX = "acme/brno/welding/line-1/cell-7"


@dataclass
class Cell:
    """A server with a robot and a program, its broker, and a host."""

    data: Path
    server: ServerProcess
    hub: RawConnection
    robot: FakeProcess
    broker: Mosquitto
    host: Host
    stopped: bool = False

    def processes(self) -> list[int]:
        """Return the ids of the processes of the MQTT clients, newest last."""
        lines = [json.loads(line) for line in self.server.log.read_text().splitlines() if line.startswith("{")]
        return [each["pid"] for each in lines if each["event"] == "MQTT process starts"]


async def until(read: Callable[[], Any], within: float = 30.0) -> Any:
    """Wait until `read` returns something true, and return it."""
    async with asyncio.timeout(within):
        while not (found := read()):
            await asyncio.sleep(0.02)
    return found


@pytest_asyncio.fixture(scope="module", loop_scope="module")
async def cell(tmp_path_factory: pytest.TempPathFactory) -> AsyncIterator[Cell]:
    folder = tmp_path_factory.mktemp("mqtt")
    data = folder / "data"
    data.mkdir(0o700)
    _, secret = TokenFile(data).add("tablet", Role.PROGRAMMER)
    broker = Mosquitto(folder)
    host = Host(broker.port, "spBv1.0/plant/#", f"{PREFIX}/#")
    robot = FakeProcess("two_axis_robot", "--link", str(folder / "ttyDXL"))
    robot.control.do("truth")  # its connection stays as long as the fixture
    objects = [
        scene_object("lamp", "Lamp"),
        scene_object("arm", "TwoAxisRobot", pose=True, port=str(folder / "ttyDXL"), watchdog=0.4),
    ]
    Package(data / "packages" / "pkg_1").write({"Lamp": LAMP, "TwoAxisRobot": ARM}, objects, PROJECT, BODY)
    server = ServerProcess(
        data,
        *("--mqtt-sparkplug", NODE, "--mqtt-json", PREFIX),
        ARCOR2_HW_DEVICE_FILES=str(folder),
        ARCOR2_HW_MQTT_URL=broker.url.replace("//", "//cell:secret-of-the-broker@"),
    )
    await server.start()
    running = None
    try:
        async with talking(f"{server.url}/?token={secret}", "technician", max_queue=None) as hub:
            running = Cell(data, server, hub, robot, broker, host)
            yield running
    finally:
        if running is None or not running.stopped:
            await server.stop()
        host.end()
        broker.end()
        robot.end()


def newest(host: Host, topic: str) -> Any:
    """Return the newest JSON below the prefix, None if there is none."""
    found = [each for each in host.of(f"{PREFIX}/{topic}") if each.payload]
    return found[-1].json if found else None


async def test_the_births_of_the_cell_and_its_devices_are_published(cell: Cell) -> None:
    host = cell.host
    (birth,) = await until(lambda: host.of("NBIRTH"))
    assert (birth.value("State"), birth.value("Counts/Good"), birth.value("Program Running")) == ("Stopped", 0, False)
    assert all(abs(metric.time - birth.time) < 30_000 for metric in birth.metrics)
    await cell.hub.granted("RunPackage", {"id": "pkg_1", "on_error": "hold"})
    await until(lambda: host.values("State")[-1].value == "Execute")
    await until(lambda: host.values("Program")[-1].value == "demo")

    def joints() -> list[Message]:
        return [each for each in host.of("DBIRTH", "arm") if any("Joints/" in (m.name or "") for m in each.metrics)]

    birth = (await until(joints))[-1]
    assert birth.value("Connection") == "online"
    assert birth.value("Properties/Type") == "TwoAxisRobot"
    joint = next(each for each in birth.metrics if "Joints/" in (each.name or ""))
    assert joint.properties["Quality"] == 192
    assert abs(joint.time - (birth.time or 0)) < 30_000
    assert host.faults == []


async def test_json_is_retained_for_a_late_subscriber(cell: Cell) -> None:
    await until(lambda: newest(cell.host, "devices/arm/points"))
    late = Host(cell.broker.port, f"{PREFIX}/#")
    try:
        await until(lambda: late.of(f"{PREFIX}/devices/arm/points"))
        assert late.of(f"{PREFIX}/status")[-1].payload == b"online"
        state = newest(late, "state")
        assert (state["state"], state["program_running"], state["authority"]) == ("execute", True, "hub")
        assert newest(late, "counts") | {"time": ""} == {"time": "", "good": 0, "bad": 0, "rejected": 0}
        assert newest(late, "devices/arm/state")["connection"] == "online"
        joints = newest(late, "devices/arm/points")["joints"]
        assert {each["quality"] for each in joints.values()} == {"good"}
        assert all(each.retain for each in late.messages)
    finally:
        late.end()


async def test_a_host_requests_a_rebirth(cell: Cell) -> None:
    host, before = cell.host, cell.host.of("NBIRTH")[-1]
    devices = len(host.of("DBIRTH", "arm"))
    host.client.publish("spBv1.0/plant/NCMD/cell-7", b"\xff\xff no payload", qos=1)
    host.rebirth(NODE)
    birth = (await until(lambda: host.of("NBIRTH")[1:]))[-1]
    assert birth.value("bdSeq") == before.value("bdSeq")
    await until(lambda: len(host.of("DBIRTH", "arm")) > devices)
    assert host.faults == []


async def test_a_pulled_cable_publishes_the_death_of_the_device_and_an_alarm(cell: Cell) -> None:
    host = cell.host
    cell.robot.control.do("unplug")
    await until(lambda: host.of("DDEATH", "arm"))
    await until(lambda: newest(host, "alarms")["alarms"])
    (alarm, *_) = newest(host, "alarms")["alarms"]
    assert (alarm["object_name"], alarm["active"]) == ("arm", True)
    await until(lambda: newest(host, "alarms/changed"))
    change = await until(lambda: [each.value for each in host.values("Alarms/Last Change") if each.value])
    assert json.loads(change[-1])["object_name"] == "arm"
    await until(lambda: host.values("Alarms/Active")[-1].value >= 1)
    await until(lambda: newest(host, "devices/arm/state")["connection"] == "lost")
    joints = (await until(lambda: newest(host, "devices/arm/points")))["joints"]
    await until(
        lambda: {each["quality"] for each in newest(host, "devices/arm/points")["joints"].values()} == {"not_connected"}
    )
    assert joints
    births = len(host.of("DBIRTH", "arm"))
    cell.robot.control.do("heal")
    await until(lambda: len(host.of("DBIRTH", "arm")) > births)
    assert host.faults == []


async def test_a_killed_process_causes_a_death_and_a_new_birth(cell: Cell) -> None:
    host, before = cell.host, cell.host.of("NBIRTH")[-1].value("bdSeq")
    (process,) = cell.processes()
    os.kill(process, signal.SIGKILL)
    (death,) = await until(lambda: host.of("NDEATH"))
    assert death.value("bdSeq") == before
    await until(lambda: host.of(f"{PREFIX}/status")[-1].payload == b"offline")
    await until(lambda: host.of("NBIRTH")[-1].value("bdSeq") == before + 1)
    await until(lambda: host.of(f"{PREFIX}/status")[-1].payload == b"online")
    await until(lambda: host.values("State")[-1].value == "Held")  # since the cable was pulled
    assert host.faults == []


async def test_a_stopped_server_publishes_one_death(cell: Cell) -> None:
    host, deaths = cell.host, len(cell.host.of("NDEATH"))
    session = host.of("NBIRTH")[-1].value("bdSeq")
    await cell.server.stop()
    cell.stopped = True
    death = (await until(lambda: host.of("NDEATH")[deaths:]))[-1]
    assert death.value("bdSeq") == session
    await until(lambda: host.of(f"{PREFIX}/status")[-1].payload == b"offline")
    assert len(host.of("NDEATH")) == deaths + 1
    assert "secret-of-the-broker" not in cell.server.log.read_text()
    assert host.faults == []
