"""The ASGI application: websocket, REST routes, editor, and the parts behind them, brought up and ended in order."""

import asyncio
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import AsyncExitStack, asynccontextmanager
from typing import Any, cast

import structlog
from litestar import Litestar, Request, Response, WebSocket, websocket
from litestar.exceptions import HTTPException, MethodNotAllowedException, NotFoundException
from litestar.plugins import PluginProtocol
from litestar.plugins.core import MsgspecDIPlugin

from arcor2_hw.data.role import Role
from arcor2_server.access.admission import Access, role_needed
from arcor2_server.access.origin import HostNames, own_pages_only
from arcor2_server.build.service import BuildService
from arcor2_server.collaboration.locks import Locks
from arcor2_server.collaboration.users import Users
from arcor2_server.documents import Session
from arcor2_server.execution.service import Execution
from arcor2_server.files import tighten
from arcor2_server.hosts.workspace_updates import tell_hosts
from arcor2_server.log.redaction import REDACTION
from arcor2_server.object_types.registry import ObjectTypes
from arcor2_server.online.online_scene import OnlineCell
from arcor2_server.rest import routes
from arcor2_server.rest.responses import ROLE, http_refusal

# Imported for their handlers.
from arcor2_server.rpc import (  # noqa: F401
    action_points,
    actions,
    build,
    calibration,
    calibration_records,
    cameras,
    copying,
    editor,
    execution,
    general,
    history,
    joints,
    lists,
    locking,
    logic,
    object_aiming,
    object_types,
    operation,
    orientations,
    parameters,
    perpendicular,
    project,
    reachability,
    robot,
    runs,
    scene,
    scene_objects,
    temporary,
)
from arcor2_server.services import Services
from arcor2_server.settings import ServerSettings
from arcor2_server.storage import AssetStore, Storage
from arcor2_server.storage.packages import Packages
from arcor2_server.storage.secret_migration import hide_stored
from arcor2_server.web.editor import editor_routes
from arcor2_server.web.response_headers import add_headers
from arcor2_server.websocket.classic_ports import SOCKET
from arcor2_server.websocket.endpoint import Endpoint
from arcor2_server.websocket.execution_endpoint import execution_endpoint
from arcor2_server.websocket.hub import Hub
from arcor2_server.workspace.collisions import CollisionWorld

log = structlog.get_logger(__name__)


@asynccontextmanager
async def running_services(settings: ServerSettings) -> AsyncIterator[Services]:
    """Bring up all parts, and end them in the opposite order. StorageError when the data cannot be used."""
    tighten(settings.data_dir)
    async with AsyncExitStack() as stack:
        storage = await Storage.open(settings)
        stack.push_async_callback(storage.close)
        assets = await AssetStore.open(settings.assets_dir)
        hub = Hub()
        locks = Locks(settings.lock_retries, settings.lock_retry_wait)
        users = Users(hub, locks, settings)
        stack.callback(users.close)
        types = ObjectTypes(storage, assets, settings.analysis_file)
        await types.load()
        services = Services(
            collisions=CollisionWorld(settings.scene_inflation),
            settings=settings,
            access=Access(settings),
            hub=hub,
            users=users,
            locks=locks,
            storage=storage,
            assets=assets,
            types=types,
            session=cast("Session", None),  # these know the others, and are made below
            cell=cast("OnlineCell", None),
            execution=cast("Execution", None),
            build=cast("BuildService", None),
        )
        services.damage.load()
        if damage := services.access.repair():
            services.damage.report(damage)
        services.secrets.store.load(services.damage)
        storage.secrets = services.secrets
        REDACTION.secrets = lambda: services.secrets.store.values
        await hide_stored_secrets(services)
        services.markers.load(services.damage)
        services.arm_calibrations.load()
        stack.push_async_callback(services.compute.close)
        services.session = Session(services)
        await services.session.open()
        stack.push_async_callback(services.session.close)
        services.cell = OnlineCell(services)
        services.execution = Execution(services)
        tell_hosts(services)
        services.build = BuildService(services)
        stack.push_async_callback(services.type_news.close)
        locks.tree = services.session
        locks.stored = _is_known(services)
        await services.share()
        stack.push_async_callback(services.close_shared)
        stack.push_async_callback(services.cell.close)
        stack.push_async_callback(services.execution.close)
        await temporary.recover(services)
        yield services


async def hide_stored_secrets(services: Services) -> None:
    """Move secrets that saved documents and packages hold in clear to the store of secrets. StorageError.

    Documents are searched once, and again when object types with further secret settings are known.
    """
    secrets, store = services.secrets, services.secrets.store
    declared = secrets.declared()
    if store.scanned is not None and declared <= store.scanned:
        return
    packages = Packages(services.settings.packages_dir, secrets.hide_in_package)
    with secrets.migrating():
        found = await hide_stored(services.storage, secrets) + await asyncio.to_thread(packages.hide_secrets)
    store.note_scanned(declared | (store.scanned or set()))
    await store.flush()
    if found:
        log.info("secrets moved out of documents", documents=found)


def _is_known(services: Services) -> Callable[[str], Awaitable[bool]]:
    """Give what tells whether an id names an object type, or a saved scene or project."""

    async def known(item: str) -> bool:
        return services.types.known(item) or await services.storage.identify(item) is not None

    return known


@websocket(["/", "/{path:path}"], opt={ROLE: Role.OPERATOR})
async def sockets(socket: WebSocket[Any, Any, Any]) -> None:
    """Speak the ARCOR2 protocol: at /execution or at its classic port as the Execution service, else as ARServer.

    Each request declares its own least role.
    """
    state = socket.app.state
    port = (socket.scope.get("server") or ("", None))[1]
    own_port = state.services.settings.classic_ports.get(SOCKET)
    endpoint = state.execution if socket.url.path == "/execution" or port == own_port else state.endpoint
    await endpoint.serve(socket)


def no_such_route(request: Request[Any, Any, Any], error: MethodNotAllowedException) -> Response[Any]:
    """Answer 404 where only the websocket is: Litestar takes that for a route without the method."""
    allowed = {name.lower(): value for name, value in (error.headers or {}).items()}.get("allow")
    if allowed in (None, "websocket"):
        return http_refusal(request, NotFoundException("There is no such route."))
    return http_refusal(request, error)


class Application(Litestar):
    """Litestar without its plugins for pydantic and attrs, which serve nothing here and cost a tenth of a second."""

    @staticmethod
    def _get_default_plugins(plugins: list[PluginProtocol]) -> list[PluginProtocol]:
        return [*plugins, MsgspecDIPlugin()]


def create_app(services: Services) -> Litestar:
    """Make the application around parts that are up."""
    endpoint, of_execution = Endpoint(services), execution_endpoint(services)
    app = Application(
        route_handlers=[sockets, *routes(), *editor_routes()],
        guards=[own_pages_only, role_needed],
        before_send=[add_headers],
        openapi_config=None,
        exception_handlers={MethodNotAllowedException: no_such_route, HTTPException: http_refusal},
        on_shutdown=[endpoint.close, of_execution.close],
        logging_config=None,
    )
    app.state.access = services.access
    app.state.endpoint = endpoint
    app.state.execution = of_execution
    app.state.host_names = HostNames.of(services.settings)
    app.state.services = services
    return app
