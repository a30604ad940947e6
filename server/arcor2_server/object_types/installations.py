"""Offers object types of distributions that are installed, changed or removed while the server runs."""

import asyncio
import contextlib
from collections.abc import Awaitable, Callable
from typing import Final

import structlog

from arcor2_hw.analysis.installed import installation_stamp
from arcor2_server.object_types.notifications import TypeNotifications
from arcor2_server.object_types.registry import ObjectTypes

PERIOD: Final = 2.0
"""Time between two checks of the installed distributions, s. They are read when two checks agree, so that pip has
finished."""

log = structlog.get_logger(__name__)


class InstallationWatch:
    """Reads installed object types again when the installed distributions have changed, and notifies the clients.

    Args:
        types: The registry of object types.
        notifications: Notifies the clients.
        changed: Called after a change, before the clients are notified.
    """

    def __init__(
        self, types: ObjectTypes, notifications: TypeNotifications, changed: Callable[[], Awaitable[None]]
    ) -> None:
        self._types = types
        self._notifications = notifications
        self._changed = changed
        self._task: asyncio.Task[None] | None = None

    def start(self) -> None:
        """Start the checks."""
        self._task = asyncio.create_task(self._watch(), name="watch of installed distributions")

    async def close(self) -> None:
        """End the checks."""
        if self._task is not None:
            self._task.cancel()
            with contextlib.suppress(asyncio.CancelledError):
                await self._task

    async def _watch(self) -> None:
        read = last = await asyncio.to_thread(installation_stamp)
        while True:
            await asyncio.sleep(PERIOD)
            before, last = last, await asyncio.to_thread(installation_stamp)
            if last == before and last != read:
                read = last
                try:
                    await self._rescan()
                except Exception:  # a broken installation must not stop the checks
                    log.exception("installed object types cannot be read")

    async def _rescan(self) -> None:
        if await self._types.rescan():
            log.info("installed object types have changed")
            await self._changed()
            await self._notifications.publish()
