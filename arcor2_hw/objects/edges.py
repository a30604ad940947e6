"""Edges of digital points: debouncing, and listeners."""

import logging
from collections.abc import Callable, Iterable

from arcor2_hw.data.base import Data, Timestamp, now
from arcor2_hw.objects.small import IOPoint, PointKind

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

    def take(self, raw: bool, at: float, sampled: Timestamp | None = None) -> Edge | None:
        """Process a sample, and return the edge that it completes, or None.

        Args:
            raw: The value.
            at: Time of the sample on the monotonic clock, s.
            sampled: Time of the sample in UTC; None: now.
        """
        if self.value is None:
            self.value = raw
            return None
        if raw == self.value:
            self._changed = None
            return None
        if self._changed is None:
            self._changed = (at, sampled or now())
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


class DigitalPoints(EdgeListeners):
    """Debounced values of the digital points among some points, and listeners to their edges."""

    def __init__(self, points: Iterable[IOPoint]) -> None:
        super().__init__()
        digital = (point for point in points if point.kind is PointKind.DIGITAL)
        self._debounced = {point.name: Debounced(point.name, point.debounce) for point in digital}
        self._edges: list[Edge] = []
        self.names = tuple(self._debounced)

    def forget(self) -> None:
        """Forget all values, because changes may have been missed."""
        for point in self._debounced.values():
            point.forget()

    def value(self, name: str) -> bool | None:
        """Return the debounced value of a point; None before the first sample."""
        return self._debounced[name].value

    def shown(self, names: Iterable[str]) -> dict[str, float]:
        """Return 1 or 0 for each of some points whose value is known; see `Generic.shown_values`."""
        return {name: float(value) for name in names if (value := self.value(name)) is not None}

    def take(self, name: str, raw: bool, at: float, sampled: Timestamp | None = None) -> None:
        """Process a sample of a point; see `Debounced.take`. Call `notify_edges` afterwards."""
        if (edge := self._debounced[name].take(raw, at, sampled)) is not None:
            self._edges.append(edge)

    def notify_edges(self) -> None:
        """Call the listeners of the edges found so far."""
        edges, self._edges = self._edges, []
        for edge in edges:
            self.notify(edge)
