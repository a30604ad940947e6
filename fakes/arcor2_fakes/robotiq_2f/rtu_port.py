"""Modbus RTU port of the gripper."""

from __future__ import annotations

from collections import deque
from pathlib import Path
from typing import Final

from pymodbus.constants import ExcCodes
from pymodbus.framer import FramerType
from pymodbus.server import ModbusSerialServer
from pymodbus.simulator import DataType, SimData, SimDevice

from arcor2_fakes.modbus import serial_line
from arcor2_fakes.robotiq_2f.gripper import Gripper

UNIT: Final = 9
_REQUESTS, _STATUS, _COUNT = 0x03E8, 0x07D0, 3


class RtuPort:
    """Serial port of the gripper. Create it in the event loop."""

    def __init__(self, gripper: Gripper, link: Path | None = None) -> None:
        self._gripper = gripper
        self.writes: deque[list[int]] = deque(maxlen=50)
        device = SimDevice(
            UNIT,
            simdata=[SimData(_REQUESTS, values=[0] * (_STATUS - _REQUESTS + _COUNT), datatype=DataType.REGISTERS)],
            action=self._access,
        )
        server = ModbusSerialServer(device, framer=FramerType.RTU, ignore_missing_devices=True)
        self.line = serial_line(server, link, UNIT)  # the library answers for other units too

    async def _access(
        self,
        _function_code: int,
        start_address: int,
        address: int,
        count: int,
        registers: list[int],
        set_values: list[int] | list[bool] | None,
    ) -> ExcCodes | None:
        first = _STATUS if address >= _STATUS else _REQUESTS
        if not first <= address <= address + count <= first + _COUNT:
            return ExcCodes.ILLEGAL_ADDRESS
        if set_values is None:
            begin = _STATUS - start_address
            registers[begin : begin + _COUNT] = self._status()
            return None
        if first == _STATUS:
            return ExcCodes.ILLEGAL_ADDRESS
        begin = _REQUESTS - start_address
        requests = registers[begin : begin + _COUNT]
        requests[address - first : address - first + len(set_values)] = [int(value) for value in set_values]
        self.writes.append(requests)
        action = requests[0] >> 8
        self._gripper.request(
            {
                "ACT": action & 1,
                "GTO": action >> 3 & 1,
                "POS": requests[1] & 0xFF,
                "SPE": requests[2] >> 8,
                "FOR": requests[2] & 0xFF,
            }
        )
        return None

    def _status(self) -> list[int]:
        now = self._gripper.registers()
        status = now["ACT"] | now["GTO"] << 3 | now["STA"] << 4 | now["OBJ"] << 6
        return [status << 8, now["FLT"] << 8 | now["PRE"], now["POS"] << 8 | now["COU"]]
