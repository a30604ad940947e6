"""A server without a socket: the real endpoint, hub, locks, storage, journal; object types as recorded.

The network, the cell host and the analysis of object types are missing. They have their own tests, and other tests
send the same requests to a real server process.
"""

import asyncio
import contextlib
import functools
import json
from collections.abc import AsyncIterator, Callable, Iterable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import msgspec

from arcor2_hw.data.events import SceneStateEnum
from arcor2_hw.data.geometry import Orientation, Pose, Position
from arcor2_hw.data.object_type import (
    ActionMetadata,
    Again,
    ObjectAction,
    ObjectTypeMeta,
    ObjectTypeSource,
    ParameterMeta,
)
from arcor2_hw.data.robot import Joint, RobotMeta, RobotType
from arcor2_hw.data.scene import SceneObject
from arcor2_hw.exceptions import NotFound
from arcor2_server.access.admission import Access
from arcor2_server.app import Server
from arcor2_server.app.application import endpoints
from arcor2_server.app.wiring import connect_edits, stored_name
from arcor2_server.audit.trail import AuditTrail
from arcor2_server.build.script_editing import ScriptEditing
from arcor2_server.collaboration.lock_takeover import LockTakeover
from arcor2_server.collaboration.locks import Locks
from arcor2_server.collaboration.log_ons import LogOns
from arcor2_server.collaboration.persons import Persons
from arcor2_server.collaboration.pins import CardHashes
from arcor2_server.collaboration.presence import PresenceBoard
from arcor2_server.collaboration.previews import Previews
from arcor2_server.collaboration.tasks import Tasks
from arcor2_server.collaboration.users import Users
from arcor2_server.collaboration.view_states import ViewStates
from arcor2_server.documents import Session
from arcor2_server.documents.dependents import Dependents
from arcor2_server.documents.edit_notifications import EditNotifications
from arcor2_server.documents.saved_problems import SavedProblems
from arcor2_server.errors import RequestRefused
from arcor2_server.execution.breakpoints import SharedBreakpoints
from arcor2_server.object_types.catalog import PackageType
from arcor2_server.object_types.changes import Changes
from arcor2_server.object_types.notifications import TypeNotifications
from arcor2_server.online.undo import Undo
from arcor2_server.settings import ServerSettings
from arcor2_server.storage import Storage
from arcor2_server.storage.damage_notices import DataDamage
from arcor2_server.storage.persons import PersonStore
from arcor2_server.storage.secret_store import SecretStore
from arcor2_server.storage.setting_secrets import SettingSecrets
from arcor2_server.storage.shared_data import SharedData
from arcor2_server.web.websocket_transport import EXTENSION
from arcor2_server.websocket.hub import Hub
from arcor2_server.workspace.object_aiming import ObjectAimings
from tests.protocol import session
from tests.server.parts import Parts


class RecordedTypes:
    """The object types of the recorded sessions, in place of the registry that analyses sources."""

    def __init__(self) -> None:
        answers = {m["msg"].get("response"): m["msg"] for m in session("01_connect_register") if m["who"] == "A<"}
        metas = msgspec.convert(answers["GetObjectTypes"]["data"], list[ObjectTypeMeta])
        self._metas = {meta.type: meta for meta in metas}
        dobot = msgspec.convert(answers["GetActions"]["data"], list[ObjectAction])
        double, text = ParameterMeta("seconds", "double"), ParameterMeta("text", "string")
        self._actions = {
            "DobotMagician": dobot,
            "TimeActions": [ObjectAction("sleep", parameters=[double]), ObjectAction("say", parameters=[text])],
            "RandomActions": [
                ObjectAction("random_bool", parameters=[ParameterMeta("probability", "double")], returns=["boolean"]),
                ObjectAction("random_double", returns=["double"], meta=ActionMetadata(again=Again.SAFE)),
            ],
        }
        self.revision = 1
        self.pending: list[ObjectTypeMeta] = []

    @property
    def digest(self) -> str:
        return f"{self.revision} {sorted(self._metas)}"

    @property
    def up_to_date(self) -> bool:
        return not self.pending

    async def refresh(self) -> Changes:
        pending, self.pending = self.pending, []
        self._metas |= {meta.type: meta for meta in pending}
        return Changes([], [], pending)

    def known(self, name: str) -> bool:
        return name in self._metas

    def meta(self, name: str) -> ObjectTypeMeta:
        try:
            return self._metas[name]
        except KeyError:
            raise NotFound(f"Object type {name!r} does not exist.") from None

    def derives_from(self, name: str, base: str) -> bool:
        while name:
            if name == base:
                return True
            name = self.meta(name).base
        return False

    def action(self, type_name: str, name: str) -> ObjectAction:
        for action in self._actions.get(type_name, ()):
            if action.name == name:
                return action
        raise NotFound(f"{type_name} has no action {name!r}.")

    def actions(self, name: str) -> list[ObjectAction]:
        return self._actions.get(name, [])

    def enumerations(self, name: str) -> dict[Any, Any]:
        return {}

    def keyword_only(self, name: str) -> frozenset[Any]:
        return frozenset()

    def bases(self, name: str) -> list[str]:
        return []

    def sources_for(self, names: Iterable[str]) -> list[PackageType]:
        return [PackageType(name, name.lower(), source="...") for name in names]

    def robot_meta(self, name: str) -> RobotMeta:
        if not self.derives_from(name, "Robot"):
            raise NotFound(f"{name} is not a robot.")
        return RobotMeta(name, RobotType.ARTICULATED)

    async def add(self, source: ObjectTypeSource) -> ObjectTypeMeta:
        base = source.source.partition(f"class {source.id}(")[2].partition(")")[0]
        meta = ObjectTypeMeta(
            source.id, base=base, object_model=source.model, has_pose=True, modified="2026-11-21T06:43:11.076433+00:00"
        )
        self._metas[source.id] = meta
        self.revision += 1
        return meta

    async def remove(self, name: str) -> ObjectTypeMeta:
        self.revision += 1
        return self._metas.pop(name)


class FakeCell:
    """A cell that is offline by default, with one robot at a fixed pose."""

    def __init__(self) -> None:
        self.state = SceneStateEnum.STOPPED
        self.pose = Pose(Position(0.4, 0.1, 0.3), Orientation(1, 0, 0, 0))
        self.joints = [Joint("j1", 0.1), Joint("j2", -0.2)]
        self.moved: list[tuple[str, Pose]] = []
        self.board = SimpleNamespace(states=list, healths=list, interlocks=[])

    @property
    def online(self) -> bool:
        return self.state is SceneStateEnum.STARTED

    def require_offline(self) -> None:
        if self.state is not SceneStateEnum.STOPPED:
            raise RequestRefused("The scene is online.")

    def require_online(self) -> None:
        if not self.online:
            raise RequestRefused("The scene is offline.")

    async def prepare_addition(self, obj: SceneObject, *, dry_run: bool) -> None: ...

    async def end_effector_pose(self, robot_id: str, end_effector: str, arm_id: str | None) -> Pose:
        return self.pose

    async def robot_joints(self, robot_id: str, arm_id: str | None) -> list[Joint]:
        return self.joints

    async def object_pose_changed(self, object_id: str, pose: Pose) -> None:
        self.moved.append((object_id, pose))


class _Socket:
    """A websocket whose other end is the test, which takes every message at once."""

    def __init__(self, take: Callable[[dict[str, Any]], None]) -> None:
        self.incoming: asyncio.Queue[dict[str, Any]] = asyncio.Queue()
        self.scope = {"extensions": {EXTENSION: self}}
        self.client = None
        self.headers: dict[str, str] = {}
        self.query_params: dict[str, str] = {}
        self.receive = self.incoming.get
        self._take = take

    async def accept(self) -> None: ...

    async def send(self, message: dict[str, Any]) -> None: ...

    def send_text_now(self, message: bytes) -> bool:
        self._take(json.loads(message))
        return True

    async def send_text(self, message: bytes) -> None:
        self.send_text_now(message)

    async def ping(self) -> None:
        raise ConnectionError

    def admit(self) -> None: ...

    def abort(self) -> None: ...


class Refused(Exception):
    """A request was answered with result=false."""


class Person:
    """A client of the server. It stores answers and events in order until the test takes them."""

    def __init__(self, server: "SessionServer", token: str = "") -> None:
        self.server = server
        self._messages: list[dict[str, Any]] = []
        self._answers: dict[int, asyncio.Future[dict[str, Any]]] = {}
        self._number = 1000
        self._socket: Any = _Socket(self._received)
        if token:
            self._socket.query_params["token"] = token
        self._served = asyncio.create_task(server.endpoint.serve(self._socket))

    def _received(self, message: dict[str, Any]) -> None:
        self._messages.append(message)
        if "response" in message:
            answer = self._answers.pop(message["id"])
            if not answer.done():
                answer.set_result(message)

    async def leave(self) -> None:
        self._socket.incoming.put_nowait({"type": "websocket.disconnect"})
        await self._served

    async def send(self, request: dict[str, Any]) -> dict[str, Any]:
        """Send a request unchanged and return the whole answer."""
        answer = self._answers[request["id"]] = asyncio.get_running_loop().create_future()
        self._socket.incoming.put_nowait({"type": "websocket.receive", "text": json.dumps(request)})
        await asyncio.wait((answer, self._served), return_when=asyncio.FIRST_COMPLETED)
        if not answer.done():
            self._served.result()
        return answer.result()

    async def ask(
        self, request_name: str, /, *, dry_run: bool = False, codes: bool = False, undo_step: str = "", **args: Any
    ) -> Any:
        """Send a request; return the answer's data. Raise Refused with its message."""
        self._number += 1
        request: dict[str, Any] = {"id": self._number, "request": request_name, "dry_run": dry_run, "codes": codes}
        if undo_step:
            request["step"] = undo_step
        if args:
            request["args"] = args
        answer = await self.send(request)
        if not answer["result"]:
            raise Refused(answer["messages"][0])
        return answer.get("data")

    def take(self) -> list[dict[str, Any]]:
        """Return the messages since the last call."""
        taken, self._messages = self._messages, []
        return taken

    def put_back(self, messages: list[dict[str, Any]]) -> None:
        """Put messages back for the next call."""
        self._messages[:0] = messages

    def events(self) -> list[dict[str, Any]]:
        """Return the events since the last call, without the answers."""
        return [message for message in self.take() if "event" in message]

    def names(self) -> list[str]:
        """Return short names of the events since the last call."""
        return ["/".join(filter(None, (e["event"], e.get("change_type")))) for e in self.events()]

    async def lock(self, item: str, tree: bool = False) -> None:
        await self.ask("WriteLock", object_id=item, lock_tree=tree)
        self.take()


class SessionServer:
    """The parts of a server that the session uses."""

    def __init__(self, services: Server, types: RecordedTypes, cell: FakeCell) -> None:
        self.services = services
        self.types = types
        self.cell = cell
        self.endpoint = endpoints(services)[0]
        self._people: list[Person] = []

    @property
    def session(self) -> Session:
        return self.services.session

    async def person(self, name: str = "", token: str = "") -> Person:
        person = Person(self, token)
        self._people.append(person)
        if name:
            await person.ask("RegisterUser", user_name=name)
        person.take()
        return person

    async def close(self) -> None:
        await asyncio.gather(*(person.leave() for person in self._people))
        await self.endpoint.close()


@contextlib.asynccontextmanager
async def open_server(directory: Path, **settings: Any) -> AsyncIterator[SessionServer]:
    """Start the parts with a data directory."""
    given: dict[str, Any] = {"lock_retries": 2, "lock_retry_wait": 0.02} | settings
    chosen = ServerSettings(data_dir=directory, **given)
    types, cell, hub = RecordedTypes(), FakeCell(), Hub()
    storage = await Storage.open(chosen)
    damage = DataDamage(directory, hub)
    damage.load()
    known: Any = types
    online: Any = cell
    secrets = SettingSecrets(known, SecretStore(chosen.secrets_file))
    session = Session(chosen, storage, known, damage, secrets)
    shared = SharedData(storage)

    locks = Locks(session, stored_name(known, storage), chosen.lock_retries, chosen.lock_retry_wait)
    users = Users(hub, locks, chosen)
    audit = AuditTrail(chosen.audit_file, str)  # not opened: it only collects entries
    persons = Persons(PersonStore(storage), CardHashes(directory))
    try:
        await session.open()
        try:
            parts: Any = Parts(
                settings=chosen,
                access=Access(chosen),
                audit=audit,
                persons=persons,
                log_ons=(log_ons := LogOns(hub, users, persons, audit, chosen.log_off_after)),
                hub=hub,
                users=users,
                locks=locks,
                storage=storage,
                damage=damage,
                secrets=secrets,
                types=types,
                session=session,
                online=cell,
                execution=SimpleNamespace(
                    busy=False,
                    greeting=list,
                    state_and_info=None,
                    board=SimpleNamespace(states=list, healths=list, interlocks=[]),
                ),
                type_notifications=TypeNotifications(known, hub),
                dependents=(dependents := Dependents(storage, known, session)),
                script_editing=ScriptEditing(storage, known, session),
                undo=Undo(locks, storage, known, session, online, dependents),
                saved_problems=SavedProblems(storage, known, chosen.problems_file),
                edit_notifications=EditNotifications(hub, session),
                lock_takeover=LockTakeover(locks, users, session.name_of),
                tasks=Tasks(hub),
                previews=Previews(hub, locks),
                view_states=ViewStates(hub, shared),
                presence=PresenceBoard(hub, users),
                breakpoints=SharedBreakpoints(hub, storage, session, shared),
                object_aiming=ObjectAimings(),
            )
            parts.greeting = functools.partial(Server.greeting, parts)
            connect_edits(parts.edit_notifications, parts.previews, parts.breakpoints)
            storage.on_deleted += [parts.view_states.forget, parts.breakpoints.forget, session.forget_history]
            try:
                server = SessionServer(parts, types, cell)
                yield server
                await server.close()
            finally:
                await parts.saved_problems.close()
                for part in (parts.edit_notifications, parts.presence, parts.previews, parts.tasks):
                    part.close()
                log_ons.close()
        finally:
            await session.close()
    finally:
        users.close()
        await storage.close()
