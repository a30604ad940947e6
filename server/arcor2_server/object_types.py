"""What the server knows of object types: built-in, installed and uploaded ones, read by analysis, never imported."""

from collections.abc import Iterable
from pathlib import Path

from msgspec import Struct

from arcor2_hw.data.base import Data
from arcor2_hw.data.object_type import ObjectAction, ObjectTypeMeta, ObjectTypeSource
from arcor2_hw.data.robot import RobotMeta
from arcor2_hw.runtime.messages import TypeCode
from arcor2_server.storage import Storage


class PackageType(Data, frozen=True):
    """What Build puts into a package for one object type.

    An uploaded type has `module` and `source`; an installed one `entry_point` ("module:Class") and the `folder` of
    its own code, and is copied from there.
    """

    name: str
    module: str
    source: str = ""
    entry_point: str = ""
    folder: Path | None = None
    distribution: str = ""
    version: str = ""


class Changes(Struct, frozen=True):
    """What `refresh` found: for ChangedObjectTypes remove, update and add, in this order."""

    removed: list[ObjectTypeMeta]
    updated: list[ObjectTypeMeta]
    added: list[ObjectTypeMeta]

    def __bool__(self) -> bool:
        return bool(self.removed or self.updated or self.added)


class ObjectTypes:
    """The registry. Look-ups raise NotFound for a type or action that is not known."""

    def __init__(self, storage: Storage) -> None:
        self._storage = storage
        self.revision = 0
        """Grows with every change of what is known."""

    async def load(self) -> None:
        """Read built-in, installed and uploaded types."""
        raise NotImplementedError

    async def refresh(self) -> Changes:
        """Take in what was put straight into storage since the last time."""
        raise NotImplementedError

    def names(self) -> list[str]:
        """Give the names of all types."""
        raise NotImplementedError

    def known(self, name: str) -> bool:
        """Tell whether there is such a type."""
        raise NotImplementedError

    def metas(self) -> list[ObjectTypeMeta]:
        """Give all types, by name, built-in and disabled ones too."""
        raise NotImplementedError

    def meta(self, name: str) -> ObjectTypeMeta:
        """Give one type."""
        raise NotImplementedError

    def bases(self, name: str) -> list[str]:
        """Give the names of all ancestors of a type, the nearest first, without the type itself."""
        raise NotImplementedError

    def derives_from(self, name: str, base: str) -> bool:
        """Tell whether a type is, or derives from, `base`."""
        raise NotImplementedError

    def actions(self, name: str) -> list[ObjectAction]:
        """Give the actions of a type: inherited and disabled ones too, hidden ones not."""
        raise NotImplementedError

    def action(self, type_name: str, name: str) -> ObjectAction:
        """Give one action, also a hidden one."""
        raise NotImplementedError

    def robot_metas(self) -> list[RobotMeta]:
        """Give the features of all non-abstract robot types."""
        raise NotImplementedError

    def robot_meta(self, name: str) -> RobotMeta:
        """Give the features of one robot type; NotFound when it is no robot."""
        raise NotImplementedError

    def implements(self, name: str, method: str) -> bool:
        """Tell whether a type really has an optional method, by itself or by an ancestor."""
        raise NotImplementedError

    def type_code(self, name: str) -> TypeCode:
        """Give how the cell host gets at one type."""
        raise NotImplementedError

    def type_codes(self, names: Iterable[str]) -> list[TypeCode]:
        """Give how the cell host gets at types and at the uploaded modules they need, bases and mixins first."""
        raise NotImplementedError

    def sources_for(self, names: Iterable[str]) -> list[PackageType]:
        """Give what a package needs of types, with their uploaded bases and mixins first."""
        raise NotImplementedError

    async def add(self, source: ObjectTypeSource) -> ObjectTypeMeta:
        """Save an uploaded type (new, or of changed source or model) and analyse it.

        InvalidData for the name of a built-in or installed type.
        """
        raise NotImplementedError

    async def remove(self, name: str) -> ObjectTypeMeta:
        """Delete an uploaded type; gives its last meta. InvalidData for a built-in or installed type, NotFound."""
        raise NotImplementedError
