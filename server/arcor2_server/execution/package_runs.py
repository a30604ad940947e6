"""Runs packages. An open scene or project that no connected user works on is closed during the run."""

import asyncio
from dataclasses import dataclass

import structlog

from arcor2_hw.data.events import SceneStateEnum
from arcor2_hw.exceptions import Arcor2Error
from arcor2_server.collaboration.lock_takeover import LockTakeover
from arcor2_server.collaboration.locks import Locks
from arcor2_server.collaboration.presence import PresenceBoard
from arcor2_server.collaboration.users import Users
from arcor2_server.documents import Session
from arcor2_server.documents.changes import Kind
from arcor2_server.errors import RequestRefused
from arcor2_server.events import EventHub, make_event
from arcor2_server.execution.runs import RunStart
from arcor2_server.execution.service import Execution
from arcor2_server.online.online_scene import OnlineScene

log = structlog.get_logger(__name__)


@dataclass(frozen=True, slots=True)
class PackageRuns:
    """Runs packages, also while a scene or project is open on which no connected user works."""

    _hub: EventHub
    _users: Users
    _locks: Locks
    _session: Session
    _online: OnlineScene
    _execution: Execution
    _presence: PresenceBoard
    _lock_takeover: LockTakeover

    def is_left_open(self) -> bool:
        """Return whether a scene or project is open on which no connected user works or holds locks."""
        opened = [item.id for kind in (Kind.SCENE, Kind.PROJECT) for item in self._session.document.of_kind(kind)]
        if not opened or self._presence.users_of(opened):
            return False
        return not set(self._locks.owners()) & set(self._users.names())

    async def run_package(self, package_id: str, how: RunStart) -> None:
        """Run a package; return when it has started.

        An open document on which no connected user works is closed and opened again after the run, with its unsaved
        changes. Its devices go offline and stay offline. Disconnected users lose their locks and are notified when they
        return.
        """
        self._execution.require_permitted(how)
        if not self.is_left_open():
            await self._execution.run(package_id, how)
            return
        started: asyncio.Future[None] = asyncio.get_running_loop().create_future()
        self._online.background.spawn(
            self._run_in_place(package_id, how, started), "package in place of the open document"
        )
        await started

    async def _require_runnable(self, package_id: str) -> None:
        if self._execution.busy:
            raise RequestRefused("A program is running. Stop it first.")
        await asyncio.to_thread(self._execution.packages.directory, package_id)

    async def _run_in_place(self, package_id: str, how: RunStart, started: "asyncio.Future[None]") -> None:
        execution = self._execution
        try:
            await self._require_runnable(package_id)
            if not self.is_left_open():
                raise RequestRefused("A user has opened the scene or project in the meantime.")
            for user in self._locks.owners():
                for event in self._lock_takeover.release(user, how.by or "An operator"):
                    self._hub.broadcast(event)
            async with self._locks.exclusive():
                await self._require_runnable(package_id)
                await self._go_offline(how.by)
                scene, project = self._session.require_scene(), self._session.project
                reopen = self._session.set_aside()
                execution.reserve()
            log.info("document closed for a program", scene=scene.name, project=project and project.name, by=how.by)
            self._hub.broadcast(make_event("SceneClosed" if project is None else "ProjectClosed"))
            try:
                await execution.run_through(package_id, how, temporary=False, started=started)
            finally:
                reopen()
                execution.release()
                for event in self._session.greeting(self._online.state):
                    self._hub.broadcast(event)
        except Arcor2Error as error:
            if started.done():
                log.warning("package run failed", package=package_id, reason=str(error))
            else:
                started.set_exception(error)
        except BaseException:
            started.cancel()
            raise

    async def _go_offline(self, by: str) -> None:
        cell = self._online
        if cell.running_action is not None:
            raise RequestRefused("An action is running. Stop it first.")
        if cell.online:
            await cell.begin_stop(by)
        if await cell.settled() is not SceneStateEnum.STOPPED:
            raise RequestRefused("The scene is {value}. Wait until it is offline.", value=cell.state.value)
