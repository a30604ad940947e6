"""The ASGI application: the websocket, the REST routes, and the parts behind them, brought up and ended in order."""

from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import AsyncExitStack, asynccontextmanager
from importlib.metadata import version
from typing import Any, cast

from litestar import Litestar, Request, Response, Router, WebSocket, get, websocket
from litestar.exceptions import MethodNotAllowedException, NotFoundException
from litestar.exceptions.responses import create_exception_response
from litestar.openapi import OpenAPIConfig
from litestar.openapi.plugins import JsonRenderPlugin

from arcor2_hw.data.role import Role
from arcor2_server.access import Access, role_needed
from arcor2_server.build.service import BuildService
from arcor2_server.cell.online import OnlineCell
from arcor2_server.endpoint import Endpoint
from arcor2_server.execution import Execution
from arcor2_server.hub import Hub
from arcor2_server.locks import Locks
from arcor2_server.object_types import ObjectTypes
from arcor2_server.origin import own_pages_only
from arcor2_server.rest import ROUTES
from arcor2_server.rest.answers import OPEN, ROLE

# Imported for their handlers.
from arcor2_server.rpc import (  # noqa: F401
    action_points,
    actions,
    build,
    copying,
    execution,
    general,
    history,
    joints,
    lists,
    locking,
    logic,
    object_types,
    orientations,
    parameters,
    project,
    robot,
    scene,
    scene_objects,
)
from arcor2_server.services import Services
from arcor2_server.session import Session
from arcor2_server.settings import ServerSettings
from arcor2_server.storage import AssetStore, Storage
from arcor2_server.users import Users


@asynccontextmanager
async def running_services(settings: ServerSettings) -> AsyncIterator[Services]:
    """Bring up all parts, and end them in the opposite order. StorageError when the data cannot be used."""
    async with AsyncExitStack() as stack:
        storage = await Storage.open(settings)
        stack.push_async_callback(storage.close)
        assets = await AssetStore.open(settings.assets_dir)
        hub = Hub()
        locks = Locks(settings.lock_retries, settings.lock_retry_wait)
        users = Users(hub, locks, settings)
        stack.callback(users.close)
        types = ObjectTypes(storage, assets)
        await types.load()
        services = Services(
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
        services.session = Session(services)
        await services.session.open()
        stack.push_async_callback(services.session.close)
        services.cell = OnlineCell(services)
        services.execution = Execution(services)
        services.build = BuildService(services)
        locks.tree = services.session
        locks.stored = _is_known(services)
        stack.push_async_callback(services.cell.close)
        stack.push_async_callback(services.execution.close)
        yield services


def _is_known(services: Services) -> Callable[[str], Awaitable[bool]]:
    """Give what tells whether an id names an object type, or a saved scene or project."""

    async def known(item: str) -> bool:
        return services.types.known(item) or await services.storage.identify(item) is not None

    return known


@get("/healthz/ready", opt={ROLE: Role.OPERATOR, OPEN: True}, status_code=200, media_type="text/plain")
async def ready() -> Response[str]:
    """Answer 200 as soon as requests are served."""
    return Response("")


@websocket(["/", "/{path:path}"], opt={ROLE: Role.OPERATOR})
async def arserver(socket: WebSocket[Any, Any, Any]) -> None:
    """Speak the ARCOR2 protocol; each request declares its own least role."""
    await socket.app.state.endpoint.serve(socket)


def no_such_route(request: Request[Any, Any, Any], error: MethodNotAllowedException) -> Response[Any]:
    """Answer 404 where only the websocket is: Litestar takes that for a route without the method."""
    allowed = {name.lower(): value for name, value in (error.headers or {}).items()}.get("allow")
    if allowed in (None, "websocket"):
        return create_exception_response(request, NotFoundException())
    return create_exception_response(request, error)


def create_app(services: Services) -> Litestar:
    """Make the application around parts that are up."""
    endpoint = Endpoint(services)
    app = Litestar(
        route_handlers=[ready, arserver, *ROUTES],
        guards=[own_pages_only, role_needed],
        openapi_config=OpenAPIConfig(
            title="ARCOR2-HW",
            version=version("arcor2-hw"),
            openapi_router=Router("/openapi", route_handlers=[], opt={ROLE: Role.OPERATOR}),
            render_plugins=[JsonRenderPlugin()],
        ),
        exception_handlers={MethodNotAllowedException: no_such_route},
        on_shutdown=[endpoint.close],
        logging_config=None,
    )
    app.state.access = services.access
    app.state.endpoint = endpoint
    app.state.services = services
    return app
