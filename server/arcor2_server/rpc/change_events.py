"""The events of the protocol for changed items, whatever request changed them (protocol, section 8)."""

from collections.abc import Sequence
from typing import Any, Final

from msgspec.structs import replace

from arcor2_hw.data.base import Unset
from arcor2_hw.data.events import ChangeType
from arcor2_hw.data.parameter import Parameter
from arcor2_hw.data.project import BareAction
from arcor2_server.documents import Session
from arcor2_server.documents.changes import Change, Kind
from arcor2_server.documents.document import OWNED, Document
from arcor2_server.rpc.registry import Context

_EVENTS: Final = {
    Kind.OBJECT: "SceneObjectChanged",
    Kind.POINT: "ActionPointChanged",
    Kind.ORIENTATION: "OrientationChanged",
    Kind.JOINTS: "JointsChanged",
    Kind.ACTION: "ActionChanged",
    Kind.PARAMETER: "ProjectParameterChanged",
    Kind.LOGIC: "LogicItemChanged",
}
_BASE_UPDATED: Final = (Kind.ORIENTATION, Kind.JOINTS, Kind.ACTION)
"""Kinds of items whose renaming is published as update_base."""
_ORDER: Final = (
    *(Kind.SCENE, Kind.PROJECT, Kind.OBJECT, Kind.OVERRIDE, Kind.PARAMETER),
    *(Kind.POINT, Kind.ORIENTATION, Kind.JOINTS, Kind.ACTION, Kind.LOGIC),
)


def _depth(document: Document, change: Change) -> int:
    """Return how many action points are above one."""
    depth = 0
    if change.kind is Kind.POINT:
        parent = change.after.parent
        while not isinstance(parent, Unset) and (item := document.find(Kind.POINT, parent)) is not None:
            parent, depth = item.value.parent, depth + 1
    return depth


# ---------------------------------------------------------------------------------------------- what goes
def _removed(changes: Sequence[Change]) -> list[Change]:
    """Return what goes, innermost first; what belongs to an action point that goes needs no event of its own."""
    gone = [change for change in changes if change.after is None]
    points = {change.id: change.before.parent for change in gone if change.kind is Kind.POINT}

    def place(change: Change) -> tuple[int, int]:
        depth, above = 0, points.get(change.id)
        while isinstance(above, str) and above in points:
            depth, above = depth + 1, points[above]
        return -_ORDER.index(change.kind), -depth

    return sorted((c for c in gone if c.kind not in OWNED or c.parent not in points), key=place)


def _emit_removed(context: Context, change: Change) -> None:
    if change.kind is Kind.OVERRIDE:
        _emit_overrides(context, change)
        return
    data: Any = change.before
    if change.kind is Kind.ACTION:
        data = BareAction(data.name, data.type, data.id)
    context.emit(_EVENTS[change.kind], data, ChangeType.REMOVE)


def _emit_one(context: Context, change: Change, *, moves: bool) -> None:
    parent = change.parent if change.kind in OWNED else None
    how = ChangeType.ADD
    if change.before is not None:
        renamed = change.kind in _BASE_UPDATED and replace(change.before, name=change.after.name) == change.after
        how = ChangeType.UPDATE_BASE if renamed else ChangeType.UPDATE
        # Joints carry their parent where a point that moves makes them invalid (protocol, section 8).
        parent = parent if change.kind is Kind.JOINTS and moves else None
    context.emit(_EVENTS[change.kind], change.after, how, parent)


def _emit_overrides(context: Context, change: Change) -> None:
    before, after = _by_name(change.before), _by_name(change.after)
    for name, parameter in before.items():
        if name not in after:
            context.emit("OverrideUpdated", parameter, ChangeType.REMOVE, change.id)
    for name, parameter in after.items():
        if name not in before:
            context.emit("OverrideUpdated", parameter, ChangeType.ADD, change.id)
        elif before[name] != parameter:
            context.emit("OverrideUpdated", parameter, ChangeType.UPDATE, change.id)


def _by_name(override: Any) -> dict[str, Parameter]:
    return {} if override is None else {parameter.name: parameter for parameter in override.parameters}


class ChangeEvents:
    """Publishes changes of the open document, whatever request made them."""

    def __init__(self, session: Session) -> None:
        self._session = session

    def emit_all(self, context: Context, changes: Sequence[Change]) -> None:
        """Send one event for each changed item after the response.

        Removed logic items come first, since one node has only one next step. Then come added and changed items, an
        action point before its children, and at last the other removed items, children before their action point.
        """
        document = self._session.document
        stays = sorted(
            (change for change in changes if change.after is not None),
            key=lambda change: (_ORDER.index(change.kind), _depth(document, change), change.rank),
        )
        goes = _removed(changes)
        for change in goes:
            if change.kind is Kind.LOGIC:
                _emit_removed(context, change)
        self._emit_remaining(context, document, stays)
        for change in goes:
            if change.kind is not Kind.LOGIC:
                _emit_removed(context, change)

    # ------------------------------------------------------------------------------ added and changed items
    def _emit_remaining(self, context: Context, document: Document, changes: Sequence[Change]) -> None:
        session = self._session
        moves = any(change.kind is Kind.POINT for change in changes)
        whole: set[str] = set()
        for change in changes:
            match change.kind:
                case Kind.SCENE:
                    context.emit("SceneChanged", session.bare_scene(), ChangeType.UPDATE_BASE)
                case Kind.PROJECT:
                    context.emit("ProjectChanged", session.bare_project(), ChangeType.UPDATE_BASE)
                case Kind.OVERRIDE:
                    _emit_overrides(context, change)
                case Kind.POINT if change.before is not None:
                    if change.before.parent == change.after.parent:
                        context.emit("ActionPointChanged", change.after, ChangeType.UPDATE_BASE)
                    elif document.find(Kind.POINT, change.id) is not None:
                        # As UpdateActionPointParent tells it: with orientations and joints, without actions.
                        whole.add(change.id)
                        point = replace(document.full_point(change.id), actions=[])
                        context.emit("ActionPointChanged", point, ChangeType.UPDATE)
                case Kind.ORIENTATION | Kind.JOINTS if change.parent in whole:
                    pass  # told with its point
                case _:
                    _emit_one(context, change, moves=moves)
