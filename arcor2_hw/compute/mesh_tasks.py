"""Tasks of the mesh worker. Imports no numerics, so that the server can use it."""

from typing import ClassVar, Final

from msgspec import field

from arcor2_hw.collision.description import StoredFile
from arcor2_hw.compute.task import Task, WorkerKind
from arcor2_hw.data.base import Data
from arcor2_hw.messages import Message

CONVERSION: Final = 1
"""Version of the conversion; cached results of another version are converted again."""


class PreparedAsset(Data, frozen=True):
    """An asset converted for display.

    Attributes:
        content: Binary glTF.
        triangles: Number of triangles in it.
        before: Number of triangles of the original.
        problems: One sentence for each mesh of a robot that cannot be shown.
    """

    content: bytes
    triangles: int
    before: int
    problems: list[str] = field(default_factory=list)


class PrepareAsset(Task[PreparedAsset], frozen=True):
    """Convert a mesh, or a robot's URDF with its meshes, for display. Fails for a file that cannot be used."""

    result_type: ClassVar = PreparedAsset
    function: ClassVar = "arcor2_hw.compute.mesh_functions:prepared"
    worker: ClassVar = WorkerKind.MESHES
    timeout: ClassVar = 120.0
    label: ClassVar = Message.of("a mesh for the editor")

    file: StoredFile


MeshTask = PrepareAsset
