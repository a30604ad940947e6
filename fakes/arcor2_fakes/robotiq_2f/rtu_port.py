"""Modbus RTU registers of the gripper."""

from __future__ import annotations

from collections import deque

from arcor2_fakes.modbus import ExceptionCode, ModbusRefusal, ModbusTables
from arcor2_fakes.robotiq_2f.gripper import Gripper

_REQUESTS, _STATUS, _COUNT = 0x03E8, 0x07D0, 3


class RtuRegisters(ModbusTables):
    """Three registers that are written and three of status; functions 3 and 4 read both."""

    unit = 9
    functions = (3, 4, 6, 16, 23)
    holding_registers = input_registers = _STATUS + _COUNT

    def __init__(self, gripper: Gripper) -> None:
        self._gripper = gripper
        self._requests = [0] * _COUNT
        self.writes: deque[list[int]] = deque(maxlen=50)

    def read_registers(self, function: int, address: int, count: int) -> list[int]:  # noqa: ARG002 - both are the same
        """Return requests or status."""
        if address >= _STATUS:
            return self._status()[address - _STATUS :][:count]
        first = self._place(address, count)
        return self._requests[first : first + count]

    def write_holding_registers(self, address: int, values: list[int]) -> None:
        """Execute a request."""
        first = self._place(address, len(values))
        self._requests[first : first + len(values)] = values
        self.writes.append(list(self._requests))
        action, position, speed_and_force = self._requests
        self._gripper.request(
            {
                "ACT": action >> 8 & 1,
                "GTO": action >> 11 & 1,
                "POS": position & 0xFF,
                "SPE": speed_and_force >> 8,
                "FOR": speed_and_force & 0xFF,
            }
        )

    @staticmethod
    def _place(address: int, count: int) -> int:
        """Return the position of the first of some requests."""
        if not _REQUESTS <= address <= address + count <= _REQUESTS + _COUNT:
            raise ModbusRefusal(ExceptionCode.ILLEGAL_ADDRESS)
        return address - _REQUESTS

    def _status(self) -> list[int]:
        now = self._gripper.registers()
        status = now["ACT"] | now["GTO"] << 3 | now["STA"] << 4 | now["OBJ"] << 6
        return [status << 8, now["FLT"] << 8 | now["PRE"], now["POS"] << 8 | now["COU"]]
