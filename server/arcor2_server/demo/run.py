"""The main job: fakes, server and cell come up, the program runs, and anyone may watch."""

import asyncio
import contextlib
import random
import signal
import socket
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

import msgspec

from arcor2_hw.client import Client
from arcor2_hw.data import rpc
from arcor2_hw.data.events import Event, SceneStateEnum
from arcor2_hw.data.package import PackageStateEnum
from arcor2_hw.data.project import Project
from arcor2_hw.exceptions import Arcor2Error, ConnectionLost, DeviceTimeout
from arcor2_server.demo.display import Display
from arcor2_server.demo.processes import Child, ChildFailed, python_module
from arcor2_server.demo.workplace import Creation, Scalar, layout_file, load

ONLINE_TIMEOUT: Final = 30.0
BOARD_TIMEOUT: Final = 120.0
"""Seconds without any event after which the program counts as stuck."""
DEVICE_POLL: Final = 0.5


class ProgramFailed(Arcor2Error):
    """The program of the demo did not run to its end."""

    code = "program_failed"


@dataclass
class Outcome:
    """Readings taken apart: what the script found, and where the boards lie in the end."""

    boards: int = 0
    passed: int = 0
    failed: int = 0
    seconds: float = 0.0
    finished: bool = False
    misplaced: list[str] = field(default_factory=list)

    @property
    def right(self) -> bool:
        """Tell whether the program ended as meant with every board in the right box."""
        return self.finished and not self.misplaced

    def summary(self) -> str:
        """Give the line that ends the cycle."""
        return f"cycle complete: {self.boards} boards, {self.passed} passed, {self.failed} failed, {self.seconds:.1f} s"


def free_loopback_address(ports: tuple[int, ...] = (30004, 30003, 29999)) -> str:
    """Find an address 127.x.y.z on which all `ports` are free: a UR controller's ports are fixed."""
    for _ in range(100):
        address = f"127.{random.randint(1, 254)}.{random.randint(0, 255)}.{random.randint(1, 254)}"
        with contextlib.ExitStack() as stack:
            try:
                for port in ports:
                    probe = stack.enter_context(socket.socket())
                    probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
                    probe.bind((address, port))
            except OSError:
                continue
            return address
    raise ChildFailed("No loopback address has the ports of a UR controller free.")


def first_of(group: BaseExceptionGroup[Any]) -> BaseException:
    """Give the first error in a group: what a person wants to read is what began it."""
    first: BaseException = group.exceptions[0]
    return first_of(first) if isinstance(first, BaseExceptionGroup) else first


async def ask(address: str, do: str) -> Any:
    """Ask a fake's control channel; raises ConnectionLost naming the address."""
    host, _, port = address.rpartition(":")
    try:
        async with asyncio.timeout(5):
            reader, writer = await asyncio.open_connection(host, int(port), limit=4 * 1024 * 1024)
            try:
                writer.write(msgspec.json.encode({"id": 1, "do": do}) + b"\n")
                answer = msgspec.json.decode(await reader.readline())
            finally:
                writer.close()
    except (OSError, TimeoutError, msgspec.DecodeError) as e:
        raise ConnectionLost(f"The small world at {address} does not answer.", str(e)) from e
    if not answer.get("ok"):
        raise ChildFailed(f"The small world refuses {do}: {answer.get('error')}")
    return answer.get("data")


class Demo:
    """One run of the demo."""

    def __init__(
        self, *, host: str, port: int, data_dir: Path, boards: int, seed: int, once: bool, display: Display
    ) -> None:
        self._host = host
        self._port = port
        self._data_dir = data_dir
        self._boards = boards
        self._seed = seed
        self._once = once
        self._display = display
        self._children: list[Child] = []
        self._stop = asyncio.Event()
        self._logs = data_dir / "logs"

    def _child(self, name: str, command: list[str]) -> Child:
        child = Child(name, command, self._logs / f"{name.replace(' ', '_')}.log")
        self._children.append(child)
        return child

    async def run(self) -> Outcome:
        """Bring everything up, run the program, keep serving unless it is to run once; end everything."""
        loop = asyncio.get_running_loop()
        for number in (signal.SIGINT, signal.SIGTERM):
            loop.add_signal_handler(number, self._stop.set)
        self._logs.mkdir(parents=True, exist_ok=True)
        job = asyncio.create_task(self._job())
        stop = asyncio.create_task(self._stop.wait())
        try:
            await asyncio.wait({job, stop}, return_when=asyncio.FIRST_COMPLETED)
            if not job.done():
                self._display.note("stopping")
                job.cancel()
            return await job
        except* Arcor2Error as group:
            raise first_of(group) from None
        finally:
            stop.cancel()
            for number in (signal.SIGINT, signal.SIGTERM):
                loop.remove_signal_handler(number)
            # The server first: it stops motion while the robot still listens.
            for child in reversed(self._children):
                await child.stop()

    async def _job(self) -> Outcome:
        robot = free_loopback_address()
        ur = self._child("robot", python_module("arcor2_fakes.ur", "--host", robot, "--control", "127.0.0.1:0"))
        tester = self._child("tester", python_module("arcor2_fakes.functional_tester", "--control", "127.0.0.1:0"))
        reader = self._child("reader", python_module("arcor2_fakes.barcode_reader", "--control", "127.0.0.1:0"))
        self._display.note("starting the robot, the tester, the reader and the server")
        server_arguments = ("serve", "--host", self._host, "--port", str(self._port), "--data-dir", str(self._data_dir))
        async with asyncio.TaskGroup() as starts:
            found = [starts.create_task(child.start_json()) for child in (ur, tester, reader)]
        ur_at, tester_at, reader_at = (task.result() for task in found)
        world = self._child(
            "world",
            python_module(
                "arcor2_fakes.cell",
                *("--layout", str(layout_file())),
                *("--robot", ur_at["control"], "--tester", tester_at["control"], "--reader", reader_at["control"]),
                *("--boards", str(self._boards), "--seed", str(self._seed), "--control", "127.0.0.1:0"),
            ),
        )
        server = self._child("server", python_module("arcor2_server.cli.main", *server_arguments))
        async with asyncio.TaskGroup() as starts:
            world_start, server_start = starts.create_task(world.start_json()), starts.create_task(server.start())
        world_at, url = world_start.result(), server_start.result()
        self._display.addresses(url, {"robot": robot, "tester": tester_at["modbus"], "reader": reader_at["port"]})
        (self._data_dir / "demo.json").write_bytes(
            msgspec.json.format(
                msgspec.json.encode(
                    {"url": url, "robot": ur_at, "tester": tester_at, "reader": reader_at, "world": world_at}
                )
            )
        )
        tester_host, _, tester_port = str(tester_at["modbus"]).rpartition(":")
        addresses: dict[str, Scalar] = {
            "robot": robot,
            "tester_host": tester_host,
            "tester_port": int(tester_port),
            "reader": reader_at["port"],
        }
        async with Client(url, "demo") as client:
            poll = asyncio.create_task(self._display.follow_devices(url, DEVICE_POLL))
            try:
                outcome = await self._cycle(client, addresses, world_at["control"])
            finally:
                poll.cancel()
                with contextlib.suppress(asyncio.CancelledError):
                    await poll
        self._display.finish(outcome.summary(), outcome.misplaced)
        if not self._once:
            self._display.serving(url)
            await self._stop.wait()
        return outcome

    async def _cycle(self, client: Client, addresses: dict[str, Scalar], world: str) -> Outcome:
        creation = Creation(client, load(), addresses)
        self._display.note("opening the workplace")
        scene = await creation.open_scene()
        project = await creation.open_project(scene, {"boards": self._boards})
        self._display.note("going online")
        await client.call("StartScene")
        await self._scene_state(client, SceneStateEnum.STARTED)
        await asyncio.sleep(DEVICE_POLL)
        await client.call("StopScene")
        await self._scene_state(client, SceneStateEnum.STOPPED)
        self._display.note("building the package")
        built = await client.call("BuildProject", rpc.BuildProjectArgs(project.id, project.name))
        await client.call("CloseProject")
        started = time.monotonic()
        await client.call("RunPackage", rpc.RunPackageArgs(built.package_id))
        outcome = await self._follow(client, project)
        outcome.seconds = time.monotonic() - started
        outcome.misplaced = await self._misplaced(world)
        return outcome

    async def _scene_state(self, client: Client, wanted: SceneStateEnum) -> None:
        while True:
            event = await client.next_event("SceneState", timeout=ONLINE_TIMEOUT)
            if event.data.state is wanted:
                return
            if event.data.state is SceneStateEnum.STOPPED:
                raise ProgramFailed(f"The workplace did not come online: {event.data.message or 'no reason given'}")

    async def _follow(self, client: Client, project: Project) -> Outcome:
        actions = {action.id: action for point in project.action_points for action in point.actions}
        outcome = Outcome()
        problem = ""
        while True:
            try:
                event: Event = await client.next_event(timeout=BOARD_TIMEOUT)
            except DeviceTimeout:
                raise ProgramFailed(f"The program stands still: nothing happened for {BOARD_TIMEOUT:g} s.") from None
            match event.event:
                case "ActionStateBefore" if event.data.action_id in actions:
                    self._display.action(actions[event.data.action_id].name)
                case "ActionStateAfter" if event.data.action_id in actions:
                    action = actions[event.data.action_id]
                    if action.outputs() == ["passed"]:
                        passed = event.data.results == ["true"]
                        outcome.boards += 1
                        outcome.passed += passed
                        outcome.failed += not passed
                        self._display.board(outcome.boards, self._boards, passed)
                case "ProjectException":
                    problem = event.data.message
                case "PackageState" if event.data.state is PackageStateEnum.STOPPED:
                    if problem:
                        raise ProgramFailed(f"The program ended with an error: {problem}")
                    outcome.finished = True
                    return outcome

    async def _misplaced(self, world: str) -> list[str]:
        truth = await ask(world, "truth")
        wrong = []
        for board in truth["boards"]:
            wanted = "bad" if board["defect"] else "good"
            if board["place"] != wanted:
                wrong.append(f"board {board['code']} lies in {board['place']}, not in {wanted}")
        return wrong
