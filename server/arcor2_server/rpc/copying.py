"""The request that copies an action point with its children (protocol, 7.4)."""

import itertools
from collections.abc import Callable
from dataclasses import dataclass

import msgspec
from msgspec import UNSET
from msgspec.structs import replace

from arcor2_hw.data.base import new_id
from arcor2_hw.data.events import ChangeType
from arcor2_hw.data.project import Action, ActionParameter, ActionParameterType
from arcor2_hw.data.rpc import CopyActionPointArgs
from arcor2_server.collaboration.locks import Locks
from arcor2_server.documents import Session
from arcor2_server.documents.changes import Change, Kind
from arcor2_server.documents.document import OUTPUT, Document
from arcor2_server.documents.item_indexes import OWNED, reference
from arcor2_server.documents.parallel_work import mapped_branches
from arcor2_server.rpc.change_events import EVENTS
from arcor2_server.rpc.editing import Editing
from arcor2_server.rpc.registry import Context, rpc

_PREFIXES = {Kind.POINT: "acp", Kind.ORIENTATION: "ori", Kind.JOINTS: "joi", Kind.ACTION: "act"}
"""Prefixes of new ids by kind of item."""


def _copy(document: Document, args: CopyActionPointArgs) -> list[Change]:
    """Return the changes that add the copies: first points, orientations and joints, then actions."""
    points = [document.action_point(args.id), *document.descendants(args.id)]
    owned = {point.id: [item for kind in OWNED for item in document.owned(point.id, kind)] for point in points}
    new_ids = {point.id: new_id("acp") for point in points}
    new_ids |= {item.id: new_id(_PREFIXES[item.kind]) for items in owned.values() for item in items}
    free_point, free_action, free_output = (_free_names(document, kind) for kind in (Kind.POINT, Kind.ACTION, OUTPUT))
    points_with_poses: list[Change] = []
    actions: list[Change] = []
    for point in points:
        key = new_ids[point.id]
        parent = point.parent if point.id == args.id else new_ids[str(point.parent)]
        position = args.position if point.id == args.id and args.position is not UNSET else point.position
        copied = replace(point, id=key, name=free_point(point.name), parent=parent, position=position)
        points_with_poses.append(document.add(Kind.POINT, key, copied))
        for item in owned[point.id]:
            value = replace(item.value, id=new_ids[item.id])
            if item.kind is Kind.ACTION:
                value = _copied_action(value, new_ids, free_action, free_output)
                actions.append(document.add(Kind.ACTION, value.id, value, key))
            else:
                points_with_poses.append(document.add(item.kind, value.id, value, key))
    return points_with_poses + actions


def _free_names(document: Document, kind: Kind | str) -> Callable[[str], str]:
    """Return a function that returns a free name for a copy: with the suffix `_copy`, `_copy_1`, `_copy_2` ..."""
    taken: set[str] = set()

    def free(name: str) -> str:
        candidates = itertools.chain([f"{name}_copy"], (f"{name}_copy_{number}" for number in itertools.count(1)))
        found = next(c for c in candidates if c not in taken and document.named(kind, c) is None)
        taken.add(found)
        return found

    return free


def _copied_action(
    action: Action, new_ids: dict[str, str], free_name: Callable[[str], str], free_output: Callable[[str], str]
) -> Action:
    flows = [replace(flow, outputs=[free_output(output) for output in flow.outputs]) for flow in action.flows]
    parameters = [_redirected(parameter, new_ids) for parameter in action.parameters]
    error = free_output(action.error_output) if action.error_output else action.error_output
    branches = mapped_branches(action, new_ids)
    name = free_name(action.name)
    return replace(action, name=name, flows=flows, parameters=parameters, error_output=error, branches=branches)


def _redirected(parameter: ActionParameter, new_ids: dict[str, str]) -> ActionParameter:
    """Return a parameter that refers to the copy of its target, if the target is copied."""
    target = reference(parameter.type, parameter.value)
    if target is None or target not in new_ids:
        return parameter
    text = msgspec.json.decode(parameter.value, type=str)
    new = new_ids[target] + text[len(target) :] if parameter.type == ActionParameterType.LINK else new_ids[target]
    return replace(parameter, value=msgspec.json.encode(new).decode())


@dataclass(frozen=True, slots=True)
class CopyRequests:
    """The request that copies an action point with its children (protocol, 7.4)."""

    _locks: Locks
    _session: Session
    _editing: Editing

    @rpc("CopyActionPoint")
    async def copy_action_point(self, context: Context, args: CopyActionPointArgs) -> None:
        """Copy an action point with its descendants. References between copied items refer to the copies."""
        document = self._session.require_project_open()
        user = context.user
        document.action_point(args.id)
        points = [args.id, *(point.id for point in document.descendants(args.id))]
        async with self._locks.read(user, *points):
            changes = _copy(document, args)
            if not await self._editing.commit(context, changes):
                return
        for change in changes:
            context.emit_first(EVENTS[change.kind], change.after, ChangeType.ADD, change.parent or None)
