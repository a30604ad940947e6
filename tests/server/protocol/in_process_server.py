"""A whole server in this process, without its socket: real storage, analysis, cell hosts, packages."""

import asyncio
import contextlib
from collections.abc import AsyncIterator, Callable
from pathlib import Path
from typing import Any

import msgspec

from arcor2_hw.data.base import UNSET
from arcor2_hw.data.events import EVENTS
from arcor2_hw.data.geometry import Pose, Position
from arcor2_hw.data.object_type import Mesh, ObjectModel, ObjectTypeSource
from arcor2_hw.data.rpc import RPCS
from arcor2_server.app import Server, running_server
from arcor2_server.app.application import endpoints
from arcor2_server.settings import ServerSettings
from tests.server.protocol import devices
from tests.server.session.session_server import Person, Refused

PATIENCE = 40.0
"""Time limit for conditions, s. Long, because the machine may be busy."""

ORIGIN = {"position": {"x": 0, "y": 0, "z": 0}, "orientation": {"x": 0, "y": 0, "z": 0, "w": 1}}
FOCUS_POINTS = [Pose(Position(*point)) for point in ((0, 0, 0), (0.2, 0, 0), (0, 0.1, 0), (0.2, 0.1, 0.05))]

TYPES = {
    "Arm": devices.ARM,
    "DumbArm": devices.DUMB_ARM,
    "TwoArms": devices.TWO_ARMS,
    "Eye": devices.EYE,
    "BlindEye": devices.BLIND_EYE,
    "Part": devices.PART,
    "Plain": devices.PART.replace("class Part", "class Plain"),
    "Thin": devices.PART.replace("class Part", "class Thin"),
    "Chooser": devices.CHOOSER,
    "OlderArm": devices.OLDER_ARM,
    "OlderArms": devices.OLDER_ARMS,
}
MODELS = {
    "Part": Mesh("Part", "part.stl", FOCUS_POINTS),
    "Thin": Mesh("Thin", "part.stl", [Pose(Position(step / 10)) for step in range(4)]),
}


PARENTS = {
    "OrientationChanged": {"add"},
    "JointsChanged": {"add", "update"},
    "ActionChanged": {"add"},
    "OverrideUpdated": {"add", "update", "remove"},
}
"""Events that name a parent (protocol, 8)."""


def faults(message: dict[str, Any]) -> list[str]:
    """Return the problems of a message according to the protocol's types and its rules for events."""
    found = ["an explicit null"] if _has_null(message) else []
    if "response" in message:
        declared, allowed = RPCS[message["response"]].data if message["response"] in RPCS else None, ANSWER
    else:
        declared, allowed = EVENTS[message["event"]].data, EVENT
        if "parent_id" in message and message.get("change_type") not in PARENTS.get(message["event"], ()):
            found.append("a parent")
    found += [f"a field {name}" for name in message.keys() - allowed]
    # A refusal with data names projects or object types instead of the answer.
    if "data" in message and message.get("result", True):
        if declared is None:
            found.append("data")
        else:
            try:
                msgspec.convert(message["data"], declared)
            except msgspec.ValidationError as error:
                found.append(str(error))
    return found


ANSWER = {"id", "response", "result", "messages", "data"}
EVENT = {"event", "change_type", "parent_id", "data"}


def _has_null(value: Any) -> bool:
    match value:
        case dict():
            return any(map(_has_null, value.values()))
        case list():
            return any(map(_has_null, value))
    return value is None


class Actor(Person):
    """A client that checks each message, and whose messages can be read without removing them."""

    def _received(self, message: dict[str, Any]) -> None:
        stage: Any = self.server
        stage.faults += [f"{fault} in {message}" for fault in faults(message)]
        super()._received(message)

    @property
    def waiting(self) -> list[dict[str, Any]]:
        return self._messages


class Stage:
    """A server in this process, with the clients and ids that a test uses."""

    def __init__(self, services: Server) -> None:
        self.services = services
        self.endpoint = endpoints(services)[0]
        self.ids: dict[str, str] = {}
        self.faults: list[str] = []
        """Problems of the messages that were sent."""
        self._people: list[Actor] = []

    async def newcomer(self) -> Actor:
        """Connect a client without registering a user. Its first messages stay in the queue."""
        person = Actor(self)  # type: ignore[arg-type]
        self._people.append(person)
        return person

    async def person(self, name: str = "") -> Actor:
        person = await self.newcomer()
        if name:
            await person.ask("RegisterUser", user_name=name)
        else:
            await person.ask("SystemInfo")  # the first messages have arrived by then
        person.take()
        return person

    async def spare_host(self) -> None:
        """Wait until the spare host runs."""
        hosts = self.services.hosts
        hosts.prepare()
        spare = hosts._spare
        assert spare is not None
        await spare

    async def close(self) -> None:
        await asyncio.gather(*(person.leave() for person in self._people))
        await self.endpoint.close()

    async def place(self, person: Actor, **objects: str) -> None:
        """Create a scene with objects given by name and type. Store their ids in `ids`."""
        await person.ask("NewScene", name="scene")
        for name, kind in objects.items():
            pose: dict[str, Any] = {"pose": ORIGIN} if self.services.types.meta(kind).has_pose else {}
            await person.ask("AddObjectToScene", name=name, type=kind, **pose)
        scene = self.services.session.require_scene()
        self.ids |= {obj.name: obj.id for obj in scene.objects}
        person.take()

    async def add(self, person: Actor, name: str, kind: str, pose: Pose, **settings: str | float) -> str:
        """Add an object to the open scene, store its id in `ids`, and return the id."""
        parameters = [
            {
                "name": key,
                "type": "string" if isinstance(value, str) else "double",
                "value": msgspec.json.encode(value).decode(),
            }
            for key, value in settings.items()
        ]
        await person.ask(
            "AddObjectToScene", name=name, type=kind, pose=msgspec.to_builtins(pose), parameters=parameters
        )
        self.ids |= {obj.name: obj.id for obj in self.services.session.require_scene().objects}
        return self.ids[name]

    async def start(self, person: Actor) -> None:
        await person.ask("StartScene")
        await until_event(person, "SceneState", state="started")
        person.take()

    async def stop(self, person: Actor) -> None:
        await person.ask("StopScene")
        await until_event(person, "SceneState", state="stopped")
        person.take()


async def until(condition: Callable[[], bool]) -> None:
    """Wait until the condition holds, or fail after the time limit."""
    async with asyncio.timeout(PATIENCE):
        while not condition():
            await asyncio.sleep(0.005)


async def until_event(person: Actor, event: str, **data: Any) -> dict[str, Any]:
    """Wait for an event with this data among the messages that were not taken yet. Return its data."""
    found: list[dict[str, Any]] = []

    def arrived() -> bool:
        found[:] = [
            message["data"]
            for message in person.waiting
            if message.get("event") == event and all(message["data"].get(key) == value for key, value in data.items())
        ]
        return bool(found)

    await until(arrived)
    return found[0]


async def refused(person: Actor, request: str, /, **args: Any) -> str:
    """Send a request that must be refused without any event. Return the message of the refusal."""
    person.take()
    try:
        await person.ask(request, **args)
    except Refused as error:
        assert person.events() == [], request
        return str(error)
    raise AssertionError(f"{request} was granted")


async def _content() -> AsyncIterator[bytes]:
    """Return the content of an asset that the test does not read."""
    yield b"content"


@contextlib.asynccontextmanager
async def open_stage(directory: Path, *types: str, **settings: Any) -> AsyncIterator[Stage]:
    """Start a server with the named types uploaded."""
    given: dict[str, Any] = {"lock_retries": 2, "lock_retry_wait": 0.02, "streaming_period": 0.05} | settings
    async with running_server(ServerSettings(data_dir=directory, **given)) as services:
        for asset in ("part.stl", "arm.zip") if types else ():
            await services.assets.put(_content(), asset)
        for name in types:
            model = MODELS.get(name)
            wrapped = UNSET if model is None else ObjectModel.of(model)
            meta = await services.types.add(ObjectTypeSource(name, TYPES[name].lstrip(), model=wrapped))
            assert not meta.disabled, meta.problem
        stage = Stage(services)
        try:
            yield stage
            assert stage.faults == []
        finally:
            await stage.close()
