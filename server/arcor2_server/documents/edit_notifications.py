"""Notifies observers of edits, and users of the edits that they can undo and redo."""

import asyncio
from collections.abc import Callable, Sequence
from typing import Any, Final

from arcor2_hw.data.base import UNSET
from arcor2_hw.data.editor import HistoryChangedData, HistoryStep
from arcor2_hw.data.events import Event
from arcor2_hw.messages import Message, translatable
from arcor2_server.documents import Session
from arcor2_server.documents.changes import Change, Edit, EditKind, Kind, net
from arcor2_server.documents.history import History
from arcor2_server.events import Connection, EventHub, encode, make_event

DELAY: Final = 0.005
"""Delay after an edit, s. Its answer and events are sent first, and successive edits cause one notification."""
MAX_DELAY: Final = 0.1
"""Maximum delay while further edits arrive, s."""
NAME: Final = "HistoryChanged"


class EditNotifications:
    """Collects changes, and publishes to subscribers of HistoryChanged the edits that the user can undo and redo."""

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
        """Return the event with the edits that the user of a client can undo and redo."""
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
        if busy and loop.time() < self._since + MAX_DELAY:
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
                undo = _step(edit, session.history)
            if (edit := session.history.redoable(user)) is not None:
                redo = _step(edit, session.history)
        return make_event(NAME, HistoryChangedData(session.revision, undo, redo))


# ---------------------------------------------------------------------------------------------- labels
_ITEMS: Final = translatable(
    {
        Kind.SCENE: "the scene {name}",
        Kind.OBJECT: "the object {name}",
        Kind.INTERLOCK: "the interlock {name}",
        Kind.PROJECT: "the project {name}",
        Kind.FUNCTION: "the function {name}",
        Kind.POINT: "the action point {name}",
        Kind.ACTION: "the action {name}",
        Kind.PARAMETER: "the parameter {name}",
        Kind.ORIENTATION: "the orientation {name}",
        Kind.JOINTS: "the joints {name}",
        Kind.LOGIC: "a connection",
        Kind.OVERRIDE: "an override",
    }
)
"""Kinds of item by importance: an edit of several kinds is named after the first of them."""
_OF_EDIT: Final = tuple(_ITEMS)
_OF_STEP: Final = (Kind.ACTION, *_OF_EDIT)
"""The order for a step of several edits: the service object and the point of an action are added with it."""


def _step(edit: Edit, history: History) -> HistoryStep:
    text = label(edit, history)
    return HistoryStep(edit.number, edit.request, str(text), **text.translation())


def _original(edit: Edit, history: History) -> Edit:
    """Return the original edit of an undo or redo, as far as it is stored."""
    while edit.kind in (EditKind.UNDO, EditKind.REDO) and (found := history.find(edit.target)) is not None:
        edit = found
    return edit


def label(edit: Edit, history: History) -> Message:
    """Describe what an undo or redo of an edit and its step reverts, as text after `Undo`: `moving the object gripper`.

    An undo is described by the edit that it reverted, which Redo would make again.
    """
    edit = _original(edit, history)
    if edit.kind is EditKind.RESTORE:
        return Message.of("going back to revision {revision}", revision=edit.target)
    step = history.step(edit)
    if len(step) > 1:
        return _described(net(change for each in step for change in each.changes), _OF_STEP, edit)
    changes = [change.inverse() for change in edit.changes] if edit.kind is EditKind.UNDO else edit.changes
    return _described(changes, _OF_EDIT, edit)


def _described(changes: Sequence[Change], importance: Sequence[Kind], edit: Edit) -> Message:
    if not changes:
        return Message.of("{request}", request=edit.request)
    # Changes of less important kinds are consequences: joints of a moved action point become invalid.
    kind = min((change.kind for change in changes), key=importance.index)
    of_kind = [change for change in changes if change.kind is kind]
    old, new = of_kind[0].before, of_kind[0].after
    name = getattr(old if new is None else new, "name", "")
    item = Message.of(_ITEMS[kind], name=name)
    if old is None:
        done = Message.of("adding {item}", item=item)
    elif new is None:
        done = Message.of("removing {item}", item=item)
    elif name and old.name != name:
        done = Message.of("renaming {item} to {name}", item=Message.of(_ITEMS[kind], name=old.name), name=name)
    elif kind is Kind.POINT and old.parent != new.parent:
        done = Message.of("changing the parent of {item}", item=item)
    elif any(getattr(old, field, None) != getattr(new, field, None) for field in ("pose", "position")):
        done = Message.of("moving {item}", item=item)
    else:
        done = Message.of("changing {item}", item=item)
    others = len({change.id for change in of_kind}) - 1
    # Action points below an action point move with it.
    return Message.of("{done} and {count} more", done=done, count=others) if others and kind is not Kind.POINT else done
