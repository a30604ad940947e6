"""The service of a node: it opens sessions for the server, and starts a cell host for each."""

import asyncio
import contextlib
import os
import secrets
import socket
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Final

import msgspec
import structlog
from nats.aio.client import Client
from nats.aio.msg import Msg
from nats.errors import Error as NatsError

from arcor2_hw.exceptions import Arcor2Error, ArrivedLate, Cancelled, ConnectionLost, InvalidData, NotFound
from arcor2_hw.messages import Message
from arcor2_hw.runtime import messages as m, ring
from arcor2_server.child_process import ChildProcess, LockedFolder, describe_exit, remove_leftovers
from arcor2_server.nodes import connections as broker
from arcor2_server.nodes.confirmation import confirm_sent
from arcor2_server.nodes.content import WITH_FILES, ContentStore, default_store
from arcor2_server.nodes.conversion import FRAMES, LARGE, STAMPED, MessageOutline, for_host, outline
from arcor2_server.nodes.credentials import Credentials, environment_without
from arcor2_server.nodes.lanes import Header, Lane
from arcor2_server.nodes.opening import Opened, Opening, refusal_of
from arcor2_server.nodes.presence import (
    PERIOD,
    Announcement,
    LastError,
    RunningSession,
    computer,
    free_space,
    load,
    own_version,
    presence_subject,
)
from arcor2_server.nodes.run_records import RingSender
from arcor2_server.nodes.session import BEAT_PERIOD, Connections, SessionEnd
from arcor2_server.nodes.stream import MessageStream

log = structlog.get_logger(__name__)

COMMAND: Final = ("-P", "-m", "arcor2_hw.runtime.host")
EXIT_TIMEOUT: Final = 3.0
"""Time limit for a host to end by itself after its socket was closed, before it is killed, s."""
LAST_MESSAGES_TIMEOUT: Final = 1.0
"""Time limit for the last messages and lines of a host after its exit, s."""
RETRY_PERIOD: Final = 0.5
"""Period of the attempts to connect to the broker, s."""
REFUSED_PERIOD: Final = 2.0
"""Period of the attempts to connect while the broker refuses the credentials, s."""
_FOLDER: Final = "session-"
_encode = msgspec.msgpack.encode


class HostedSession:
    """A session and its cell host, which ends with it.

    Args:
        connections: to the broker.
        node: name of this node.
        opening: the request.
        store: the files that the node has received.
        folder: for copies of the files that the session uses.
        failed: called with each error.
    """

    def __init__(
        self,
        connections: Connections,
        node: str,
        opening: Opening,
        store: ContentStore,
        folder: LockedFolder,
        failed: Callable[[Message], None] = lambda _: None,
    ) -> None:
        self.id = opening.session
        self._failed = failed
        self._started = time.monotonic()
        self._running = ("", "")
        self._store = store
        self._folder = folder
        self.end = SessionEnd(
            connections,
            broker.session_subject(node, opening.session),
            "node",
            "server",
            Message.of("the server"),
            self,
            opening.silence,
        )
        self._limit = opening.silence
        self._recorded: RingSender | None = None
        self._stream = MessageStream(self._from_host, self._host_closed)
        self._closed = asyncio.Event()
        self._over = asyncio.Event()
        self._failing: asyncio.Task[None] | None = None
        self._stop_ids: set[int] = set()
        self._stopped: dict[str, int] = {}
        """Number of the last stop of each device, and with the key "" of all devices."""

    @property
    def running(self) -> RunningSession:
        """What runs in this session."""
        return RunningSession(self.id, *self._running, time.monotonic() - self._started)

    async def open(self) -> None:
        """Subscribe to the messages of the server."""
        await self.end.open()
        await self.end.answer_files(self._store.missing)

    async def run(self, environment: Mapping[str, str]) -> None:
        """Run a host until it or the session ends."""
        self.end.start()
        await self.end.synchronised()
        try:
            if self._over.is_set():
                return
            process = await self._start(environment)
            output = asyncio.create_task(self._pass_output_on(process), name=f"output of cell host {process.pid}")
            waiting = asyncio.create_task(process.wait(), name=f"end of cell host {process.pid}")
            over = asyncio.create_task(self._over.wait(), name=f"end of session {self.id}")
            alive = asyncio.create_task(self._show_alive(), name=f"signs of life for cell host {process.pid}")
            try:
                await asyncio.wait({waiting, over}, return_when=asyncio.FIRST_COMPLETED)
                if not waiting.done():  # the closed socket stops all motion, and ends the host
                    await asyncio.wait({waiting}, timeout=EXIT_TIMEOUT)
                    process.kill()
                status = await waiting
                with contextlib.suppress(TimeoutError):
                    async with asyncio.timeout(LAST_MESSAGES_TIMEOUT):
                        await self._closed.wait()
                        await output
                self._send_recorded()
                end = Message.of("the cell host {end}", end=describe_exit(status))
                if status and not self._over.is_set():
                    self._failed(end)
                await self.end.finish(end)
            finally:
                process.kill()
                for task in (output, over, alive):
                    task.cancel()
        except OSError as error:
            reason = Message.of("the cell host cannot be started: {reason}", reason=error)
            self._failed(reason)
            await self.end.finish(reason)
        finally:
            self.end.end(Message.of("the session has ended"))
            await self.end.close()
            self._folder.remove()

    async def _start(self, environment: Mapping[str, str]) -> ChildProcess:
        ours, theirs = socket.socketpair()
        memory = ring.create()
        try:
            await asyncio.get_running_loop().create_unix_connection(lambda: self._stream, sock=ours)
            process = await ChildProcess.start(
                (*COMMAND, "--ring", str(memory)), theirs, environment, inherited=[memory, self._folder.lock]
            )
        except BaseException:
            os.close(memory)
            raise
        self._recorded = RingSender(ring.Ring(memory), lambda body: self.end.send(Lane.CALLS, body))
        return process

    async def _show_alive(self) -> None:
        """Send signs of life to the host: it stops when this service hangs, so that nothing is executed unobserved.

        Also send to the relay what the host has recorded.
        """
        alive = _encode(m.Alive(self._limit + BEAT_PERIOD))
        while True:
            self._stream.send(alive)
            self._send_recorded()
            await asyncio.sleep(BEAT_PERIOD)

    def _send_recorded(self) -> None:
        if self._recorded is not None:
            self._recorded.flush()

    async def _pass_output_on(self, process: ChildProcess) -> None:
        async for line in process.output():
            self.end.send(Lane.CALLS, _encode(m.LogLine("info", line)))

    # -------------------------------------------------------------------------------- from the host
    def _from_host(self, body: bytes) -> None:
        found = outline(body)
        if found.type in ("CallDone", "CallFailed") and found.id in self._stop_ids:
            self._stop_ids.discard(found.id)
            lane = Lane.STOP
        else:
            lane = Lane.FRAMES if len(body) >= LARGE and found.type in FRAMES else Lane.CALLS
            if found.type in STAMPED:  # an alarm or an end, of which the server makes a recording
                self._send_recorded()
        self.end.send(lane, body, may_drop=lane is Lane.FRAMES and found.type == "StreamEvent")

    def _host_closed(self) -> None:
        self._closed.set()

    # -------------------------------------------------------------------------------- from the server
    def received(self, lane: Lane, header: Header, body: bytes) -> None:
        """Pass a message of the server on, unless it arrived too late."""
        if lane is Lane.FRAMES:
            self._store_file(body)
            return
        found = outline(body)
        if lane is Lane.STOP:
            self._stopped[found.object_id] = header.number
            if found.id:
                self._stop_ids.add(found.id)
        elif not found.passive:
            refusal = self._refusal(header, found)
            if refusal is not None:
                self._refuse(found, refusal)
                return
        if found.type in ("OpenScene", "RunPackage"):
            self._running = _started_by(found.type, body)
        if found.type in WITH_FILES:
            try:
                body = self._store.unpacked(body, self._folder.path)
            except (NotFound, InvalidData) as error:
                self._fail(error.message)
                return
        self._stream.send(for_host(found.type, body, self.end.local_time))

    def _store_file(self, body: bytes) -> None:
        try:
            self._store.add(body)
        except (InvalidData, OSError) as error:
            self._fail(Message.of("a file of the server cannot be stored: {reason}", reason=error))

    def _fail(self, reason: Message) -> None:
        """End the session, and report why."""
        self._failed(reason)
        self._stream.close()
        self._failing = asyncio.create_task(self.end.finish(reason), name=f"end of session {self.id}")

    def _refusal(self, header: Header, found: MessageOutline) -> Arcor2Error | None:
        """Return why a command must not be executed any more, None if it may be executed."""
        stopped = max(self._stopped.get("", 0), self._stopped.get(found.object_id, 0))
        if header.number < stopped:
            return Cancelled("The command was stopped before it reached the node.")
        age = self.end.age(header)
        if age <= min(self._limit, found.deadline or self._limit):
            return None
        return ArrivedLate("The command reached the node {age:.2f} s after it was sent, and was not executed.", age=age)

    def _refuse(self, found: MessageOutline, error: Arcor2Error) -> None:
        log.warning("command refused", session=self.id, type=found.type, id=found.id, reason=str(error))
        if found.id:
            data = m.ErrorData(error.code, type(error).__name__, error.message, error.detail, found.object_id)
            self.end.send(Lane.CALLS, _encode(m.CallFailed(found.id, data)))
        elif found.type in ("OpenScene", "RunPackage"):
            self._fail(error.message)
        else:
            self.end.send(Lane.CALLS, _encode(m.LogLine("warning", f"{found.type}: {error}")))

    def ended(self, reason: Message, by_peer: bool) -> None:
        """Close the socket of the host, on which it stops all motion, disconnects and ends."""
        log.info("session ended", session=self.id, reason=str(reason), by_server=by_peer)
        if not by_peer and not self._closed.is_set():  # the connection was lost while the host ran
            self._failed(reason)
        self._stream.close()
        self._over.set()


class _Scene(msgspec.Struct, frozen=True):
    name: str = ""


class _Run(msgspec.Struct, frozen=True):
    """The fields of OpenScene and RunPackage that name what runs."""

    scene: _Scene = _Scene()
    package_id: str = ""


def _started_by(kind: str, body: bytes) -> tuple[str, str]:
    """Return the kind and name of the scene or program that a message starts."""
    run = msgspec.msgpack.decode(body, type=_Run)
    return ("scene", run.scene.name) if kind == "OpenScene" else ("program", run.package_id)


class NodeService:
    """Serves the sessions of a node.

    Args:
        name: name of the node.
        credentials: returns the credentials for the broker; called before each attempt to connect.
        sessions: directory for the files of sessions.
        environment: the environment of cell hosts.
        ready: called each time when the node can be used.
    """

    def __init__(
        self,
        name: str,
        credentials: Callable[[], Credentials],
        sessions: Path,
        environment: Mapping[str, str] = os.environ,
        ready: Callable[[], None] = lambda: None,
    ) -> None:
        self._name, self._credentials, self._ready = name, credentials, ready
        self._environment = environment_without(environment)
        self._folders = sessions.absolute()
        self._store = ContentStore(default_store())
        self._connections: Connections = {}
        self._sessions: set[HostedSession] = set()
        self._tasks: set[asyncio.Task[None]] = set()
        self._lost = asyncio.Event()
        self._id = secrets.token_hex(8)
        self._started = time.monotonic()
        self._error: tuple[Message, float] | None = None

    async def run(self) -> None:
        """Serve until cancelled. Connect again when the connection to the broker is lost."""
        self._store.prune()
        self._remove_leftovers()
        reported = ""
        while True:
            refused = False
            try:
                await self._serve()
                reported = ""
            except Arcor2Error as error:
                if reported != str(error):
                    log.warning("broker not reached", reason=str(error), detail=error.detail)
                reported, refused = str(error), isinstance(error, broker.CredentialsRefused)
            await asyncio.sleep(REFUSED_PERIOD if refused else RETRY_PERIOD)

    def _remove_leftovers(self) -> None:
        """Remove the files of sessions of services that were killed."""
        remove_leftovers(self._folders, _FOLDER)

    async def _serve(self) -> None:
        """Serve until the connection is lost. Raise ConnectionLost if there is none."""
        self._lost.clear()
        announcing: asyncio.Task[None] | None = None
        try:
            self._connections = await broker.connect(self._credentials(), self._name, self._lose)
            try:
                calls = self._connections[Lane.CALLS]
                await calls.subscribe(broker.open_subject(self._name), cb=self._open)
                await confirm_sent(calls)
            except (NatsError, OSError) as error:
                raise ConnectionLost("The broker closed the connection.", str(error)) from error
            log.info("node ready", node=self._name)
            self._ready()
            announcing = asyncio.create_task(self._announce(calls), name="announcements")
            await self._lost.wait()
            log.warning("connection to the broker lost", node=self._name)
            self._note(Message.of("the connection to the broker was lost"))
        finally:
            if announcing is not None:
                announcing.cancel()
            self._end_sessions()
            if self._tasks:
                await asyncio.wait(set(self._tasks))
            await broker.close(self._connections)

    async def _announce(self, client: Client) -> None:
        """Announce this node periodically."""
        subject = presence_subject(self._name)
        while True:
            free = await asyncio.to_thread(free_space, self._store.directory)
            with contextlib.suppress(NatsError, OSError):  # the end of the connection is noticed elsewhere
                await client.publish(subject, msgspec.json.encode(self._announcement(free)))
            await asyncio.sleep(PERIOD)

    def _announcement(self, free: int) -> Announcement:
        now = time.monotonic()
        return Announcement(
            self._name,
            own_version(),
            computer(),
            self._id,
            now - self._started,
            load(),
            free,
            [each.running for each in self._sessions],
            None if self._error is None else LastError(self._error[0], now - self._error[1]),
        )

    def _note(self, error: Message) -> None:
        """Store the last error, for announcements."""
        self._error = (error, time.monotonic())

    def _lose(self) -> None:
        self._lost.set()
        self._end_sessions()

    def _end_sessions(self) -> None:
        for session in list(self._sessions):
            session.end.connection_lost()

    async def _open(self, message: Msg) -> None:
        """Open a session, or answer with the reason for a refusal."""
        try:
            opening = msgspec.json.decode(message.data, type=Opening)
        except msgspec.MsgspecError as error:
            log.warning("invalid request to open a session", reason=str(error))
            return
        refusal = refusal_of(self._name, opening)
        if refusal is None:
            try:
                self._folders.mkdir(mode=0o700, parents=True, exist_ok=True)
                folder = LockedFolder(self._folders, _FOLDER)
            except OSError as error:  # such as a full disk
                refusal = Message.of("The node {node} cannot store files: {reason}", node=self._name, reason=error)
        if refusal is None:
            session = HostedSession(self._connections, self._name, opening, self._store, folder, self._note)
            try:
                await session.open()
            except BaseException:  # the connection was lost
                folder.remove()
                raise
        await message.respond(msgspec.json.encode(Opened(refusal)))
        if refusal is not None:
            log.warning("session refused", reason=str(refusal))
            self._note(refusal)
            return
        log.info("session opened", session=session.id)
        self._sessions.add(session)
        task = asyncio.create_task(session.run(self._environment), name=f"session {session.id}")
        self._tasks.add(task)
        task.add_done_callback(lambda _: self._forget(task, session))
        await asyncio.to_thread(self._remove_leftovers)  # also of hosts that ended only after the start of this service

    def _forget(self, task: asyncio.Task[None], session: HostedSession) -> None:
        self._tasks.discard(task)
        self._sessions.discard(session)
        if not task.cancelled() and (error := task.exception()) is not None:
            log.error("session failed", session=session.id, exc_info=error)
