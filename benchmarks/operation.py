"""The cell host through the server: start of a scene, start of a program, overhead of an action."""

import asyncio
import time
from pathlib import Path
from typing import Any

import httpx

from arcor2_hw.client import Client
from arcor2_hw.data import rpc
from arcor2_hw.data.geometry import Position
from arcor2_hw.data.parameter import Parameter
from arcor2_hw.data.project import Flow
from benchmarks import server_process
from benchmarks.metrics import Metric, Report, median
from benchmarks.requests import fdatasync_time

SLOW = '''"""A device that connects slowly."""

import time

from arcor2_hw.objects import Generic


class Slow(Generic):
    """Connects in half a second."""

    _ABSTRACT = False

    def connect(self, timeout: float = 5.0) -> None:
        time.sleep(0.5)
'''

PROBE = '''"""A device that records the times of its calls."""

import dataclasses
import pathlib
import statistics
import time

from arcor2_hw.actions import action
from arcor2_hw.exceptions import ProgramFinished
from arcor2_hw.objects import Generic, Settings


@dataclasses.dataclass
class ProbeSettings(Settings):
    file: str
    calls: int


class Probe(Generic):
    """Records the time between calls."""

    _ABSTRACT = False

    def __init__(self, obj_id: str, name: str, settings: ProbeSettings) -> None:
        super().__init__(obj_id, name, settings)
        self.stamps = []

    @action
    def tick(self, *, an: str | None = None) -> None:
        """Record the time."""
        self.stamps.append(time.perf_counter())
        if len(self.stamps) > self.settings.calls:
            periods = [b - a for a, b in zip(self.stamps, self.stamps[1:])]
            pathlib.Path(self.settings.file).write_text(str(statistics.median(periods)))
            raise ProgramFinished
'''


async def add_type(url: str, name: str, source: str) -> None:
    """Upload an object type to the server."""
    async with httpx.AsyncClient() as http:
        body = {"id": name, "name": name, "source": source}
        answer = await http.put(f"{url.replace('ws://', 'http://')}/object-types", json=body)
        answer.raise_for_status()


async def scene_state(client: Client, wanted: str) -> None:
    """Wait until the scene has a state.

    Raises:
        RuntimeError: The scene stopped instead.
    """
    while True:
        data = (await client.next_event("SceneState")).data
        if data.state == wanted:
            return
        if data.state == "stopped":
            raise RuntimeError(f"The scene stopped: {data.message}")


async def new_scene(
    client: Client, name: str, objects: list[tuple[str, str, list[Parameter]]]
) -> tuple[str, list[str]]:
    """Create and save a scene; return its id and the ids of its objects."""
    await client.call("NewScene", rpc.NewSceneArgs(name))
    scene_id = (await client.next_event("OpenScene")).data.scene.id
    ids = []
    for object_name, kind, parameters in objects:
        await client.call("AddObjectToScene", rpc.AddObjectToSceneArgs(object_name, kind, parameters=parameters))
        ids.append((await client.next_event("SceneObjectChanged")).data.id)
    await client.call("SaveScene")
    return scene_id, ids


async def start_of_scene(report: Report, url: str, rounds: int = 5) -> None:
    """Measure from StartScene to `started` with 20 devices that take 0.5 s each."""
    async with Client(url, "bench") as client:
        await new_scene(client, "twenty", [(f"slow_{number}", "Slow", []) for number in range(20)])
        samples = []
        for _ in range(rounds):
            await asyncio.sleep(2.0)  # the spare cell host starts
            begin = time.perf_counter()
            await client.call("StartScene")
            await scene_state(client, "started")
            samples.append(time.perf_counter() - begin)
            await client.call("StopScene")
            await scene_state(client, "stopped")
        await client.call("CloseScene", rpc.CloseSceneArgs(force=True))
    report.add(Metric("scene_start_20_s", median(samples), rounds, f"worst {max(samples):.3f} s"))


async def programs(report: Report, url: str, directory: Path, rounds: int = 5, calls: int = 5000) -> None:
    """Measure from RunPackage to the first action, and the period of actions that do nothing."""
    file = directory / "period.txt"
    async with Client(url, "bench") as client:
        settings = [Parameter("file", "string", f'"{file}"'), Parameter("calls", "integer", str(calls))]
        scene_id, (probe,) = await new_scene(client, "probe", [("probe", "Probe", settings)])
        await client.call("NewProject", rpc.NewProjectArgs(scene_id, "ticking"))
        project_id = (await client.next_event("OpenProject")).data.project.id
        await client.call("AddActionPoint", rpc.AddActionPointArgs("ap", Position()))
        point = (await client.next_event("ActionPointChanged")).data.id
        await client.call("AddAction", rpc.AddActionArgs(point, "tick", f"{probe}/tick", [], [Flow()]))
        tick = (await client.next_event("ActionChanged")).data.id
        await client.call("AddLogicItem", rpc.AddLogicItemArgs("START", tick))
        await client.call("AddLogicItem", rpc.AddLogicItemArgs(tick, "END"))
        await client.call("SaveProject")
        package = (await client.call("BuildProject", rpc.BuildProjectArgs(project_id, "ticking"))).package_id
        await client.call("MakeFunction", rpc.MakeFunctionArgs("tick_once", [tick]))
        await client.call("SaveProject")
        nested = (await client.call("BuildProject", rpc.BuildProjectArgs(project_id, "nested"))).package_id
        await client.call("CloseProject")
        await client.call("RunPackage", rpc.RunPackageArgs(nested, checkpoints=False))
        await ended(client)
        in_function = float(file.read_text()) / 2
        first, periods, stored, syncs = [], [], [], []
        for _ in range(rounds):
            await asyncio.sleep(2.0)
            begin = time.perf_counter()
            await client.call("RunPackage", rpc.RunPackageArgs(package, checkpoints=False))
            await client.next_event("ActionStateBefore")
            first.append(time.perf_counter() - begin)
            await ended(client)
            periods.append(float(file.read_text()))
            await asyncio.sleep(2.0)
            await client.run_package(package)
            await ended(client)
            stored.append(float(file.read_text()))
            syncs.append(fdatasync_time(directory, 1000, 512))
    report.add(Metric("run_first_action_ms", median(first) * 1e3, rounds, f"worst {max(first) * 1e3:.0f} ms"))
    note = "including script, device executor, deadline and both events; a client follows them"
    note += f"; {in_function * 1e3:.3f} ms if every second action is a call of a function with the other one"
    report.add(Metric("action_overhead_ms", median(periods) * 1e3, rounds * calls, note))
    added = median(stored) - median(periods)
    note = f"added {added * 1e3:.3f} ms, fdatasync {median(syncs) * 1e3:.3f} ms"
    report.add(Metric("checkpoint_ms", (added - 2.0 * median(syncs)) * 1e3, rounds * calls, note))


async def ended(client: Client) -> None:
    """Wait until the program has stopped."""
    while True:
        event: Any = await client.next_event("PackageState", "ProjectException", timeout=60)
        if event.event == "ProjectException":
            raise RuntimeError(event.data.message)
        if event.data.state == "stopped":
            return


async def run(report: Report, directory: Path) -> None:
    """Measure everything in this group."""
    async with server_process.server(directory / "operation") as (url, _):
        await add_type(url, "Slow", SLOW)
        await add_type(url, "Probe", PROBE)
        await start_of_scene(report, url)
        await programs(report, url, directory)
