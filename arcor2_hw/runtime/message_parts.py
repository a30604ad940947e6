"""Parts of the messages between server and cell host."""

from msgspec import Struct, field

from arcor2_hw.data.geometry import Pose
from arcor2_hw.data.object_type import ObjectModel


class PutIn(Struct, frozen=True):
    """Something that stands in the way beside the objects of the scene.

    pose: in the world, or in the frame of the link that holds it. scale: of a mesh, whose file is `file`. robot: the id
    of the object that holds it with `link`, empty when nobody does; it may touch the links `touching`, too.
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
    """A part that a link of a robot holds, pose in the frame of that. model: None for an object of the scene."""

    name: str
    link: str
    pose: Pose
    model: ObjectModel | None = None


class DeviceStop(Struct, frozen=True):
    """The result of a stop on one device.

    reason: why it was not stopped, empty when it was. method: the call that ran when the stop came, empty for none.
    """

    object_id: str
    reason: str = ""
    method: str = ""
