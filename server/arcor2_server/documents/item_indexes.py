"""Indexes of the items of a document: by name, by action point, and by the items that they refer to."""

import contextlib
from collections.abc import Iterable, Iterator
from typing import Any, Final

import msgspec

from arcor2_hw.data.project import CALL, START, Action, ActionParameterType, FunctionReturns, parse_link
from arcor2_server.documents.changes import Item, Kind

OWNED: Final = (Kind.ORIENTATION, Kind.JOINTS, Kind.ACTION)
"""Kinds that belong to an action point; actions may belong to a function instead."""

REFERRING: Final = frozenset(
    {"pose", "position", "joints", ActionParameterType.LINK, ActionParameterType.PROJECT_PARAMETER}
)
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


def link_of(result: FunctionReturns) -> tuple[str, str, int] | None:
    """Return action id, flow and output index of a result of a function, None if it is malformed."""
    with contextlib.suppress(ValueError):
        return parse_link(result.link)
    return None


def place_of(end: str, function: str) -> str:
    """Return the key of one side of a logic item: the action id, END, or START of the program or of a function."""
    place = action_of(end)
    return f"{START}/{function}" if function and place == START else place


class ItemIndexes:
    """The ids of items by key, in the order in which they were added.

    Attributes:
        owned: Orientations, joints, actions and logic items, by action point or function, and kind.
        points: Action points by parent.
        names: Items by scope and name; the scope is a kind, for orientations and joints with their action point.
        users: Actions, logic items and functions by the item that they refer to; calls also by their function, and
            parallel actions by their branches.
        leaving: Logic items by their start (`place_of`).
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
        if item.parent:
            self.owned.setdefault(item.parent, {}).setdefault(item.kind, {})[item.id] = None

    def remove(self, item: Item) -> None:
        """Remove an item."""
        for index, key in self._keys(item):
            ids = index[key]
            ids.pop(item.id, None)
            if not ids:
                del index[key]
        if item.parent:
            owned = self.owned[item.parent]
            del owned[item.kind][item.id]
            if not any(owned.values()):
                del self.owned[item.parent]

    def owned_by(self, point_id: str, kind: Kind) -> Iterable[str]:
        """Return the ids of the items of a kind that belong to an action point or function."""
        return self.owned.get(point_id, {}).get(kind, ())

    def _keys(self, item: Item) -> Iterator[tuple[dict[Any, dict[str, None]], Any]]:
        """Return each index with the key under which it lists the item, each key at most once."""
        value = item.value
        match item.kind:
            case Kind.OBJECT | Kind.PARAMETER | Kind.INTERLOCK:
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
                called, _, method = value.type.partition("/")
                if method == CALL:
                    targets.add(called)
                targets.update(value.branches or ())
                for target in targets - {None}:
                    yield self.users, target
            case Kind.FUNCTION:
                yield self.names, (item.kind, value.name)
                for target in {link[0] for link in map(link_of, value.returns) if link is not None}:
                    yield self.users, target
            case Kind.LOGIC:
                yield self.leaving, place_of(value.start, item.parent)
                yield self.arriving, action_of(value.end)
                for used in value.used():
                    yield self.users, used
