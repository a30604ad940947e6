"""The Modbus register map of the station."""

from __future__ import annotations

import struct

from pymodbus.constants import ExcCodes
from pymodbus.pdu import ExceptionResponse, ModbusPDU
from pymodbus.pdu.bit_message import ReadDiscreteInputsRequest
from pymodbus.pdu.device import ModbusDeviceIdentification
from pymodbus.simulator import DataType, SimData, SimDevice

from arcor2_fakes.functional_tester.station import Answer, Station

UNIT_ID = 1
IDENTITY = ModbusDeviceIdentification(  # type: ignore[no-untyped-call]
    info_name={
        "VendorName": "Fake Test Systems",
        "ProductCode": "FT-100",
        "MajorMinorRevision": "1.2",
        "ProductName": "Functional tester",
    }
)

_COMMAND, _COMMAND_SEQUENCE, _TEST_PROGRAM, _DOOR_COMMAND, _DOOR_SEQUENCE, _HOST_WATCHDOG = range(6)
_HOLDING = 6
_INPUTS = 17
_DISCRETE = 5

_READ_COILS, _READ_DISCRETE, _READ_HOLDING, _READ_INPUT, _WRITE_COIL, _WRITE_COILS = 1, 2, 3, 4, 5, 15
_COIL_FUNCTIONS = (_READ_COILS, _WRITE_COIL, _WRITE_COILS)
_DOOR_COMMANDS = {0: None, 1: True, 2: False}  # leave, open, close


class RegisterMap:
    """Maps the station to the registers of a simulated Modbus device."""

    def __init__(self, station: Station) -> None:
        self._station = station
        self.power_on()

    def power_on(self) -> None:
        """Reset to the state after power-on: nothing is written or acknowledged."""
        self._acknowledged = 0
        self._answer = Answer.ACCEPTED
        self.last_command: int | None = None
        self._written = False

    def device(self) -> SimDevice:
        """Return the device for the Modbus server."""
        return SimDevice(
            UNIT_ID,
            simdata=(
                # There are no coils. All addresses are defined nevertheless, so that every request reaches the action,
                # which answers it with "illegal function".
                [SimData(0, values=[False] * 65536, datatype=DataType.BITS)],
                [SimData(0, values=[False] * 16, datatype=DataType.BITS)],
                [SimData(0, values=self._initial_holding(), datatype=DataType.REGISTERS)],
                [SimData(0, values=[0] * _INPUTS, datatype=DataType.REGISTERS)],
            ),
            identity=IDENTITY,
            action=self._access,
        )

    def _initial_holding(self) -> list[int]:
        registers = [0] * _HOLDING
        registers[_TEST_PROGRAM] = self._station.test_program
        return registers

    async def _access(
        self,
        function_code: int,
        start_address: int,
        address: int,
        count: int,  # noqa: ARG002 - in 16-bit words even for bits; see CheckedReadDiscreteInputs
        registers: list[int],
        set_values: list[int] | list[bool] | None,
    ) -> ExcCodes | None:
        """Update the registers before a read, execute a write."""
        if function_code in _COIL_FUNCTIONS:
            return ExcCodes.ILLEGAL_FUNCTION
        self._station.advance()
        if function_code not in (_READ_INPUT, _READ_DISCRETE) and not self._written:
            self._written = True
            registers[:_HOLDING] = self._initial_holding()
        if function_code == _READ_INPUT:
            registers[:_INPUTS] = self._inputs()
        elif function_code == _READ_DISCRETE:
            registers[0] = sum(bit << place for place, bit in enumerate(self._discrete()))
        elif set_values is not None:
            written = registers[:_HOLDING]
            first = address - start_address
            written[first : first + len(set_values)] = [int(value) for value in set_values]
            return self._write(registers[:_HOLDING], written)
        return None

    def _write(self, before: list[int], after: list[int]) -> ExcCodes | None:
        if after[_DOOR_COMMAND] not in _DOOR_COMMANDS:
            return ExcCodes.ILLEGAL_VALUE
        self._station.test_program = after[_TEST_PROGRAM]
        self._station.watchdog_ms = after[_HOST_WATCHDOG]
        if after[_COMMAND_SEQUENCE] != before[_COMMAND_SEQUENCE]:
            self.last_command = after[_COMMAND]
            self._answer = self._station.command(after[_COMMAND])
            self._acknowledged = after[_COMMAND_SEQUENCE]
        if after[_DOOR_SEQUENCE] != before[_DOOR_SEQUENCE]:
            opening = _DOOR_COMMANDS[after[_DOOR_COMMAND]]
            if opening is not None:
                self._station.move_door(opening=opening)
        return None

    def _inputs(self) -> list[int]:
        station = self._station
        last = station.results[-1] if station.results else None
        passed = sum(result.result == "pass" for result in station.results)
        tested = len(station.results)
        words = [
            station.state,
            self._acknowledged,
            self._answer,
            station.fault,
            0 if last is None else 1 if last.result == "pass" else 2,
            tested,
            *_float(station.measured.supply_voltage),
            *_float(station.measured.supply_current),
            *_float(station.measured.contact_resistance),
            tested,
            passed,
            tested - passed,
            station.life,
            station.mode,
        ]
        return [word & 0xFFFF for word in words]

    def _discrete(self) -> tuple[bool, ...]:
        station = self._station
        return (
            station.door_open,
            station.door_closed,
            station.board_present,
            station.clamped,
            station.emergency_stop_pressed,
        )


def _float(value: float) -> tuple[int, int]:
    """Return a 32-bit float as two registers, high word first."""
    high, low = struct.unpack(">HH", struct.pack(">f", value))
    return high, low


class CheckedReadDiscreteInputs(ReadDiscreteInputsRequest):
    """A read of discrete inputs that rejects addresses beyond the last one, unlike pymodbus, which rounds up to 16."""

    async def datastore_update(self, context: object, device_id: int) -> ModbusPDU:
        """Answer the request."""
        if self.address + self.count > _DISCRETE:
            return ExceptionResponse(self.function_code, ExcCodes.ILLEGAL_ADDRESS)
        return await super().datastore_update(context, device_id)  # type: ignore[arg-type]
