"""Arguments and answers of Undo, Redo, RestoreRevision and History."""

from typing import Annotated, Final

from msgspec import Meta

from arcor2_hw.data.base import UNSET, Data, Timestamp, Unset
from arcor2_hw.data.role import Role
from arcor2_hw.data.rpc.envelope import Rpc


class UndoArgs(Data, frozen=True):
    """Arguments of Undo: the edit of the caller, by default the latest one in effect."""

    number: int | Unset = UNSET


class RedoArgs(Data, frozen=True):
    """Arguments of Redo: the undo of the caller, by default the latest one."""

    number: int | Unset = UNSET


class UndoData(Data, frozen=True):
    """Answer to Undo and Redo: the reverted edit, the request that made it, and the new revision."""

    number: int
    request: str
    revision: int


class RestoreRevisionArgs(Data, frozen=True):
    """Arguments of RestoreRevision: the number of the edit after which the document is restored."""

    revision: int


class RestoreRevisionData(Data, frozen=True):
    """Answer to RestoreRevision: the new revision."""

    revision: int


class HistoryArgs(Data, frozen=True):
    """Arguments of History: maximum number, number before which edits are listed."""

    limit: Annotated[int, Meta(ge=0, le=1000)] = 100
    before: int | Unset = UNSET


class HistoryItem(Data, frozen=True):
    """One item changed by an edit; `name` is empty for items without a name."""

    kind: str
    id: str
    name: str
    change: str


class HistoryEdit(Data, frozen=True):
    """One edit. `of` is the edit that an undo or redo reverted or that started the step, or the restored revision."""

    number: int
    time: Timestamp
    user: str
    request: str
    how: str
    in_force: bool
    items: list[HistoryItem]
    touched: int
    of: int | Unset = UNSET


class HistoryData(Data, frozen=True):
    """Answer to History: the present revision, the oldest one that can be restored, and edits, newest first.

    `undo` and `redo` are the edits that these requests of the caller would revert.
    """

    revision: int
    oldest: int
    edits: list[HistoryEdit]
    undo: int | Unset = UNSET
    redo: int | Unset = UNSET


HISTORY_RPCS: Final = (
    Rpc("History", HistoryArgs, HistoryData, Role.OPERATOR, args_optional=True, additional=True),
    Rpc("Redo", RedoArgs, UndoData, Role.STANDARD_USER, args_optional=True, dry_run=True, additional=True),
    Rpc("RestoreRevision", RestoreRevisionArgs, RestoreRevisionData, Role.STANDARD_USER, dry_run=True, additional=True),
    Rpc("Undo", UndoArgs, UndoData, Role.STANDARD_USER, args_optional=True, dry_run=True, additional=True),
)
"""Requests about the history of edits."""
