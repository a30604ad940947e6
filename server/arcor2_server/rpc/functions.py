"""Requests about the functions of the open project (docs/protocol/programs.md)."""

from collections.abc import Sequence
from dataclasses import dataclass

from msgspec.structs import replace

from arcor2_hw.data.base import Unset, new_id
from arcor2_hw.data.project import ProjectFunction
from arcor2_hw.data.rpc import (
    AddFunctionArgs,
    AddFunctionData,
    AddFunctionParameterArgs,
    AddFunctionResultArgs,
    DissolveCallArgs,
    DissolveCallData,
    DissolveParallelArgs,
    FunctionExport,
    IdArgs,
    ImportFunctionArgs,
    ImportFunctionData,
    MakeFunctionArgs,
    MakeFunctionData,
    MakeParallelArgs,
    MakeParallelData,
    RemoveFunctionParameterArgs,
    RemoveFunctionResultArgs,
    RenameFunctionArgs,
    UpdateFunctionParameterArgs,
    UpdateFunctionResultArgs,
    UpdateParallelArgs,
)
from arcor2_server.documents import Session
from arcor2_server.documents.changes import Change, EditKind, Kind
from arcor2_server.documents.function_calls import changes_to_remove, dissolve_call
from arcor2_server.documents.function_exchange import export_function, import_function
from arcor2_server.documents.function_signature import (
    add_parameter,
    add_result,
    remove_parameter,
    remove_result,
    update_parameter,
    update_result,
)
from arcor2_server.documents.functions import make_function
from arcor2_server.documents.parallel_work import dissolve_parallel, make_parallel
from arcor2_server.documents.removal import require_unused
from arcor2_server.errors import RequestRefused
from arcor2_server.object_types.registry import ObjectTypes
from arcor2_server.online.undo import Undo
from arcor2_server.rpc.change_events import emit_all
from arcor2_server.rpc.editing import Editing
from arcor2_server.rpc.registry import Context, rpc


@dataclass(frozen=True, slots=True)
class FunctionRequests:
    """Requests about the functions of the open project (docs/protocol/programs.md).

    Each request is one edit. Its result is checked by the rules that also apply to an undo.
    """

    _types: ObjectTypes
    _session: Session
    _undo: Undo
    _editing: Editing

    async def _edit(self, context: Context, changes: Sequence[Change]) -> None:
        """Commit changes of the present document as one edit, with the locks of the ordinary requests, and publish it.

        Raises:
            RequestRefused: the project would not be consistent, or others have edited it meanwhile.
            Locked: another user holds a lock.
        """
        revision = self._session.revision
        async with self._undo.locked(context.user, changes):
            await self._undo.apply(
                context.user,
                changes,
                revision,
                context.request,
                EditKind.EDIT,
                dry_run=context.dry_run,
                step=context.step,
            )
        if not context.dry_run:
            emit_all(context, self._session, changes)
            self._editing.drop_locks(context, *(change.id for change in changes if change.after is None))

    # ---------------------------------------------------------------------------------------------- functions
    @rpc("MakeFunction")
    async def make_function(self, context: Context, args: MakeFunctionArgs) -> MakeFunctionData:
        """Move connected actions into a new function, and call it in their place."""
        document = self._session.require_project_open()
        call_name = "" if isinstance(args.call_name, Unset) else args.call_name
        changes, function_id, call_id = make_function(document, self._types, args.name, args.action_ids, call_name)
        await self._edit(context, changes)
        return MakeFunctionData(function_id, call_id)

    @rpc("DissolveCall")
    async def dissolve_call(self, context: Context, args: DissolveCallArgs) -> DissolveCallData:
        """Replace a call by copies of the actions of its function."""
        document = self._session.require_project_open()
        changes, ids = dissolve_call(document, args.action_id, remove_function=args.remove_function)
        await self._edit(context, changes)
        return DissolveCallData(ids)

    # ---------------------------------------------------------------------------------------------- parallel work
    @rpc("MakeParallel")
    async def make_parallel(self, context: Context, args: MakeParallelArgs) -> MakeParallelData:
        """Let calls that follow each other, or are not connected, run at once."""
        document = self._session.require_project_open()
        changes, action_id = make_parallel(document, args.name, args.action_ids)
        await self._edit(context, changes)
        return MakeParallelData(action_id)

    @rpc("UpdateParallel")
    async def update_parallel(self, context: Context, args: UpdateParallelArgs) -> None:
        """Change the calls that a parallel action runs at once. A call whose results are used cannot be left out."""
        document = self._session.require_project_open()
        action = document.action(args.action_id)
        for left_out in set(action.branches or ()).difference(args.branches):
            require_unused(document, document.action(left_out), {action.id})
        await self._edit(
            context, [document.update(Kind.ACTION, action.id, replace(action, branches=list(args.branches)))]
        )

    @rpc("DissolveParallel")
    async def dissolve_parallel(self, context: Context, args: DissolveParallelArgs) -> None:
        """Let the calls of a parallel action run one after the other in its place."""
        document = self._session.require_project_open()
        await self._edit(context, dissolve_parallel(document, args.action_id))

    # ---------------------------------------------------------------------------------------------- functions
    @rpc("AddFunction")
    async def add_function(self, context: Context, args: AddFunctionArgs) -> AddFunctionData:
        """Add a function without actions."""
        document = self._session.require_project_open()
        function = ProjectFunction(args.name, id=new_id("pfu"))
        await self._edit(context, document.changes_to_add(function))
        return AddFunctionData(function.id)

    @rpc("RenameFunction")
    async def rename_function(self, context: Context, args: RenameFunctionArgs) -> None:
        """Rename a function."""
        document = self._session.require_project_open()
        renamed = replace(document.function(args.function_id), name=args.new_name, actions=[], logic=[])
        await self._edit(context, [document.update(Kind.FUNCTION, renamed.id, renamed)])

    @rpc("RemoveFunction")
    async def remove_function(self, context: Context, args: IdArgs) -> None:
        """Remove a function with its actions. Refuse while an action calls it."""
        document = self._session.require_project_open()
        function = document.function(args.id)
        for call in document.calls_of(args.id):
            raise RequestRefused(
                "{call} calls the function {name}. Remove or dissolve the call first.",
                call=call.name,
                name=function.name,
            )
        await self._edit(context, changes_to_remove(document, args.id))

    # ---------------------------------------------------------------------------------------------- parameters
    @rpc("AddFunctionParameter")
    async def add_parameter(self, context: Context, args: AddFunctionParameterArgs) -> None:
        """Add a parameter to a function and its calls."""
        document = self._session.require_project_open()
        await self._edit(context, add_parameter(document, args.function_id, args.name, args.type, args.value))

    @rpc("UpdateFunctionParameter")
    async def update_parameter(self, context: Context, args: UpdateFunctionParameterArgs) -> None:
        """Rename a parameter of a function, change its type, or its value in the present calls."""
        document = self._session.require_project_open()
        changes = update_parameter(document, args.function_id, args.name, args.new_name, args.type, args.value)
        await self._edit(context, changes)

    @rpc("RemoveFunctionParameter")
    async def remove_parameter(self, context: Context, args: RemoveFunctionParameterArgs) -> None:
        """Remove a parameter from a function and its calls. Refuse while an action of the function uses it."""
        document = self._session.require_project_open()
        await self._edit(context, remove_parameter(document, args.function_id, args.name))

    # ---------------------------------------------------------------------------------------------- results
    @rpc("AddFunctionResult")
    async def add_result(self, context: Context, args: AddFunctionResultArgs) -> None:
        """Add a result to a function and its calls."""
        document = self._session.require_project_open()
        await self._edit(context, add_result(document, self._types, args.function_id, args.link))

    @rpc("UpdateFunctionResult")
    async def update_result(self, context: Context, args: UpdateFunctionResultArgs) -> None:
        """Replace a result of a function by another result of its actions."""
        document = self._session.require_project_open()
        await self._edit(context, update_result(document, self._types, args.function_id, args.index, args.link))

    @rpc("RemoveFunctionResult")
    async def remove_result(self, context: Context, args: RemoveFunctionResultArgs) -> None:
        """Remove a result from a function and its calls. Refuse while it is used."""
        document = self._session.require_project_open()
        await self._edit(context, remove_result(document, args.function_id, args.index))

    # ---------------------------------------------------------------------------------------------- exchange
    @rpc("ExportFunction")
    async def export_function(self, context: Context, args: IdArgs) -> FunctionExport:
        """Return a function with the items to which its actions refer."""
        return export_function(self._session.require_project_open(), args.id)

    @rpc("ImportFunction")
    async def import_function(self, context: Context, args: ImportFunctionArgs) -> ImportFunctionData:
        """Add exported functions to the open project."""
        document = self._session.require_project_open()
        changes, ids = import_function(document, args.function, args.points or {})
        await self._edit(context, changes)
        return ImportFunctionData(ids)
