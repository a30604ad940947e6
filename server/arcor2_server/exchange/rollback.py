"""Undoes the finished steps of an import if a later step fails."""

from collections.abc import Awaitable, Callable
from typing import Any

from arcor2_hw.client import ResourceNotFound
from arcor2_hw.exceptions import Arcor2Error


class Rollback:
    """The steps of an import with the calls that undo them. Undoing a step that was not done has no effect."""

    def __init__(self) -> None:
        self._done: list[tuple[str, Callable[[], Awaitable[Any]]]] = []

    def before_step(self, step: str, undo: Callable[[], Awaitable[Any]]) -> None:
        """Record a step before it is executed, because its outcome is unknown if its answer is lost."""
        self._done.append((step, undo))

    async def run(self) -> str:
        """Undo all steps in reverse order.

        Return sentences that name the undone steps and those that could not be undone.
        """
        results: dict[str, bool] = {}
        while self._done:
            what, undo = self._done.pop()
            succeeded = True
            try:
                await undo()
            except ResourceNotFound:
                pass  # the step was not done, or its parent is undone
            except Arcor2Error:
                succeeded = False
            results[what] = succeeded and results.get(what, True)
        undone = [what for what in reversed(results) if results[what]]
        failed = [what for what in reversed(results) if not results[what]]
        text = f"Undone: {', '.join(undone)}." if undone else ""
        if failed:
            text += f" Could not be undone: {', '.join(failed)}. Import the file again to replace it."
        return text.strip()
