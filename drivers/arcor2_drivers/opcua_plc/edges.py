"""Edges of digital points, as the subscription tells them. Pure but for the calls to subscribers."""

import logging
from collections.abc import Callable
from typing import NamedTuple

from arcor2_hw.data.base import Data, Timestamp

log = logging.getLogger(__name__)


class Edge(Data, frozen=True):
    """A digital point has changed: to `value`, by the source at `stamp` (UTC), known here since `monotonic` (s)."""

    name: str
    value: bool
    stamp: Timestamp
    monotonic: float


class _Subscription(NamedTuple):
    name: str
    listener: Callable[[Edge], None]


class Edges:
    """What is known of each digital point, and who wants to hear of it. Listeners have to be quick."""

    def __init__(self) -> None:
        self._known: dict[str, bool] = {}
        self._all: tuple[_Subscription, ...] = ()

    def forget(self) -> None:
        """Begin anew: what happened meanwhile is not known, and is told by no edge."""
        self._known = {}

    def add(self, name: str, listener: Callable[[Edge], None]) -> Callable[[], None]:
        """Subscribe; what is given back ends it."""
        subscription = _Subscription(name, listener)
        self._all = (*self._all, subscription)

        def end() -> None:
            self._all = tuple(each for each in self._all if each is not subscription)

        return end

    def take(self, name: str, value: bool, stamp: Timestamp, monotonic: float) -> None:
        """Take a value, and tell of the edge if it is one. What a listener raises is logged and harms nobody else."""
        before = self._known.get(name)
        self._known[name] = value
        if before is None or before == value:
            return
        for subscription in self._all:
            if subscription.name == name:
                try:
                    subscription.listener(Edge(name, value, stamp, monotonic))
                except Exception:
                    log.exception("a listener of the point %s failed", name)
