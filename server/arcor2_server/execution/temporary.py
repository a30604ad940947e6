"""Runs the open project as a temporary package and opens the project again afterwards (protocol, 12.6)."""

import asyncio
import contextlib
import time
from dataclasses import dataclass

import structlog

from arcor2_hw.data.base import new_id
from arcor2_hw.data.editor import TaskKind
from arcor2_hw.data.events import ChangeType, MainScreen, OpenProjectData, SceneStateEnum, ShowMainScreenData
from arcor2_hw.data.project import Project
from arcor2_hw.exceptions import Arcor2Error
from arcor2_hw.messages import Message
from arcor2_server.build.service import BuildService
from arcor2_server.collaboration.locks import Locks
from arcor2_server.collaboration.tasks import Tasks
from arcor2_server.documents import Session
from arcor2_server.documents.checks.project import project_problems
from arcor2_server.documents.renamed_actions import with_present_names
from arcor2_server.errors import RequestRefused
from arcor2_server.events import EventHub, make_event
from arcor2_server.execution.runs import RunStart
from arcor2_server.execution.service import Execution
from arcor2_server.object_types.registry import ObjectTypes
from arcor2_server.online.online_scene import OnlineScene
from arcor2_server.storage import Storage

log = structlog.get_logger(__name__)


def _settle(built: "asyncio.Future[None]", error: Exception | None = None) -> None:
    """Answer the request unless the caller has disconnected."""
    if built.done():
        return
    if error is None:
        built.set_result(None)
    else:
        built.set_exception(error)


class _Run:
    """One run, from the checks until the project is open again."""

    def __init__(self, runs: "TemporaryRuns", how: RunStart) -> None:
        self._runs = runs
        self._how = how
        self._package = ""
        self._requested_at = time.monotonic()
        self._online = False

    async def execute(self, built: "asyncio.Future[None]") -> None:
        """Build, run and delete the package. Set `built` when the request can be answered.

        The exclusive lock is held from the checks until the project is closed.
        """
        try:
            async with self._runs.locks.exclusive():
                project = await self._build()
                self._runs.online.last_stop.require_none_since(self._requested_at)
                self._runs.execution.reserve()
                _settle(built)
                await asyncio.sleep(0)  # the answer is sent first
                await self._close()
        except Exception as error:
            self._runs.execution.release()
            await self._discard_package()
            if not built.done():
                _settle(built, error)
                return
            log.exception("run of the project failed")
            return
        except BaseException:
            built.cancel()
            await self._discard_package()
            raise
        try:
            await self._run()
            await self._delete()
            await self._open_again(project)
        except BaseException:  # the server ends: the project has to be open at the next start
            await self._discard_package()
            await self._open_again(project)
            raise
        finally:
            self._runs.execution.release()
        if self._online and self._runs.session.project is not None:
            try:
                await self._runs.online.begin_start(self._how.by)
            except Arcor2Error as error:
                log.warning("scene not started again", reason=str(error))

    async def _discard_package(self) -> None:
        """Delete the package without an event. No client knows it."""
        if self._package:
            with contextlib.suppress(Arcor2Error):
                await asyncio.to_thread(self._runs.execution.packages.delete_temporary, self._package)

    async def _build(self) -> Project:
        self._runs.execution.require_permitted(self._how)
        project = self._runs.session.require_project()
        if self._runs.session.has_changes:
            raise RequestRefused("{name} has unsaved changes. Save it first.", name=project.name)
        if self._runs.execution.busy:
            raise RequestRefused("A program is running. Stop it first.")
        if self._runs.online.running_action is not None:
            raise RequestRefused("An action is running. Wait until it ends, or stop it.")
        if self._runs.online.state not in (SceneStateEnum.STOPPED, SceneStateEnum.STARTED):
            raise RequestRefused(
                "The scene is {value}. Wait until it is started or stopped.", value=self._runs.online.state.value
            )
        name = f"Temporary package for project '{project.name}'."
        self._package = new_id("pkg")
        await asyncio.to_thread(self._runs.execution.packages.mark_temporary, self._package, project.id)
        with self._runs.tasks.running(
            TaskKind.BUILD, Message.of("Building {name} to run it", name=project.name), self._how.by
        ):
            await self._runs.builder.build(project.id, name, self._package)
        return project

    async def _close(self) -> None:
        self._online = self._runs.online.online
        if self._online:
            await self._runs.online.begin_stop(self._how.by)
            await self._runs.online.settled()
        ids = [item.id for item in self._runs.session.document.items()]
        await self._runs.session.discard()
        self._runs.locks.drop(ids)
        self._runs.hub.broadcast(make_event("ProjectClosed"))
        summary = await asyncio.to_thread(self._runs.execution.packages.summary, self._package)
        self._runs.hub.broadcast(make_event("PackageChanged", summary, ChangeType.ADD))

    async def _run(self) -> None:
        try:
            self._runs.online.last_stop.require_none_since(self._requested_at)
            await self._runs.execution.run_through(self._package, self._how)
        except Arcor2Error as error:
            log.warning("run of the temporary package failed", package=self._package, reason=str(error))

    async def _delete(self) -> None:
        try:
            summary = await self._runs.execution.delete(self._package)
        except Arcor2Error as error:
            log.warning("temporary package not deleted", package=self._package, reason=str(error))
        else:
            self._runs.hub.broadcast(make_event("PackageChanged", summary, ChangeType.REMOVE))

    async def _open_again(self, project: Project) -> None:
        """Open the saved project. If that fails, send clients to the list of projects."""
        try:
            opened = await self._runs.open(project.id)
        except Arcor2Error as error:
            log.warning("project not opened again", project=project.name, reason=str(error))
            self._runs.hub.broadcast(
                make_event("ShowMainScreen", ShowMainScreenData(MainScreen.PROJECTS_LIST, project.id))
            )
            return
        self._runs.hub.broadcast(make_event("OpenProject", opened))


@dataclass(frozen=True, slots=True)
class TemporaryRuns:
    """Runs the open project as a temporary package, and opens the project again afterwards."""

    hub: EventHub
    locks: Locks
    _storage: Storage
    _types: ObjectTypes
    session: Session
    online: OnlineScene
    execution: Execution
    builder: BuildService
    tasks: Tasks

    async def run(self, how: RunStart) -> None:
        """Run the open project, which is closed during the run. Return when the package is built.

        Raises:
            RequestRefused: the project has unsaved changes, or something is running.
            InvalidProject: the project cannot be built.
        """
        built: asyncio.Future[None] = asyncio.get_running_loop().create_future()
        self.online.background.spawn(_Run(self, how).execute(built), "temporary package")
        await built

    async def open(self, project_id: str) -> OpenProjectData:
        """Open a saved project.

        Raises:
            RequestRefused: the project has errors.
            NotFound: the project or its scene does not exist.
            StorageError: a document cannot be read.
        """
        project = await self._storage.project(project_id)
        scene = await self._storage.scene(project.scene_id)
        if problems := project_problems(scene, project, self._types):
            raise RequestRefused(Message.joined(problems))
        project = with_present_names(scene, project, self._types)
        await self.session.show(scene, project)
        return OpenProjectData(scene, project)

    async def recover(self) -> None:
        """Delete the package of a run that a crash interrupted, and open its project again."""
        try:
            projects = await asyncio.to_thread(self.execution.packages.remove_leftovers)
            if self.session.scene is None and len(projects) == 1:
                await self.open(projects[0])
        except Arcor2Error as error:
            log.warning("cleaning up after an interrupted run failed", reason=str(error))
