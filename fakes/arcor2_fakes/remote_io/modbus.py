"""The Modbus side: pymodbus answers the requests; a TCP port or a pty carries the bytes and their faults."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from pathlib import Path

from pymodbus import FramerType
from pymodbus.server import ModbusTcpServer

from arcor2_fakes.remote_io.registers import IDENTITY, RegisterMap
from arcor2_fakes.serial_line import PtyLine
from arcor2_fakes.wire import Connection, TcpWire


class TcpPort:
    """The block's Modbus TCP port. Must be made inside the event loop.

    The pymodbus server never listens itself: each connection of the wire gets one of its protocol objects.
    """

    def __init__(self, host: str, port: int, registers: RegisterMap) -> None:
        self._server = ModbusTcpServer(registers.device(), identity=IDENTITY)
        self.wire = TcpWire("modbus", host, port, self._opened)

    @property
    def address(self) -> str:
        """``host:port``."""
        return self.wire.address

    async def open(self) -> None:
        """Listen."""
        await self.wire.listen()

    def reset(self) -> None:
        """Reset every connection."""
        self.wire.reset()

    async def fault(self, kind: str, seconds: float = 1.0) -> None:
        """Apply one of the shared faults."""
        await self.wire.fault(kind, seconds)

    async def close(self) -> None:
        """Close everything."""
        self.wire.close()

    def _opened(self, connection: Connection) -> None:
        protocol = self._server.handle_new_connection()
        protocol.connection_made(_Onto(connection.send, connection.close))
        connection.received = protocol.data_received
        connection.closed = lambda: protocol.connection_lost(None)


class SerialPort:
    """The block's RTU line on a pty. Must be made inside the event loop."""

    def __init__(self, registers: RegisterMap, link: Path | None = None) -> None:
        server = ModbusTcpServer(registers.device(), framer=FramerType.RTU, identity=IDENTITY)
        self._protocol = server.handle_new_connection()
        self._line = PtyLine(self._protocol.data_received, link)
        self._protocol.connection_made(_Onto(self._line.send, lambda: None))

    @property
    def address(self) -> str:
        """The path that a host opens."""
        return self._line.port

    async def open(self) -> None:
        """Make the terminal and answer on it."""
        await self._line.plug()

    def reset(self) -> None:
        """Do nothing: a block that starts anew leaves the port of its host as it is."""

    async def fault(self, kind: str, seconds: float = 1.0) -> None:
        """Apply one of the shared faults."""
        await self._line.fault(kind, seconds)

    async def close(self) -> None:
        """Take the terminal away."""
        await self._line.unplug()
        self._protocol.connection_lost(None)


class _Onto(asyncio.Transport):
    """What pymodbus takes for its transport."""

    def __init__(self, send: Callable[[bytes], object], close: Callable[[], None]) -> None:
        super().__init__()
        self._send, self._close = send, close
        self._closing = False

    def write(self, data: bytes | bytearray | memoryview) -> None:
        self._send(bytes(data))

    def close(self) -> None:
        self._closing = True
        self._close()

    def is_closing(self) -> bool:
        return self._closing
