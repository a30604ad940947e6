"""Settings of a Robotiq 2F gripper, checked when they are given."""

import dataclasses
import math

from arcor2_hw.actions import StrEnum
from arcor2_hw.exceptions import OutOfRange
from arcor2_hw.objects import Settings


class Wire(StrEnum):
    """How the gripper is reached."""

    URCAP = "urcap"
    MODBUS_RTU = "modbus_rtu"


def within(name: str, value: float, low: float, high: float, unit: str = "") -> None:
    """Raise OutOfRange, naming the parameter, unless the value lies in the range."""
    if not (math.isfinite(value) and low <= value <= high):
        raise OutOfRange(f"{name} must be {low:g} to {high:g}{unit and ' ' + unit}, not {value!r}")


@dataclasses.dataclass
class Robotiq2FSettings(Settings):
    """Where the gripper is, and the limits of its model; as delivered those of a 2F-85.

    :param wire: urcap for the ASCII port of the URCap on a robot, modbus_rtu for a serial port
    :param host: address of the robot controller whose URCap has the gripper; for urcap
    :param port: TCP port of the URCap
    :param serial_port: path of the serial port, such as /dev/ttyUSB0; for modbus_rtu
    :param baud_rate: bits per second of the serial port
    :param unit_id: Modbus unit id
    :param request_timeout: seconds the gripper has to answer one request
    :param activation_timeout: seconds an activation may take
    :param stroke: width between the open fingers, m
    :param open_position: the gripper's own position when open, 0 to 255
    :param closed_position: the gripper's own position when closed, 0 to 255
    :param min_force: force for the value 0, N
    :param max_force: force for the value 255, N
    :param min_speed: speed for the value 0, m/s
    :param max_speed: speed for the value 255, m/s
    """

    wire: Wire = Wire.URCAP
    host: str = ""
    port: int = 63352
    serial_port: str = ""
    baud_rate: int = 115200
    unit_id: int = 9
    request_timeout: float = 0.5
    activation_timeout: float = 10.0
    stroke: float = 0.085
    open_position: int = 3
    closed_position: int = 230
    min_force: float = 20.0
    max_force: float = 235.0
    min_speed: float = 0.020
    max_speed: float = 0.150

    def __post_init__(self) -> None:
        if self.wire is Wire.URCAP and not self.host.strip():
            raise OutOfRange("host must be the address of the robot controller, as wire is urcap")
        if self.wire is Wire.MODBUS_RTU and not self.serial_port.strip():
            raise OutOfRange("serial_port must be the path of a serial port, as wire is modbus_rtu")
        within("port", self.port, 1, 65535)
        within("baud_rate", self.baud_rate, 9600, 115200)
        within("unit_id", self.unit_id, 1, 247)
        within("request_timeout", self.request_timeout, 0.05, 5.0, "s")
        within("activation_timeout", self.activation_timeout, 1.0, 60.0, "s")
        within("stroke", self.stroke, 0.01, 0.2, "m")
        within("open_position", self.open_position, 0, 254)
        within("closed_position", self.closed_position, self.open_position + 1, 255)
        within("min_force", self.min_force, 0.0, 500.0, "N")
        within("max_force", self.max_force, self.min_force + 1.0, 500.0, "N")
        within("min_speed", self.min_speed, 0.001, 0.5, "m/s")
        within("max_speed", self.max_speed, self.min_speed + 0.001, 0.5, "m/s")
