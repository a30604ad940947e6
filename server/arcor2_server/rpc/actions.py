"""Requests that add, change and remove actions (protocol, 7.4 and 10.2, 10.3)."""

from msgspec.structs import replace

from arcor2_hw.data.base import Unset, new_id
from arcor2_hw.data.events import ChangeType
from arcor2_hw.data.project import Action, BareAction, LogicItem
from arcor2_hw.data.rpc import AddActionArgs, RemoveActionArgs, RenameActionArgs, UpdateActionArgs
from arcor2_hw.exceptions import InvalidData
from arcor2_server.documents.changes import Change, Kind
from arcor2_server.documents.checks import (
    action_meta,
    check_flows,
    check_outputs_unique,
    check_parameters,
    complete_parameters,
)
from arcor2_server.documents.document import Document, action_of
from arcor2_server.documents.logic import check_logic_item
from arcor2_server.errors import RequestRefused
from arcor2_server.rpc.editing import commit, drop_locks, require_free, require_held, tell, unlock
from arcor2_server.rpc.registry import Context, rpc


def _check_name(context: Context, name: str) -> None:
    if not name:
        raise InvalidData("The action needs a name.")
    require_free(context, Kind.ACTION, name, "an action")


@rpc("AddAction")
async def add_action(context: Context, args: AddActionArgs) -> None:
    """Add an action to an action point; parameters that have a default may be left out."""
    services = context.services
    document = services.session.require_project_open()
    async with services.locks.auto_skip_held(context.user, args.action_point_id):
        document.action_point(args.action_point_id)
        _check_name(context, args.name)
        action = Action(args.name, args.type, new_id("act"), list(args.parameters), list(args.flows))
        meta = action_meta(action, document, services.types)
        check_flows(action, meta)
        check_outputs_unique(document, action)
        action = complete_parameters(action, meta)
        check_parameters(action, meta, document, services.types)
        changes = [document.add(Kind.ACTION, action.id, action, args.action_point_id)]
        if await commit(context, changes):
            tell(context, changes, "ActionChanged", ChangeType.ADD, args.action_point_id)


@rpc("UpdateAction")
async def update_action(context: Context, args: UpdateActionArgs) -> None:
    """Replace parameters, flows or both of an action."""
    services = context.services
    document = services.session.require_project_open()
    _, action = document.action(args.action_id)
    meta = action_meta(action, document, services.types)
    updated = action
    if not isinstance(args.flows, Unset):
        updated = replace(updated, flows=list(args.flows))
        check_flows(updated, meta)
        check_outputs_unique(document, updated)
        _check_results_unneeded(document, action, updated)
    if not isinstance(args.parameters, Unset):
        updated = complete_parameters(replace(updated, parameters=list(args.parameters)), meta)
        check_parameters(updated, meta, document, services.types)
    require_held(context, action.id)
    changes = [document.update(Kind.ACTION, action.id, updated)]
    if await commit(context, changes):
        tell(context, changes, "ActionChanged", ChangeType.UPDATE)


def _check_results_unneeded(document: Document, before: Action, after: Action) -> None:
    """Refuse that results are no longer kept which a link or a condition uses."""
    if before.outputs() and not after.outputs() and (users := document.users_of(before.id)):
        user = users[0]
        who = f"The action {user.name}" if isinstance(user, Action) else "A condition of the logic"
        raise RequestRefused(f"{who} uses a result of {before.name}: its results have to keep names.")


@rpc("RenameAction")
async def rename_action(context: Context, args: RenameActionArgs) -> None:
    """Give an action another name."""
    document = context.services.session.require_project_open()
    _check_name(context, args.new_name)
    _, action = document.action(args.action_id)
    require_held(context, action.id)
    changes = [document.update(Kind.ACTION, action.id, replace(action, name=args.new_name))]
    if await commit(context, changes):
        unlock(context, action.id)
        tell(context, changes, "ActionChanged", ChangeType.UPDATE_BASE)


@rpc("RemoveAction")
async def remove_action(context: Context, args: RemoveActionArgs) -> None:
    """Remove an action; refused while another action needs it, or the logic does and its steps are not to go along."""
    services = context.services
    document = services.session.require_project_open()
    document.action(args.id)
    places = _beside(document, args.id) if args.with_steps else ()
    async with services.locks.auto_skip_held(context.user, args.id, *places):
        _, action = document.action(args.id)
        if not args.with_steps and (document.outgoing(action.id) or document.incoming(action.id)):
            raise RequestRefused(f"{action.name} is part of the logic: remove its steps first.")
        steps = [] if not args.with_steps else _taken_out(context, document, action)
        gone = {step.id for step in steps if step.after is None}
        for user in document.users_of(action.id):
            if isinstance(user, LogicItem) and user.id in gone:
                continue
            who = f"the action {user.name}" if isinstance(user, Action) else "a condition of the logic"
            raise RequestRefused(f"A result of {action.name} is used by {who}: change that first.")
        # The action first: what is undone is told by what it began with.
        if await commit(context, [document.remove(Kind.ACTION, action.id), *steps]):
            for step in steps:
                tell(
                    context, [step], "LogicItemChanged", ChangeType.REMOVE if step.after is None else ChangeType.UPDATE
                )
            context.emit("ActionChanged", BareAction(action.name, action.type, action.id), ChangeType.REMOVE)
            drop_locks(context, action.id)


def _beside(document: Document, action_id: str) -> set[str]:
    """Give the places of the logic from which steps lead to an action, and to which they lead from it."""
    before = {action_of(step.start) for step in document.incoming(action_id)}
    return before | {action_of(step.end) for step in document.outgoing(action_id)}


def _taken_out(context: Context, document: Document, action: Action) -> list[Change]:
    """Give what happens to the steps of an action that goes.

    Where one way alone leads on from it, in any case, what led to it leads there instead, as far as that is a step.
    """
    leaving = document.outgoing(action.id)
    changes = [document.remove(Kind.LOGIC, step.id) for step in leaving]
    on = leaving[0].end if len(leaving) == 1 and isinstance(leaving[0].condition, Unset) else None
    for step in document.incoming(action.id):
        instead = None if on is None else replace(step, end=on)
        if instead is not None and _is_step(context, document, instead):
            changes.append(document.update(Kind.LOGIC, step.id, instead))
        else:
            changes.append(document.remove(Kind.LOGIC, step.id))
    return changes


def _is_step(context: Context, document: Document, step: LogicItem) -> bool:
    try:
        check_logic_item(document, lambda action: action_meta(action, document, context.services.types), step)
    except InvalidData:
        return False
    return True
