"""A local socket to a server or a cell host, divided into messages."""

import asyncio
from collections.abc import Callable
from typing import cast

from arcor2_hw import framing
from arcor2_hw.runtime import messages as m


class MessageStream(asyncio.Protocol):
    """Reads and writes messages with a length prefix.

    Args:
        received: called with each message.
        closed: called at the end of the connection, also after an invalid message.
    """

    def __init__(self, received: Callable[[bytes], None], closed: Callable[[], None]) -> None:
        self._received, self._closed = received, closed
        self._buffer = bytearray()
        self._transport: asyncio.Transport | None = None

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Store the transport."""
        self._transport = cast("asyncio.Transport", transport)

    def data_received(self, data: bytes) -> None:
        """Pass complete messages on."""
        buffer, start = self._buffer, 0
        buffer += data
        while len(buffer) - start >= m.PREFIX_SIZE:
            try:
                end = start + m.PREFIX_SIZE + m.body_length(bytes(buffer[start : start + m.PREFIX_SIZE]))
            except ValueError:
                self.close()
                return
            if len(buffer) < end:
                break
            self._received(bytes(buffer[start + m.PREFIX_SIZE : end]))
            start = end
        del buffer[:start]

    def connection_lost(self, error: Exception | None) -> None:  # noqa: ARG002 - each end is handled alike
        """Report the end."""
        self._closed()

    def send(self, body: bytes) -> None:
        """Send a message. It is dropped after the end."""
        if self._transport is not None and not self._transport.is_closing():
            self._transport.write(framing.framed(body))

    def close(self) -> None:
        """Close the connection when the written messages are sent."""
        if self._transport is not None:
            self._transport.close()
