"""The websocket transport on uvicorn: encoded text messages, pings that can be awaited, and abort."""

import asyncio
import secrets
from typing import Any, Final

from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol
from websockets.exceptions import InvalidState
from websockets.frames import Frame
from websockets.http11 import Request

from arcor2_server.access.connection_limits import Connection

CLOSE_TIMEOUT: Final = 1.0
"""Time limit for sending the close frame to a client that does not answer pings, s."""
MAX_UNADMITTED_MESSAGE: Final = 64 * 1024
"""Maximum length of a message from an unadmitted client, bytes. A longer message closes the connection."""
EXTENSION: Final = "arcor2_hw.wire"
"""Key of the WireProtocol in the extensions of an ASGI scope."""


class WireProtocol(WebSocketsSansIOProtocol):
    """The websocket protocol of uvicorn with pings, abort and encoded text messages, which ASGI does not have."""

    def __init__(self, *args: Any, connection: Connection, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self._connection = connection
        self._max_size = self.conn.max_message_size
        self.conn.max_message_size = MAX_UNADMITTED_MESSAGE
        self._pongs: dict[bytes, asyncio.Future[None]] = {}

    def handle_connect(self, event: Request) -> None:
        """Put this object into the scope for the endpoint."""
        super().handle_connect(event)
        if (scope := getattr(self, "scope", None)) is not None:
            scope["extensions"][EXTENSION] = self

    def handle_pong(self, event: Frame) -> None:
        """Notify the waiter for this pong."""
        waiter = self._pongs.pop(bytes(event.data), None)
        if waiter is None:
            super().handle_pong(event)
        elif not waiter.done():
            waiter.set_result(None)

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Take over a connection from the HTTP protocol."""
        super().connection_made(transport)
        self._connection.drop = self.abort

    def admit(self) -> None:
        """Count the connection among the admitted ones, and accept long messages."""
        self._connection.admit()
        self.conn.max_message_size = self._max_size

    def keepalive_timeout(self) -> None:
        """Close the connection; abort it if the client does not receive the close frame in time."""
        super().keepalive_timeout()
        self.loop.call_later(CLOSE_TIMEOUT, self.abort)

    def connection_lost(self, exc: Exception | None) -> None:
        """Notify the waiters that no pong will arrive."""
        super().connection_lost(exc)
        self._connection.close()
        for waiter in self._pongs.values():
            if not waiter.done():
                waiter.set_exception(ConnectionError("the connection is lost"))
        self._pongs.clear()

    def send_text_now(self, message: bytes) -> bool:
        """Send an encoded text message if it can be sent at once; return whether it was sent."""
        if self.disconnected or self.close_sent or not self.writable.is_set():
            return False
        try:
            self.conn.send_text(message)
        except InvalidState:
            return False
        self.transport.writelines(self.conn.data_to_send())
        return True

    async def send_text(self, message: bytes) -> None:
        """Send an encoded text message as soon as the buffer has room. Raise ConnectionError if it is closed."""
        while not self.send_text_now(message):
            if self.writable.is_set():
                raise ConnectionError("the connection is closed")
            await self.writable.wait()

    async def ping(self) -> None:
        """Send a ping and wait for its answer. Raise ConnectionError if the connection ends."""
        if self.disconnected or self.close_sent:
            raise ConnectionError("the connection is closed")
        payload = secrets.token_bytes(8)  # uvicorn's own pings have four bytes
        waiter = self._pongs[payload] = self.loop.create_future()
        try:
            self.conn.send_ping(payload)
            self.transport.write(b"".join(self.conn.data_to_send()))
            await waiter
        finally:
            self._pongs.pop(payload, None)

    def abort(self) -> None:
        """Close the connection at once, without sending buffered data."""
        if not self.disconnected:
            self.transport.abort()
