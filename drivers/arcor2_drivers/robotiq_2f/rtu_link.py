"""RtuLink: the gripper on Modbus RTU. Registers: docs/devices/robotiq-2f.md."""

from typing import Final

from arcor2_hw.messages import Message
from arcor2_hw.objects.modbus_link import ModbusLink

from .status import Activation, Command, Object, Status

REQUESTS: Final = 0x03E8
STATUS: Final = 0x07D0
COUNT: Final = 3


def decode(registers: list[int]) -> Status:
    """Return the status in its three registers. Raise ValueError if they are invalid."""
    if len(registers) != COUNT:
        raise ValueError(f"{len(registers)} registers instead of {COUNT}")
    status = registers[0] >> 8
    return Status(
        act=bool(status & 1),
        go_to=bool(status >> 3 & 1),
        activation=Activation(status >> 4 & 3),
        object=Object(status >> 6 & 3),
        fault=registers[1] >> 8 & 0x0F,
        echo=registers[1] & 0xFF,
        position=registers[2] >> 8,
    )


def encode(command: Command, before: list[int]) -> list[int]:
    """Return the three request registers; a value that is None in the command stays as in `before`."""
    position = before[1] & 0xFF if command.position is None else command.position
    speed = before[2] >> 8 if command.speed is None else command.speed
    force = before[2] & 0xFF if command.force is None else command.force
    return [(int(command.act) | int(command.go_to) << 3) << 8, position, speed << 8 | force]


class RtuLink(ModbusLink):
    """A gripper on a serial port."""

    def __init__(self, name: str, port: str, baud_rate: int, unit_id: int, request_timeout: float) -> None:
        super().__init__(name, unit_id=unit_id, request_timeout=request_timeout, serial_port=port, baudrate=baud_rate)
        self.who: str | Message = Message.of("{device} at {port} unit {unit}", device=name, port=port, unit=unit_id)
        self._requests = [0] * COUNT

    def read(self) -> Status:
        """Read the status. Raise DeviceTimeout, ConnectionLost, DeviceFault, or ValueError for an invalid status."""
        return decode(self.read_holding_registers(STATUS, COUNT))

    def write(self, command: Command) -> None:
        """Write all request registers; never repeated."""
        values = encode(command, self._requests)
        self.write_registers(REQUESTS, *values)
        self._requests = values
