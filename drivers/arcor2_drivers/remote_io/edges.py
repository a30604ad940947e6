"""Edges of digital points: debounced, and told to whoever subscribed. Pure but for the calls to subscribers."""

import logging
from collections.abc import Callable
from typing import NamedTuple

from arcor2_hw.data.base import Data, Timestamp, now

log = logging.getLogger(__name__)


class Edge(Data, frozen=True):
    """A digital point has changed: to `value`, first seen at `stamp` (UTC) or `monotonic` (s)."""

    name: str
    value: bool
    stamp: Timestamp
    monotonic: float


Listener = Callable[[Edge], None]


class Debounced:
    """A digital point whose value counts when it has stood for `debounce` s; the first one counts at once."""

    def __init__(self, name: str, debounce: float) -> None:
        self.name, self._debounce = name, debounce
        self.value: bool | None = None
        self._changed: tuple[float, Timestamp] | None = None

    def forget(self) -> None:
        """Begin anew: what happened meanwhile is not known."""
        self.value = self._changed = None

    def take(self, raw: bool, at: float) -> Edge | None:
        """Take a sample of the monotonic time `at`; give the edge that it completes."""
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


class _Subscription(NamedTuple):
    name: str
    listener: Listener


class Subscriptions:
    """Who wants to hear of which point. A listener is called on the observing thread and has to be quick."""

    def __init__(self) -> None:
        self._all: tuple[_Subscription, ...] = ()

    def add(self, name: str, listener: Listener) -> Callable[[], None]:
        """Subscribe; what is given back ends it."""
        subscription = _Subscription(name, listener)
        self._all = (*self._all, subscription)

        def end() -> None:
            self._all = tuple(each for each in self._all if each is not subscription)

        return end

    def tell(self, edge: Edge) -> None:
        """Tell an edge. What a listener raises is logged and harms nobody else."""
        for subscription in self._all:
            if subscription.name == edge.name:
                try:
                    subscription.listener(edge)
                except Exception:
                    log.exception("a listener of the point %s failed", edge.name)
