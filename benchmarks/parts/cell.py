"""The demo cell without its first run: fakes, world and a server that can be killed."""

import asyncio
import contextlib
import os
import signal
import socket
import sqlite3
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

from arcor2_hw.client import Client
from arcor2_hw.data import rpc
from arcor2_hw.exceptions import Arcor2Error
from arcor2_server.demo.control import ask
from arcor2_server.demo.fakes import fakes, world_arguments
from arcor2_server.demo.processes import Child, python_module
from arcor2_server.demo.run import FAST, FAST_ACCELERATIONS
from arcor2_server.demo.workplace import Creation, Scalar, layout_file, load


class FakeCommand(NamedTuple):
    """A command to a fake."""

    fake: str
    command: str
    arguments: dict[str, Any]


class Cell:
    """The processes of the cell, and the true state of its world."""

    def __init__(self, folder: Path, boards: int, seed: int) -> None:
        self.folder, self._boards, self._seed = folder, boards, seed
        self._children: list[Child] = []
        self.at: dict[str, str] = {}
        """Control channels of the fakes."""
        self.url = ""
        self.package_id = ""
        with socket.socket() as probe:
            probe.bind(("127.0.0.1", 0))
            self._port = probe.getsockname()[1]
        self._server = self._new_server()

    def _child(self, name: str, command: list[str]) -> Child:
        child = Child(name, command, self.folder / f"{name}.log")
        self._children.append(child)
        return child

    def _new_server(self) -> Child:
        serve = python_module(
            *("arcor2_server.cli.main", "serve", "--port", str(self._port), "--data-dir", str(self.folder / "data"))
        )
        return Child("server", serve, self.folder / "server.log")

    async def start(self) -> None:
        """Start everything, and build the package."""
        wanted = fakes(self._boards, self._seed, fast=True)
        options = {"robot": ("--time-scale", "0.1")}  # shorter delays before a protective stop may be unlocked
        children = [self._child(fake.name, [*fake.command(), *options.get(fake.name, ())]) for fake in wanted]
        async with asyncio.TaskGroup() as starts:
            found = [starts.create_task(child.start_json()) for child in children]
            serving = starts.create_task(self._server.start())
        self.url = serving.result()
        started = {fake.name: (fake, task.result()) for fake, task in zip(wanted, found, strict=True)}
        self.at = {name: str(ready["control"]) for name, (_, ready) in started.items()}
        arguments = world_arguments(started, layout_file(), self._boards, self._seed)
        world = self._child("world", python_module("arcor2_fakes.cell", *arguments, "--control", "127.0.0.1:0"))
        self.at["world"] = (await world.start_json())["control"]
        settings: dict[str, Scalar] = {"outbox": str((self.folder / "data" / "outbox").absolute())}
        settings |= FAST_ACCELERATIONS
        for fake, ready in started.values():
            settings |= fake.settings(ready)
        async with Client(self.url, "technician", reconnect=False) as client:
            creation = Creation(client, load(), settings)
            project = await creation.open_project(await creation.open_scene(), FAST)
            built = await client.call("BuildProject", rpc.BuildProjectArgs(project.id, project.name))
            self.package_id = built.package_id
            await client.close_project()

    async def stop(self) -> None:
        """Stop everything."""
        await self._server.stop()
        await asyncio.gather(*(child.stop() for child in reversed(self._children)))

    async def command(self, fake: str, command: str, **arguments: Any) -> Any:
        """Send a command to a fake."""
        return await ask(self.at[fake], command, within=15.0, **arguments)

    async def apply(self, commands: tuple[FakeCommand, ...]) -> None:
        """Send commands to fakes. A command that is impossible now, such as dropping a missing part, has no effect."""
        for fake, command, arguments in commands:
            with contextlib.suppress(Arcor2Error):
                await self.command(fake, command, **arguments)

    async def kill(self, target: str) -> None:
        """Kill the cell hosts, or the server, as a power cut does; then start the server again."""
        server = self._server.pid
        for pid in [server] if target == "server" else list(_hosts_of(server)):
            with contextlib.suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)
        if target == "server":
            await self._server.stop()
            self._server = self._new_server()
            self.url = await self._server.start()

    async def boards(self) -> list[dict[str, Any]]:
        """Return the boards of the world. A board at the stop of the belt has the place `stop`."""
        truth = await self.command("world", "truth")
        for board in truth["boards"]:
            if board["code"] == truth["at_pick_place"]:
                board["place"] = "stop"
        boards: list[dict[str, Any]] = truth["boards"]
        return boards

    async def finished(self) -> bool:
        return all(board["place"] in ("good", "bad", "removed") for board in await self.boards())

    async def joints(self) -> tuple[list[float], Any]:
        """Return the joints of the robot and of the press, once they and the gripper are at standstill."""
        while True:
            robot, press = await self.command("robot", "truth"), await self.command("press", "truth")
            speeds = [servo["speed"] for servo in press["servos"].values()]
            jaws = (await self.command("world", "truth"))["gripper"]
            settled = not jaws["works"] or jaws["closed"] == bool(robot["digital_outputs"] & 1)
            if settled and not robot["moving"] and not any(abs(speed) > 1e-3 for speed in speeds):
                angles = {name: round(servo["angle"], 2) for name, servo in press["servos"].items()}
                return [round(q, 3) for q in robot["q"]], angles
            await asyncio.sleep(0.05)

    def waiting_results(self) -> int:
        """Return the number of results that are stored for the planning service and not delivered."""
        waiting = 0
        for file in (self.folder / "data" / "outbox").glob("*.sqlite"):
            with contextlib.closing(sqlite3.connect(f"file:{file}?mode=ro", uri=True)) as database:
                waiting += database.execute("SELECT count(*) FROM message WHERE state = 'waiting'").fetchone()[0]
        return waiting


def waiting(boards: list[dict[str, Any]]) -> list[str]:
    """Return the boards that have not been picked yet."""
    return [board["code"] for board in boards if board["place"] in ("feeder", "belt", "stop")]


def _hosts_of(server: int) -> Iterator[int]:
    for task in Path(f"/proc/{server}/task").iterdir():
        for pid in (task / "children").read_text().split():
            with contextlib.suppress(OSError):
                if b"arcor2_hw.runtime.host" in Path(f"/proc/{pid}/cmdline").read_bytes():
                    yield int(pid)
