"""Round trips of requests compared with an echo; edits compared with echo and fdatasync; start time and memory."""

import asyncio
import json
import os
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import psutil

from arcor2_hw.client import Client
from arcor2_hw.data import rpc
from arcor2_hw.data.geometry import Position
from arcor2_server.hosts.process import CellHost
from benchmarks import server_process
from benchmarks.metrics import Metric, Report, median

ROUNDS = 20
PER_ROUND = 100


async def ratio(report: Report, url: str, directory: Path, name: str, request: str) -> None:
    """Measure a request and an echo of the same size in alternation, so that load affects both."""
    text = json.dumps({"id": 1, "request": request})
    async with server_process.socket(url) as real:
        size = len(await server_process.answer(real, text))
        async with server_process.echo(directory, size) as echo_url, server_process.socket(echo_url) as echo:
            await server_process.round_trips(real, text, PER_ROUND)
            await server_process.round_trips(echo, text, PER_ROUND)
            ratios, reals, echoes = [], [], []
            for _ in range(ROUNDS):
                ours = median(await server_process.round_trips(real, text, PER_ROUND))
                theirs = median(await server_process.round_trips(echo, text, PER_ROUND))
                ratios.append(ours / theirs)
                reals.append(ours)
                echoes.append(theirs)
    note = f"{median(reals) * 1e6:.0f} us against {median(echoes) * 1e6:.0f} us, response of {size} bytes"
    report.add(Metric(name, median(ratios), ROUNDS * PER_ROUND, note))


def fdatasync_time(directory: Path, n: int = 200, size: int = 4096) -> float:
    """Return the median time of writing `size` bytes and fdatasync, s."""
    samples = []
    with tempfile.TemporaryFile(dir=directory) as file:
        for _ in range(n):
            begin = time.perf_counter()
            file.write(b"x" * size)
            file.flush()
            os.fdatasync(file.fileno())
            samples.append(time.perf_counter() - begin)
    return median(samples)


async def edits(report: Report, url: str, directory: Path) -> None:
    """Measure AddAction with 10 and with 1,000 actions in the project."""
    async with Client(url, "author") as client:
        await client.call("NewScene", rpc.NewSceneArgs("bench"))
        await client.call("AddObjectToScene", rpc.AddObjectToSceneArgs("time", "TimeActions"))
        scene_object = (await client.next_event("SceneObjectChanged")).data.id
        await client.call("SaveScene")
        scene_id = (await client.call("ListScenes"))[0].id
        await client.call("NewProject", rpc.NewProjectArgs(scene_id, "bench project"))
        await client.call("AddActionPoint", rpc.AddActionPointArgs("ap", Position()))
        point = (await client.next_event("ActionPointChanged")).data.id
    request = {
        "id": 1,
        "request": "AddAction",
        "args": {
            "action_point_id": point,
            "name": "",
            "type": f"{scene_object}/sleep",
            "parameters": [{"name": "seconds", "type": "double", "value": "0.5"}],
            "flows": [{"type": "default", "outputs": []}],
        },
    }
    async with server_process.socket(url) as real:
        await real.send(json.dumps({"id": 1, "request": "RegisterUser", "args": {"user_name": "bench"}}))
        await server_process.answer(
            real, json.dumps({"id": 2, "request": "RegisterUser", "args": {"user_name": "bench"}})
        )
        count = 0

        async def add(n: int) -> list[float]:
            nonlocal count
            samples = []
            for _ in range(n):
                request["args"]["name"] = f"action {count}"  # type: ignore[index]
                count += 1
                text = json.dumps(request)
                begin = time.perf_counter()
                answer = await server_process.answer(real, text)
                samples.append(time.perf_counter() - begin)
                assert json.loads(answer)["result"], answer
            return samples

        async with server_process.echo(directory, 50) as echo_url, server_process.socket(echo_url) as echo:
            for size in (10, 1000):
                await add(max(0, size - count))
                syncs, echoes, adds = [], [], []
                for _ in range(10):
                    adds += await add(10)
                    echoes += await server_process.round_trips(echo, json.dumps(request), 20)
                    syncs.append(fdatasync_time(directory, 20))
                beyond = statistics.median(adds) - statistics.median(echoes) - statistics.median(syncs)
                note = (
                    f"AddAction {median(adds) * 1e3:.3f} ms, echo {median(echoes) * 1e3:.3f} ms,"
                    f" fdatasync {median(syncs) * 1e3:.3f} ms"
                )
                report.add(Metric(f"add_action_{size}_ms", beyond * 1e3, len(adds), note))


def interpreter_start() -> float:
    """Return the processor time of an interpreter that imports asyncio, s; median of 5."""
    samples = []
    for _ in range(5):
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        subprocess.run([sys.executable, "-c", "import asyncio"], check=True)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        samples.append(after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime)
    return median(samples)


async def host_start() -> float:
    """Return the processor time of a cell host until it is ready, s."""
    host = await CellHost.start()
    await host.ready
    taken = processor_time(psutil.Process(host.pid))
    await host.close()
    return taken


def processor_time(process: psutil.Process) -> float:
    """Return the processor time that a process has used, s."""
    times = process.cpu_times()
    return float(times.user + times.system)


async def start(report: Report, directory: Path) -> None:
    """Measure the start of server and cell host with existing data, and the memory of the idle server."""
    samples, servers, cell_hosts = [], [], []
    memory = 0.0
    hosts = 0.0
    for _ in range(6):
        reference = interpreter_start()
        cell_hosts.append(await host_start() / reference)
        begin = time.perf_counter()
        async with server_process.server(directory / "data") as (url, process):
            async with server_process.socket(url) as opened:
                await server_process.answer(opened, '{"id": 1, "request": "SystemInfo"}')
            samples.append(time.perf_counter() - begin)
            servers.append(processor_time(process) / reference)
            if len(samples) == 6:
                await _settled(url)
                memory = process.memory_full_info().pss / 2**20
                hosts = sum(child.memory_full_info().pss for child in process.children()) / 2**20
    # The first start creates the database and fills the file cache.
    report.add(Metric("cold_start_s", median(samples[1:]), 5, f"first on empty data {samples[0]:.2f} s"))
    report.add(Metric("start_server_ratio", median(servers[1:]), 5, f"first on empty data {servers[0]:.1f}"))
    report.add(Metric("start_host_ratio", median(cell_hosts[1:]), 5, f"interpreter {reference * 1e3:.0f} ms"))
    report.add(Metric("idle_memory_mib", memory, 1, f"PSS of the server; the spare cell host uses {hosts:.0f} MiB"))


async def _settled(url: str) -> None:
    async with server_process.socket(url) as opened:
        for request in ("ListScenes", "GetObjectTypes", "ListProjects"):
            await server_process.answer(opened, json.dumps({"id": 1, "request": request}))
    await asyncio.sleep(3)  # the spare cell host imports its modules


async def run(report: Report, directory: Path) -> None:
    """Measure everything in this group."""
    await start(report, directory)
    async with server_process.server(directory / "data") as (url, _):
        async with Client(url, "filler") as client:
            for number in range(30):
                await client.call("NewScene", rpc.NewSceneArgs(f"scene {number}", "one of many"))
                await client.call("SaveScene")
                await client.call("CloseScene")
        await ratio(report, url, directory, "rpc_ratio_system_info", "SystemInfo")
        await ratio(report, url, directory, "rpc_ratio_list_scenes", "ListScenes")
        await ratio(report, url, directory, "rpc_ratio_object_types", "GetObjectTypes")
    async with server_process.server(directory / "edits") as (url, _):
        await edits(report, url, directory)
