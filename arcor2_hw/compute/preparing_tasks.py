"""What the worker for meshes is asked. Imports no numerics: the server knows it."""

from typing import ClassVar, Final

from msgspec import field

from arcor2_hw.collision.description import StoredFile
from arcor2_hw.compute.task import Room, Task
from arcor2_hw.data.base import Data

MAKER: Final = 1
"""Grows when the same asset would be prepared otherwise, so that what was kept is made anew."""


class Prepared(Data, frozen=True):
    """An asset as clients show it: binary glTF; of how many triangles it is, and of how many it was.

    problems: of a robot's meshes that cannot be shown, a sentence each.
    """

    content: bytes
    triangles: int
    before: int
    problems: list[str] = field(default_factory=list)


class PrepareAsset(Task[Prepared], frozen=True):
    """A mesh, or a robot's description with its meshes, made ready for clients. Fails for what cannot be used."""

    gives: ClassVar = Prepared
    runs: ClassVar = "arcor2_hw.compute.preparing:prepared"
    room: ClassVar = Room.MESHES
    within: ClassVar = 120.0
    what: ClassVar = "a mesh for the editor"

    file: StoredFile


PreparingTask = PrepareAsset
