"""Requests that read and edit the script of the open project (docs/protocol/programs.md)."""

from collections.abc import Sequence
from dataclasses import dataclass

from arcor2_hw.data.project import END, START
from arcor2_hw.data.rpc import (
    CheckScriptData,
    HistoryItem,
    ImportScriptData,
    ProjectScriptData,
    ScriptArgs,
    ScriptProblem,
)
from arcor2_hw.exceptions import Arcor2Error
from arcor2_server.build.script_editing import ScriptEditing
from arcor2_server.documents import Session
from arcor2_server.documents.changes import Change, EditKind, Kind
from arcor2_server.documents.item_indexes import action_of
from arcor2_server.documents.undo import role_for
from arcor2_server.errors import RequestRefused
from arcor2_server.online.undo import Undo
from arcor2_server.rpc.change_events import emit_all
from arcor2_server.rpc.editing import Editing
from arcor2_server.rpc.registry import Context, rpc


@dataclass(frozen=True, slots=True)
class ScriptRequests:
    """Requests that read and edit the script of the open project (docs/protocol/programs.md)."""

    _session: Session
    _undo: Undo
    _scripts: ScriptEditing
    _editing: Editing

    @rpc("ProjectScript")
    async def project_script(self, context: Context, args: None) -> ProjectScriptData:
        """Return the script of the open project with its unsaved changes."""
        found = await self._scripts.script()
        return ProjectScriptData(found.revision, found.source, found.generated)

    @rpc("CheckScript")
    async def check_script(self, context: Context, args: ScriptArgs) -> CheckScriptData:
        """Check an edited script without importing it."""
        self._session.require_project_open()
        try:
            changes = await self._changes(context, args)
            if changes:
                await self._undo.apply(
                    context.user, changes, args.revision, context.request, EditKind.EDIT, dry_run=True
                )
        except Arcor2Error as error:
            return CheckScriptData(self._session.revision, context.translatable([_problem(error, args.script)]), [])
        return CheckScriptData(self._session.revision, [], self._described(changes))

    @rpc("ImportScript")
    async def import_script(self, context: Context, args: ScriptArgs) -> ImportScriptData:
        """Import an edited script into the open project, as one edit."""
        session = self._session
        changes = await self._changes(context, args)
        described = self._described(changes)
        if not changes:
            return ImportScriptData(session.revision, [])
        async with self._undo.locked(context.user, changes):
            revision = await self._undo.apply(
                context.user, changes, args.revision, context.request, EditKind.EDIT, dry_run=context.dry_run
            )
        if not context.dry_run:
            emit_all(context, session, changes)
            self._editing.drop_locks(context, *(change.id for change in changes if change.after is None))
        return ImportScriptData(revision, described)

    async def _changes(self, context: Context, args: ScriptArgs) -> list[Change]:
        changes = await self._scripts.changes(args.script, args.revision)
        needed = role_for(changes)
        if context.client.role < needed:
            raise RequestRefused("These changes need the role {name} or a higher one.", name=needed.shown)
        return changes

    def _described(self, changes: Sequence[Change]) -> list[HistoryItem]:
        """Return the changed items. The name of a logic item is that of its two actions."""
        added = {change.id: change.after.name for change in changes if change.kind is Kind.ACTION and change.after}

        def place(end: str) -> str:
            key = action_of(end)
            return key if key in (START, END) else added.get(key) or self._session.name_of(key)

        def described(change: Change) -> HistoryItem:
            value = change.before if change.after is None else change.after
            name = f"{place(value.start)} → {place(value.end)}" if change.kind is Kind.LOGIC else value.name
            how = "remove" if change.after is None else "add" if change.before is None else "update"
            return HistoryItem(change.kind.value, change.id, name, how)

        return [described(change) for change in changes]


def _problem(error: Arcor2Error, source: str) -> ScriptProblem:
    from arcor2_server.build.reading import NotUnderstood  # not needed for the start of the server

    if not isinstance(error, NotUnderstood):
        return ScriptProblem(error.message.text, **error.message.translation())
    lines = source.splitlines()
    line = lines[error.line - 1] if error.line <= len(lines) else ""
    column = len(line) - len(line.lstrip()) + 1
    if isinstance(error.__cause__, SyntaxError) and error.__cause__.offset:
        column = error.__cause__.offset
    return ScriptProblem(error.problem.text, error.line, column, **error.problem.translation())
