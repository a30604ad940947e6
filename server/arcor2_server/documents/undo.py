"""Determines the changes, locks and role that an undo needs, and the later edits that prevent it."""

from collections.abc import Iterable, Sequence
from typing import Final

from arcor2_hw.data.base import Unset
from arcor2_hw.data.project import END, START
from arcor2_hw.data.role import Role
from arcor2_hw.messages import Message
from arcor2_server.documents.changes import OF_SCENE, Change, Edit, EditKind, Kind, net
from arcor2_server.documents.checks.object_types import Types
from arcor2_server.documents.consistency import Inconsistent, check_consistent, title
from arcor2_server.documents.document import ROOTS, Document
from arcor2_server.documents.history import History
from arcor2_server.documents.item_indexes import OWNED, action_of
from arcor2_server.errors import RequestRefused


def inverse_changes(edits: Iterable[Edit]) -> list[Change]:
    """Return the changes that revert consecutive edits, given oldest first."""
    return [change.inverse() for change in net(change for edit in edits for change in edit.changes)]


def require_applicable(
    document: Document, changes: Sequence[Change], types: Types, history: History, after: int, user: str
) -> None:
    """Refuse changes that conflict with edits after number `after`.

    Raises:
        RequestRefused: There is a conflict; the message names the author of the later edit.
    """
    for change in changes:
        item = document.find(change.kind, change.id)
        if (None if item is None else item.value) != change.before:
            by = _author(history, {change.id}, after, user)
            raise RequestRefused(
                "{change} was removed since{by}." if item is None else "{change} was changed since{by}.",
                change=title(change),
                by=by,
            )
    try:
        check_consistent(document, changes, types)
    except Inconsistent as error:
        author = _author(history, error.ids, after, user)
        if not author:
            raise RequestRefused(error.message) from None
        raise RequestRefused("{reason} The later edit was made{author}.", reason=error, author=author) from None


def _author(history: History, ids: set[str], after: int, user: str) -> Message | str:
    """Return the author and number of the latest conflicting edit: ` by bob (edit 7)`; empty if there is none."""
    edit = history.last_change_of(ids, after=after, user=user)
    if edit is None:
        return ""
    if edit.kind is EditKind.EXTERNAL:
        text = " outside the editor, while the document was closed (edit {number})"
        return Message.of(text, number=edit.number)
    number = f"{edit.number}, {edit.request}" if edit.request else edit.number
    if edit.user == user:
        return Message.of(" by you (edit {number})", number=number)
    return Message.of(" by {user} (edit {number})", user=edit.user, number=number)


def role_for(changes: Iterable[Change]) -> Role:
    """Return the lowest role that may make such changes with the ordinary requests."""
    return max(map(_role_for, changes), default=Role.STANDARD_USER)


def _role_for(change: Change) -> Role:
    if change.kind in OF_SCENE:
        return Role.TECHNICIAN
    if change.kind is Kind.OVERRIDE:
        return Role.ADVANCED_USER
    if change.kind is Kind.PARAMETER and (change.before is None or change.after is None):
        return Role.ADVANCED_USER
    if change.kind is Kind.PROJECT and change.before.has_logic != change.after.has_logic:
        return Role.ADVANCED_USER
    return Role.STANDARD_USER


# ---------------------------------------------------------------------------------------------- locks
def ids_to_lock(document: Document, changes: Iterable[Change]) -> list[str]:
    """Return the existing ids that the ordinary requests for such changes lock."""
    found = dict.fromkeys(key for change in changes for key in _locked_ids(change))
    return [key for key in found if key in _OWN or any(document.find(kind, key) is not None for kind in _LOCKABLE)]


SCENE: Final = "SCENE"
PROJECT: Final = "PROJECT"
"""Ids that are locked while a scene or project as a whole is opened or closed (protocol, section 6)."""
_OWN = frozenset({SCENE, PROJECT, START, END})
_LOCKABLE = (*OWNED, *ROOTS, Kind.POINT)


def _locked_ids(change: Change) -> list[str]:
    values = [value for value in (change.before, change.after) if value is not None]
    match change.kind:
        case Kind.OBJECT | Kind.INTERLOCK:
            return [change.id if change.before is not None else SCENE]
        case Kind.PARAMETER | Kind.FUNCTION:
            return [change.id if change.before is not None else PROJECT]
        case Kind.POINT:
            parents = {value.parent for value in values if not isinstance(value.parent, Unset)}
            moved_to = [parent for parent in parents if len(values) > 1 and _parent_changes(change)]
            return [change.id if change.before is not None else PROJECT, *moved_to]
        case Kind.JOINTS:
            return [change.parent, change.id]
        case Kind.ORIENTATION | Kind.ACTION:
            return [change.id if change.before is not None else change.parent]
        case Kind.LOGIC:
            return [action_of(place) for value in values for place in (value.start, value.end)]
        case _:
            return [change.id]


def _parent_changes(change: Change) -> bool:
    return bool(change.before.parent != change.after.parent)


def moved_ids(document: Document, changes: Iterable[Change]) -> list[str]:
    """Return the ids of all items below action points whose position or parent the changes modify."""
    found: dict[str, None] = {}
    for change in changes:
        if change.kind is not Kind.POINT or change.before is None or change.after is None:
            continue
        if change.before.position != change.after.position or _parent_changes(change):
            found.update(dict.fromkeys(document.tree_of(change.id)))
    return list(found)
