"""A Modbus TCP server with one block of input registers and one of holding registers.

Written from MODBUS Application Protocol V1.1b3 and MODBUS Messaging on TCP/IP Implementation Guide V1.0b. It has the
functions 3, 4, 6 and 16 and answers any unit id.
"""

import asyncio
import contextlib
import enum
import socket
import struct
from collections.abc import Sequence
from typing import Final, Protocol

import structlog

log = structlog.get_logger(__name__)

MAX_CONNECTIONS: Final = 8
"""Maximum number of connections. A further one replaces the one that was idle longest."""
_HEADER: Final = struct.Struct(">HHHB")
"""Transaction, protocol, number of following bytes, unit id."""
_MAX_PDU: Final = 253
_MAX_READ, _MAX_WRITTEN = 125, 123


class ExceptionCode(enum.IntEnum):
    """Code of an exception response."""

    ILLEGAL_FUNCTION = 1
    ILLEGAL_ADDRESS = 2
    ILLEGAL_VALUE = 3
    BUSY = 6


class ModbusRefusal(Exception):
    """The request is answered with an exception."""

    def __init__(self, code: ExceptionCode) -> None:
        super().__init__(code.name)
        self.code = code


class Registers(Protocol):
    """The registers of the block. Methods may raise ModbusRefusal."""

    def inputs(self) -> Sequence[int]:
        """Return all input registers."""

    def holding(self) -> Sequence[int]:
        """Return all holding registers."""

    def write(self, address: int, values: Sequence[int], peer: str) -> None:
        """Write holding registers that exist, for the client at an address."""


def answer(request: bytes, registers: Registers, peer: str) -> bytes:
    """Return the answer to a request (PDU); refusals are answered with an exception.

    Args:
        request: function code and data, at least one byte.
        registers: the block.
        peer: address of the client.
    """
    function = request[0]
    try:
        return _execute(function, request[1:], registers, peer)
    except ModbusRefusal as refusal:
        return bytes((function | 0x80, refusal.code))


def _execute(function: int, data: bytes, registers: Registers, peer: str) -> bytes:
    if function not in (3, 4, 6, 16):
        raise ModbusRefusal(ExceptionCode.ILLEGAL_FUNCTION)
    if len(data) < 4:
        raise ModbusRefusal(ExceptionCode.ILLEGAL_VALUE)
    address, count = struct.unpack_from(">HH", data)
    if function in (3, 4):
        if len(data) != 4 or not 1 <= count <= _MAX_READ:
            raise ModbusRefusal(ExceptionCode.ILLEGAL_VALUE)
        values = registers.holding() if function == 3 else registers.inputs()
        _require_within(address, count, len(values))
        return struct.pack(f">BB{count}H", function, 2 * count, *values[address : address + count])
    if function == 6:
        if len(data) != 4:
            raise ModbusRefusal(ExceptionCode.ILLEGAL_VALUE)
        written: Sequence[int] = (count,)
    else:
        if not 1 <= count <= _MAX_WRITTEN or len(data) != 5 + 2 * count or data[4] != 2 * count:
            raise ModbusRefusal(ExceptionCode.ILLEGAL_VALUE)
        written = struct.unpack_from(f">{count}H", data, 5)
    _require_within(address, len(written), len(registers.holding()))
    registers.write(address, written, peer)
    return bytes((function,)) + data[:4]


def _require_within(address: int, count: int, size: int) -> None:
    if address + count > size:
        raise ModbusRefusal(ExceptionCode.ILLEGAL_ADDRESS)


class ModbusServer:
    """Serves the registers on a bound socket."""

    def __init__(self, registers: Registers) -> None:
        self._registers = registers
        self._server: asyncio.Server | None = None
        self._connections: dict[asyncio.StreamWriter, float] = {}
        """The connections, with the time of the last request of each."""

    async def serve(self, listener: socket.socket) -> None:
        """Start to serve clients."""
        self._server = await asyncio.start_server(self._serve_client, sock=listener, limit=4096)

    async def close(self) -> None:
        """End all connections."""
        if self._server is not None:
            self._server.close()
            for writer in tuple(self._connections):
                writer.close()
            await self._server.wait_closed()

    async def _serve_client(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        clock = asyncio.get_running_loop().time
        while len(self._connections) >= MAX_CONNECTIONS:
            idle = min(self._connections, key=lambda each: self._connections[each])
            del self._connections[idle]
            idle.close()
        self._connections[writer] = clock()
        peer = str(writer.get_extra_info("peername")[0])
        log.info("Modbus client connected", address=peer)
        try:
            while writer in self._connections:
                transaction, protocol, length, unit = _HEADER.unpack(await reader.readexactly(_HEADER.size))
                if protocol or not 2 <= length <= 1 + _MAX_PDU:
                    break  # the boundaries of the following requests are unknown
                request = await reader.readexactly(length - 1)
                self._connections[writer] = clock()
                reply = answer(request, self._registers, peer)
                writer.write(_HEADER.pack(transaction, 0, len(reply) + 1, unit) + reply)
                await writer.drain()
        except (OSError, asyncio.IncompleteReadError):
            pass  # the client has disconnected
        finally:
            self._connections.pop(writer, None)
            writer.close()
            with contextlib.suppress(OSError):
                await writer.wait_closed()
            log.info("Modbus client disconnected", address=peer)
