"""Primitive shapes, centred at their own origin. Imports no numerics, so the server can use it.

Fields are lengths in m. Cylinders and capsules are along z.
"""

from msgspec import Struct

from arcor2_hw.data import object_type


class Box(Struct, frozen=True, tag="box"):
    """Box with edges along the axes."""

    x: float
    y: float
    z: float


class Cylinder(Struct, frozen=True, tag="cylinder"):
    """Cylinder along z."""

    radius: float
    length: float


class Capsule(Struct, frozen=True, tag="capsule"):
    """Cylinder along z with a hemisphere at each end; `length` excludes the hemispheres."""

    radius: float
    length: float


class Sphere(Struct, frozen=True, tag="sphere"):
    """Sphere."""

    radius: float


def primitive_of(model: object_type.Box | object_type.Cylinder | object_type.Sphere) -> Box | Cylinder | Sphere:
    """Return the shape of a collision model of the protocol that is not a mesh."""
    match model:
        case object_type.Box():
            return Box(model.size_x, model.size_y, model.size_z)
        case object_type.Cylinder():
            return Cylinder(model.radius, model.height)
        case object_type.Sphere():
            return Sphere(model.radius)
