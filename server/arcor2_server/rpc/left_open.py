"""Running a package while a scene or project is open that nobody uses any more: it is set aside meanwhile."""

import asyncio

import structlog

from arcor2_hw.data.events import SceneStateEnum
from arcor2_hw.exceptions import Arcor2Error
from arcor2_server.documents.changes import Kind
from arcor2_server.errors import RequestRefused
from arcor2_server.events import make_event
from arcor2_server.execution.runs import How
from arcor2_server.rpc.locking import release_locks
from arcor2_server.services import Services

log = structlog.get_logger(__name__)


def is_left_open(services: Services) -> bool:
    """Return whether a scene or project is open that no connected user has open, or holds locks in."""
    opened = [item.id for kind in (Kind.SCENE, Kind.PROJECT) for item in services.session.document.of_kind(kind)]
    if not opened or services.presence.users_of(opened):
        return False
    return not set(services.locks.owners()) & set(services.users.names())


async def run_package(services: Services, package_id: str, how: How) -> None:
    """Run a package; returns once it has started.

    What is left open is set aside and is open again afterwards, with its unsaved changes. Its devices go offline and
    stay offline. Users who left lose their locks and are notified on returning.
    """
    if not is_left_open(services):
        await services.execution.run(package_id, how)
        return
    started: asyncio.Future[None] = asyncio.get_running_loop().create_future()
    services.cell.spawn(_run_in_place(services, package_id, how, started), "package in place of what is open")
    await started


async def _require_runnable(services: Services, package_id: str) -> None:
    if services.execution.busy:
        raise RequestRefused("A program is running. Stop it first.")
    await asyncio.to_thread(services.execution.packages.directory, package_id)


async def _run_in_place(services: Services, package_id: str, how: How, started: "asyncio.Future[None]") -> None:
    execution = services.execution
    try:
        await _require_runnable(services, package_id)
        if not is_left_open(services):
            raise RequestRefused("The scene or project was opened by somebody meanwhile.")
        for user in services.locks.owners():
            for event in release_locks(services, user, how.by or "An operator"):
                services.hub.broadcast(event)
        async with services.locks.exclusive():
            await _require_runnable(services, package_id)
            await _go_offline(services)
            scene, project = services.session.require_scene(), services.session.project
            show_again = services.session.set_aside()
            execution.reserved = True
        log.info("set aside for a program", scene=scene.name, project=project and project.name, by=how.by)
        services.hub.broadcast(make_event("SceneClosed" if project is None else "ProjectClosed"))
        try:
            await execution.run_through(package_id, how, temporary=False, started=started)
        finally:
            show_again()
            execution.reserved = False
            for event in services.session.greeting():
                services.hub.broadcast(event)
    except Arcor2Error as error:
        if started.done():
            log.warning("package not run", package=package_id, reason=str(error))
        else:
            started.set_exception(error)
    except BaseException:
        started.cancel()
        raise


async def _go_offline(services: Services) -> None:
    cell = services.cell
    if cell.running_action is not None:
        raise RequestRefused("An action is running. Stop it first.")
    if cell.online:
        await cell.begin_stop()
    if await cell.settled() is not SceneStateEnum.STOPPED:
        raise RequestRefused(f"The scene is {cell.state.value}. Wait until it is offline.")
