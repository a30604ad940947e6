"""The request that runs the open project as a package of its own, and opens it again afterwards (protocol, 12.6)."""

import asyncio
import contextlib
import time

import structlog

from arcor2_hw.data.base import new_id
from arcor2_hw.data.editor import TaskKind
from arcor2_hw.data.events import ChangeType, Event, MainScreen, OpenProjectData, SceneStateEnum, ShowMainScreenData
from arcor2_hw.data.project import Project
from arcor2_hw.data.rpc import TemporaryPackageArgs
from arcor2_hw.exceptions import Arcor2Error
from arcor2_server.documents.checks import project_problems
from arcor2_server.documents.renamed_actions import with_present_names
from arcor2_server.errors import RequestRefused
from arcor2_server.events import make_event
from arcor2_server.execution.runs import How
from arcor2_server.rpc.execution import how
from arcor2_server.rpc.registry import Context, rpc
from arcor2_server.services import Services

log = structlog.get_logger(__name__)


@rpc("TemporaryPackage")
async def temporary_package(context: Context, args: TemporaryPackageArgs) -> None:
    """Run the open project, which is closed meanwhile; answered once the package is built."""
    built: asyncio.Future[None] = asyncio.get_running_loop().create_future()
    services = context.services
    services.cell.spawn(_Run(services, how(context, args)).whole(built), "temporary package")
    await built


def _settle(built: "asyncio.Future[None]", error: Exception | None = None) -> None:
    """Let the request be answered, unless nobody waits any more."""
    if built.done():
        return
    if error is None:
        built.set_result(None)
    else:
        built.set_exception(error)


class _Run:
    """One run, from the check whether it is allowed to the project being open again."""

    def __init__(self, services: Services, asked: How) -> None:
        self._services = services
        self._how = asked
        self._package = ""
        self._requested_at = time.monotonic()
        self._online = False

    async def whole(self, built: "asyncio.Future[None]") -> None:
        """Do it all; `built` gets the moment in which the request can be answered, or why it is refused.

        One task from the checks to the closed project, so that it keeps everybody else out without a gap.
        """
        try:
            async with self._services.locks.exclusive():
                project = await self._build()
                self._services.cell.last_stop.require_none_since(self._requested_at)
                self._services.execution.reserved = True
                _settle(built)
                await asyncio.sleep(0)  # the answer goes out first
                await self._close()
        except Exception as error:
            self._services.execution.reserved = False
            await self._discard_package()
            if not built.done():
                _settle(built, error)
                return
            log.exception("project not run")
            return
        except BaseException:
            built.cancel()
            await self._discard_package()
            raise
        try:
            await self._run()
            await self._delete()
            await self._open_again(project)
        except BaseException:  # the server ends: at its next start the project is open, as it was
            await self._discard_package()
            await self._open_again(project)
            raise
        finally:
            self._services.execution.reserved = False
        if self._online and self._services.session.project is not None:
            try:
                await self._services.cell.begin_start()
            except Arcor2Error as error:
                log.warning("scene not started again", reason=str(error))

    async def _discard_package(self) -> None:
        """Delete the package without a word: nobody was told of it, or nobody is there any more."""
        if self._package:
            with contextlib.suppress(Arcor2Error):
                await asyncio.to_thread(self._services.execution.packages.forget_temporary, self._package)

    def _tell(self, event: Event) -> None:
        self._services.hub.broadcast(event)

    async def _build(self) -> Project:
        services = self._services
        project = services.session.require_project()
        if services.session.has_changes:
            raise RequestRefused(f"{project.name} has changes that are not saved: save it first.")
        if services.execution.busy:
            raise RequestRefused("A program is running: stop it first.")
        if services.cell.running_action is not None:
            raise RequestRefused("An action is running: wait for it, or stop it.")
        if services.cell.state not in (SceneStateEnum.STOPPED, SceneStateEnum.STARTED):
            raise RequestRefused(f"The scene is {services.cell.state.value}: wait until that is over.")
        name = f"Temporary package for project '{project.name}'."
        self._package = new_id("pkg")
        await asyncio.to_thread(services.execution.packages.note_temporary, self._package, project.id)
        with services.tasks.running(TaskKind.BUILD, f"Building {project.name} to run it", self._how.by):
            await services.build.build(project.id, name, self._package)
        return project

    async def _close(self) -> None:
        services = self._services
        self._online = services.cell.online
        if self._online:
            await services.cell.begin_stop()
            await services.cell.settled()
        ids = [item.id for item in services.session.document.items()]
        await services.session.discard()
        services.locks.drop(ids)
        self._tell(make_event("ProjectClosed"))
        summary = await asyncio.to_thread(services.execution.packages.summary, self._package)
        self._tell(make_event("PackageChanged", summary, ChangeType.ADD))

    async def _run(self) -> None:
        try:
            self._services.cell.last_stop.require_none_since(self._requested_at)
            await self._services.execution.run_through(self._package, self._how)
        except Arcor2Error as error:
            log.warning("temporary package not run", package=self._package, reason=str(error))

    async def _delete(self) -> None:
        try:
            summary = await self._services.execution.delete(self._package)
        except Arcor2Error as error:
            log.warning("temporary package not deleted", package=self._package, reason=str(error))
        else:
            self._tell(make_event("PackageChanged", summary, ChangeType.REMOVE))

    async def _open_again(self, project: Project) -> None:
        """Open the project as it is saved now; without it, clients get the list of projects."""
        try:
            opened = await _open(self._services, project.id)
        except Arcor2Error as error:
            log.warning("project not opened again", project=project.name, reason=str(error))
            self._tell(make_event("ShowMainScreen", ShowMainScreenData(MainScreen.PROJECTS_LIST, project.id)))
            return
        self._tell(make_event("OpenProject", opened))


async def _open(services: Services, project_id: str) -> OpenProjectData:
    """Open a project as it is saved. RequestRefused, NotFound, StorageError."""
    project = await services.storage.project(project_id)
    scene = await services.storage.scene(project.scene_id)
    if problems := project_problems(scene, project, services.types):
        raise RequestRefused(" ".join(problems))
    project = with_present_names(scene, project, services.types)
    await services.session.show(scene, project)
    return OpenProjectData(scene, project)


async def recover(services: Services) -> None:
    """After a crash: delete the package of a project that was being run, and open the project again."""
    try:
        projects = await asyncio.to_thread(services.execution.packages.sweep)
        if services.session.scene is None and len(projects) == 1:
            await _open(services, projects[0])
    except Arcor2Error as error:
        log.warning("a run that a crash ended is not cleared up", reason=str(error))
