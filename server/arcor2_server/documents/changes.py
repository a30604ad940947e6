"""Items of the open document and changes to them."""

import enum
from collections.abc import Iterable
from typing import Any, Final

import msgspec
from msgspec import Raw, Struct

from arcor2_hw.data.project import (
    Action,
    BareActionPoint,
    LogicItem,
    NamedOrientation,
    Project,
    ProjectParameter,
    ProjectRobotJoints,
)
from arcor2_hw.data.scene import Scene, SceneObject, SceneObjectOverride


class Kind(enum.StrEnum):
    """Kinds of item. SCENE and PROJECT carry the document's own fields, their lists stay empty."""

    SCENE = "scene"
    OBJECT = "object"
    PROJECT = "project"
    POINT = "action_point"
    ORIENTATION = "orientation"
    JOINTS = "joints"
    ACTION = "action"
    PARAMETER = "parameter"
    LOGIC = "logic"
    OVERRIDE = "override"


VALUE_TYPES: Final[dict[Kind, type]] = {
    Kind.SCENE: Scene,
    Kind.OBJECT: SceneObject,
    Kind.PROJECT: Project,
    Kind.POINT: BareActionPoint,
    Kind.ORIENTATION: NamedOrientation,
    Kind.JOINTS: ProjectRobotJoints,
    Kind.ACTION: Action,
    Kind.PARAMETER: ProjectParameter,
    Kind.LOGIC: LogicItem,
    Kind.OVERRIDE: SceneObjectOverride,
}

OF_SCENE: Final = frozenset({Kind.SCENE, Kind.OBJECT})
"""Kinds that belong to the scene; all others belong to the project."""


class Item(Struct, frozen=True, array_like=True):
    """One item. `parent`: the action point of an orientation, joints or action, else empty.

    `rank` orders the items of one kind: a restored item returns to its old position. Values are never modified in
    place.
    """

    kind: Kind
    id: str
    parent: str
    rank: int
    value: Any


class Change(Struct, frozen=True, array_like=True):
    """An item is added (`before` is None), replaced, or removed (`after` is None)."""

    kind: Kind
    id: str
    parent: str
    rank: int
    before: Any
    after: Any

    def inverse(self) -> "Change":
        """Return the change that takes this one back."""
        return Change(self.kind, self.id, self.parent, self.rank, self.after, self.before)


class How(enum.StrEnum):
    """The kind of an edit."""

    EDIT = "edit"
    UNDO = "undo"
    REDO = "redo"
    RESTORE = "restore"
    EXTERNAL = "external"
    """The stored document was changed while it was closed; such an edit has no user."""


class Edit(Struct, frozen=True):
    """The changes of one request, which are applied, undone and stored together. `number` grows by one per edit.

    `request`: the request that made the edit; for an undo or redo, the request of the edit that it reverts.
    `of`: the number of that edit, or the restored revision.
    """

    number: int
    time: str
    user: str
    changes: list[Change]
    request: str = ""
    how: How = How.EDIT
    of: int = 0


def net(changes: Iterable[Change]) -> list[Change]:
    """Return one change for each item: from before the first of the changes to after the last, none without effect."""
    found: dict[tuple[Kind, str], Change] = {}
    for change in changes:
        key = (change.kind, change.id)
        if (first := found.get(key)) is not None:
            change = Change(change.kind, change.id, change.parent, change.rank, first.before, change.after)
        found[key] = change
    return [change for change in found.values() if change.before != change.after]


class _Row(Struct, frozen=True, array_like=True):
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


_encode = msgspec.json.Encoder().encode
_decode_items = msgspec.json.Decoder(list[_Row]).decode
_decode_changes = msgspec.json.Decoder(list[_ChangeRow]).decode
_values: Final = {kind: msgspec.json.Decoder(of | None).decode for kind, of in VALUE_TYPES.items()}


def encode_items(items: list[Item]) -> bytes:
    """Write items for the journal."""
    return _encode(items)


def decode_items(data: bytes) -> list[Item]:
    """Read what `encode_items` wrote; msgspec.DecodeError when it is damaged."""
    return [Item(row.kind, row.id, row.parent, row.rank, _values[row.kind](row.value)) for row in _decode_items(data)]


def encode_changes(changes: list[Change]) -> bytes:
    """Write changes for the journal."""
    return _encode(changes)


def decode_changes(data: bytes) -> list[Change]:
    """Read what `encode_changes` wrote; msgspec.DecodeError when it is damaged."""
    return [
        Change(row.kind, row.id, row.parent, row.rank, _values[row.kind](row.before), _values[row.kind](row.after))
        for row in _decode_changes(data)
    ]
