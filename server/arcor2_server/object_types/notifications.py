"""Notifies the clients of object types that were added or changed outside of their requests."""

import asyncio
from typing import Final

from arcor2_hw.data.events import ChangeType, Event
from arcor2_server.background import BackgroundTasks
from arcor2_server.events import EventHub, make_event
from arcor2_server.object_types.changes import Changes
from arcor2_server.object_types.registry import ObjectTypes

QUIET_PERIOD: Final = 0.5
"""Time without an upload after which the clients are notified of all uploads, s."""


def change_events(changes: Changes) -> list[Event]:
    """Return the events for changed object types."""
    kinds = (
        (ChangeType.REMOVE, changes.removed),
        (ChangeType.UPDATE, changes.updated),
        (ChangeType.ADD, changes.added),
    )
    return [make_event("ChangedObjectTypes", metas, change) for change, metas in kinds if metas]


class TypeNotifications:
    """Publishes new and changed object types: when a document is opened, otherwise after a series of uploads."""

    def __init__(self, types: ObjectTypes, hub: EventHub) -> None:
        self._types = types
        self._hub = hub
        self._timer: asyncio.TimerHandle | None = None
        self._publishing = BackgroundTasks()

    async def uploaded(self) -> None:
        """Read object types that were written to the storage, and notify the clients when uploads pause."""
        await self._types.update()
        if self._timer is not None:
            self._timer.cancel()
        self._timer = asyncio.get_running_loop().call_later(QUIET_PERIOD, self._start)

    async def publish(self) -> None:
        """Read new and changed object types and notify the clients of them."""
        for event in change_events(await self._types.refresh()):
            self._hub.broadcast(event)

    def _start(self) -> None:
        self._timer = None
        self._publishing.spawn(self.publish(), "notification of object types")

    async def close(self) -> None:
        """Cancel pending notifications."""
        if self._timer is not None:
            self._timer.cancel()
        await self._publishing.cancel()
