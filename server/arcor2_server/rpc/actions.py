"""Requests that add, change and remove actions (protocol, 7.4 and 10.2, 10.3)."""

from msgspec.structs import replace

from arcor2_hw.data.base import Unset, new_id
from arcor2_hw.data.events import ChangeType
from arcor2_hw.data.project import Action, BareAction, LogicItem
from arcor2_hw.data.rpc import AddActionArgs, RemoveActionArgs, RenameActionArgs, UpdateActionArgs
from arcor2_hw.exceptions import InvalidData
from arcor2_server.collaboration.locks import Locks
from arcor2_server.documents import Session
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
from arcor2_server.object_types.registry import ObjectTypes
from arcor2_server.rpc.editing import Editing, emit_changes
from arcor2_server.rpc.registry import Context, rpc


def _check_results_unneeded(document: Document, before: Action, after: Action) -> None:
    """Refuse to remove results that a link or a condition uses."""
    if before.outputs() and not after.outputs() and (users := document.users_of(before.id)):
        user = users[0]
        who = f"The action {user.name}" if isinstance(user, Action) else "A condition of the logic"
        raise RequestRefused(
            "{device} uses a result of {name}: its results have to keep names.", device=who, name=before.name
        )


def _neighbours(document: Document, action_id: str) -> set[str]:
    """Return the places of the logic from which steps lead to an action, and to which they lead from it."""
    before = {action_of(step.start) for step in document.incoming(action_id)}
    return before | {action_of(step.end) for step in document.outgoing(action_id)}


class ActionRequests:
    """Requests that add, change and remove actions (protocol, 7.4 and 10.2, 10.3)."""

    def __init__(self, locks: Locks, types: ObjectTypes, session: Session, editing: Editing) -> None:
        self._locks = locks
        self._types = types
        self._session = session
        self._editing = editing

    def _check_name(self, context: Context, name: str) -> None:
        if not name:
            raise InvalidData("The action needs a name.")
        self._editing.require_free(context, Kind.ACTION, name, "an action")

    @rpc("AddAction")
    async def add_action(self, context: Context, args: AddActionArgs) -> None:
        """Add an action to an action point; parameters that have a default may be left out."""
        document = self._session.require_project_open()
        async with self._locks.auto_skip_held(context.user, args.action_point_id):
            document.action_point(args.action_point_id)
            self._check_name(context, args.name)
            action = Action(args.name, args.type, new_id("act"), list(args.parameters), list(args.flows))
            meta = action_meta(action, document, self._types)
            check_flows(action, meta)
            check_outputs_unique(document, action)
            action = complete_parameters(action, meta)
            check_parameters(action, meta, document, self._types)
            changes = [document.add(Kind.ACTION, action.id, action, args.action_point_id)]
            if await self._editing.commit(context, changes):
                emit_changes(context, changes, "ActionChanged", ChangeType.ADD, args.action_point_id)

    @rpc("UpdateAction")
    async def update_action(self, context: Context, args: UpdateActionArgs) -> None:
        """Replace parameters, flows or both of an action."""
        document = self._session.require_project_open()
        _, action = document.action(args.action_id)
        meta = action_meta(action, document, self._types)
        updated = action
        if not isinstance(args.flows, Unset):
            updated = replace(updated, flows=list(args.flows))
            check_flows(updated, meta)
            check_outputs_unique(document, updated)
            _check_results_unneeded(document, action, updated)
        if not isinstance(args.parameters, Unset):
            updated = complete_parameters(replace(updated, parameters=list(args.parameters)), meta)
            check_parameters(updated, meta, document, self._types)
        self._editing.require_held(context, action.id)
        changes = [document.update(Kind.ACTION, action.id, updated)]
        if await self._editing.commit(context, changes):
            emit_changes(context, changes, "ActionChanged", ChangeType.UPDATE)

    @rpc("RenameAction")
    async def rename_action(self, context: Context, args: RenameActionArgs) -> None:
        """Give an action another name."""
        document = self._session.require_project_open()
        self._check_name(context, args.new_name)
        _, action = document.action(args.action_id)
        self._editing.require_held(context, action.id)
        changes = [document.update(Kind.ACTION, action.id, replace(action, name=args.new_name))]
        if await self._editing.commit(context, changes):
            self._editing.unlock(context, action.id)
            emit_changes(context, changes, "ActionChanged", ChangeType.UPDATE_BASE)

    @rpc("RemoveAction")
    async def remove_action(self, context: Context, args: RemoveActionArgs) -> None:
        """Remove an action. Refuse while another action uses it, or the logic does without `with_steps`."""
        document = self._session.require_project_open()
        document.action(args.id)
        places = _neighbours(document, args.id) if args.with_steps else ()
        async with self._locks.auto_skip_held(context.user, args.id, *places):
            _, action = document.action(args.id)
            if not args.with_steps and (document.outgoing(action.id) or document.incoming(action.id)):
                raise RequestRefused("{name} is part of the logic: remove its steps first.", name=action.name)
            steps = [] if not args.with_steps else self._taken_out(context, document, action)
            gone = {step.id for step in steps if step.after is None}
            for user in document.users_of(action.id):
                if isinstance(user, LogicItem) and user.id in gone:
                    continue
                who = f"the action {user.name}" if isinstance(user, Action) else "a condition of the logic"
                raise RequestRefused(
                    "A result of {name} is used by {device}: change that first.", name=action.name, device=who
                )
            # The action first: what is undone is told by what it began with.
            if await self._editing.commit(context, [document.remove(Kind.ACTION, action.id), *steps]):
                for step in steps:
                    emit_changes(
                        context,
                        [step],
                        "LogicItemChanged",
                        ChangeType.REMOVE if step.after is None else ChangeType.UPDATE,
                    )
                context.emit("ActionChanged", BareAction(action.name, action.type, action.id), ChangeType.REMOVE)
                self._editing.drop_locks(context, action.id)

    def _taken_out(self, context: Context, document: Document, action: Action) -> list[Change]:
        """Return what happens to the steps of an action that goes.

        Where one way alone leads on from it, in any case, what led to it leads there instead, as far as that is a step.
        """
        leaving = document.outgoing(action.id)
        changes = [document.remove(Kind.LOGIC, step.id) for step in leaving]
        on = leaving[0].end if len(leaving) == 1 and isinstance(leaving[0].condition, Unset) else None
        for step in document.incoming(action.id):
            instead = None if on is None else replace(step, end=on)
            if instead is not None and self._is_step(context, document, instead):
                changes.append(document.update(Kind.LOGIC, step.id, instead))
            else:
                changes.append(document.remove(Kind.LOGIC, step.id))
        return changes

    def _is_step(self, context: Context, document: Document, step: LogicItem) -> bool:
        try:
            check_logic_item(document, lambda action: action_meta(action, document, self._types), step)
        except InvalidData:
            return False
        return True
