"""Notifies observers of edits, and users of what they can undo and redo."""

import asyncio
from collections.abc import Callable, Sequence
from typing import Any, Final

from arcor2_hw.data.base import UNSET
from arcor2_hw.data.editor import HistoryChangedData, HistoryStep
from arcor2_hw.data.events import Event
from arcor2_server.documents import Session
from arcor2_server.documents.changes import Change, Edit, EditKind, Kind
from arcor2_server.documents.history import History
from arcor2_server.events import Connection, EventHub, encode, make_event

DELAY: Final = 0.005
"""Delay after an edit, s. Its answer and events are sent first, and successive edits cause one notification."""
AT_LATEST: Final = 0.1
"""Maximum delay while further edits arrive, s."""
NAME: Final = "HistoryChanged"


class EditNotifications:
    """Collects changes, and publishes to each subscriber of HistoryChanged what the user can undo and redo."""

    def __init__(self, hub: EventHub, session: Session) -> None:
        self.on_edit: list[Callable[[Sequence[Change]], None]] = []
        """Called at once with the changes of each edit."""
        self.on_pause: list[Callable[[Sequence[Change]], None]] = []
        """Called with all changes since the last call, after their own events were sent."""
        self._hub = hub
        self._session = session
        self._changes: list[Change] = []
        self._timer: asyncio.TimerHandle | None = None
        self._since = 0.0
        self._last = 0.0
        self._stored_revision = session.revision
        session.on_change.append(self._changed)

    def history_of(self, client: Connection) -> Event:
        """Return the event with what the user of a client can undo and redo."""
        return self._history(client.user)

    def close(self) -> None:
        """Cancel the pending notification."""
        if self._timer is not None:
            self._timer.cancel()

    def _changed(self, edit: Edit | None) -> None:
        loop = asyncio.get_running_loop()
        self._last = loop.time()
        self._stored_revision = self._session.revision if edit is None else edit.number
        if edit is not None:
            self._changes += edit.changes
            for notify in self.on_edit:
                notify(edit.changes)
        if self._timer is None:
            self._since = self._last
            self._timer = loop.call_later(DELAY, self._publish)

    def _publish(self) -> None:
        loop = asyncio.get_running_loop()
        busy = self._session.revision != self._stored_revision or loop.time() < self._last + DELAY
        if busy and loop.time() < self._since + AT_LATEST:
            self._timer = loop.call_later(DELAY, self._publish)
            return
        self._timer = None
        changes, self._changes = self._changes, []
        for notify in self.on_pause:
            notify(changes)
        events: dict[str | None, bytes] = {}
        for client in self._hub.subscribers(NAME):
            if client.user not in events:
                events[client.user] = encode(self._history(client.user))
            client.put_newest(NAME, events[client.user])

    def _history(self, user: str | None) -> Event:
        session = self._session
        undo: Any = UNSET
        redo: Any = UNSET
        if user is not None:
            if (edit := session.history.undoable(user)) is not None:
                undo = HistoryStep(edit.number, edit.request, sentence(_original(edit, session.history)))
            if (edit := session.history.redoable(user)) is not None:
                redo = HistoryStep(edit.number, edit.request, sentence(_original(edit, session.history)))
        return make_event(NAME, HistoryChangedData(session.revision, undo, redo))


# ---------------------------------------------------------------------------------------------- sentences
_WORDS: Final = {
    Kind.SCENE: "the scene",
    Kind.OBJECT: "the object",
    Kind.PROJECT: "the project",
    Kind.POINT: "the action point",
    Kind.ACTION: "the action",
    Kind.PARAMETER: "the parameter",
    Kind.ORIENTATION: "the orientation",
    Kind.JOINTS: "the joints",
    Kind.LOGIC: "a connection",
    Kind.OVERRIDE: "an override",
}
"""Kinds of item by importance: an edit of several kinds is named after the first of them."""
_BY_IMPORTANCE: Final = tuple(_WORDS)


def _original(edit: Edit, history: History) -> Edit:
    """Return the original edit of an undo or redo, as far as it is stored."""
    while edit.kind in (EditKind.UNDO, EditKind.REDO) and (found := history.find(edit.target)) is not None:
        edit = found
    return edit


def sentence(edit: Edit) -> str:
    """Describe an edit as text after `Undo` on a button: `moving the object gripper`.

    An undo is described by the edit that it reverted, which Redo would make again.
    """
    if edit.kind is EditKind.RESTORE:
        return f"going back to revision {edit.target}"
    changes = [change.inverse() for change in edit.changes] if edit.kind is EditKind.UNDO else edit.changes
    if not changes:
        return edit.request
    # Changes of less important kinds are consequences: joints of a moved action point become invalid.
    kind = min((change.kind for change in changes), key=_BY_IMPORTANCE.index)
    of_kind = [change for change in changes if change.kind is kind]
    first = of_kind[0]
    value = first.before if first.after is None else first.after
    name = getattr(value, "name", "")
    what = f"{_WORDS[kind]} {name}".rstrip()
    old, new = first.before, first.after
    if old is None or new is None:
        text = f"{'adding' if old is None else 'removing'} {what}"
    elif name and old.name != name:
        text = f"renaming {_WORDS[kind]} {old.name} to {name}"
    elif kind is Kind.POINT and old.parent != new.parent:
        text = f"changing the parent of {what}"
    elif any(getattr(old, field, None) != getattr(new, field, None) for field in ("pose", "position")):
        text = f"moving {what}"
    else:
        text = f"changing {what}"
    others = len({change.id for change in of_kind}) - 1
    # Action points below an action point move with it.
    return text + (f" and {others} more" if others and kind is not Kind.POINT else "")
