"""The Modbus register map of the station."""

from __future__ import annotations

import struct

from arcor2_fakes.functional_tester.station import Answer, Station
from arcor2_fakes.modbus import ExceptionCode, ModbusRefusal, ModbusTables

_COMMAND, _COMMAND_SEQUENCE, _TEST_PROGRAM, _DOOR_COMMAND, _DOOR_SEQUENCE, _HOST_WATCHDOG = range(6)
_DOOR_COMMANDS = {0: None, 1: True, 2: False}  # leave, open, close


class RegisterMap(ModbusTables):
    """Maps the station to the tables of a Modbus device."""

    identity = ("Fake Test Systems", "FT-100", "1.2", "Functional tester")
    discrete_inputs, holding_registers, input_registers = 5, 6, 17

    def __init__(self, station: Station) -> None:
        self._station = station
        self.power_on()

    def power_on(self) -> None:
        """Reset to the state after power-on: nothing is written or acknowledged."""
        self._acknowledged = 0
        self._answer = Answer.ACCEPTED
        self.last_command: int | None = None
        self._holding = [0] * self.holding_registers
        self._holding[_TEST_PROGRAM] = self._station.test_program

    def request_arrived(self) -> None:
        """Apply the changes that are due, and reset the host watchdog."""
        self._station.request_arrived()

    def read_holding_register(self, address: int) -> int:
        """Return what the host wrote."""
        return self._holding[address]

    def write_holding_registers(self, address: int, values: list[int]) -> None:
        """Execute all writes of a request, or none."""
        before, after = self._holding, list(self._holding)
        after[address : address + len(values)] = values
        if after[_DOOR_COMMAND] not in _DOOR_COMMANDS:
            raise ModbusRefusal(ExceptionCode.ILLEGAL_VALUE)
        self._holding = after
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

    def read_input_registers(self) -> list[int]:
        """Return state, results and measured values."""
        station, measured = self._station, self._station.measured
        tested, passed = len(station.results), station.passed
        result = (1 if station.results[-1].result == "pass" else 2) if station.results else 0
        return [
            *(station.state, self._acknowledged, self._answer, station.fault, result, tested),
            *_float(measured.supply_voltage),
            *_float(measured.supply_current),
            *_float(measured.contact_resistance),
            *(tested, passed, tested - passed, station.life, station.mode),
        ]

    def read_discrete_inputs(self) -> tuple[bool, ...]:
        """Return the inputs."""
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
