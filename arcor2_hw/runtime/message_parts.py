"""Parts of the messages between server and cell host."""

from msgspec import Struct, field

from arcor2_hw.data.geometry import Pose
from arcor2_hw.data.object_type import ObjectModel
from arcor2_hw.messages import Message


class AddedBody(Struct, frozen=True):
    """An obstacle that is not an object of the scene, or a part that a robot holds.

    pose: in the world, or in the frame of the link that holds the part. scale: of a mesh, whose file is `file`. robot:
    id of the robot that holds the part with `link`; empty for an obstacle. touching: further links that the part may
    touch.
    """

    id: str
    model: ObjectModel
    pose: Pose
    scale: tuple[float, float, float] = (1.0, 1.0, 1.0)
    file: str = ""
    robot: str = ""
    link: str = ""
    touching: list[str] = field(default_factory=list)


class HeldPart(Struct, frozen=True):
    """A part that a link of a robot holds. pose: in the frame of the link. model: None for an object of the scene."""

    name: str
    link: str
    pose: Pose
    model: ObjectModel | None = None


class DeviceStop(Struct, frozen=True):
    """The result of a stop on one device.

    reason: why the device was not stopped; None if it was. method: the call that the stop interrupted; empty for none.
    """

    object_id: str
    reason: Message | None = None
    method: str = ""


class ErrorData(Struct, frozen=True):
    """An error on its way between processes: code and name of its class, texts, and the device that raised it.

    fault: code of the device's fault, or kind of the safety stop. stamp: when it was raised, on the monotonic clock, s.
    object_name, object_type: of the device, in the error that ended a program.
    """

    code: str
    type: str
    message: Message
    detail: str = ""
    object_id: str = ""
    fault: str = ""
    stamp: float = 0.0
    object_name: str = ""
    object_type: str = ""


class TypeCode(Struct, frozen=True):
    """Location of an object type: entry point ("module:Class") if installed, otherwise module and source code.

    modules: sources of the modules that belong to this type only, by name.
    """

    name: str
    entry_point: str = ""
    module: str = ""
    source: str = ""
    modules: dict[str, str] = {}


class ForceStarted(Struct, frozen=True):
    """The value of CallDone for ForcePoint. before: value of the output before. unit: of both values."""

    before: bool | float
    unit: str
