"""TCP ports of devices with fault injection: silence, reset, half a frame, garbage, slow and refuse."""

import asyncio
import contextlib
import os
import socket
import struct
from collections import deque
from collections.abc import Callable, Container
from typing import Any, Protocol, cast

from arcor2_fakes.control import ControlServer

FAULTS = ("silence", "reset", "half_frame", "garbage", "slow", "refuse", "heal")
CHECKSUM = "wrong_checksum"
_TEXTS = {
    "silence": "carry nothing in either direction",
    "reset": "break every connection",
    "half_frame": "send half of the next frame and then nothing",
    "garbage": "send random bytes in place of frames",
    "slow": "send everything so many seconds late",
    "refuse": "accept no new connection",
    "heal": "work again",
    CHECKSUM: "send frames whose checksum is wrong",
}
_RESET_ON_CLOSE = struct.pack("ii", 1, 0)  # struct linger: on, 0 s: closing sends RST
_TIMER_GRAIN = 0.001  # s, of the event loop
_MAX_UNSENT = 1 << 20  # bytes; further frames to a client that does not read are dropped, as by a real device


class Faults:
    """Injected faults of a wire, applied to the frames it sends, for any transport: TCP, pty, CAN hub."""

    def __init__(self) -> None:
        self.silent = False
        self.half_next = False
        self.garbage = False
        self.wrong_checksum = False
        self.delay = 0.0

    def outgoing(self, frame: bytes) -> bytes:
        """Return the bytes to send in place of a frame, possibly none. The caller applies `delay`."""
        if self.silent:
            return b""
        if self.half_next:
            self.half_next, self.silent = False, True
            return frame[: max(1, len(frame) // 2)]
        if self.garbage:
            return os.urandom(len(frame))
        if self.wrong_checksum:
            return frame[:-1] + bytes([frame[-1] ^ 0x01])
        return frame

    def set(self, fault: str, seconds: float = 1.0) -> None:
        """Apply one of `FAULTS`; the transport implements reset and refuse."""
        if fault not in (*FAULTS, CHECKSUM):
            raise ValueError(f"fault {fault!r} does not exist; available: {', '.join(FAULTS)}")
        if fault == "silence":
            self.silent = True
        elif fault == "half_frame":
            self.half_next = True
        elif fault == "garbage":
            self.garbage = True
        elif fault == CHECKSUM:
            self.wrong_checksum = True
        elif fault == "slow":
            if not 0.0 <= seconds <= 600.0:
                raise ValueError("seconds must be 0 to 600")
            self.delay = seconds
        elif fault == "heal":
            self.silent = self.half_next = self.garbage = self.wrong_checksum = False
            self.delay = 0.0


class Faulty(Protocol):
    """A wire with fault injection: a TCP port, a pty, a CAN hub."""

    async def fault(self, kind: str, seconds: float = 1.0) -> None:
        """Apply one of `FAULTS`."""
        ...


def register_faults(control: ControlServer, wires: dict[str, Faulty], checked: Container[str] = ()) -> None:
    """Register each fault as a command: ``{"do": "slow", "wire": "rtde", "seconds": 2}``; without a wire for all.

    `checked` names the wires whose frames end in a checksum, for the fault `wrong_checksum`.
    """

    async def apply(kind: str, among: dict[str, Faulty], wire: str | None, seconds: float) -> None:
        if wire is not None and wire not in among:
            raise ValueError(f"wire {wire!r} does not exist; available: {', '.join(among)}")
        for name, faulty in among.items():
            if wire in (None, name):
                await faulty.fault(kind, seconds)

    def command(kind: str, among: dict[str, Faulty]) -> Callable[..., Any]:
        def fault(wire: str | None = None, seconds: float = 1.0) -> Any:
            return apply(kind, among, wire, seconds)

        fault.__doc__ = f"Let the wire {_TEXTS[kind]}."
        return fault

    for kind in FAULTS:
        control.command(kind, command(kind, wires))
    with_checksum = {name: wire for name, wire in wires.items() if name in checked}
    if with_checksum:
        control.command(CHECKSUM, command(CHECKSUM, with_checksum))


class Connection(asyncio.Protocol):
    """A client of a `TcpWire`. The device sets `received` and `closed` in `opened`, and sends complete frames."""

    def __init__(self, wire: "TcpWire") -> None:
        self.wire = wire
        self.received: Callable[[bytes], None] = lambda _: None
        self.closed: Callable[[], None] = lambda: None
        self.alive = False
        self._torn = False  # half a frame was sent, so that no further frame can be decoded
        self._late: deque[tuple[float, bytes]] = deque()  # (time to send, frame), in order
        self._transport: asyncio.Transport

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Handle the event of the loop."""
        self._transport = cast("asyncio.Transport", transport)
        self.alive = True
        self.wire.connections.add(self)
        self.wire.opened(self)

    def data_received(self, data: bytes) -> None:
        """Handle the event of the loop; a silent wire carries nothing in either direction."""
        if not self.wire.faults.silent:
            self.received(data)

    def connection_lost(self, _exc: Exception | None) -> None:
        """Handle the event of the loop."""
        self.alive = False
        self.wire.connections.discard(self)
        self.closed()

    def send(self, frame: bytes) -> bool:
        """Send a frame, subject to the faults of the wire. Return whether it was sent."""
        faults = self.wire.faults
        if not self.alive or self._torn or self.congested:
            return False
        data = faults.outgoing(frame)
        if len(data) < len(frame):
            self._torn = bool(data)
            if data:
                self._transport.write(data)
            return False
        if faults.delay > 0.0 or self._late:
            loop = asyncio.get_running_loop()
            self._late.append((loop.time() + faults.delay, data))
            if len(self._late) == 1:
                loop.call_later(faults.delay, self._send_late)
        else:
            self._transport.write(data)
        return True

    @property
    def congested(self) -> bool:
        """Return whether the client does not read, so that frames are dropped."""
        return self._transport.get_write_buffer_size() > _MAX_UNSENT

    def close(self) -> None:
        """Close after everything has been sent."""
        if self.alive:
            self._transport.close()

    def reset(self) -> None:
        """Send RST."""
        if self.alive:
            raw: socket.socket = self._transport.get_extra_info("socket")
            with contextlib.suppress(OSError):
                raw.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, _RESET_ON_CLOSE)
            self._transport.abort()

    def heal(self) -> None:
        """Send delayed frames; reset a connection on which half a frame was sent."""
        if self._torn:
            self.reset()
        elif self.alive:
            for _, data in self._late:
                self._transport.write(data)
        self._late.clear()

    def _send_late(self) -> None:
        loop = asyncio.get_running_loop()
        if not self.alive or self._torn or self.wire.faults.silent:
            self._late.clear()
        while self._late and self._late[0][0] <= loop.time() + _TIMER_GRAIN:
            self._transport.write(self._late.popleft()[1])
        if self._late:
            loop.call_at(self._late[0][0], self._send_late)


class TcpWire:
    """A TCP port of a device. `opened` is called with each new `Connection`."""

    def __init__(self, name: str, host: str, port: int, opened: Callable[[Connection], object]) -> None:
        self.name = name
        self.faults = Faults()
        self.connections: set[Connection] = set()
        self.opened = opened
        self._host, self._port = host, port
        self._server: asyncio.Server | None = None

    @property
    def address(self) -> str:
        """Return ``host:port``; after `listen` the real port."""
        return f"{self._host}:{self._port}"

    async def listen(self) -> str:
        """Open the port and return the address. Raise `OSError` if it is in use."""
        if self._server is None:
            loop = asyncio.get_running_loop()
            self._server = await loop.create_server(lambda: Connection(self), self._host, self._port)
            self._port = self._server.sockets[0].getsockname()[1]
        return self.address

    def refuse(self) -> None:
        """Stop listening; connections stay open."""
        if self._server is not None:
            self._server.close()
            self._server = None

    def reset(self) -> None:
        """Reset every connection."""
        for connection in tuple(self.connections):
            connection.reset()

    async def fault(self, kind: str, seconds: float = 1.0) -> None:
        """Apply one of `FAULTS`."""
        self.faults.set(kind, seconds)
        if kind == "reset":
            self.reset()
        elif kind == "refuse":
            self.refuse()
        elif kind == "heal":
            for connection in tuple(self.connections):
                connection.heal()
            await self.listen()

    def close(self) -> None:
        """Close the port and every connection."""
        self.refuse()
        for connection in tuple(self.connections):
            connection.close()
