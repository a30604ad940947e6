"""Move previews: the positions of items while a user drags them. They are published and never stored."""

import asyncio
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final

from msgspec import UNSET

from arcor2_hw.data.editor import MovePreview, MovePreviewData
from arcor2_server.collaboration.locks import Locks
from arcor2_server.collaboration.throttle import Throttle
from arcor2_server.events import Connection, EventHub, encode, make_event

PERIOD: Final = 1 / 30
"""Minimum time between two events of one item, s."""
CHECK_PERIOD: Final = 0.1
"""Period of checking that users who drag an item still hold its lock, s."""
NAME: Final = "MovePreview"


@dataclass(slots=True)
class _Preview:
    client: Connection
    user: str
    locked: str
    changed: bool = False


class Previews:
    """The items that are being dragged."""

    def __init__(self, hub: EventHub, locks: Locks) -> None:
        self._hub = hub
        self._locks = locks
        self._dragged: dict[str, _Preview] = {}
        self._events = Throttle(PERIOD, self._send)
        self._check_timer: asyncio.TimerHandle | None = None

    def show(self, client: Connection, user: str, preview: MovePreview, locked: str) -> None:
        """Publish the position of a dragged item, or the end of the preview; `locked`: the locked item."""
        if preview.position is UNSET and preview.orientation is UNSET and preview.joints is UNSET:
            self._end(preview.id)
            return
        dragged = self._dragged.get(preview.id)
        if dragged is None or dragged.changed or dragged.client is not client or dragged.user != user:
            self._dragged[preview.id] = _Preview(client, user, locked)
        data = MovePreviewData(
            id=preview.id,
            position=preview.position,
            orientation=preview.orientation,
            joints=preview.joints,
            user=user,
        )
        self._events.put(preview.id, encode(make_event(NAME, data)))
        if self._check_timer is None:
            self._check_timer = asyncio.get_running_loop().call_later(CHECK_PERIOD, self._check_holders)

    def changed(self, items: Iterable[str]) -> None:
        """Record that items were changed or removed, so that `end_changed` ends their previews."""
        if self._dragged:
            for item in items:
                if (dragged := self._dragged.get(item)) is not None:
                    dragged.changed = True

    def end_changed(self) -> None:
        """End the previews of changed and removed items."""
        for item in [item for item, dragged in self._dragged.items() if dragged.changed]:
            self._end(item)

    def close(self) -> None:
        """Cancel the pending events."""
        self._events.close()
        if self._check_timer is not None:
            self._check_timer.cancel()

    def _check_holders(self) -> None:
        """End the previews of clients that disconnected or no longer hold the lock."""
        self._check_timer = None
        for item, dragged in list(self._dragged.items()):
            if dragged.client not in self._hub.clients or not self._locks.holds(dragged.user, dragged.locked):
                self._end(item)
        if self._dragged:
            self._check_timer = asyncio.get_running_loop().call_later(CHECK_PERIOD, self._check_holders)

    def _end(self, item: str) -> None:
        if (dragged := self._dragged.get(item)) is None:
            return
        self._events.end(item, encode(make_event(NAME, MovePreviewData(id=item, user=dragged.user))))
        del self._dragged[item]

    def _send(self, item: str, event: bytes) -> None:
        if (dragged := self._dragged.get(item)) is not None:
            self._hub.stream_to_subscribers(NAME, item, event, besides=dragged.client)
