"""Edges of digital points, debouncing, and listeners."""

import logging
from collections.abc import Callable

from arcor2_hw.data.base import Data, Timestamp, now

log = logging.getLogger(__name__)


class Edge(Data, frozen=True):
    """A digital point changed to `value`, at `stamp` (UTC) or `monotonic` (s)."""

    name: str
    value: bool
    stamp: Timestamp
    monotonic: float


Listener = Callable[[Edge], None]


class Debounced:
    """Debounce a digital point: a change counts after `debounce` s, the first value at once."""

    def __init__(self, name: str, debounce: float) -> None:
        self.name, self._debounce = name, debounce
        self.value: bool | None = None
        self._changed: tuple[float, Timestamp] | None = None

    def forget(self) -> None:
        """Forget the value, because changes may have been missed."""
        self.value = self._changed = None

    def take(self, raw: bool, at: float) -> Edge | None:
        """Process a sample taken at the time `at` (monotonic, s). Return the edge that it completes, or None."""
        if self.value is None:
            self.value = raw
            return None
        if raw == self.value:
            self._changed = None
            return None
        if self._changed is None:
            self._changed = (at, now())
        since, stamp = self._changed
        if at - since < self._debounce:
            return None
        self.value, self._changed = raw, None
        return Edge(name=self.name, value=raw, stamp=stamp, monotonic=since)


class EdgeListeners:
    """Call listeners on the thread that detects an edge. They must return quickly."""

    def __init__(self) -> None:
        self._all: tuple[tuple[str, Listener], ...] = ()

    def add(self, name: str, listener: Listener) -> Callable[[], None]:
        """Call `listener` with each edge of a point. Return the function that ends the subscription."""
        entry = (name, listener)
        self._all = (*self._all, entry)

        def end() -> None:
            self._all = tuple(each for each in self._all if each is not entry)

        return end

    def notify(self, edge: Edge) -> None:
        """Call the listeners of an edge. An error of a listener is logged and does not affect the others."""
        for name, listener in self._all:
            if name == edge.name:
                try:
                    listener(edge)
                except Exception:
                    log.exception("A listener of the point %s failed.", edge.name)
