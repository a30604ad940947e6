"""ModbusSettings: the settings of a device on Modbus TCP or RTU, for drivers to derive from."""

import dataclasses
from typing import Annotated

from arcor2_hw.actions import StrEnum
from arcor2_hw.exceptions import OutOfRange
from arcor2_hw.objects.settings import Range, Settings, check_host, check_serial_port, within


class Parity(StrEnum):
    """Parity bit of a serial port."""

    NONE = "none"
    EVEN = "even"
    ODD = "odd"


@dataclasses.dataclass
class ModbusSettings(Settings):
    """Address of a device on Modbus TCP, or on a serial line with Modbus RTU (8 data bits).

    :param host: address or name of the device on Modbus TCP; empty for a serial line
    :param port: port of its Modbus TCP server
    :param serial_port: serial port of a device on Modbus RTU; empty for TCP
    :param baudrate: bits per second on the serial line
    :param parity: parity bit on the serial line
    :param stopbits: number of stop bits on the serial line
    :param unit_id: Modbus unit id
    :param request_timeout: time the device has to answer one request, s
    """

    host: str = dataclasses.field(default="", metadata={"found_by": "modbus"})
    port: int = 502
    serial_port: str = dataclasses.field(default="", metadata={"found_by": "serial"})
    baudrate: Annotated[int, Range(300, 921600)] = 19200
    parity: Parity = Parity.NONE
    stopbits: Annotated[int, Range(1, 2)] = 1
    unit_id: int = 1
    request_timeout: Annotated[float, Range(0.05, 5.0, "s")] = 0.25

    def __post_init__(self) -> None:
        super().__post_init__()
        self.serial_port = self.serial_port.strip()
        if bool(self.host.strip()) == bool(self.serial_port):
            raise OutOfRange("host must be the address of the device, or serial_port its serial port; set one of them")
        if self.serial_port:
            check_serial_port("serial_port", self.serial_port)
        else:
            check_host(self.host, self.port)
        within("unit_id", self.unit_id, 1 if self.serial_port else 0, 247 if self.serial_port else 255)
