"""The Modbus side: pymodbus answers the requests; a TCP port or a pty carries the bytes and their faults."""

from __future__ import annotations

import asyncio
import os
import tty
from collections.abc import Callable

from pymodbus import FramerType
from pymodbus.server import ModbusTcpServer

from arcor2_fakes.remote_io.registers import IDENTITY, RegisterMap
from arcor2_fakes.wire import Connection, Faults, TcpWire


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

    def close(self) -> None:
        """Close everything."""
        self.wire.close()

    def _opened(self, connection: Connection) -> None:
        protocol = self._server.handle_new_connection()
        protocol.connection_made(_Onto(connection.send, connection.close))
        connection.received = protocol.data_received
        connection.closed = lambda: protocol.connection_lost(None)


class SerialPort:
    """The block's RTU line as a pty, whose path stays the same; reset and refuse do nothing to a serial line."""

    def __init__(self, registers: RegisterMap) -> None:
        self._server = ModbusTcpServer(registers.device(), framer=FramerType.RTU, identity=IDENTITY)
        self._faults = Faults()
        self._loop = asyncio.get_running_loop()
        self._ends: tuple[int, int] | None = None
        self.address = ""

    async def open(self) -> None:
        """Make the terminal and answer on it."""
        ours, hosts = os.openpty()
        self._ends = ours, hosts
        tty.setraw(hosts)
        os.set_blocking(ours, False)
        self.address = os.ttyname(hosts)
        self._protocol = self._server.handle_new_connection()
        self._protocol.connection_made(_Onto(self._send, lambda: None))
        self._loop.add_reader(ours, self._readable)

    def reset(self) -> None:
        """Do nothing: a serial line has no connection."""

    async def fault(self, kind: str, seconds: float = 1.0) -> None:
        """Apply one of the shared faults."""
        self._faults.set(kind, seconds)

    def close(self) -> None:
        """Take the terminal away."""
        if self._ends is not None:
            self._loop.remove_reader(self._ends[0])
            for end in self._ends:
                os.close(end)
            self._ends = None
            self._protocol.connection_lost(None)

    def _readable(self) -> None:
        assert self._ends is not None
        try:
            data = os.read(self._ends[0], 4096)
        except BlockingIOError:
            return
        if not self._faults.silent:
            self._protocol.data_received(data)

    def _send(self, frame: bytes) -> None:
        data = self._faults.outgoing(frame)
        if data:
            self._loop.call_later(self._faults.delay, self._write, data)

    def _write(self, data: bytes) -> None:
        if self._ends is not None:
            try:
                os.write(self._ends[0], data)
            except BlockingIOError:
                return  # nobody reads; what a serial line carries then is lost


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
