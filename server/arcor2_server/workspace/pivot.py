"""Placement of an object at the tool tip of a robot."""

from typing import Final

from arcor2_hw.data.base import Unset
from arcor2_hw.data.geometry import Orientation, Pose, Position
from arcor2_hw.data.object_type import Box, Cylinder, ObjectModel, Sphere
from arcor2_hw.data.rpc import Pivot
from arcor2_server.errors import RequestRefused

FLIPPED: Final = Orientation(1, 0, 0, 0)
"""Orientation of the object in the tool frame: the tool points at the object, so their z axes are opposite."""


def pivot_offset(model: ObjectModel | Unset, pivot: Pivot) -> Pose:
    """Return the pose of an object in the frame of the tool tip, with the pivot of the object at the tip.

    Raises:
        RequestRefused: the pivot is the top or bottom, and the object is not a box, cylinder or sphere.
    """
    if pivot is Pivot.MIDDLE:
        return Pose(Position(), FLIPPED)
    shape = None if isinstance(model, Unset) else model.model()
    match shape:
        case Box():
            half = shape.size_z / 2
        case Cylinder():
            half = shape.height / 2
        case Sphere():
            half = shape.radius / 2
        case _:
            raise RequestRefused("Only a box, a cylinder or a sphere has a top and a bottom: use the middle.")
    return Pose(Position(0, 0, half if pivot is Pivot.TOP else -half), FLIPPED)
