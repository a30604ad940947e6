"""The raw mode of socketcand over TCP: each client is another node on the bus of the hub.

The server sends `< hi >` first and answers `< open can0 >` and `< rawmode >` by `< ok >`. Then `< send 123 2 1 ff >`
sends a frame, and `< frame 123 1.5 01FF >` reports one. No specification of the protocol was available.
"""

from __future__ import annotations

import re
import time

from arcor2_fakes.conveyor.hub import Hub
from arcor2_fakes.wire import Connection, TcpWire

_MESSAGE = re.compile(rb"<([^<>]*)>")
_LONGEST = 256
_HIGHEST_ID = 0x7FF


class Client:
    """A client: opens the bus, then sends and receives frames."""

    def __init__(self, server: Server, connection: Connection) -> None:
        self._server, self._connection = server, connection
        self._buffer = b""
        self._opened = False
        self.open = False
        connection.received = self._received
        connection.closed = lambda: server.hub.adapters.discard(self)
        self._say("hi")

    def deliver(self, identifier: int, data: bytes) -> None:
        """Send the client a frame from the bus."""
        if self.open:
            self._say(f"frame {identifier:03X} {time.time():.6f} {data.hex().upper()}")

    def _say(self, text: str) -> None:
        self._connection.send(f"< {text} >".encode())

    def _received(self, data: bytes) -> None:
        self._buffer += data
        taken = 0
        for message in _MESSAGE.finditer(self._buffer):
            taken = message.end()
            self._command(message[1].decode("latin-1").split())
        self._buffer = self._buffer[taken:][-_LONGEST:]

    def _command(self, words: list[str]) -> None:
        if words[:1] == ["open"] and not self._opened:
            self._opened = words[1:] == [self._server.bus]
            self._say("ok" if self._opened else "error could not open bus")
        elif words == ["rawmode"] and self._opened:
            self.open = True
            self._say("ok")
        elif words[:1] == ["send"] and self.open:
            self._send(words[1:])
        else:
            self._say("error unknown command")

    def _send(self, words: list[str]) -> None:
        try:
            identifier, length, *data = (int(word, 16) for word in words)
            if identifier > _HIGHEST_ID or length != len(data):
                raise ValueError
            frame = bytes(data)
        except ValueError:
            self._say("error could not send frame")
            return
        self._server.hub.transmit(identifier, frame, self)


class Server:
    """The socketcand server of the bus."""

    def __init__(self, hub: Hub, host: str, port: int, bus: str = "can0") -> None:
        self.hub, self.bus = hub, bus
        self.wire = TcpWire("socketcand", host, port, self._opened)

    def _opened(self, connection: Connection) -> None:
        self.hub.adapters.add(Client(self, connection))
