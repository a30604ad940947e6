"""The Modbus TCP port of the station."""

from __future__ import annotations

import time
from collections import deque

from pymodbus.pdu import ModbusPDU
from pymodbus.server import ModbusTcpServer

from arcor2_fakes.functional_tester.registers import IDENTITY, CheckedReadDiscreteInputs, RegisterMap
from arcor2_fakes.functional_tester.station import Station
from arcor2_fakes.modbus import tcp_wire

_STORED_FRAMES = 20


class ModbusPort:
    """The Modbus TCP port of the station. Create it inside the event loop."""

    def __init__(self, host: str, port: int, station: Station, registers: RegisterMap) -> None:
        self._station = station
        self.frames: deque[dict[str, object]] = deque(maxlen=_STORED_FRAMES)
        self._server = ModbusTcpServer(
            registers.device(),
            identity=IDENTITY,
            custom_pdu=[CheckedReadDiscreteInputs],
            trace_packet=self._trace_packet,
            trace_pdu=self._trace_pdu,
        )
        self.wire = tcp_wire(self._server, host, port)

    def _trace_packet(self, sending: bool, data: bytes) -> bytes:
        self.frames.append({"time": time.time(), "to_host": sending, "hex": data.hex()})
        return data

    def _trace_pdu(self, sending: bool, pdu: ModbusPDU) -> ModbusPDU:
        if not sending:
            self._station.request_arrived()
        return pdu
