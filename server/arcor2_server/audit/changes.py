"""Collects the changes that a request makes, for its entry in the audit trail."""

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Any, Final, Protocol


class Change(Protocol):
    """A changed item of a document."""

    @property
    def kind(self) -> str:
        """Kind of the item."""

    @property
    def id(self) -> str:
        """Id of the item."""

    @property
    def before(self) -> Any:
        """The item before the change, None if it was added."""

    @property
    def after(self) -> Any:
        """The item after the change, None if it was removed."""


_COLLECTED: Final[ContextVar[list[Change] | None]] = ContextVar("changes of the request", default=None)


@contextmanager
def collecting() -> Iterator[list[Change]]:
    """Collect the changes that are recorded in this task and in tasks that it starts."""
    changes: list[Change] = []
    token = _COLLECTED.set(changes)
    try:
        yield changes
    finally:
        _COLLECTED.reset(token)


def record(changes: Iterable[Change]) -> None:
    """Record changes that are on disk."""
    if (collected := _COLLECTED.get()) is not None:
        collected += changes
