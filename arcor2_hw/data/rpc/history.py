"""Arguments and answers of Undo, Redo, RestoreRevision and History (docs/protocol.md)."""

from typing import Annotated

from msgspec import Meta

from arcor2_hw.data.base import UNSET, Data, Timestamp, Unset


class UndoArgs(Data, frozen=True):
    """Arguments of Undo: which edit of the caller, else his latest one in force."""

    number: int | Unset = UNSET


class RedoArgs(Data, frozen=True):
    """Arguments of Redo: which undo of the caller, else his latest one."""

    number: int | Unset = UNSET


class UndoData(Data, frozen=True):
    """What Undo and Redo answer: the edit that was taken back, what had made it, and the revision there is now."""

    number: int
    request: str
    revision: int


class RestoreRevisionArgs(Data, frozen=True):
    """Arguments of RestoreRevision: the document as it was after the edit of that number."""

    revision: int


class RestoreRevisionData(Data, frozen=True):
    """What RestoreRevision answers: the revision there is now."""

    revision: int


class HistoryArgs(Data, frozen=True):
    """Arguments of History: at most so many edits, the newest ones before that number."""

    limit: Annotated[int, Meta(ge=0, le=1000)] = 100
    before: int | Unset = UNSET


class HistoryItem(Data, frozen=True):
    """One thing that an edit touched; `name` is empty for what has none."""

    kind: str
    id: str
    name: str
    change: str


class HistoryEdit(Data, frozen=True):
    """One edit. `of` is what an undo or redo took back, or the revision that was restored."""

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
    """What History answers: the revision there is, the oldest one that can be restored, and edits, newest first.

    `undo` and `redo` are the edits that these requests of the caller would take back.
    """

    revision: int
    oldest: int
    edits: list[HistoryEdit]
    undo: int | Unset = UNSET
    redo: int | Unset = UNSET
