"""The Modbus TCP side: pymodbus answers the requests, the shared wire carries the bytes and their faults."""

from __future__ import annotations

import asyncio
import time
from collections import deque

from pymodbus.pdu import ModbusPDU
from pymodbus.server import ModbusTcpServer

from arcor2_fakes.functional_tester.registers import IDENTITY, CheckedReadDiscreteInputs, RegisterMap
from arcor2_fakes.functional_tester.station import Station
from arcor2_fakes.wire import Connection, TcpWire

_FRAMES_KEPT = 20


class ModbusPort:
    """The station's Modbus TCP port. Must be made inside the event loop.

    The pymodbus server never listens itself: each connection of the wire gets one of its protocol objects, as if the
    server had accepted it. So silence, resets and half frames happen below Modbus, where they happen in life.
    """

    def __init__(self, host: str, port: int, station: Station, registers: RegisterMap) -> None:
        self._station = station
        self.frames: deque[dict[str, object]] = deque(maxlen=_FRAMES_KEPT)
        self._server = ModbusTcpServer(
            registers.device(),
            identity=IDENTITY,
            custom_pdu=[CheckedReadDiscreteInputs],
            trace_packet=self._trace_packet,
            trace_pdu=self._trace_pdu,
        )
        self.wire = TcpWire("modbus", host, port, self._opened)

    def _opened(self, connection: Connection) -> None:
        protocol = self._server.handle_new_connection()
        protocol.connection_made(_OntoWire(connection))
        connection.received = protocol.data_received
        connection.closed = lambda: protocol.connection_lost(None)

    def _trace_packet(self, sending: bool, data: bytes) -> bytes:
        self.frames.append({"time": time.time(), "to_host": sending, "hex": data.hex()})
        return data

    def _trace_pdu(self, sending: bool, pdu: ModbusPDU) -> ModbusPDU:
        if not sending:
            self._station.request_arrived()
        return pdu


class _OntoWire(asyncio.Transport):
    """What pymodbus takes for its transport."""

    def __init__(self, connection: Connection) -> None:
        super().__init__()
        self._connection = connection

    def write(self, data: bytes | bytearray | memoryview) -> None:
        self._connection.send(bytes(data))

    def close(self) -> None:
        self._connection.close()

    def is_closing(self) -> bool:
        return not self._connection.alive
