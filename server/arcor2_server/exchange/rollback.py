"""Undoes the finished steps of an import if a later step fails."""

from collections.abc import Awaitable, Callable
from typing import Any

from arcor2_hw.client import NothingThere
from arcor2_hw.exceptions import Arcor2Error


class Rollback:
    """Each thing that is about to be done, with what takes it back; where it was not done, that does nothing."""

    def __init__(self) -> None:
        self._done: list[tuple[str, Callable[[], Awaitable[Any]]]] = []

    def before_step(self, what: str, undo: Callable[[], Awaitable[Any]]) -> None:
        """Note the next step, since its outcome is unknown if its answer is lost."""
        self._done.append((what, undo))

    async def run(self) -> str:
        """Undo all steps in reverse order; return a sentence that names what was undone, and what could not be."""
        undone: list[str] = []
        left: list[str] = []
        while self._done:
            what, undo = self._done.pop()
            try:
                await undo()
            except NothingThere:
                pass  # it was not done, or what it hangs on has gone
            except Arcor2Error:
                if what not in left:
                    left.append(what)
                continue
            if what not in undone:
                undone.append(what)
        told = []
        if undone := [what for what in reversed(undone) if what not in left]:
            told.append(f"Taken back: {', '.join(undone)}.")
        if left:
            told.append(f"Could not be taken back: {', '.join(reversed(left))}; to end it, import the file again.")
        return " ".join(told)
