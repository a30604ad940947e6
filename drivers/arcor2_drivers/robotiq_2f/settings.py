"""Settings of a Robotiq 2F gripper."""

import dataclasses
from typing import Annotated, Final

from arcor2_hw.actions import StrEnum
from arcor2_hw.exceptions import OutOfRange
from arcor2_hw.objects import Settings
from arcor2_hw.objects.gripping import check_part_size
from arcor2_hw.objects.settings import Range, check_host, check_serial_port, within


class Wire(StrEnum):
    """Wire to the gripper."""

    URCAP = "urcap"
    MODBUS_RTU = "modbus_rtu"


class Model(StrEnum):
    """Model of the gripper."""

    TWO_F_85 = "2F-85"
    TWO_F_140 = "2F-140"


@dataclasses.dataclass(frozen=True)
class ModelData:
    """Data sheet of a model, in m, kg, N and m/s. A tcp_z of 0 is unknown."""

    tcp_z: float
    mass: float
    stroke: float
    min_force: float
    max_force: float
    min_speed: float
    max_speed: float


MODELS: Final = {
    Model.TWO_F_85: ModelData(0.163, 0.925, 0.085, 20.0, 235.0, 0.020, 0.150),
    Model.TWO_F_140: ModelData(0.0, 1.025, 0.140, 10.0, 125.0, 0.030, 0.250),
}


@dataclasses.dataclass
class Robotiq2FSettings(Settings):
    """Connection and limits of the gripper. The value 0 stands for the value of the model.

    :param model: model of the gripper
    :param wire: urcap for the ASCII port of the URCap, modbus_rtu for a serial port
    :param host: address of the robot controller with the URCap; for urcap
    :param port: TCP port of the URCap
    :param serial_port: path of the serial port, such as /dev/ttyUSB0; for modbus_rtu
    :param baud_rate: bit rate of the serial port, bit/s
    :param unit_id: Modbus unit id
    :param request_timeout: time limit of an answer, s
    :param activation_timeout: time limit of the activation, s
    :param tcp_z: from the flange to the tool centre point of the closed fingers, m; required for a 2F-140
    :param mass: mass with fingers, kg
    :param stroke: width between the open fingers, m
    :param open_position: position of the open fingers, 0 to 255
    :param closed_position: position of the closed fingers, 0 to 255
    :param min_force: force for the value 0, N
    :param max_force: force for the value 255, N
    :param min_speed: speed for the value 0, m/s
    :param max_speed: speed for the value 255, m/s
    :param robot: name of the robot that carries the gripper; empty: the only robot of the scene
    :param part_size_x: size of a gripped part along the x axis of the tool, m; 0: unknown, its width is used
    :param part_size_y: size of a gripped part along the y axis of the tool, m
    :param part_size_z: size of a gripped part along the z axis of the tool, m
    :param part_offset_z: shift of a gripped part from the tool center point along the tool, m
    """

    model: Model = Model.TWO_F_85
    wire: Wire = Wire.URCAP
    host: str = ""
    port: int = 63352
    serial_port: str = dataclasses.field(default="", metadata={"found_by": "serial"})
    baud_rate: Annotated[int, Range(9600, 115200)] = 115200
    unit_id: Annotated[int, Range(1, 247)] = 9
    request_timeout: Annotated[float, Range(0.05, 5.0, "s")] = 0.5
    activation_timeout: Annotated[float, Range(1.0, 60.0, "s")] = 10.0
    tcp_z: float = 0.0
    mass: float = 0.0
    stroke: float = 0.0
    open_position: Annotated[int, Range(0, 254)] = 3
    closed_position: int = 230
    min_force: float = 0.0
    max_force: float = 0.0
    min_speed: float = 0.0
    max_speed: float = 0.0
    robot: str = ""
    part_size_x: float = 0.0
    part_size_y: float = 0.0
    part_size_z: float = 0.0
    part_offset_z: float = 0.0

    def __post_init__(self) -> None:
        super().__post_init__()
        data = MODELS[self.model]
        for field in dataclasses.fields(data):
            if getattr(self, field.name) == 0.0:
                setattr(self, field.name, getattr(data, field.name))
        if self.tcp_z == 0.0:
            raise OutOfRange("tcp_z must be set to 0.05 to 0.5 m: that of a {model} is unknown", model=self.model)
        within("tcp_z", self.tcp_z, 0.05, 0.5, "m")
        within("mass", self.mass, 0.1, 5.0, "kg")
        if self.wire is Wire.URCAP:
            check_host(self.host, self.port)
        else:
            check_serial_port("serial_port", self.serial_port)
        within("stroke", self.stroke, 0.01, 0.2, "m")
        within("closed_position", self.closed_position, self.open_position + 1, 255)
        within("min_force", self.min_force, 0.0, 500.0, "N")
        within("max_force", self.max_force, self.min_force + 1.0, 500.0, "N")
        within("min_speed", self.min_speed, 0.001, 0.5, "m/s")
        within("max_speed", self.max_speed, self.min_speed + 0.001, 0.5, "m/s")
        check_part_size(self, within)
