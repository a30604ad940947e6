"""Indexes of the items of a document: by name, by action point, and by the items that they refer to."""

import contextlib
from collections.abc import Iterable, Iterator
from typing import Any, Final

import msgspec

from arcor2_hw.data.project import Action, ActionParameterType, parse_link
from arcor2_server.documents.changes import Item, Kind

OWNED: Final = (Kind.ORIENTATION, Kind.JOINTS, Kind.ACTION)
"""Kinds that belong to an action point."""

REFERRING: Final = frozenset({"pose", "position", "joints", *ActionParameterType})
"""Types of action parameter whose value is the id of an item of the project."""


def action_of(end: str) -> str:
    """Return the action id, START or END of one side of a logic item, without the name of the flow."""
    return end.partition("/")[0]


def reference(kind: str, value: str) -> str | None:
    """Return the id that an action parameter refers to, None if it is a literal or malformed."""
    if kind not in REFERRING:
        return None
    try:
        target = msgspec.json.decode(value, type=str)
        return parse_link(target)[0] if kind == ActionParameterType.LINK else target
    except (msgspec.DecodeError, ValueError):
        return None


def links(action: Action) -> Iterator[tuple[str, str, int]]:
    """Return action id, flow and output index of each link among the parameters of an action."""
    for parameter in action.parameters:
        if parameter.type == ActionParameterType.LINK:
            with contextlib.suppress(msgspec.DecodeError, ValueError):
                yield parse_link(msgspec.json.decode(parameter.value, type=str))


class ItemIndexes:
    """The ids of items by key, in the order in which they were added.

    Attributes:
        owned: Orientations, joints and actions, by action point and kind.
        points: Action points by parent.
        names: Items by scope and name; the scope is a kind, for orientations and joints with their action point.
        users: Actions and logic items by the item that they refer to.
        leaving: Logic items by their start.
        arriving: Logic items by their end.
    """

    def __init__(self) -> None:
        self.owned: dict[str, dict[Kind, dict[str, None]]] = {}
        self.points: dict[str, dict[str, None]] = {}
        self.names: dict[tuple[str, str], dict[str, None]] = {}
        self.users: dict[str, dict[str, None]] = {}
        self.leaving: dict[str, dict[str, None]] = {}
        self.arriving: dict[str, dict[str, None]] = {}

    def add(self, item: Item) -> None:
        """Add an item."""
        for index, key in self._keys(item):
            index.setdefault(key, {})[item.id] = None
        if item.kind in OWNED:
            self.owned.setdefault(item.parent, {kind: {} for kind in OWNED})[item.kind][item.id] = None

    def remove(self, item: Item) -> None:
        """Remove an item."""
        for index, key in self._keys(item):
            ids = index[key]
            ids.pop(item.id, None)
            if not ids:
                del index[key]
        if item.kind in OWNED:
            owned = self.owned[item.parent]
            del owned[item.kind][item.id]
            if not any(owned.values()):
                del self.owned[item.parent]

    def owned_by(self, point_id: str, kind: Kind) -> Iterable[str]:
        """Return the ids of the items of a kind that belong to an action point."""
        return self.owned.get(point_id, {}).get(kind, ())

    def _keys(self, item: Item) -> Iterator[tuple[dict[Any, dict[str, None]], Any]]:
        """Return each index with the key under which it lists the item, each key at most once."""
        value = item.value
        match item.kind:
            case Kind.OBJECT | Kind.PARAMETER:
                yield self.names, (item.kind, value.name)
            case Kind.POINT:
                yield self.names, (item.kind, value.name)
                if value.parent:
                    yield self.points, value.parent
            case Kind.ORIENTATION | Kind.JOINTS:
                yield self.names, (item.parent + item.kind, value.name)
            case Kind.ACTION:
                yield self.names, (item.kind, value.name)
                for output in set(value.names()):
                    yield self.names, ("output", output)
                targets = {reference(parameter.type, parameter.value) for parameter in value.parameters}
                for target in targets - {None}:
                    yield self.users, target
            case Kind.LOGIC:
                yield self.leaving, action_of(value.start)
                yield self.arriving, action_of(value.end)
                if value.condition:
                    yield self.users, action_of(value.condition.what)
