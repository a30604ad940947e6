"""Recordings of runs on several computers contain the values of the devices of all of them."""

import asyncio
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from msgspec.structs import replace

from arcor2_hw.data.geometry import Position
from arcor2_hw.data.project import Action, ActionPoint, Project
from tests.e2e.harness import until
from tests.runtime.conftest import Package, scene_object
from tests.server.core.serving import ServerProcess, running, talking
from tests.server.nodes.conftest import Broker, Node
from tests.server.nodes.test_node_hosts import AN_HOUR_AHEAD
from tests.server.nodes.test_node_records import recordings

pytestmark = pytest.mark.xdist_group("nodes")

GAUGE = """
from arcor2_hw.data.device import Observation
from arcor2_hw.objects.state_observer import Snapshot, StateObserver

class Level(StateObserver):
    period = busy_period = 0.01
    level = 0.0
    def open(self, timeout):
        return Snapshot.by(self.read)
    def read(self):
        return self.level

@dataclass
class GaugeSettings(Settings):
    file: str

class Gauge(Generic):
    _ABSTRACT = False
    recorded = None

    def __init__(self, obj_id, name, settings: GaugeSettings):
        super().__init__(obj_id, name, settings)
        self.observer = Level(name)

    def connect(self, timeout=1.0): self.observer.connect(timeout)
    def disconnect(self): self.observer.disconnect()
    @property
    def connection(self): return self.observer.observing.state
    @property
    def shown_values(self): return {"gripped": 1.0}
    def observations(self):
        self.recorded = self.observer.current().value
        return [Observation("level", self.recorded, "m")]

    @action
    def fill(self, level: float, *, an: str | None = None) -> None:
        while self.recorded is None:
            time.sleep(0.005)
        self.observer.level = level
        while self.recorded != level:
            time.sleep(0.005)

    @action
    def wait(self, *, an: str | None = None) -> None:
        file = Path(self.settings.file)
        time.sleep(0.3)  # a node sends records every 0.1 s
        file.touch()
        while file.exists():
            time.sleep(0.005)
        raise Refused("the gauge leaks")
"""
BODY = """
near, far = res.objects["obj_near"], res.objects["obj_far"]
near.fill(0.25, an="near")
far.fill(0.5, an="far")
near.wait(an="wait")
"""
ACTIONS = {"near": "obj_near/fill", "far": "obj_far/fill", "wait": "obj_near/wait"}
PROJECT = Project(
    "project",
    "scn_1",
    id="pro_1",
    action_points=[
        ActionPoint("top", Position(), id="acp", actions=[Action(n, of, f"act_{n}") for n, of in ACTIONS.items()])
    ],
)
AHEAD = "ahead"


@pytest.fixture(scope="module")
def ahead(broker: Broker, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Node]:
    """Return a node whose clock is an hour ahead."""
    if subprocess.run([*AN_HOUR_AHEAD, "true"], capture_output=True, check=False).returncode:
        pytest.skip("this user may not create a time namespace (needs root and Linux 5.6)")
    node = Node(broker.url, tmp_path_factory.mktemp("ahead"), name=AHEAD, wrapper=AN_HOUR_AHEAD)
    yield node
    node.end()


def write(data: Path, name: str, file: Path, **nodes: str) -> None:
    objects = [replace(scene_object(each, "Gauge", file=str(file)), node=node) for each, node in nodes.items()]
    Package(data / "packages" / name).write({"Gauge": GAUGE}, objects, PROJECT, BODY)


def check(recording: dict[str, Any], *, failed: bool) -> None:
    """Check that the level of each device changed while the action that fills it ran."""
    signals = [(each["object_name"], each["name"]) for each in recording["signals"]]
    assert len(signals) == len(set(signals))
    assert {(device, name) for device in ("near", "far") for name in ("level", "connected", "gripped")} <= set(signals)
    actions = {each["name"]: each for each in recording["actions"]}
    assert list(actions) == ["near", "far", "wait"]
    assert actions["wait"].get("error") == ("the gauge leaks" if failed else None)
    for device, level in (("near", 0.25), ("far", 0.5)):
        (found,) = (each for each in recording["signals"] if (each["object_name"], each["name"]) == (device, "level"))
        assert [each for each in found["values"] if each is not None] == [0.0, level]
        # A time is converted to the earliest possible one, which is earlier by a round trip at most.
        assert actions[device]["begin"] - 200 <= found["times"][-1] <= actions[device]["end"] + 50


async def test_a_recording_has_the_values_of_all_computers(broker: Broker, ahead: Node, tmp_path: Path) -> None:
    """The main host is on the server's computer in the first run, on the node in the second. The server is killed."""
    data, file = tmp_path / "data", tmp_path / "waits"
    write(data, "pkg_1", file, near="", far=AHEAD)
    write(data, "pkg_2", file, near=AHEAD, far="", other=AHEAD)
    server = ServerProcess(data, ARCOR2_HW_NATS_URL=broker.url)
    await server.start()
    async with talking(server.url, "ann") as client:
        await client.granted("RunPackage", {"id": "pkg_1"})
        await until(file.exists, "the last action runs")
        file.unlink()
        async with asyncio.timeout(30):
            while not (found := await recordings(server))[0]["complete"]:
                await asyncio.sleep(0.1)
        (recording,) = found
        check(recording, failed=True)
        assert "the gauge leaks" in recording["error"]

        await client.granted("RunPackage", {"id": "pkg_2"})
        await until(file.exists, "the last action runs")
        server.process.kill()
    await server.ended()
    async with asyncio.timeout(30):
        while len(list((data / "recordings").glob("*.ring"))) < 2:
            await asyncio.sleep(0.05)
    file.unlink()
    async with running(data, ARCOR2_HW_NATS_URL=broker.url) as server:
        async with asyncio.timeout(30):
            while len(found := await recordings(server)) < 2:
                await asyncio.sleep(0.1)
        check(found[0], failed=False)
        assert (found[0]["run"], found[0]["run_failed"]) == (2, True)
        assert not list((data / "recordings").glob("*.ring"))
