"""Edges of digital points, as the subscription reports them."""

from arcor2_hw.data.base import Timestamp
from arcor2_hw.objects.edges import Edge, EdgeListeners


class Edges(EdgeListeners):
    """The known values of digital points, and the listeners to their edges."""

    def __init__(self) -> None:
        super().__init__()
        self._known: dict[str, bool] = {}

    def forget(self) -> None:
        """Start again: what happened meanwhile is unknown and causes no edge."""
        self._known = {}

    def take(self, name: str, value: bool, stamp: Timestamp, monotonic: float) -> None:
        """Take a value, and notify the listeners when it is an edge."""
        before = self._known.get(name)
        self._known[name] = value
        if before is not None and before != value:
            self.notify(Edge(name, value, stamp, monotonic))
