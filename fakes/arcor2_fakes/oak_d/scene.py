"""The scene in front of the camera: a table and named objects."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable
from pathlib import Path
from typing import Annotated, Any, Final

import msgspec
import numpy as np
import numpy.typing as npt
from msgspec import Meta
from transforms3d.quaternions import quat2mat

Matrix = npt.NDArray[np.float64]
"""A rigid transform as a homogeneous 4 × 4 matrix."""

Length = Annotated[float, Meta(gt=0.0, le=5.0)]
Channel = Annotated[int, Meta(ge=0, le=255)]
MAX_MESH: Final = 20_000_000
MAX_THINGS: Final = 200


class Pose(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A pose in the world: m, unit quaternion x, y, z, w."""

    position: tuple[float, float, float]
    orientation: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 1.0)

    def __post_init__(self) -> None:
        if not all(map(math.isfinite, self.position)):
            raise ValueError("position must be finite")
        if not abs(math.hypot(*self.orientation) - 1.0) <= 1e-3:
            raise ValueError("orientation must be a unit quaternion x, y, z, w")

    def matrix(self) -> Matrix:
        """Return the pose as a transform."""
        x, y, z, w = self.orientation
        matrix = np.eye(4)
        matrix[:3, :3] = quat2mat((w, x, y, z))
        matrix[:3, 3] = self.position
        return matrix


class Marker(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """An ArUco marker at the centre of the top; `size` is the side of its black square, m."""

    id: Annotated[int, Meta(ge=0, le=1023)]
    size: Length
    dictionary: str = "DICT_4X4_50"


class Charuco(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A ChArUco board at the centre of the top; sides of a square and of its marker, m."""

    columns: Annotated[int, Meta(ge=2, le=50)]
    rows: Annotated[int, Meta(ge=2, le=50)]
    square: Length
    marker: Length
    dictionary: str = "DICT_4X4_50"


class Thing(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A box, cylinder or capsule whose pose is at its centre, or a mesh whose pose is at the origin of the mesh.

    `cylinder` and `capsule` are radius and length along z, without the hemispheres of a capsule.
    """

    name: str
    pose: Pose
    size: tuple[Length, Length, Length] | None = None
    mesh: str | None = None
    cylinder: tuple[Length, Length] | None = None
    capsule: tuple[Length, Length] | None = None
    color: tuple[Channel, Channel, Channel] = (150, 150, 150)
    marker: Marker | None = None
    charuco: Charuco | None = None

    def __post_init__(self) -> None:
        if not self.name:
            raise ValueError("an object needs a name")
        if sum(form is not None for form in (self.size, self.mesh, self.cylinder, self.capsule)) != 1:
            raise ValueError(f"{self.name}: either size, mesh, cylinder or capsule")
        if self.size is None and (self.marker or self.charuco):
            raise ValueError(f"{self.name}: only a box can have a marker")
        if self.mesh is not None and not (Path(self.mesh).is_file() and Path(self.mesh).stat().st_size <= MAX_MESH):
            raise ValueError(f"{self.name}: mesh {self.mesh} must be a file of at most {MAX_MESH} bytes")


class Scene:
    """Table, objects and camera. `version` increases with every visible change."""

    def __init__(self, camera: Pose, table_height: float) -> None:
        self._versions = itertools.count(1)
        self.version = 0
        self.camera = camera
        self.table_height = table_height
        self._things: dict[str, Thing] = {}

    @property
    def things(self) -> tuple[Thing, ...]:
        """Return the objects."""
        return tuple(self._things.values())

    def replace(self, things: Iterable[Any], table_height: float | None = None) -> None:
        """Replace all objects. Raises ValueError for an invalid one."""
        new = [msgspec.convert(each, Thing) for each in things]
        by_name = {each.name: each for each in new}
        if len(by_name) < len(new) or len(new) > MAX_THINGS:
            raise ValueError(f"at most {MAX_THINGS} objects with unique names are allowed")
        if table_height is not None:
            self.table_height = float(table_height)
        self._things = by_name
        self._changed()

    def place(self, thing: Any) -> None:
        """Add an object, or replace the one with its name."""
        found = msgspec.convert(thing, Thing)
        if len(self._things) >= MAX_THINGS and found.name not in self._things:
            raise ValueError(f"at most {MAX_THINGS} objects are allowed")
        self._things[found.name] = found
        self._changed()

    def move(self, poses: dict[str, Any]) -> None:
        """Move objects. Raises LookupError if one does not exist; none is moved then."""
        new = {name: msgspec.convert(pose, Pose) for name, pose in poses.items()}
        if unknown := set(new) - set(self._things):
            raise LookupError(f"unknown objects: {', '.join(sorted(unknown))}")
        moved = {name: pose for name, pose in new.items() if self._things[name].pose != pose}
        for name, pose in moved.items():
            self._things[name] = msgspec.structs.replace(self._things[name], pose=pose)
        if moved:
            self._changed()

    def remove(self, name: str) -> None:
        """Remove an object. Raises LookupError."""
        if name not in self._things:
            raise LookupError(f"object {name} does not exist")
        del self._things[name]
        self._changed()

    def look_from(self, pose: Any) -> None:
        """Move the camera: the pose of its optical frame, x right, y down, z forward."""
        self.camera = msgspec.convert(pose, Pose)
        self._changed()

    def _changed(self) -> None:
        self.version = next(self._versions)
