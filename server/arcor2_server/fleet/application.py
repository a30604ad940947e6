"""The web application of the fleet: the page, its live updates, and the stored results. Nobody commands a cell here."""

import asyncio
import contextlib
from typing import Annotated, Any, Final, cast

from litestar import Litestar, Request, Response, WebSocket, delete, get, websocket
from litestar.exceptions import HTTPException, WebSocketDisconnect
from litestar.params import Parameter

from arcor2_hw.data.role import Role
from arcor2_hw.exceptions import Conflict, NotFound, StorageError
from arcor2_hw.messages import translatable
from arcor2_server.access.admission import Access, AccessRefused, role_needed
from arcor2_server.access.origin import HostNames, own_pages_only
from arcor2_server.access.route_options import OPEN, ROLE
from arcor2_server.access.tokens import Token
from arcor2_server.audit.trail import AuditTrail
from arcor2_server.fleet import records
from arcor2_server.fleet.collector import Collector
from arcor2_server.fleet.file import FleetResult
from arcor2_server.fleet.registry import FleetUpdate
from arcor2_server.fleet.report_routes import json_response, refusal, report_routes
from arcor2_server.rest.responses import http_refusal
from arcor2_server.settings import ServerSettings
from arcor2_server.web.application import Application
from arcor2_server.web.editor import FLEET_PAGE, editor_routes
from arcor2_server.web.response_headers import add_headers
from arcor2_server.web.websocket_transport import EXTENSION, WireProtocol
from arcor2_server.websocket.client import CloseCode

SEND_PERIOD: Final = 0.1
"""Shortest time between two updates of a page, s."""
BEAT_PERIOD: Final = 1.0
"""Longest time between two updates of a page, s. A page without an update shows all cells without a signal."""
TOKEN_NEEDED: Final = translatable("A token is needed.")


class NoPersons:
    """Replacement for the persons of a cell: nobody logs on at the fleet."""

    @staticmethod
    def person_of(_session: str, _device: str, *, active: bool) -> None:
        """Return nobody."""


class _Routes:
    """The routes."""

    def __init__(self, collector: Collector, access: Access, audit: AuditTrail) -> None:
        self._collector, self._access, self._audit = collector, access, audit
        self.handlers = [self._page(), self._cells(), self._remove(), self._results(), self._translations()]
        self.handlers += report_routes(collector)

    def _page(self) -> Any:
        @websocket("/ws", opt={ROLE: Role.OPERATOR})
        async def follow(socket: WebSocket[Any, Any, Any]) -> None:
            """Send the cells, then changes. What the page sends is ignored: it can only view."""
            await socket.accept()
            try:
                admission = self._access.admit(socket)
            except AccessRefused as error:
                await socket.close(CloseCode.NOT_ADMITTED, str(error))
                return
            if admission.role is None:
                await socket.close(CloseCode.NOT_ADMITTED, TOKEN_NEEDED)
                return
            protocol = cast("WireProtocol", (socket.scope["extensions"] or {})[EXTENSION])
            protocol.admit()
            sending = asyncio.create_task(self._send(socket, protocol, admission.token), name="page of the fleet")
            with contextlib.suppress(WebSocketDisconnect):
                while not sending.done():
                    await socket.receive_data("text")
            sending.cancel()
            await asyncio.gather(sending, return_exceptions=True)

        return follow

    async def _send(self, socket: WebSocket[Any, Any, Any], protocol: WireProtocol, token: Token | None) -> None:
        registry = self._collector.registry
        since = -1
        while token is None or self._access.valid(token):
            changed = self._collector.changed
            revision = registry.revision
            update = FleetUpdate(registry.cards(since), registry.removed(since), self._collector.connected)
            since = revision
            try:
                await protocol.send_text(records.encode(update))
            except ConnectionError:
                return
            await asyncio.sleep(SEND_PERIOD)
            with contextlib.suppress(TimeoutError):
                async with asyncio.timeout(BEAT_PERIOD - SEND_PERIOD):
                    await changed.wait()
        await socket.close(CloseCode.NOT_ADMITTED, TOKEN_NEEDED)

    def _cells(self) -> Any:
        @get("/api/fleet/cells", opt={ROLE: Role.OPERATOR}, sync_to_thread=False)
        def cells() -> Response[bytes]:
            """Return all cells."""
            registry = self._collector.registry
            return json_response(FleetUpdate(registry.cards(), [], self._collector.connected))

        return cells

    def _remove(self) -> Any:
        @delete("/api/fleet/cells/{card_id:str}", opt={ROLE: Role.TECHNICIAN}, status_code=204)
        async def remove(card_id: str) -> None:
            """Forget a cell without a signal. Its results stay."""
            try:
                await self._collector.remove(card_id)
            except (NotFound, Conflict, StorageError) as error:
                raise refusal(error) from None

        return remove

    def _results(self) -> Any:
        @get("/api/fleet/results", opt={ROLE: Role.OPERATOR})
        async def results(
            cell: Annotated[str, Parameter(max_length=63)] = "",
            kind: Annotated[str, Parameter(pattern="^(unit|alarm|)$")] = "",
            before: Annotated[int, Parameter(ge=0, lt=1 << 62)] = 0,
            limit: Annotated[int, Parameter(ge=1, le=1000)] = 100,
        ) -> Response[bytes]:
            """Return stored results, newest first."""
            try:
                found: list[FleetResult] = await self._collector.results(cell, kind, before, limit)
            except StorageError as error:
                raise refusal(error) from None
            return json_response(found)

        return results

    @staticmethod
    def _translations() -> Any:
        @get("/api/translations/{language:str}", opt={ROLE: Role.OPERATOR, OPEN: True})
        async def translations(language: str) -> Response[bytes]:
            """Return the translations of the server's messages, for alarms."""
            from arcor2_server.object_types import translations as texts  # not needed for pages in English

            return json_response(await asyncio.to_thread(texts.into, language, ()))

        return translations


def refused(request: Request[Any, Any, Any], error: HTTPException) -> Response[Any]:
    """Answer a refused request."""
    return http_refusal(request, error)


def create_fleet_app(settings: ServerSettings, collector: Collector, access: Access, audit: AuditTrail) -> Litestar:
    """Return the application."""
    app = Application(
        route_handlers=[*_Routes(collector, access, audit).handlers, *editor_routes(page_name=FLEET_PAGE)],
        guards=[own_pages_only, role_needed],
        before_send=[add_headers],
        openapi_config=None,
        exception_handlers={HTTPException: refused},
        logging_config=None,
    )
    app.state.access = access
    app.state.audit = audit
    app.state.host_names = HostNames.of(settings)
    app.state.log_ons = NoPersons()
    return app
