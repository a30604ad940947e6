"""The server's parts with a real cell host and object types from the test; no network."""

import asyncio
import contextlib
import json
from collections.abc import AsyncIterator, Awaitable, Callable, Iterable
from pathlib import Path
from typing import Any

import msgspec

from arcor2_hw.data.object_type import ActionMetadata, ObjectAction, ObjectTypeMeta, ParameterMeta
from arcor2_hw.data.project import Project
from arcor2_hw.data.robot import RobotFeatures, RobotMeta, RobotType
from arcor2_hw.data.role import Role
from arcor2_hw.data.rpc import RPCS
from arcor2_hw.data.scene import Scene
from arcor2_hw.exceptions import NotFound
from arcor2_hw.runtime.messages import TypeCode
from arcor2_server.app.adapters import request_handlers
from arcor2_server.collaboration.lock_takeover import LockTakeover
from arcor2_server.collaboration.locks import Locks
from arcor2_server.collaboration.presence import PresenceBoard
from arcor2_server.collaboration.tasks import Tasks
from arcor2_server.collaboration.users import Users
from arcor2_server.compute.workers import Compute
from arcor2_server.documents import Session
from arcor2_server.execution.breakpoints import SharedBreakpoints
from arcor2_server.execution.package_runs import PackageRuns
from arcor2_server.execution.part_inventories import PartInventories
from arcor2_server.execution.run_message import RunMessages
from arcor2_server.execution.runs import Runs
from arcor2_server.execution.service import Execution
from arcor2_server.execution.stop_all import StopAll
from arcor2_server.hosts.pool import CellHosts
from arcor2_server.hosts.session import HostSession
from arcor2_server.online.connection_check import ConnectionCheck
from arcor2_server.online.motion import RobotMotion
from arcor2_server.online.online_scene import OnlineScene
from arcor2_server.online.scene_opening import SceneOpening
from arcor2_server.rpc.registry import Context
from arcor2_server.settings import ServerSettings
from arcor2_server.storage import AssetStore
from arcor2_server.storage.damage_notices import DataDamage
from arcor2_server.storage.packages import Packages
from arcor2_server.storage.secret_store import SecretStore
from arcor2_server.storage.setting_secrets import SettingSecrets
from arcor2_server.websocket.hub import Hub
from arcor2_server.workspace.host_world import HostWorld
from arcor2_server.workspace.kinematics import Kinematics
from arcor2_server.workspace.obstacles import ObstacleRegistry
from arcor2_server.workspace.robot_calibrations import RobotCalibrations
from arcor2_server.workspace.robot_models import RobotModels
from arcor2_server.workspace.robots import SceneRobots
from arcor2_server.workspace.scene_collisions import SceneCollisions
from tests.runtime.conftest import type_code
from tests.server.parts import Parts

PATIENCE = 40.0
"""Longest wait for an event, s."""


class Recorder:
    """A client that stores the received messages."""

    def __init__(self, user: str | None) -> None:
        self.user = user
        self.name = user or ""
        self.number = 1
        self.role = Role.PROGRAMMER
        self.device = "tablet"
        self.person = None
        self.got: list[dict[str, Any]] = []
        self._received = asyncio.Event()

    def put(self, message: bytes) -> None:
        self.got.append(json.loads(message))
        self._received.set()

    def put_newest(self, stream: str, message: bytes) -> None:
        self.put(message)

    async def event(self, name: str, where: Callable[[dict[str, Any]], bool] = lambda _: True) -> dict[str, Any]:
        """Wait for an event with this name, starting with the received events that were not taken yet."""
        async with asyncio.timeout(PATIENCE):
            while True:
                for index, event in enumerate(self.got):
                    data = event.get("data", {})
                    if event["event"] == name and where(data):
                        del self.got[: index + 1]
                        return data
                self._received.clear()
                await self._received.wait()

    async def state(self, wanted: str, name: str = "SceneState") -> dict[str, Any]:
        return await self.event(name, lambda data: data["state"] == wanted)


class Types:
    """Object types as the server knows them, declared by the test instead of analysed."""

    def __init__(self) -> None:
        self.codes: dict[str, TypeCode] = {}
        self.known: dict[str, dict[str, ObjectAction]] = {}
        self.robots: dict[str, RobotMeta] = {}
        self.settings: dict[str, list[ParameterMeta]] = {}

    def add(self, name: str, source: str, actions: Iterable[ObjectAction] = (), robot: RobotMeta | None = None) -> None:
        self.codes[name] = type_code(name, source)
        self.known[name] = {action.name: action for action in actions}
        if robot is not None:
            self.robots[name] = robot

    def meta(self, name: str) -> ObjectTypeMeta:
        return ObjectTypeMeta(name, settings=self.settings.get(name, []))

    def type_codes(self, names: Iterable[str]) -> list[TypeCode]:
        return [self.codes[name] for name in names]

    def action(self, type_name: str, name: str) -> ObjectAction:
        try:
            return self.known[type_name][name]
        except KeyError:
            raise NotFound(name) from None

    def derives_from(self, name: str, base: str) -> bool:
        return base == "Robot" and name in self.robots

    def robot_meta(self, name: str) -> RobotMeta:
        return self.robots[name]


class Server:
    def __init__(self, services: Any, types: Types) -> None:
        self.services = services
        self.handlers = request_handlers(services).by_request
        self.types = types
        self.client = Recorder("alice")
        services.hub.add(self.client)  # type: ignore[arg-type]

    async def ask(self, name: str, args: Any = None, client: Recorder | None = None, codes: bool = False) -> Any:
        """Handle a request like the endpoint, and store the response among the events in the order of sending."""
        client = client or self.client
        context = Context(client, codes=codes)  # type: ignore[arg-type]
        if isinstance(args, dict):
            args = msgspec.convert(args, RPCS[name].args)
        data = await self.handlers[name](context, args)
        for event in context.events_before:
            self.services.hub.broadcast(event)
        client.put(msgspec.json.encode({"event": f"response {name}"}))
        for event in context.events_after:
            self.services.hub.broadcast(event)
        return data

    async def open(self, scene: Scene, project: Project | None = None) -> None:
        await self.services.session.show(scene, project)

    async def start(self) -> None:
        await self.ask("StartScene")
        await self.client.state("started")


@contextlib.asynccontextmanager
async def running_server(data_dir: Path) -> AsyncIterator[Server]:
    data_dir.mkdir(exist_ok=True)
    settings = ServerSettings(data_dir=data_dir, streaming_period=0.05)
    hub, types = Hub(), Types()
    known: Any = types
    none: Any = None
    assets = await AssetStore.open(settings.assets_dir)
    damage = DataDamage(data_dir, hub)
    secrets = SettingSecrets(known, SecretStore(settings.secrets_file))
    session = Session(settings, none, known, damage, secrets)
    await session.open()

    async def stored_name(item: str) -> str | None:
        return None

    locks = Locks(session, stored_name, 2, 0.05)
    users = Users(hub, locks, settings)
    compute, tasks, hosts = Compute(settings.compute_idle), Tasks(hub), CellHosts(settings.device_files_dirs)
    scene_host, program_host = HostSession(hub, hosts, "scene"), HostSession(hub, hosts, "program", to_all_clients=True)
    robots = SceneRobots(assets, known, session, scene_host)
    calibrations = RobotCalibrations(settings, hub, known, session, scene_host, compute, damage, robots)
    models, collisions = RobotModels(robots, calibrations), ObstacleRegistry(settings.scene_inflation)
    scene_collisions = SceneCollisions(
        assets, known, session, compute, collisions, robots, models, scene_host, program_host
    )
    world = HostWorld(collisions, calibrations, assets, scene_host, program_host)
    opening = SceneOpening(settings, known, session, secrets, world, lambda: (parts.identities or dict)())
    online = OnlineScene(scene_host, opening, hub, locks, session, robots, tasks, calibrations)
    runs = Runs(hub)
    breakpoints = SharedBreakpoints(hub, none, session, none)
    packages = Packages(settings.packages_dir, secrets.hide_in_package)
    messages = RunMessages(settings, secrets, breakpoints, world, lambda: (parts.identities or dict)())
    inventory = PartInventories(hub, settings.checkpoints_dir)
    execution = Execution(
        packages, program_host, online, settings, hub, known, runs, breakpoints, secrets, messages, inventory
    )
    presence = PresenceBoard(hub, users)
    takeover = LockTakeover(locks, users, session.name_of)
    kinematics = Kinematics(known, scene_host, compute, robots, models, scene_collisions)
    parts: Any = Parts(
        settings=settings,
        hub=hub,
        users=users,
        locks=locks,
        assets=assets,
        secrets=secrets,
        connection_check=ConnectionCheck(hosts, opening),
        types=types,
        session=session,
        compute=compute,
        hosts=hosts,
        tasks=tasks,
        robots=robots,
        robot_calibrations=calibrations,
        robot_models=models,
        collisions=collisions,
        scene_collisions=scene_collisions,
        kinematics=kinematics,
        online=online,
        motion=RobotMotion(hub, known, session, online, robots, kinematics),
        execution=execution,
        runs=runs,
        breakpoints=breakpoints,
        presence=presence,
        lock_takeover=takeover,
        package_runs=PackageRuns(hub, users, locks, session, online, execution, presence, takeover),
        stop_all=StopAll(session, online, execution),
    )
    server = Server(parts, types)
    await users.register(server.client, server.client.name)  # type: ignore[arg-type]
    try:
        yield server
    finally:
        presence.close()
        await execution.close()
        await online.close()
        await session.close()


Test = Callable[[Server], Awaitable[None]]
Prepare = Callable[[Server], Awaitable[None]]


def serving(prepare: Prepare | None = None) -> Callable[[Test], Callable[[Path], Awaitable[None]]]:
    """Start a server in the task of the test, because the tasks of hosts must end before fixtures do."""

    def wrap(test: Test) -> Callable[[Path], Awaitable[None]]:
        async def run(tmp_path: Path) -> None:
            async with running_server(tmp_path / "data") as server:
                if prepare is not None:
                    await prepare(server)
                await test(server)

        run.__name__ = test.__name__
        return run

    return wrap


def action(name: str, *returns: str, cancellable: bool = False) -> ObjectAction:
    return ObjectAction(name, returns=list(returns), meta=ActionMetadata(cancellable=cancellable))


def robot_meta(name: str, **features: bool) -> RobotMeta:
    return RobotMeta(name, RobotType.ARTICULATED, features=RobotFeatures(**features))
