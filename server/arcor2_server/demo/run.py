"""The demo: starts the fakes, the simulated world and the server, creates the cell, and runs its program."""

import asyncio
import contextlib
import importlib.util
import signal
import time
from pathlib import Path
from typing import Any, Final

import msgspec

from arcor2_hw.client import Client
from arcor2_hw.data import rpc
from arcor2_hw.data.events import Event, SceneStateEnum
from arcor2_hw.data.package import PackageStateEnum
from arcor2_hw.data.project import Project
from arcor2_hw.exceptions import Arcor2Error, DeviceTimeout
from arcor2_server.demo.control import ask
from arcor2_server.demo.display import Display
from arcor2_server.demo.fakes import Fake, Ready, fakes, wires, world_arguments
from arcor2_server.demo.outcome import Outcome, board_errors, report_errors
from arcor2_server.demo.processes import Child, python_module
from arcor2_server.demo.workplace import Creation, Scalar, confirm_emptied, layout_file, load, markers_file
from arcor2_server.files import replace_file

ONLINE_TIMEOUT: Final = 30.0
BOARD_TIMEOUT: Final = 120.0
"""Time without any event after which the program counts as stuck, s."""
DEVICE_POLL: Final = 0.5
"""Period for reading the states of the devices, s."""
ACCELERATIONS: Final[dict[str, Scalar]] = {"joint_acceleration": 10.0, "tcp_acceleration": 5.0}
"""Maximum accelerations of the robot, rad/s² and m/s²."""
FAST: Final[dict[str, Scalar]] = {"speed": 1.0, "slow_speed": 0.7}
"""Project parameters of the fast demo."""
FAST_ACCELERATIONS: Final[dict[str, Scalar]] = {"joint_acceleration": 30.0, "tcp_acceleration": 15.0}


class ProgramFailed(Arcor2Error):
    """The program of the demo did not run to its end."""

    code = "program_failed"


def first_of(group: BaseExceptionGroup[Any]) -> BaseException:
    """Return the first error in a group, which caused the others."""
    first: BaseException = group.exceptions[0]
    return first_of(first) if isinstance(first, BaseExceptionGroup) else first


class Demo:
    """One run of the demo."""

    def __init__(
        self,
        *,
        host: str,
        port: int,
        data_dir: Path,
        boards: int,
        seed: int,
        once: bool,
        display: Display,
        fast: bool = False,
        opcua_port: int | None = None,
    ) -> None:
        self._opcua = "" if opcua_port is None else f"{f'[{host}]' if ':' in host else host}:{opcua_port}"
        """Address of the OPC UA server; empty without one."""
        self._host = host
        self._port = port
        self._data_dir = data_dir
        self._boards = boards
        self._seed = seed
        self._once = once
        self._fast = fast
        self._display = display
        self._children: list[Child] = []
        self._stop = asyncio.Event()
        self._logs = data_dir / "logs"
        self._where = data_dir / "demo.json"

    def _child(self, name: str, command: list[str]) -> Child:
        child = Child(name, command, self._logs / f"{name.replace(' ', '_')}.log")
        self._children.append(child)
        return child

    async def run(self) -> Outcome:
        """Start everything, run the program, wait for Ctrl-C unless it runs only once, and stop everything."""
        loop = asyncio.get_running_loop()
        for number in (signal.SIGINT, signal.SIGTERM):
            loop.add_signal_handler(number, self._stop.set)
        self._logs.mkdir(parents=True, exist_ok=True)
        self._where.unlink(missing_ok=True)
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
            # The server first, so that it can stop the devices. Then the world, which needs the fakes.
            order = {"server": 0, "world": 1}
            for child in sorted(self._children, key=lambda child: order.get(child.name, 2)):
                if child.name in order:
                    await child.stop()
            await asyncio.gather(*(child.stop() for child in self._children))
            self._where.unlink(missing_ok=True)

    async def _job(self) -> Outcome:
        started, server_at = await self._start_all()
        world = self._child(
            "world",
            python_module(
                "arcor2_fakes.cell",
                *world_arguments(started, layout_file(), self._boards, self._seed),
                *("--control", "127.0.0.1:0"),
            ),
        )
        at: dict[str, Any] = {name: ready for name, (_, ready) in started.items()}
        at["world"] = await world.start_json()
        self._display.addresses(server_at, wires(started))
        opcua = {"opcua": f"opc.tcp://{self._opcua}/arcor2hw/"} if self._opcua else {}
        if opcua:
            self._display.note(f"OPC UA server at {opcua['opcua']}")
        self._write_addresses({"url": server_at, **opcua, **at})
        settings: dict[str, Scalar] = {"outbox": str((self._data_dir / "outbox").absolute())}
        settings |= FAST_ACCELERATIONS if self._fast else ACCELERATIONS
        for fake, ready in started.values():
            settings |= fake.settings(ready)
        problem: Arcor2Error | None = None
        outcome = Outcome()
        async with Client(server_at, "demo", reconnect=False) as client:
            poll = asyncio.create_task(self._display.follow_devices(server_at, DEVICE_POLL))
            try:
                await self._cycle(client, settings, outcome)
                outcome.errors = await self._errors(at)
            except ProgramFailed as e:
                if self._once:
                    raise
                problem = e
            finally:
                poll.cancel()
                with contextlib.suppress(asyncio.CancelledError):
                    await poll
        if problem is None:
            self._display.finish(outcome.summary(), outcome.errors)
        else:
            self._display.failed(str(problem))
        if not self._once:
            self._display.serving(server_at)
            await self._stop.wait()
        return outcome

    def _write_addresses(self, addresses: dict[str, Any]) -> None:
        """Write the addresses for `arcor2-hw fake fault`."""
        replace_file(self._where, msgspec.json.format(msgspec.json.encode(addresses)))

    async def _start_all(self) -> tuple[dict[str, tuple[Fake, Ready]], str]:
        """Start the fakes and the server concurrently; return the addresses in their ready lines."""
        wanted = fakes(self._boards, self._seed, self._fast)
        self._display.note(f"starting {', '.join(fake.name for fake in wanted)} and the server")
        server = self._child(
            "server",
            python_module(
                *("arcor2_server.cli.main", "serve", "--host", self._host, "--port", str(self._port)),
                *("--data-dir", str(self._data_dir), "--markers", str(markers_file())),
                *(["--history"] if importlib.util.find_spec("duckdb") is not None else []),
                *(["--opcua", self._opcua] if self._opcua else []),
            ),
        )
        children = [self._child(fake.name, fake.command()) for fake in wanted]
        async with asyncio.TaskGroup() as starts:
            found = [starts.create_task(child.start_json()) for child in children]
            serving = starts.create_task(server.start())
        ready = [task.result() for task in found]
        return {fake.name: (fake, addresses) for fake, addresses in zip(wanted, ready, strict=True)}, serving.result()

    async def _cycle(self, client: Client, settings: dict[str, Scalar], outcome: Outcome) -> None:
        workplace = load()
        creation = Creation(client, workplace, settings)
        self._display.note("opening the scene and the project")
        await creation.close_all()
        scene = await creation.open_scene()
        project = await creation.open_project(scene, FAST if self._fast else workplace.constants)
        self._display.note("going online")
        await client.start_scene()
        await self._scene_state(client, SceneStateEnum.STARTED)
        await asyncio.sleep(DEVICE_POLL)
        await client.stop_scene()
        await self._scene_state(client, SceneStateEnum.STOPPED)
        self._display.note("building the package")
        built = await client.call("BuildProject", rpc.BuildProjectArgs(project.id, project.name))
        await client.close_project()
        await confirm_emptied(client)  # the simulated world is new
        started = time.monotonic()
        await client.subscribe_events({"ProgramPosition"})  # also actions of functions are announced then
        await client.run_package(built.package_id)
        await self._follow(client, project, outcome)
        outcome.seconds = time.monotonic() - started

    async def _scene_state(self, client: Client, wanted: SceneStateEnum) -> None:
        starting = False  # opening a scene also publishes "stopped"
        while True:
            event = await client.next_event("SceneState", timeout=ONLINE_TIMEOUT)
            if event.data.state is wanted:
                return
            starting = starting or event.data.state is SceneStateEnum.STARTING
            if event.data.state is SceneStateEnum.STOPPED and starting:
                raise ProgramFailed(
                    "The workplace did not come online: {text}", text=event.data.message or "no reason given"
                )

    async def _follow(self, client: Client, project: Project, outcome: Outcome) -> None:
        actions = {action.id: action for action in project.all_actions()}
        problem = ""
        while True:
            try:
                event: Event = await client.next_event(timeout=BOARD_TIMEOUT)
            except DeviceTimeout:
                raise ProgramFailed(
                    "The program is stuck: no event was received for {board_timeout:g} s.", board_timeout=BOARD_TIMEOUT
                ) from None
            match event.event:
                case "ActionStateBefore" if event.data.action_id in actions:
                    self._display.action(actions[event.data.action_id].name)
                case "ActionStateAfter" if event.data.action_id in actions:
                    action = actions[event.data.action_id]
                    if action.type.endswith("/test"):
                        passed = event.data.results == ["true"]
                        outcome.boards += 1
                        outcome.passed += passed
                        outcome.failed += not passed
                        self._display.board(outcome.boards, self._boards, passed)
                case "ProjectException":
                    problem = event.data.message
                case "PackageState" if event.data.state is PackageStateEnum.STOPPED:
                    if problem:
                        # The cause may be a fault of a device on which no action was waiting.
                        alarms = "".join(f"; {alarm}" for alarm in self._display.alarms())
                        raise ProgramFailed(
                            "The program ended with an error: {problem}{alarms}", problem=problem, alarms=alarms
                        )
                    outcome.finished = True
                    return

    @staticmethod
    async def _errors(at: dict[str, Any]) -> list[str]:
        world, erp = await ask(at["world"]["control"], "truth"), await ask(at["erp"]["control"], "truth")
        return board_errors(world) + report_errors(world, erp)
