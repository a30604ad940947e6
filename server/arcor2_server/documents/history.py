"""The latest edits of the open document, and which of them each user can undo."""

from collections import defaultdict, deque
from collections.abc import Iterator

from arcor2_server.documents.changes import Edit, EditKind


class History:
    """Edits with consecutive numbers, oldest first. The oldest is dropped if there are more than `limit`.

    An undo is an edit that reverts another one; a redo is an edit that reverts an undo.
    """

    def __init__(self, limit: int) -> None:
        self._edits: deque[Edit] = deque(maxlen=limit)
        self._undoable: defaultdict[str, deque[int]] = defaultdict(deque)
        self._redoable: defaultdict[str, deque[int]] = defaultdict(deque)
        self._taken_back: set[int] = set()

    def __iter__(self) -> Iterator[Edit]:
        return iter(self._edits)

    def __reversed__(self) -> Iterator[Edit]:
        return reversed(self._edits)

    def __len__(self) -> int:
        return len(self._edits)

    # ------------------------------------------------------------------------------------------ what is kept
    def append(self, edit: Edit) -> None:
        """Take in the next edit."""
        if self._edits and len(self._edits) == self._edits.maxlen:
            self._forget(self._edits[0])
        self._edits.append(edit)
        self._note(edit)

    def pop(self) -> Edit:
        """Remove the newest edit, which could not be stored."""
        edit = self._edits.pop()
        kept = list(self._edits)
        self.clear()
        for one in kept:
            self.append(one)
        return edit

    def clear(self) -> None:
        """Forget all: another document is opened."""
        self._edits.clear()
        self._undoable.clear()
        self._redoable.clear()
        self._taken_back.clear()

    def _note(self, edit: Edit) -> None:
        undoable, redoable = self._undoable[edit.user], self._redoable[edit.user]
        if edit.kind in (EditKind.UNDO, EditKind.REDO):
            self._taken_back.add(edit.target)
            source, target = (undoable, redoable) if edit.kind is EditKind.UNDO else (redoable, undoable)
            if edit.target in source:
                source.remove(edit.target)
            target.append(edit.number)
        else:
            undoable.append(edit.number)
            redoable.clear()

    def _forget(self, edit: Edit) -> None:
        self._taken_back.discard(edit.number)
        for numbers in (self._undoable[edit.user], self._redoable[edit.user]):
            if edit.number in numbers:
                numbers.remove(edit.number)

    # ------------------------------------------------------------------------------------------ what is asked
    def find(self, number: int) -> Edit | None:
        """Return an edit, None if it is not stored."""
        index = number - self._edits[0].number if self._edits else -1
        return self._edits[index] if 0 <= index < len(self._edits) else None

    def in_force(self, edit: Edit) -> bool:
        """Return whether an edit was not taken back."""
        return edit.number not in self._taken_back

    def undoable(self, user: str) -> Edit | None:
        """Return the latest edit of a user that is in force, and no undo itself."""
        numbers = self._undoable.get(user)
        return self.find(numbers[-1]) if numbers else None

    def redoable(self, user: str) -> Edit | None:
        """Return the latest undo of a user, if the user made no other edit after it."""
        numbers = self._redoable.get(user)
        return self.find(numbers[-1]) if numbers else None

    def can_undo(self, user: str, number: int) -> bool:
        """Return whether an edit is one of the user's that are in force, and no undo itself."""
        return number in self._undoable.get(user, ())

    def can_redo(self, user: str, number: int) -> bool:
        """Return whether an edit is an undo of the user without a later edit of the user."""
        return number in self._redoable.get(user, ())

    def since(self, number: int) -> list[Edit]:
        """Return the edits after one, oldest first."""
        found = []
        for edit in reversed(self._edits):
            if edit.number <= number:
                break
            found.append(edit)
        return found[::-1]

    def last_change_of(self, ids: set[str], *, after: int, user: str) -> Edit | None:
        """Return the latest edit after number `after` that changed any of the ids, preferably by another user."""
        own = None
        for edit in reversed(self.since(after)):
            if any(change.id in ids for change in edit.changes):
                if edit.user != user:
                    return edit
                own = own or edit
        return own
