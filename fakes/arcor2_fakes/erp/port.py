"""The HTTP port of the service, and its simulated faults."""

from __future__ import annotations

import asyncio
import hmac
import ssl
import time
from collections import deque
from collections.abc import Callable
from typing import Any, Final

from arcor2_fakes.erp.http import REASONS, BadRequest, Request, Requests, answer
from arcor2_fakes.erp.planning import Planning, Problem
from arcor2_fakes.wire import Connection, TcpWire

MAX_OFF_TIME: Final = 60.0
"""Longest power cycle, s."""


class TlsWire(TcpWire):
    """A TCP port with optional TLS."""

    def __init__(
        self, host: str, port: int, context: ssl.SSLContext | None, opened: Callable[[Connection], None]
    ) -> None:
        super().__init__("http", host, port, opened)
        self._context = context

    async def listen(self) -> str:
        """Open the port and return the address. Raises `OSError` when it is in use."""
        if self._context is None:
            return await super().listen()
        if self._server is None:
            loop = asyncio.get_running_loop()
            self._server = await loop.create_server(lambda: Connection(self), self._host, self._port, ssl=self._context)
            self._port = self._server.sockets[0].getsockname()[1]
        return self.address


class Port:
    """Serves the planning over HTTP.

    Args:
        planning: The state of the service.
        host: Address to listen on.
        port: TCP port; 0 takes a free one.
        token: Bearer token that clients must send; empty for none.
        context: TLS context; None for plain HTTP.
    """

    def __init__(self, planning: Planning, host: str, port: int, token: str, context: ssl.SSLContext | None) -> None:
        self._planning, self._token = planning, token
        self.wire = TlsWire(host, port, context, self._opened)
        self.received: deque[dict[str, Any]] = deque(maxlen=1000)
        self.total = 0
        self.changed: Callable[[], None] = lambda: None  # called after each accepted request
        self._lost_answers = self._mistakes = 0
        self._failing: tuple[int, float, str, bool] | None = (
            None  # status, Retry-After (s), path, whether the request is executed
        )
        self._failures = 0
        self._starting: asyncio.Future[None] | None = None

    # -------------------------------------------------------------------------------- faults
    def lose_answers(self, count: int = 1) -> None:
        """Execute the next `count` POSTs, and reset the connection instead of answering."""
        self._lost_answers = int(count)

    def mistake(self, count: int = 1) -> None:
        """Answer the next `count` POSTs with a wrong key, without executing them."""
        self._mistakes = int(count)

    def fail(self, status: int, count: int = 1, retry_after: float = 0.0, path: str = "", done: bool = False) -> None:
        """Answer the next `count` requests (-1: all) of a path (empty: all) with a status; `done`: execute them."""
        if status not in REASONS:
            raise ValueError(f"status must be one of {', '.join(map(str, REASONS))}")
        self._failing, self._failures = (int(status), float(retry_after), path, bool(done)), int(count)

    def heal(self) -> None:
        """End all simulated faults."""
        self._lost_answers = self._failures = self._mistakes = 0
        self._failing = None

    def power_cycle(self, seconds: float = 1.0) -> None:
        """Switch off for `seconds`: connections are reset and the port is closed; stored data survive."""
        if not 0.0 <= seconds <= MAX_OFF_TIME:
            raise ValueError(f"seconds must be 0 to {MAX_OFF_TIME:g}")
        self.wire.refuse()
        self.wire.reset()
        self.heal()
        asyncio.get_running_loop().call_later(seconds, self._switch_on)

    def _switch_on(self) -> None:
        self._starting = asyncio.ensure_future(self.wire.fault("heal"))

    # -------------------------------------------------------------------------------- serving
    def _opened(self, connection: Connection) -> None:
        requests = Requests()

        def received(data: bytes) -> None:
            try:
                for request in requests.feed(data):
                    self._serve(connection, request)
            except BadRequest as e:
                connection.send(answer(e.status, {"error": str(e)}, {"Connection": "close"}))
                connection.close()

        connection.received = received

    def _serve(self, connection: Connection, request: Request) -> None:
        self.total += 1
        self.received.append(
            {
                "method": request.method,
                "path": request.path,
                "key": request.headers.get("idempotency-key", ""),
                "body": request.body.decode(errors="replace"),
                "at": time.monotonic(),
            }
        )
        failing = self._failure(request)
        if failing is not None and not failing[3]:
            self._send_failure(connection, failing)
            return
        if self._mistakes > 0 and request.method == "POST":
            self._mistakes -= 1
            connection.send(answer(201, {"key": "0" * 32, "number": 1, "order": None}))
            return
        try:
            self._authorised(request)
            status, body = self._planning.execute(request)
            if status == 201:
                self.changed()
        except Problem as problem:
            status, body = problem.status, {"error": str(problem)}
        if failing is not None:
            self._send_failure(connection, failing)
        elif self._lost_answers > 0 and request.method == "POST":
            self._lost_answers -= 1
            connection.reset()
        else:
            connection.send(answer(status, body))

    def _failure(self, request: Request) -> tuple[int, float, str, bool] | None:
        if self._failing is None or self._failures == 0 or self._failing[2] not in ("", request.path):
            return None
        self._failures -= 1 if self._failures > 0 else 0
        return self._failing

    @staticmethod
    def _send_failure(connection: Connection, failing: tuple[int, float, str, bool]) -> None:
        status, retry_after, _, _ = failing
        headers = {"Retry-After": f"{retry_after:.0f}"} if retry_after else {}
        connection.send(answer(status, {"error": REASONS[status]}, headers))

    def _authorised(self, request: Request) -> None:
        if self._token:
            given = request.headers.get("authorization", "").removeprefix("Bearer ")
            if not hmac.compare_digest(given.encode(), self._token.encode()):
                raise Problem(401, "the token is not valid")
