"""Cell hosts on nodes: calls, stops, several nodes, a cut cable; broker, socket and Zenoh side by side.

Zenoh is measured if it is installed: `pip install eclipse-zenoh`.
"""

import asyncio
import contextlib
import importlib.util
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import AsyncIterator, Awaitable, Callable
from pathlib import Path
from typing import Any

import msgspec
import nats
from msgspec.structs import replace
from nats.aio.client import Client

from arcor2_hw.data.cell import BROKER_URL
from arcor2_hw.data.project import Project
from arcor2_hw.data.scene import SceneObject
from arcor2_hw.messages import Message
from arcor2_hw.runtime import messages as m
from arcor2_server.access.authority import Authority
from arcor2_server.hosts.group import HostGroup
from arcor2_server.hosts.pool import CellHosts
from arcor2_server.hosts.process import CellHost
from benchmarks.metrics import Metric, Report, percentile
from benchmarks.node_echo import SUBJECT, Frames, context, zenoh_session
from tests.ports import free_port
from tests.runtime.conftest import HEADER, Package, open_scene, scene_object, type_code
from tests.server.nodes.cable import Cable, CannotIsolate
from tests.server.nodes.conftest import NODE, Broker, Node
from tests.server.nodes.test_cut_cable import cut_and_heal
from tests.waiting import wait_for

CALLS = 1000
STOPS = 200
PICTURE = 1_000_000
"""Size of a picture, bytes."""
PICTURE_RATE = 30.0
"""Rate of the camera, 1/s."""
CUTS = 3
WITHIN = 60.0
SECOND = "oven"
DEVICE = type_code(
    "Device",
    f"""
    class Device(Generic):
        _ABSTRACT = False
        picture_ = "x" * {PICTURE}

        def add(self, a: int, b: int) -> int:
            return a + b

        def picture(self) -> str:
            return self.picture_

        def move(self, file: str) -> None:
            self.moving = True
            Path(file).touch()
            while self.moving:
                time.sleep(0.001)
            Path(file).write_text(str(time.monotonic()))

        def stop(self) -> None:
            self.moving = False
""",
)


async def started(url: str, node: str) -> CellHost:
    """Return a host with an arm and a camera, on a node or on this computer."""
    host = await CellHost.start(os.environ | {"ARCOR2_HW_NATS_URL": url}, node)
    await asyncio.wait_for(asyncio.shield(host.ready), WITHIN)
    host.send(open_scene([DEVICE], scene_object("arm", "Device"), scene_object("camera", "Device")))
    await host.expect(m.SceneOpened, WITHIN)
    return host


async def timed(call: Callable[[], Awaitable[object]]) -> float:
    """Return the duration of a call, ms."""
    begin = time.perf_counter()
    await call()
    return (time.perf_counter() - begin) * 1e3


async def _calls(report: Report, local: CellHost, remote: CellHost) -> None:
    samples: dict[CellHost, list[float]] = {local: [], remote: []}
    for number in range(CALLS + 50):
        for host, found in samples.items():
            duration = await timed(lambda host=host: host.call("obj_arm", "add", {"a": b"1", "b": b"2"}))  # type: ignore[misc]
            if number >= 50:
                found.append(duration)
    for percent in (50, 99):
        here, there = (percentile(found, percent) for found in samples.values())
        note = f"local {here:.2f} ms, on a node {there:.2f} ms"
        report.add(Metric(f"node_call_added_p{percent}_ms", there - here, CALLS, note))


async def _stops(report: Report, local: CellHost, remote: CellHost) -> None:
    here, _ = await _stop_durations(local)
    there, rate = await _stop_durations(remote)
    note = f"median {percentile(there, 50):.1f} ms, next to {rate:.0f} pictures of 1 MB per second; 99th percentile "
    note += f"without a node {percentile(here, 99):.1f} ms"
    report.add(Metric("node_stop_beside_pictures_p99_ms", percentile(there, 99), STOPS, note))


async def _stop_durations(host: CellHost) -> tuple[list[float], float]:
    """Return the durations of stops of the arm while the camera is read, ms, and the number of pictures per second."""
    taken = 0

    async def take_pictures() -> None:
        nonlocal taken
        loop = asyncio.get_running_loop()
        due = loop.time()
        while True:
            await host.call("obj_camera", "picture")
            taken += 1
            due = max(due + 1.0 / PICTURE_RATE, loop.time())
            await asyncio.sleep(due - loop.time())

    camera = asyncio.create_task(take_pictures())
    try:
        await asyncio.sleep(0.5)
        begin, before, samples = time.perf_counter(), taken, []
        for _ in range(STOPS):
            samples.append(await timed(lambda: host.stop_motion("obj_arm")))
            await asyncio.sleep(0.02)
        return samples, (taken - before) / (time.perf_counter() - begin)
    finally:
        camera.cancel()


async def _cuts(report: Report, folder: Path) -> None:
    stopped: list[float] = []
    named: list[float] = []
    for number in range(CUTS):
        place = folder / f"cut_{number}"
        place.mkdir()
        try:
            with Cable() as cable:
                found = await asyncio.to_thread(cut_and_heal, cable, place)
        except CannotIsolate as reason:
            print(f"no network namespaces: {reason}", file=sys.stderr)
            return
        stopped.append(float(str(found["stopped"])))
        named.append(float(str(found["named"])))
    report.add(Metric("node_cut_stopped_s", max(stopped), CUTS, "the longest"))
    report.add(Metric("node_cut_named_s", max(named), CUTS, "the longest"))


# ------------------------------------------------------------------------------------------------ several nodes
TIMED_CALLS = f"""
import json, statistics
here, there = res.objects["obj_arm"], res.objects["obj_camera"]
samples = {{"here": [], "there": []}}
for number in range({CALLS + 50}):
    for name, device in (("here", here), ("there", there)):
        begin = time.perf_counter()
        device.add(1, 2)
        samples[name].append((time.perf_counter() - begin) * 1e3)
with open(FILE, "w") as file:
    json.dump({{name: found[50:] for name, found in samples.items()}}, file)
"""


class _Group:
    """The hosts of a scene or program on this computer and on nodes, and their reports."""

    def __init__(self) -> None:
        self.messages: asyncio.Queue[m.ServerBound] = asyncio.Queue()
        self.ended_at = 0.0

    def host_message(self, host: HostGroup, message: m.ServerBound) -> None:  # noqa: ARG002
        self.messages.put_nowait(message)

    def host_silent(self, host: HostGroup, silent: bool) -> None:
        """Ignore it."""

    def host_ended(self, host: HostGroup, reason: Message) -> None:  # noqa: ARG002
        self.ended_at = time.monotonic()

    async def until(self, *kinds: type[m.ToServer]) -> m.ServerBound:
        """Return the next message of these types."""
        async with asyncio.timeout(WITHIN):
            while not isinstance(message := await self.messages.get(), kinds):
                continue
        return message


def _objects(*nodes: str) -> list[SceneObject]:
    return [
        replace(scene_object(name, "Device"), node=node)
        for name, node in zip(("arm", "camera", "belt"), nodes, strict=False)
    ]


async def _several(report: Report, folder: Path, broker: Broker) -> None:
    """Measure calls of a program of an object on a node, stops of all hosts, and the loss of a node."""
    pool = CellHosts([])
    try:
        objects, samples = _objects("", NODE), folder / "samples.json"
        package = Package(folder / "package")
        source = DEVICE.source.removeprefix(HEADER)
        package.write({"Device": source}, objects, Project("p", "scn_1"), f"FILE = {str(samples)!r}\n{TIMED_CALLS}")
        user = _Group()
        group = await pool.take_all(user, pool.place(objects))
        group.send(m.RunPackage("bench", str(package.directory)))
        while (message := await user.until(m.ProgramChanged)).state != "stopped":  # type: ignore[union-attr]
            continue
        await group.wait_or_kill()
        if message.error is not None:  # type: ignore[union-attr]
            raise RuntimeError(message.error)  # type: ignore[union-attr]
        found = msgspec.json.decode(samples.read_bytes(), type=dict[str, list[float]])
        for percent in (50, 99):
            here, there = (percentile(found[name], percent) for name in ("here", "there"))
            note = f"local {here:.2f} ms, on a node {there:.2f} ms"
            report.add(Metric(f"node_program_call_added_p{percent}_ms", there - here, CALLS, note))

        objects = _objects("", NODE, SECOND)
        user = _Group()
        group = await pool.take_all(user, pool.place(objects))
        group.send(open_scene([DEVICE], *objects))
        await user.until(m.SceneOpened)
        stops = [await timed(group.stop_all) for _ in range(STOPS)]
        report.add(
            Metric("node_stop_all_p99_ms", percentile(stops, 99), STOPS, f"median {percentile(stops, 50):.1f} ms")
        )

        file = folder / "moving"
        moving = asyncio.create_task(group.call("obj_arm", "move", {"file": msgspec.json.encode(str(file))}))
        await asyncio.to_thread(wait_for, file.exists)
        cut_at = time.monotonic()
        os.kill(broker.process.pid, signal.SIGSTOP)
        try:
            text = await asyncio.to_thread(wait_for, file.read_text)
        finally:
            os.kill(broker.process.pid, signal.SIGCONT)
        moving.cancel()
        report.add(
            Metric("node_lost_others_stopped_s", float(text) - cut_at, 1, "a device on the computer of the server")
        )
    finally:
        await pool.close()


# ------------------------------------------------------------------------------------------------ engines side by side
def certificates(folder: Path) -> None:
    """Write the files of a local authority for the servers."""
    data = folder / "data"
    data.mkdir()
    authority = Authority(data, lambda: ["localhost", "127.0.0.1"])
    authority.renew()
    for source, name in zip((*authority.files, authority.file), ("chain.pem", "key.pem", "authority.pem"), strict=True):
        shutil.copyfile(source, folder / name)


@contextlib.asynccontextmanager
async def echo(folder: Path, kind: str, port: int = 0) -> AsyncIterator[str]:
    """Run an echo process in this context; return its output after it is ready."""
    command = (sys.executable, "-m", "benchmarks.node_echo", str(folder), kind, str(port))
    process = await asyncio.create_subprocess_exec(*command, stdout=subprocess.PIPE)
    try:
        assert process.stdout is not None
        yield (await process.stdout.readline()).decode().strip()
    finally:
        process.kill()
        await process.wait()


class _Asking(Frames):
    answer: "asyncio.Future[bytes]"

    def received(self, body: bytes) -> None:
        self.answer.set_result(body)

    async def ask(self, body: bytes) -> bytes:
        self.answer = asyncio.get_running_loop().create_future()
        self.send(body)
        return await self.answer


@contextlib.asynccontextmanager
async def asking_zenoh(folder: Path, payload: bytes) -> AsyncIterator[Callable[[], Awaitable[object]] | None]:
    """Run an echo process of Zenoh in this context; return a function that asks it, None if Zenoh is not installed."""
    if importlib.util.find_spec("zenoh") is None:
        yield None
        return
    port = free_port()
    async with echo(folder, "zenoh", port):
        session = zenoh_session(folder, port, server=False)
        loop = asyncio.get_running_loop()

        async def ask() -> bytes:
            answer: asyncio.Future[bytes] = loop.create_future()

            def answered(reply: Any) -> None:
                loop.call_soon_threadsafe(answer.set_result, bytes(reply.ok.payload))

            session.get(SUBJECT, answered, payload=payload)
            return await asyncio.wait_for(answer, WITHIN)

        try:
            yield ask
        finally:
            session.close()


async def _engines(report: Report, folder: Path) -> None:
    certificates(folder)
    config = folder / "nats.conf"
    config.write_text(f'tls {{cert_file: "{folder}/chain.pem", key_file: "{folder}/key.pem"}}\n')
    broker = Broker(folder, options=("--config", str(config)))
    payload = os.urandom(256)
    try:
        port = int(broker.url.rpartition(":")[2])
        tls = context(folder, server=False)
        async with (
            echo(folder, "nats", port),
            echo(folder, "socket") as number,
            asking_zenoh(folder, payload) as ask_zenoh,
        ):
            client: Client = await nats.connect(f"tls://localhost:{port}", tls=tls)
            _, asking = await asyncio.get_running_loop().create_connection(
                _Asking, "127.0.0.1", int(number), ssl=tls, server_hostname="localhost"
            )
            engines: dict[str, Callable[[], Awaitable[object]]] = {
                "broker": lambda: client.request(SUBJECT, payload, WITHIN),
                "socket": lambda: asking.ask(payload),
            }
            if ask_zenoh is not None:
                engines["zenoh"] = ask_zenoh
            samples: dict[str, list[float]] = {name: [] for name in engines}
            for repetition in range(CALLS + 50):
                for name, ask in engines.items():
                    duration = await timed(ask)
                    if repetition >= 50:
                        samples[name].append(duration)
            await client.close()
    finally:
        broker.end()
    for name, found in samples.items():
        note = f"median {percentile(found, 50):.2f} ms; 256 bytes, TLS"
        report.add(Metric(f"node_{name}_p99_ms", percentile(found, 99), CALLS, note))


async def run(report: Report, directory: Path) -> None:
    """Measure everything in this group."""
    folder = directory / "nodes"
    folder.mkdir()
    places = [folder / name for name in ("broker", "cache", "engines", "several")]
    for place in places:
        place.mkdir()
    broker = Broker(places[0])
    try:
        node = Node(broker.url, places[1])
        try:
            local, remote = await started(broker.url, ""), await started(broker.url, NODE)
            try:
                await _calls(report, local, remote)
                await _stops(report, local, remote)
            finally:
                await asyncio.gather(local.close(), remote.close())
            second = Node(broker.url, places[1], name=SECOND)
            os.environ[BROKER_URL] = broker.url
            try:
                await _several(report, places[3], broker)
            finally:
                del os.environ[BROKER_URL]
                second.end()
        finally:
            node.end()
    finally:
        broker.end()
    await _cuts(report, folder)
    await _engines(report, places[2])
