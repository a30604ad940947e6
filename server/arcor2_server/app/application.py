"""The ASGI application: routes of the websocket, the REST operations and the editor."""

from typing import TYPE_CHECKING, Any

from litestar import Litestar, Request, Response, WebSocket, websocket
from litestar.exceptions import HTTPException, MethodNotAllowedException, NotFoundException

from arcor2_hw.data.role import Role
from arcor2_server.access.admission import role_needed
from arcor2_server.access.origin import HostNames, own_pages_only
from arcor2_server.access.route_options import ROLE
from arcor2_server.app.adapters import request_handlers, rest_groups
from arcor2_server.app.parts import Server
from arcor2_server.rest import routes as rest_routes
from arcor2_server.rest.metrics import Metrics, metrics_route
from arcor2_server.rest.responses import http_refusal
from arcor2_server.web.application import Application
from arcor2_server.web.editor import editor_routes
from arcor2_server.web.response_headers import add_headers
from arcor2_server.websocket.classic_ports import SOCKET
from arcor2_server.websocket.endpoint import Endpoint
from arcor2_server.websocket.execution_endpoint import execution_service
from arcor2_server.websocket.routes import Service, routes

if TYPE_CHECKING:
    from arcor2_server.rest.plant_metrics import PlantMetrics


@websocket(["/", "/{path:path}"], opt={ROLE: Role.OPERATOR})
async def sockets(socket: WebSocket[Any, Any, Any]) -> None:
    """Serve the Execution service at /execution and at its classic port, and ARServer elsewhere.

    The role of the route is the lowest one, since each request declares the role that it needs.
    """
    state = socket.app.state
    port = (socket.scope.get("server") or ("", None))[1]
    execution_port = state.settings.classic_ports.get(SOCKET)
    endpoint = state.execution if socket.url.path == "/execution" or port == execution_port else state.endpoint
    await endpoint.serve(socket)


def no_such_route(request: Request[Any, Any, Any], error: MethodNotAllowedException) -> Response[Any]:
    """Answer 404 instead of 405 if only the websocket has the path, since there is no HTTP route."""
    allowed = {name.lower(): value for name, value in (error.headers or {}).items()}.get("allow")
    if allowed in (None, "websocket"):
        return http_refusal(request, NotFoundException())
    return http_refusal(request, error)


def endpoints(server: Server) -> tuple[Endpoint, Endpoint]:
    """Return the websocket endpoints of ARServer and of the Execution service."""
    handlers = request_handlers(server)
    table = routes(handlers.by_request, handlers.cached)

    def endpoint(service: Service) -> Endpoint:
        return Endpoint(
            service,
            server.settings,
            server.access,
            server.hub,
            server.users,
            server.damage,
            server.audit,
            server.log_ons,
        )

    execution = execution_service(table, server.execution.state_and_info)
    return endpoint(Service(table, server.greeting)), endpoint(execution)


def metrics_of(s: Server, served: dict[str, Endpoint]) -> Metrics:
    """Return what reads the metrics of the parts."""
    hosts = {"scene": s.scene_host, "program": s.program_host}
    requests = {service: endpoint.durations for service, endpoint in served.items()}

    def plant() -> "PlantMetrics":
        from arcor2_server.rest.plant_metrics import PlantMetrics  # few servers are asked for metrics

        return PlantMetrics(s.nodes, s.fleet, s.history, s.opcua, s.mqtt)

    return Metrics(
        s.settings, s.hub, s.storage, s.execution, s.online, s.cell, s.units, s.alarms, s.system_alarms, hosts,
        requests, plant,
    )  # fmt: skip


def create_app(server: Server) -> Litestar:
    """Return the application that serves the running parts."""
    endpoint, execution_endpoint = endpoints(server)
    app = Application(
        route_handlers=[
            sockets,
            *rest_routes(rest_groups(server), server.tasks, server.audit),
            metrics_route(metrics_of(server, {"arserver": endpoint, "execution": execution_endpoint})),
            *editor_routes(),
        ],
        guards=[own_pages_only, role_needed],
        before_send=[add_headers],
        openapi_config=None,
        exception_handlers={MethodNotAllowedException: no_such_route, HTTPException: http_refusal},
        on_shutdown=[endpoint.close, execution_endpoint.close],
        logging_config=None,
    )
    app.state.access = server.access
    app.state.audit = server.audit
    app.state.endpoint = endpoint
    app.state.execution = execution_endpoint
    app.state.log_ons = server.log_ons
    app.state.host_names = HostNames.of(server.settings)
    app.state.settings = server.settings
    return app
