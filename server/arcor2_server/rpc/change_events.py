"""The events of the protocol for changed items, for requests that change items of several kinds (section 8)."""

from collections.abc import Sequence
from typing import Any, Final

from msgspec.structs import replace

from arcor2_hw.data.base import Unset
from arcor2_hw.data.events import ChangeType
from arcor2_hw.data.parameter import Parameter
from arcor2_hw.data.project import BareAction
from arcor2_server.documents import Session
from arcor2_server.documents.changes import Change, Kind
from arcor2_server.documents.document import Document
from arcor2_server.documents.item_indexes import OWNED
from arcor2_server.rpc.registry import Context

EVENTS: Final = {
    Kind.OBJECT: "SceneObjectChanged",
    Kind.INTERLOCK: "InterlockChanged",
    Kind.POINT: "ActionPointChanged",
    Kind.ORIENTATION: "OrientationChanged",
    Kind.JOINTS: "JointsChanged",
    Kind.ACTION: "ActionChanged",
    Kind.PARAMETER: "ProjectParameterChanged",
    Kind.FUNCTION: "FunctionChanged",
    Kind.LOGIC: "LogicItemChanged",
}
"""The event that publishes a change, by kind of item."""
_UPDATE_BASE_KINDS: Final = (Kind.ORIENTATION, Kind.JOINTS, Kind.ACTION)
"""Kinds of items whose renaming is published as update_base."""
_ORDER: Final = (
    *(Kind.SCENE, Kind.PROJECT, Kind.OBJECT, Kind.INTERLOCK, Kind.OVERRIDE, Kind.PARAMETER),
    *(Kind.POINT, Kind.ORIENTATION, Kind.JOINTS, Kind.ACTION, Kind.LOGIC),
)
"""Kinds in the order in which added and changed items are published; removed items are published in reverse."""


def _depth(document: Document, change: Change) -> int:
    """Return the number of action points above an action point; 0 for other items."""
    depth = 0
    if change.kind is Kind.POINT:
        parent = change.after.parent
        while not isinstance(parent, Unset) and (item := document.find(Kind.POINT, parent)) is not None:
            parent, depth = item.value.parent, depth + 1
    return depth


# ---------------------------------------------------------------------------------------------- removed items
def _removals(changes: Sequence[Change]) -> list[Change]:
    """Return the removals to publish, children first.

    The event of a removed action point covers its orientations, joints and actions.
    """
    removals = [change for change in changes if change.after is None]
    parents = {change.id: change.before.parent for change in removals if change.kind is Kind.POINT}

    def order(change: Change) -> tuple[int, int]:
        depth, parent = 0, parents.get(change.id)
        while isinstance(parent, str) and parent in parents:
            depth, parent = depth + 1, parents[parent]
        return -_ORDER.index(change.kind), -depth

    return sorted((c for c in removals if c.kind not in OWNED or c.parent not in parents), key=order)


def _emit_removed(context: Context, change: Change) -> None:
    if change.kind is Kind.OVERRIDE:
        _emit_overrides(context, change)
        return
    data: Any = change.before
    if change.kind is Kind.ACTION:
        data = BareAction(data.name, data.type, data.id)
    context.emit(EVENTS[change.kind], data, ChangeType.REMOVE)


def _emit_added_or_updated(context: Context, change: Change, *, point_moves: bool) -> None:
    parent = change.parent or None
    change_type = ChangeType.ADD
    if change.before is not None:
        renamed = change.kind in _UPDATE_BASE_KINDS and replace(change.before, name=change.after.name) == change.after
        change_type = ChangeType.UPDATE_BASE if renamed else ChangeType.UPDATE
        # Events of joints name the parent if a moved action point made the joints invalid (protocol, section 8).
        parent = parent if change.kind is Kind.JOINTS and point_moves else None
    context.emit(EVENTS[change.kind], change.after, change_type, parent)


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


def emit_functions(context: Context, session: Session, changes: Sequence[Change]) -> list[Change]:
    """Send FunctionChanged for each changed function after the response; return the changes outside of functions.

    The event contains the actions and logic of the function, so their own events are not sent.
    """
    document = session.document
    own = {change.id: change for change in changes if change.kind is Kind.FUNCTION}
    changed: dict[str, None] = {}
    others: list[Change] = []
    for change in changes:
        key = change.id if change.kind is Kind.FUNCTION else change.parent
        if key in own or (key and document.find(Kind.FUNCTION, key) is not None):
            changed[key] = None
        else:
            others.append(change)
    for key in changed:
        function = document.find_function(key)
        if function is None:
            context.emit("FunctionChanged", own[key].before, ChangeType.REMOVE)
        else:
            added = key in own and own[key].before is None
            context.emit("FunctionChanged", function, ChangeType.ADD if added else ChangeType.UPDATE)
    return others


def emit_all(context: Context, session: Session, changes: Sequence[Change]) -> None:
    """Send one event for each changed item after the response.

    Removed logic items come first, since an action has only one next step. Then come added and changed items, an
    action point before its children, and at last the other removed items, children before their action point. Changed
    functions come before all others, so that a client knows a function before its first call.
    """
    document = session.document
    changes = emit_functions(context, session, changes)
    present = sorted(
        (change for change in changes if change.after is not None),
        key=lambda change: (_ORDER.index(change.kind), _depth(document, change), change.rank),
    )
    removals = _removals(changes)
    for change in removals:
        if change.kind is Kind.LOGIC:
            _emit_removed(context, change)
    _emit_present(context, session, present)
    for change in removals:
        if change.kind is not Kind.LOGIC:
            _emit_removed(context, change)


# ---------------------------------------------------------------------------------- added and changed items
def _emit_present(context: Context, session: Session, changes: Sequence[Change]) -> None:
    document = session.document
    point_moves = any(change.kind is Kind.POINT for change in changes)
    published_points: set[str] = set()
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
                    # Like UpdateActionPointParent: with orientations and joints, without actions.
                    published_points.add(change.id)
                    point = replace(document.full_point(change.id), actions=[])
                    context.emit("ActionPointChanged", point, ChangeType.UPDATE)
            case Kind.ORIENTATION | Kind.JOINTS if change.parent in published_points:
                pass  # included in the event of the point
            case _:
                _emit_added_or_updated(context, change, point_moves=point_moves)
