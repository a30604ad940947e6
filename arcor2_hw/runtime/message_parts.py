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
