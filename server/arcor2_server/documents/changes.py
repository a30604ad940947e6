"""Items of the open document and changes to them."""

import enum
from collections.abc import Iterable
from typing import Any, Final

import msgspec
from msgspec import Raw, Struct

from arcor2_hw.data.interlocks import Interlock
from arcor2_hw.data.project import (
    Action,
    BareActionPoint,
    LogicItem,
    NamedOrientation,
    Project,
    ProjectFunction,
    ProjectParameter,
    ProjectRobotJoints,
)
from arcor2_hw.data.scene import Scene, SceneObject, SceneObjectOverride


class Kind(enum.StrEnum):
    """Kinds of items.

    SCENE, PROJECT and FUNCTION contain only their own fields; their lists of other items are empty.
    """

    SCENE = "scene"
    OBJECT = "object"
    INTERLOCK = "interlock"
    PROJECT = "project"
    POINT = "action_point"
    ORIENTATION = "orientation"
    JOINTS = "joints"
    ACTION = "action"
    PARAMETER = "parameter"
    FUNCTION = "function"
    LOGIC = "logic"
    OVERRIDE = "override"


VALUE_TYPES: Final[dict[Kind, type]] = {
    Kind.SCENE: Scene,
    Kind.OBJECT: SceneObject,
    Kind.INTERLOCK: Interlock,
    Kind.PROJECT: Project,
    Kind.POINT: BareActionPoint,
    Kind.ORIENTATION: NamedOrientation,
    Kind.JOINTS: ProjectRobotJoints,
    Kind.ACTION: Action,
    Kind.PARAMETER: ProjectParameter,
    Kind.FUNCTION: ProjectFunction,
    Kind.LOGIC: LogicItem,
    Kind.OVERRIDE: SceneObjectOverride,
}

OF_SCENE: Final = frozenset({Kind.SCENE, Kind.OBJECT, Kind.INTERLOCK})
"""Kinds that belong to the scene; all others belong to the project."""


class Item(Struct, frozen=True, array_like=True):
    """One item of a document.

    Attributes:
        kind: The kind of the item.
        id: Its id, unique within the kind.
        parent: The action point of an orientation, joints or action, or the function of an action or logic item, else
            empty.
        rank: Orders the items of one kind, so that a restored item returns to its old position.
        value: Never modified in place.
    """

    kind: Kind
    id: str
    parent: str
    rank: int
    value: Any


class Change(Struct, frozen=True, array_like=True):
    """Adds an item (`before` is None), replaces it, or removes it (`after` is None)."""

    kind: Kind
    id: str
    parent: str
    rank: int
    before: Any
    after: Any

    def inverse(self) -> "Change":
        """Return the change that reverts this one."""
        return Change(self.kind, self.id, self.parent, self.rank, self.after, self.before)


class EditKind(enum.StrEnum):
    """Kinds of edit."""

    EDIT = "edit"
    UNDO = "undo"
    REDO = "redo"
    RESTORE = "restore"
    EXTERNAL = "external"
    """The stored document was changed while it was closed. The edit has no user."""


FILE_NAMES: Final = {"kind": "how", "target": "of"}
"""Fields of an edit that have another name in the files of closed histories."""


class Edit(Struct, frozen=True, rename=FILE_NAMES):
    """The changes of one request, which are applied, undone and stored together.

    Attributes:
        number: Grows by one per edit.
        time: Time of the edit.
        user: Author of the edit.
        changes: In the order in which they are applied.
        request: The request that made the edit; for an undo or redo, the request of the edit that it reverts.
        kind: The kind of the edit.
        target: The number of the edit that an undo or redo reverts, or the restored revision; for an edit, the
            number of the edit that started its step, 0 if it is a step itself.
    """

    number: int
    time: str
    user: str
    changes: list[Change]
    request: str = ""
    kind: EditKind = EditKind.EDIT
    target: int = 0


def net(changes: Iterable[Change]) -> list[Change]:
    """Combine changes into one change per item. Drop changes without effect."""
    found: dict[tuple[Kind, str], Change] = {}
    for change in changes:
        key = (change.kind, change.id)
        if (first := found.get(key)) is not None:
            change = Change(change.kind, change.id, change.parent, change.rank, first.before, change.after)
        found[key] = change
    return [change for change in found.values() if change.before != change.after]


class _ItemRow(Struct, frozen=True, array_like=True):
    kind: Kind
    id: str
    parent: str
    rank: int
    value: Raw


class _ChangeRow(Struct, frozen=True, array_like=True):
    kind: Kind
    id: str
    parent: str
    rank: int
    before: Raw
    after: Raw


encode_rows: Final = msgspec.json.Encoder().encode
"""Encode items or changes for storage."""
_decode_items = msgspec.json.Decoder(list[_ItemRow]).decode
_decode_changes = msgspec.json.Decoder(list[_ChangeRow]).decode
_values: Final = {kind: msgspec.json.Decoder(of | None).decode for kind, of in VALUE_TYPES.items()}


def decode_items(data: bytes) -> list[Item]:
    """Decode stored items.

    Raises:
        msgspec.DecodeError: The data is damaged.
    """
    return [Item(row.kind, row.id, row.parent, row.rank, _values[row.kind](row.value)) for row in _decode_items(data)]


def decode_changes(data: bytes) -> list[Change]:
    """Decode stored changes.

    Raises:
        msgspec.DecodeError: The data is damaged.
    """
    return [
        Change(row.kind, row.id, row.parent, row.rank, _values[row.kind](row.before), _values[row.kind](row.after))
        for row in _decode_changes(data)
    ]
