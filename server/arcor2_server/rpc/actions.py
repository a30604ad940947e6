"""Requests that add, change and remove actions (protocol, 7.4 and 10.2, 10.3)."""

from dataclasses import dataclass

from msgspec.structs import replace

from arcor2_hw.data.base import UNSET, Unset, new_id
from arcor2_hw.data.events import ChangeType
from arcor2_hw.data.project import Action, BareAction, Retry
from arcor2_hw.data.rpc import AddActionArgs, RemoveActionArgs, RenameActionArgs, UpdateActionArgs
from arcor2_hw.exceptions import InvalidData
from arcor2_server.collaboration.locks import Locks
from arcor2_server.documents import Session
from arcor2_server.documents.changes import Kind
from arcor2_server.documents.checks.actions import (
    action_meta,
    check_flows,
    check_outputs_unique,
    check_parameters,
    check_recursion,
    check_retry,
    check_stored,
    complete_parameters,
)
from arcor2_server.documents.checks.branches import check_branches
from arcor2_server.documents.removal import bypass, neighbours, require_results_unused, require_unused
from arcor2_server.errors import RequestRefused
from arcor2_server.object_types.registry import ObjectTypes
from arcor2_server.rpc.change_events import emit_functions
from arcor2_server.rpc.editing import Editing
from arcor2_server.rpc.registry import Context, rpc


def _given(retry: Retry | Unset) -> Retry | Unset:
    return UNSET if isinstance(retry, Unset) or retry.count == 0 else retry


@dataclass(frozen=True, slots=True)
class ActionRequests:
    """Requests that add, change and remove actions (protocol, 7.4 and 10.2, 10.3)."""

    _locks: Locks
    _types: ObjectTypes
    _session: Session
    _editing: Editing

    def _check_name(self, name: str) -> None:
        if not name:
            raise InvalidData("The action needs a name.")
        self._editing.require_name_free(Kind.ACTION, name, "an action")

    @rpc("AddAction")
    async def add_action(self, context: Context, args: AddActionArgs) -> None:
        """Add an action to an action point or a function. Parameters with a default value may be omitted."""
        document = self._session.require_project_open()
        async with self._locks.auto_skip_held(context.user, args.action_point_id):
            function = document.find_function(args.action_point_id)
            if function is None:
                document.action_point(args.action_point_id)
            self._check_name(args.name)
            action = Action(args.name, args.type, new_id("act"), list(args.parameters), list(args.flows))
            action = replace(action, error_output=args.error_output or UNSET, retry=_given(args.retry))
            meta = action_meta(action, document, self._types)
            check_branches(action, document)
            check_flows(action, meta)
            check_retry(action, meta)
            check_outputs_unique(document, action, "" if function is None else function.id)
            check_stored(document, action, meta, "" if function is None else function.id)
            action = complete_parameters(action, meta)
            check_parameters(action, meta, document, self._types, function)
            if function is not None:
                check_recursion(action, function, document)
            await self._editing.commit_one(context, document.add(Kind.ACTION, action.id, action, args.action_point_id))

    @rpc("UpdateAction")
    async def update_action(self, context: Context, args: UpdateActionArgs) -> None:
        """Replace the parameters, the flows, the name of the error or the retry of an action."""
        document = self._session.require_project_open()
        action = document.action(args.action_id)
        function = document.find_function(document.function_of(action.id))
        meta = action_meta(action, document, self._types)
        updated = action
        if not isinstance(args.flows, Unset):
            updated = replace(updated, flows=list(args.flows))
        if not isinstance(args.error_output, Unset):
            updated = replace(updated, error_output=args.error_output or UNSET)
        if not isinstance(args.retry, Unset):
            updated = replace(updated, retry=_given(args.retry))
        if updated is not action:
            check_flows(updated, meta)
            check_retry(updated, meta)
            check_outputs_unique(document, updated, "" if function is None else function.id)
            check_stored(document, updated, meta, "" if function is None else function.id)
            require_results_unused(document, action, updated)
        if not isinstance(args.parameters, Unset):
            updated = complete_parameters(replace(updated, parameters=list(args.parameters)), meta)
            check_parameters(updated, meta, document, self._types, function)
        self._editing.require_locked(context, action.id)
        await self._editing.commit_one(context, document.update(Kind.ACTION, action.id, updated))

    @rpc("RenameAction")
    async def rename_action(self, context: Context, args: RenameActionArgs) -> None:
        """Rename an action."""
        document = self._session.require_project_open()
        self._check_name(args.new_name)
        action = document.action(args.action_id)
        self._editing.require_locked(context, action.id)
        renamed = replace(action, name=args.new_name)
        change = document.update(Kind.ACTION, action.id, renamed)
        if await self._editing.commit(context, [change]):
            self._editing.unlock(context, action.id)
            if emit_functions(context, self._session, [change]):
                context.emit("ActionChanged", renamed, ChangeType.UPDATE_BASE)

    @rpc("RemoveAction")
    async def remove_action(self, context: Context, args: RemoveActionArgs) -> None:
        """Remove an action. Refuse while something else uses it.

        With `with_steps`, its logic items and the calls that it runs in parallel are removed, too.
        """
        document = self._session.require_project_open()
        calls = (document.action(args.id).branches or ()) if args.with_steps else ()
        places = neighbours(document, args.id) if args.with_steps else ()
        async with self._locks.auto_skip_held(context.user, args.id, *places, *calls):
            action = document.action(args.id)
            branches = [document.action(key) for key in (action.branches or ()) if args.with_steps]
            if not args.with_steps and (document.outgoing(action.id) or document.incoming(action.id)):
                raise RequestRefused("{name} is part of the logic: remove its steps first.", name=action.name)
            logic_changes = bypass(document, self._types, action) if args.with_steps else []
            removed = {change.id for change in logic_changes if change.after is None}
            for each in (action, *branches):
                require_unused(document, each, {*removed, action.id, *(one.id for one in branches)})
            # The action comes first, since the history names an edit by its first change.
            changes = [document.remove(Kind.ACTION, each.id) for each in (action, *branches)] + logic_changes
            if await self._editing.commit(context, changes):
                if emit_functions(context, self._session, changes):
                    for change in logic_changes:
                        if change.after is None:
                            context.emit("LogicItemChanged", change.before, ChangeType.REMOVE)
                        else:
                            context.emit("LogicItemChanged", change.after, ChangeType.UPDATE)
                    for each in (action, *branches):
                        context.emit("ActionChanged", BareAction(each.name, each.type, each.id), ChangeType.REMOVE)
                self._editing.drop_locks(context, action.id, *calls)
