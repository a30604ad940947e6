"""The server's parts around a real cell host, with object types that the test writes; no network."""

import asyncio
import contextlib
import json
from collections.abc import AsyncIterator, Awaitable, Callable, Iterable
from pathlib import Path
from typing import Any

import msgspec

from arcor2_hw.data.object_type import ActionMetadata, ObjectAction, ObjectTypeMeta
from arcor2_hw.data.project import Project
from arcor2_hw.data.robot import RobotFeatures, RobotMeta, RobotType
from arcor2_hw.data.role import Role
from arcor2_hw.data.rpc import RPCS
from arcor2_hw.data.scene import Scene
from arcor2_hw.exceptions import NotFound
from arcor2_hw.runtime.messages import TypeCode
from arcor2_server.collaboration.locks import Locks
from arcor2_server.collaboration.presence import PresenceBoard
from arcor2_server.collaboration.users import Users
from arcor2_server.documents import Session
from arcor2_server.execution.service import Execution
from arcor2_server.hosts.workspace_updates import tell_hosts
from arcor2_server.online.online_scene import OnlineCell
from arcor2_server.rpc import execution as _execution  # noqa: F401 - for their handlers
from arcor2_server.rpc import robot as _robot  # noqa: F401 - for their handlers
from arcor2_server.rpc import runs as _runs  # noqa: F401 - for their handlers
from arcor2_server.rpc.registry import HANDLERS, Context
from arcor2_server.services import Services
from arcor2_server.settings import ServerSettings
from arcor2_server.storage import AssetStore
from arcor2_server.websocket.hub import Hub
from tests.runtime.conftest import type_code

PATIENCE = 15.0


class Recorder:
    """A client that keeps what it gets."""

    def __init__(self, user: str | None) -> None:
        self.user = user
        self.name = user or ""
        self.number = 1
        self.role = Role.PROGRAMMER
        self.got: list[dict[str, Any]] = []
        self._news = asyncio.Event()

    def put(self, message: bytes) -> None:
        self.got.append(json.loads(message))
        self._news.set()

    def put_newest(self, stream: str, message: bytes) -> None:
        self.put(message)

    async def event(self, name: str, where: Callable[[dict[str, Any]], bool] = lambda _: True) -> dict[str, Any]:
        """Wait for an event, from the beginning of what was received and not yet taken."""
        async with asyncio.timeout(PATIENCE):
            while True:
                for index, event in enumerate(self.got):
                    data = event.get("data", {})
                    if event["event"] == name and where(data):
                        del self.got[: index + 1]
                        return data
                self._news.clear()
                await self._news.wait()

    async def state(self, wanted: str, name: str = "SceneState") -> dict[str, Any]:
        return await self.event(name, lambda data: data["state"] == wanted)


class Types:
    """Object types as the server knows them, told by the test instead of read by analysis."""

    def __init__(self) -> None:
        self.codes: dict[str, TypeCode] = {}
        self.known: dict[str, dict[str, ObjectAction]] = {}
        self.robots: dict[str, RobotMeta] = {}

    def add(self, name: str, source: str, actions: Iterable[ObjectAction] = (), robot: RobotMeta | None = None) -> None:
        self.codes[name] = type_code(name, source)
        self.known[name] = {action.name: action for action in actions}
        if robot is not None:
            self.robots[name] = robot

    def meta(self, name: str) -> ObjectTypeMeta:
        return ObjectTypeMeta(name)

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
    def __init__(self, services: Services, types: Types) -> None:
        self.services = services
        self.types = types
        self.client = Recorder("alice")
        services.hub.add(self.client)  # type: ignore[arg-type]

    async def ask(self, name: str, args: Any = None, client: Recorder | None = None) -> Any:
        """Send a request as the endpoint does: the response takes its place among the events."""
        client = client or self.client
        context = Context(self.services, client)  # type: ignore[arg-type]
        if isinstance(args, dict):
            args = msgspec.convert(args, RPCS[name].args)
        data = await HANDLERS[name](context, args)
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
    hub, locks, types = Hub(), Locks(2, 0.05), Types()
    none: Any = None
    given: dict[str, Any] = dict.fromkeys(("access", "storage", "session", "cell", "execution", "build"), none)
    given["users"] = Users(hub, locks, settings)
    given["assets"] = await AssetStore.open(settings.assets_dir)
    services = Services(settings=settings, hub=hub, locks=locks, types=types, **given)  # type: ignore[arg-type]
    services.session = Session(services)
    await services.session.open()
    services.cell = OnlineCell(services)
    services.execution = Execution(services)
    tell_hosts(services)
    services.presence = PresenceBoard(hub, services.users)
    locks.tree = services.session
    server = Server(services, types)
    await services.users.register(server.client, server.client.name)  # type: ignore[arg-type]
    try:
        yield server
    finally:
        services.presence.close()
        await services.cell.close()
        await services.session.close()


Test = Callable[[Server], Awaitable[None]]
Prepare = Callable[[Server], Awaitable[None]]


def serving(prepare: Prepare | None = None) -> Callable[[Test], Callable[[Path], Awaitable[None]]]:
    """Run a test with a server inside its own body: the tasks of hosts must end with the test, before fixtures do."""

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
