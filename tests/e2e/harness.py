"""The whole workplace for tests: fakes, simulated cell and server as processes, and helpers to control them."""

import asyncio
import contextlib
import os
import signal
import subprocess
from collections.abc import AsyncIterator, Callable
from pathlib import Path
from typing import IO, Any
from urllib.parse import urlsplit

import msgspec
import psutil

from arcor2_hw.client import Client
from arcor2_hw.data import rpc
from arcor2_hw.data.events import Event, SceneStateEnum
from arcor2_hw.data.project import Project
from arcor2_hw.data.scene import Scene
from arcor2_hw.testing.own_time import own_time
from arcor2_server.demo.fakes import free_loopback_address
from arcor2_server.demo.processes import Child
from arcor2_server.demo.workplace import Creation, Scalar, Workplace, load
from tests import forked_children
from tests.fakes.conftest import start_forked_fake
from tests.forking import Forked, awaited
from tests.leaks import outliving_the_test
from tests.server.core.serving import fork_server, keep_analysis
from tests.waiting import WITHIN

WORKPLACE = Path(__file__).parent / "workplace" / "three_devices.toml"


async def until(check: Callable[[], Any], condition: str, timeout: float = 30.0) -> Any:
    """Poll until the result is true, and return it. Fail with the name of the condition."""
    start = own_time()
    while True:
        answer = check()
        if asyncio.iscoroutine(answer):
            answer = await answer
        if answer:
            return answer
        assert not start.is_past(timeout), f"not within {timeout} s: {condition}"
        await asyncio.sleep(0.02)


class ForkedChild(Child):
    """A child that is forked from a process which has already imported its program."""

    def __init__(self, name: str, log: Path, fork: Callable[[IO[bytes]], Forked | subprocess.Popen[bytes]]) -> None:
        super().__init__(name, [], log)
        self._fork = fork

    async def _launch(self, log: IO[bytes]) -> Any:
        return await awaited(self._fork(log))


class Cell:
    """All processes. `command_fake` sends commands to a fake, `client` connects to the server."""

    def __init__(self, directory: Path) -> None:
        self.directory = directory
        self.data_dir = directory / "data"
        self.logs = directory / "logs"
        self.logs.mkdir(parents=True, exist_ok=True)
        self.at: dict[str, dict[str, Any]] = {}
        self.url = ""
        self.children: dict[str, Child] = {}
        self._exit = contextlib.AsyncExitStack()
        self.robot_host = free_loopback_address()

    # ------------------------------------------------------------------------------------------------ processes
    async def _start(self, name: str, fork: Callable[[IO[bytes]], Forked | subprocess.Popen[bytes]]) -> str:
        child = ForkedChild(name, self.logs / f"{name}-{len(self.children)}.log", fork)
        self.children[name] = child
        return await child.start()

    async def start_fake(self, name: str, module: str, *arguments: str) -> None:
        """Start a module of `arcor2_fakes`."""
        control = ("--control", "127.0.0.1:0")
        ready = await self._start(name, lambda log: start_forked_fake(module, [*arguments, *control], log))
        self.at[name] = msgspec.json.decode(ready)

    async def start_robot(self, *arguments: str) -> None:
        await self.start_fake("robot", "ur", "--host", self.robot_host, *arguments)

    async def start_devices(self) -> None:
        async with asyncio.TaskGroup() as tasks:
            tasks.create_task(self.start_robot())
            tasks.create_task(self.start_fake("tester", "functional_tester"))
            tasks.create_task(self.start_fake("reader", "barcode_reader"))

    async def start_world(self, boards: int, seed: int) -> None:
        await self.start_fake(
            "world",
            "cell",
            *("--layout", str(WORKPLACE.with_suffix(".json"))),
            *("--robot", self.at["robot"]["control"]),
            *("--tester", self.at["tester"]["control"]),
            *("--reader", self.at["reader"]["control"]),
            *("--boards", str(boards), "--seed", str(seed)),
        )

    async def start_server(self, port: int = 0) -> None:
        fresh = not self.data_dir.exists()
        self.url = await self._start(
            "server", lambda log: fork_server(self.data_dir, "--port", str(port), "--history", stderr=log)
        )
        if fresh:
            keep_analysis(self.data_dir)

    async def restart_server(self) -> None:
        """Restart the killed server on the same port and data directory."""
        with outliving_the_test():
            await self.start_server(urlsplit(self.url).port or 0)

    async def renew_server(self) -> None:
        """Stop the server if it runs, and start it on an empty data directory."""
        await self.children["server"].stop()
        self.data_dir = self.directory / f"data-{len(list(self.directory.glob('data*')))}"
        with outliving_the_test():
            await self.start_server()

    async def renew_robot(self, *arguments: str) -> None:
        """Restart the simulated robot at the same address, with more arguments."""
        await self.children["robot"].stop()
        with outliving_the_test():
            await self.start_robot(*arguments)

    async def kill(self, name: str) -> None:
        """Kill a process, as a power failure would."""
        process = self.children[name]._process
        assert process is not None
        process.kill()
        await process.wait()
        await self.children[name].stop()

    def hosts(self) -> list[psutil.Process]:
        """Return the cell hosts of the server, the newest last."""
        server = self.children["server"]._process
        assert server is not None
        return forked_children.children(server.pid, "arcor2_hw.runtime.host")

    async def close_clients(self) -> None:
        await self._exit.aclose()

    async def stop(self) -> None:
        await self.close_clients()
        # End the server first, because it holds the devices, and the world before the fakes that it follows.
        for name in sorted(self.children, key=lambda name: {"server": 0, "world": 1}.get(name, 2)):
            await self.children[name].stop()

    # -------------------------------------------------------------------------------------- clients and commands
    async def client(self, name: str) -> Client:
        """Return a connected, registered client, which is closed with the cell or by `close_clients`."""
        return await self._exit.enter_async_context(Client(self.url, name, reconnect=False))

    async def command_fake(self, name: str, do: str, **arguments: Any) -> Any:
        """Send a command to a fake over its control channel."""
        host, _, port = self.at[name]["control"].rpartition(":")
        reader, writer = await asyncio.open_connection(host, int(port), limit=1 << 22)
        try:
            writer.write(msgspec.json.encode({"id": 1, "do": do, **arguments}) + b"\n")
            async with asyncio.timeout(WITHIN):  # `wait_for` of Python 3.11 may ignore a cancellation
                answer = msgspec.json.decode(await reader.readline())
        finally:
            writer.close()
            with contextlib.suppress(OSError):
                await writer.wait_closed()
        assert answer["ok"], f"{name} refuses {do}: {answer}"
        return answer.get("data")

    def addresses(self) -> dict[str, Scalar]:
        host, _, port = self.at["tester"]["modbus"].rpartition(":")
        return {
            "robot": self.robot_host,
            "tester_host": host,
            "tester_port": int(port),
            "reader": self.at["reader"]["port"],
        }

    async def open(self, client: Client, boards: int = 2, workplace: Workplace | None = None) -> tuple[Scene, Project]:
        """Open the scene and project of the three devices; create missing ones."""
        creation = Creation(client, workplace or load(WORKPLACE), self.addresses())
        scene = await creation.open_scene()
        return scene, await creation.open_project(scene, {"boards": boards})

    async def build(self, client: Client, project: Project) -> str:
        """Build the open project and close it; return the package's id."""
        built = await client.call("BuildProject", rpc.BuildProjectArgs(project.id, project.name))
        await client.call("CloseProject")
        package_id: str = built.package_id
        return package_id


async def scene_state(client: Client, wanted: SceneStateEnum, timeout: float = 120.0) -> Event:
    """Wait for the next SceneState with this state."""
    while True:
        event = await client.next_event("SceneState", timeout=timeout)
        if event.data.state is wanted:
            return event


def alive(pid: int) -> bool:
    """Return whether a process runs (a zombie does not)."""
    try:
        return psutil.Process(pid).status() != psutil.STATUS_ZOMBIE
    except psutil.NoSuchProcess:
        return False


def kill(pid: int) -> None:
    os.kill(pid, signal.SIGKILL)


@contextlib.asynccontextmanager
async def running_cell(directory: Path, *, boards: int = 0, seed: int = 0) -> AsyncIterator[Cell]:
    """Start all fakes and the server. With boards, start the simulated cell, too."""
    cell = Cell(directory)
    try:
        async with asyncio.TaskGroup() as tasks:
            tasks.create_task(cell.start_devices())
            tasks.create_task(cell.start_server())
        if boards:
            await cell.start_world(boards, seed)
        yield cell
    finally:
        await cell.stop()
