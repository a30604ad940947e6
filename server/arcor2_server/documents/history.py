"""The latest edits of the open document; determines which edits each user can undo."""

import itertools
from collections import defaultdict, deque
from collections.abc import Iterable, Iterator

from arcor2_server.documents.changes import Change, Edit, EditKind


class History:
    """Edits with consecutive numbers, oldest first. The oldest are dropped if there are more than `limit`.

    An undo is an edit that reverts another one; a redo is an edit that reverts an undo. Edits caused by one action
    of the user form a step: they are undone together. The number of the step is that of its first edit.
    """

    def __init__(self, limit: int) -> None:
        self._edits: deque[Edit] = deque(maxlen=limit)
        self._undoable: defaultdict[str, deque[int]] = defaultdict(deque)
        self._redoable: defaultdict[str, deque[int]] = defaultdict(deque)
        self._reverted: set[int] = set()
        self._latest_step: dict[str, tuple[str, int]] = {}
        """Name and number of the latest named step of each user."""

    def __iter__(self) -> Iterator[Edit]:
        return iter(self._edits)

    def __reversed__(self) -> Iterator[Edit]:
        return reversed(self._edits)

    def __len__(self) -> int:
        return len(self._edits)

    # ------------------------------------------------------------------------------------------ changes
    def append(self, edit: Edit, step: str = "") -> None:
        """Append the next edit. Later edits with the same step name continue its step."""
        if self._edits and len(self._edits) == self._edits.maxlen:
            self._remove_from_lists(self._edits[0])
        self._edits.append(edit)
        undoable, redoable = self._undoable[edit.user], self._redoable[edit.user]
        if edit.kind in (EditKind.UNDO, EditKind.REDO):
            self._reverted.add(edit.target)
            source, target = (undoable, redoable) if edit.kind is EditKind.UNDO else (redoable, undoable)
            if edit.target in source:
                source.remove(edit.target)
            target.append(edit.number)
        else:
            if not (edit.kind is EditKind.EDIT and edit.target in undoable):
                undoable.append(edit.number)
            redoable.clear()
        if step:
            self._latest_step[edit.user] = step, edit.target or edit.number

    def pop(self) -> Edit:
        """Remove and return the newest edit."""
        edit = self._edits.pop()
        edits = list(self._edits)
        self.clear()
        for remaining in edits:
            self.append(remaining)
        return edit

    def clear(self) -> None:
        """Remove all edits."""
        self._edits.clear()
        self._undoable.clear()
        self._redoable.clear()
        self._reverted.clear()
        self._latest_step.clear()

    def _remove_from_lists(self, edit: Edit) -> None:
        self._reverted.discard(edit.number)
        for numbers in (self._undoable[edit.user], self._redoable[edit.user]):
            if edit.number in numbers:
                numbers.remove(edit.number)

    # ------------------------------------------------------------------------------------------ queries
    def find(self, number: int) -> Edit | None:
        """Return an edit, None if it is not stored."""
        index = number - self._edits[0].number if self._edits else -1
        return self._edits[index] if 0 <= index < len(self._edits) else None

    def in_force(self, edit: Edit) -> bool:
        """Return whether an edit is not reverted."""
        step = edit.target if edit.kind is EditKind.EDIT else 0
        return edit.number not in self._reverted and step not in self._reverted

    def step(self, edit: Edit) -> list[Edit]:
        """Return the edits of the step that an edit starts, oldest first."""
        later = self.since(edit.number) if edit.kind is EditKind.EDIT else []
        return [edit, *(each for each in later if each.kind is EditKind.EDIT and each.target == edit.number)]

    def start_of_step(self, user: str, step: str, changes: Iterable[Change]) -> int:
        """Return the number of the step that an edit continues, 0 if it starts a new one.

        An edit starts a new step if the step was undone or dropped, or if another edit has changed one of the items
        since then.
        """
        name, number = self._latest_step.get(user, ("", 0))
        if name != step or not self.can_undo(user, number):
            return 0
        ids = {change.id for change in changes}
        others = (edit for edit in self.since(number) if edit.target != number or edit.kind is not EditKind.EDIT)
        return 0 if any(change.id in ids for edit in others for change in edit.changes) else number

    def undoable(self, user: str) -> Edit | None:
        """Return the latest edit of a user that is in force and is not an undo."""
        numbers = self._undoable.get(user)
        return self.find(numbers[-1]) if numbers else None

    def redoable(self, user: str) -> Edit | None:
        """Return the latest undo of a user, unless the user made another edit after it."""
        numbers = self._redoable.get(user)
        return self.find(numbers[-1]) if numbers else None

    def can_undo(self, user: str, number: int) -> bool:
        """Return whether an edit of the user is in force and is not an undo."""
        return number in self._undoable.get(user, ())

    def can_redo(self, user: str, number: int) -> bool:
        """Return whether an edit is an undo of the user, who made no other edit after it."""
        return number in self._redoable.get(user, ())

    def since(self, number: int) -> list[Edit]:
        """Return the edits with a higher number, oldest first."""
        later = itertools.takewhile(lambda edit: edit.number > number, reversed(self._edits))
        return list(later)[::-1]

    def last_change_of(self, ids: set[str], *, after: int, user: str) -> Edit | None:
        """Return the latest edit after number `after` that changed any of the ids, preferably by another user."""
        found = [edit for edit in self.since(after) if any(change.id in ids for change in edit.changes)]
        of_others = [edit for edit in found if edit.user != user]
        return next(reversed(of_others or found), None)
