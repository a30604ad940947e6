"""The CAN bus: each TCP client is a Lawicel adapter (slcan); the drive is connected directly."""

from __future__ import annotations

import re
import time
from collections import deque
from collections.abc import Callable
from typing import Protocol

from arcor2_fakes.wire import Connection, TcpWire

OK, BELL = b"\r", b"\a"
_FRAMES_KEPT = 400
_MAX_COMMAND = 64
_FIRST_PDO, _FIRST_SDO = 0x180, 0x580
_DATA_FRAME = re.compile(rb"t([0-7][0-9A-Fa-f]{2})([0-8])((?:[0-9A-Fa-f]{2})*)")

Receive = Callable[[int, bytes], None]


class Member(Protocol):
    """A node on the bus."""

    def deliver(self, identifier: int, data: bytes) -> None:
        """Receive a frame from another node."""
        ...


class Adapter:
    """A client: its commands are parsed, and it receives the frames of other nodes while its channel is open."""

    def __init__(self, hub: Hub, connection: Connection) -> None:
        self._hub, self._connection = hub, connection
        self._buffer = b""
        self.open = False
        connection.received = self._received
        connection.closed = lambda: hub.adapters.discard(self)

    def deliver(self, identifier: int, data: bytes) -> None:
        """Send the client a frame from the bus."""
        if self.open:
            self._connection.send(f"t{identifier:03X}{len(data)}{data.hex().upper()}".encode() + OK)

    def _received(self, data: bytes) -> None:
        *commands, self._buffer = (self._buffer + data).split(b"\r")
        if len(self._buffer) > _MAX_COMMAND:
            self._buffer = b""
        for command in commands:
            if command:
                self._connection.send(self._command(command))

    def _command(self, command: bytes) -> bytes:
        if command[:1] == b"O" and not self.open:
            self.open = True
            return OK
        if command[:1] == b"C":
            was, self.open = self.open, False
            return OK if was else BELL
        if command[:1] in (b"S", b"s") and not self.open:
            return OK
        if command[:1] == b"V":
            return b"V1013" + OK
        if command[:1] == b"N":
            return b"NFAKE" + OK
        frame = _DATA_FRAME.fullmatch(command)
        if frame is None or not self.open or len(frame[3]) != 2 * int(frame[2]):
            return BELL
        self._hub.transmit(int(frame[1], 16), bytes.fromhex(frame[3].decode()), self)
        return b"z" + OK


class Hub:
    """The bus. A frame reaches all adapters except that of its sender, and all functions passed to `listen`."""

    def __init__(self, host: str, port: int) -> None:
        self.wire = TcpWire("can", host, port, self._opened)
        self.adapters: set[Member] = set()
        self.frames: deque[dict[str, object]] = deque(maxlen=_FRAMES_KEPT)
        self._listeners: list[Receive] = []

    def listen(self, receive: Receive) -> None:
        """Call `receive` with every frame that an adapter sends."""
        self._listeners.append(receive)

    def transmit(self, identifier: int, data: bytes, sender: Member | None = None) -> None:
        """Send a frame; without a sender it comes from the drive."""
        if not _FIRST_PDO <= identifier < _FIRST_SDO:  # these states would displace all other entries
            self.frames.append(
                {"time": time.monotonic(), "id": identifier, "data": data.hex(), "from_host": sender is not None}
            )
        for adapter in tuple(self.adapters):
            if adapter is not sender:
                adapter.deliver(identifier, data)
        if sender is not None:
            for receive in self._listeners:
                receive(identifier, data)

    def _opened(self, connection: Connection) -> None:
        self.adapters.add(Adapter(self, connection))
