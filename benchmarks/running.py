"""A running program: latency of its commands, and a package of 1,000 distinct actions."""

import asyncio
import itertools
import time
from pathlib import Path
from typing import Any

import httpx

from arcor2_hw.client import Client
from arcor2_hw.data import rpc
from benchmarks import server_process
from benchmarks.metrics import Metric, Report, median, percentile
from benchmarks.operation import PROBE, add_type, ended

NAPPER = '''"""A device whose action takes 5 ms."""

import time

from arcor2_hw.actions import action
from arcor2_hw.objects import Generic


class Napper(Generic):
    """Waits."""

    _ABSTRACT = False

    @action
    def nap(self, *, an: str | None = None) -> None:
        """Wait for 5 ms."""
        time.sleep(0.005)
'''
ROUNDS = 100
STOPS = 10
DISTINCT = 1000


def project(name: str, actions: int, action_type: str) -> dict[str, Any]:
    """Return a project of `actions` consecutive actions of the same type."""
    ids = [f"act_{number}" for number in range(actions)]
    ends = ["START", *ids, "END"]
    return {
        "id": f"pro_{name}",
        "name": name,
        "sceneId": "scn_running",
        "actionPoints": [
            {
                "name": f"ap{number}",
                "id": f"acp_{number}",
                "position": {"x": 0, "y": 0, "z": 0},
                "actions": [{"name": f"do_{number}", "id": key, "type": action_type, "flows": [{}]}],
            }
            for number, key in enumerate(ids)
        ],
        "logic": [
            {"id": f"lit_{number}", "start": start, "end": end}
            for number, (start, end) in enumerate(itertools.pairwise(ends))
        ],
    }


async def prepare(url: str, directory: Path) -> None:
    """Save a scene with three objects, and three projects: an endless one, a long one, and one that sleeps."""
    await add_type(url, "Probe", PROBE)
    await add_type(url, "Napper", NAPPER)
    parameters = [
        {"name": "file", "type": "string", "value": f'"{directory / "running.txt"}"'},
        {"name": "calls", "type": "integer", "value": str(DISTINCT)},
    ]
    probe = {"name": "probe", "type": "Probe", "id": "obj_probe", "parameters": parameters}
    scene = {
        "id": "scn_running",
        "name": "running",
        "objects": [
            probe,
            {"name": "napper", "type": "Napper", "id": "obj_napper"},
            {"name": "time", "type": "TimeActions", "id": "obj_time"},
        ],
    }
    sleeping = project("sleeping", 1, "obj_time/sleep")
    sleeping["actionPoints"][0]["actions"][0]["parameters"] = [{"name": "seconds", "type": "double", "value": "60.0"}]
    async with httpx.AsyncClient(base_url=url.replace("ws://", "http://"), timeout=30) as http:
        for path, body in (
            ("/scenes", scene),
            ("/projects", project("few", 2, "obj_napper/nap")),
            ("/projects", project("distinct", DISTINCT, "obj_probe/tick")),
            ("/projects", sleeping),
        ):
            (await http.put(path, json=body)).raise_for_status()


async def built(client: Client, name: str) -> str:
    """Build a project; return the id of the package."""
    answer = await client.call("BuildProject", rpc.BuildProjectArgs(f"pro_{name}", name))
    package: str = answer.package_id
    return package


async def timed(client: Client, request: str, event: str, state: str = "") -> float:
    """Return the time from sending a request to an event, of a state if one is given, s."""
    begin = time.perf_counter()
    asked = asyncio.create_task(client.call(request))
    try:
        while True:
            data = (await client.next_event(event)).data
            if not state or data.state == state:
                return time.perf_counter() - begin
    finally:
        await asked


async def commands(report: Report, url: str) -> None:
    """Measure the latency of commands to a running program."""
    samples: dict[str, list[float]] = {name: [] for name in ("pausing", "step", "resume", "stopping")}
    async with Client(url, "bench") as client:
        package = await built(client, "few")
        for _ in range(ROUNDS // 10):
            await asyncio.sleep(1.0)  # the spare cell host starts
            await client.call("RunPackage", rpc.RunPackageArgs(package, start_paused=True))
            await until_paused(client)
            for _ in range(10):
                samples["step"].append(await timed(client, "StepAction", "PackageState", "running"))
                await until_paused(client)
                samples["resume"].append(await timed(client, "ResumePackage", "PackageState", "running"))
                samples["pausing"].append(await timed(client, "PausePackage", "PackageState", "pausing"))
                await until_paused(client)
            samples["stopping"].append(await timed(client, "StopPackage", "PackageState", "stopping"))
            await ended(client)
    for name, values in samples.items():
        note = f"median {median(values) * 1e3:.2f} ms, worst {max(values) * 1e3:.1f} ms"
        report.add(Metric(f"{name}_ms", percentile(values, 95) * 1e3, len(values), note))


async def stopped(report: Report, url: str) -> None:
    """Measure the time until a program ends that is stopped during a sleeping action."""
    samples = []
    async with Client(url, "bench") as client:
        package = await built(client, "sleeping")
        for _ in range(STOPS):
            await asyncio.sleep(1.0)  # the spare cell host starts
            await client.call("RunPackage", rpc.RunPackageArgs(package))
            await client.next_event("ActionStateBefore")
            await asyncio.sleep(0.1)
            samples.append(await timed(client, "StopPackage", "PackageState", "stopped"))
            await client.next_event("ShowMainScreen")
    note = f"median {median(samples) * 1e3:.1f} ms"
    report.add(Metric("stopped_ms", percentile(samples, 95) * 1e3, len(samples), note))


async def until_paused(client: Client) -> None:
    """Wait until the program is paused."""
    while (await client.next_event("PackageState")).data.state != "paused":
        pass


async def distinct(report: Report, url: str, rounds: int = 3) -> None:
    """Measure a run of 1,000 distinct actions, from the request to the end."""
    samples, first = [], []
    async with Client(url, "bench") as client:
        package = await built(client, "distinct")
        for _ in range(rounds):
            await asyncio.sleep(1.0)
            begin = time.perf_counter()
            await client.call("RunPackage", rpc.RunPackageArgs(package, checkpoints=False))
            await client.next_event("ActionStateBefore")
            first.append(time.perf_counter() - begin)
            await ended(client)
            samples.append(time.perf_counter() - begin)
        runs = (await client.call("ListRuns", rpc.ListRunsArgs(limit=1))).runs
        assert runs[0].actions == DISTINCT + 1, runs[0]
    note = f"first action after {median(first) * 1e3:.0f} ms"
    report.add(Metric("run_1000_distinct_s", median(samples), rounds, note))


async def run(report: Report, directory: Path) -> None:
    """Measure everything in this group."""
    async with server_process.server(directory / "running") as (url, _):
        await prepare(url, directory)
        await commands(report, url)
        await stopped(report, url)
        await distinct(report, url)
