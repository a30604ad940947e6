"""HTTP connections with time limits for sending and receiving."""

import asyncio
import functools
from typing import Any, Final, cast

from uvicorn.protocols.http.httptools_impl import HttpToolsProtocol

from arcor2_server.access.connection_limits import CONNECTION, Connection
from arcor2_server.web.websocket_transport import WireProtocol

SLOWEST: Final = 500
"""Minimum rate at which a client must send a body or receive an answer, bytes/s."""


class HttpProtocol(HttpToolsProtocol):
    """The HTTP protocol of uvicorn with time limits.

    The connection may be dropped for a new one, except while a request of an admitted client is served.

    Args:
        connection: the connection.
        request_timeout: time limit for the head of a request, for a pause in its body, and between two checks that
            the client receives the answer, s.
    """

    def __init__(self, *args: Any, connection: Connection, request_timeout: float, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self._connection = connection
        self._timeout = request_timeout
        self._deadline: float | None = None
        """Deadline for the part of a request that is being received; None between requests."""
        self._in_body = False
        self._timer: asyncio.TimerHandle | None = None
        self._sending_timer: asyncio.TimerHandle | None = None
        self._unsent = 0
        # uvicorn creates the websocket protocol by this class when a request asks for an upgrade.
        self.ws_protocol_class = functools.partial(WireProtocol, connection=connection)  # type: ignore[assignment]

    # ------------------------------------------------------------------------------------------------ connection
    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Start the time limit for the first request."""
        super().connection_made(cast("asyncio.Transport", transport))
        self._connection.drop = self.transport.abort
        self._expect_head()

    def connection_lost(self, exc: Exception | None) -> None:
        """Stop all time limits."""
        self._end_timers()
        self._connection.close()
        super().connection_lost(exc)

    def handle_websocket_upgrade(self) -> None:
        """Hand the connection over to the websocket protocol."""
        self._end_timers()
        super().handle_websocket_upgrade()

    def _end_timers(self) -> None:
        self._deadline = None
        for timer in (self._timer, self._sending_timer):
            if timer is not None:
                timer.cancel()
        self._timer = self._sending_timer = None

    # ------------------------------------------------------------------------------------------------ receiving
    def data_received(self, data: bytes) -> None:
        """Process received bytes. The bytes of a body extend its time limit."""
        if self._deadline is None:
            self._expect_head()
        elif self._in_body:
            now = self.loop.time()
            self._deadline = min(now + self._timeout, self._deadline + len(data) / SLOWEST)
        super().data_received(data)

    def on_message_begin(self) -> None:
        """Put the connection into the scope for the guards of the routes."""
        super().on_message_begin()
        extensions: dict[str, Any] = {CONNECTION: self._connection}
        self.scope["extensions"] = extensions
        if self._deadline is None:  # a further request in the same bytes
            self._expect_head()

    def on_headers_complete(self) -> None:
        """Start the time limit for the body."""
        self._in_body = True
        self._expect(self.loop.time() + self._timeout)
        super().on_headers_complete()

    def on_message_complete(self) -> None:
        """Stop the time limit until the next request."""
        self._in_body, self._deadline = False, None
        super().on_message_complete()

    def _expect_head(self) -> None:
        self._in_body = False
        self._expect(self.loop.time() + self._timeout)

    def _expect(self, deadline: float) -> None:
        self._deadline = deadline
        if self._timer is None:
            self._timer = self.loop.call_at(deadline, self._check_received)

    def _check_received(self) -> None:
        self._timer = None
        if self._deadline is None:
            return
        now = self.loop.time()
        if self.flow.read_paused:  # the server is slow, not the client
            self._deadline = now + self._timeout
        if now >= self._deadline:
            self.transport.abort()
        else:
            self._expect(self._deadline)

    # ------------------------------------------------------------------------------------------------ sending
    def on_response_complete(self) -> None:
        """Wait for the next request."""
        self._connection.wait()
        super().on_response_complete()
        if self.transport.is_closing() and self.transport.get_write_buffer_size():
            self._watch_sending()

    def pause_writing(self) -> None:
        """Check that the client receives what is sent."""
        super().pause_writing()
        self._watch_sending()

    def resume_writing(self) -> None:
        """Continue sending, since the client has received the buffered data."""
        if self._sending_timer is not None:
            self._sending_timer.cancel()
            self._sending_timer = None
        super().resume_writing()

    def timeout_keep_alive_handler(self) -> None:
        """Close an idle connection. One that still sends an answer is closed later."""
        if self.transport.get_write_buffer_size():
            self._watch_sending()
        else:
            super().timeout_keep_alive_handler()

    def _watch_sending(self) -> None:
        if self._sending_timer is None:
            self._unsent = self.transport.get_write_buffer_size()
            self._sending_timer = self.loop.call_later(self._timeout, self._check_sent)

    def _check_sent(self) -> None:
        self._sending_timer = None
        left = self.transport.get_write_buffer_size()
        if left and self._unsent - left < SLOWEST * self._timeout:
            self.transport.abort()
        elif left:
            self._watch_sending()
        elif self.cycle is not None and self.cycle.response_complete and self.timeout_keep_alive_task is not None:
            super().timeout_keep_alive_handler()
