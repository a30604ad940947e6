"""A pymodbus server on the wires of the fakes: pymodbus answers the requests, the wires carry bytes and faults.

The pymodbus server does not listen: each connection of a wire is passed to one of its protocol objects. Silence, resets
and half frames therefore affect the bytes below Modbus, as on a real cable.
"""

import asyncio
from collections.abc import Callable
from pathlib import Path
from typing import Any

from pymodbus.server.base import ModbusBaseServer

from arcor2_fakes.serial_line import PtyLine
from arcor2_fakes.wire import Connection, TcpWire


def tcp_wire(server: ModbusBaseServer, host: str, port: int, name: str = "modbus") -> TcpWire:
    """Return a TCP port on which a server answers."""

    def opened(connection: Connection) -> None:
        protocol: Any = server.handle_new_connection()
        protocol.connection_made(_Transport(connection.send, connection.close))
        connection.received = protocol.data_received
        connection.closed = lambda: protocol.connection_lost(None)

    return TcpWire(name, host, port, opened)


def serial_line(server: ModbusBaseServer, link: Path | None = None, unit: int | None = None) -> PtyLine:
    """Return a pty on which a server answers; with `unit`, answers of other units are dropped."""
    protocol: Any = server.handle_new_connection()
    line = PtyLine(protocol.data_received, link)

    def send(data: bytes) -> None:
        if unit is None or data[0] == unit:
            line.send(data)

    protocol.connection_made(_Transport(send, lambda: None))
    return line


class _Transport(asyncio.Transport):
    """Transport of a pymodbus protocol object."""

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
