"""Tells clients of object types that came in by other ways than theirs: soon, and all of them at once."""

import asyncio
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from arcor2_server.services import Services

QUIET: Final = 0.5
"""Seconds after the last upload: who uploads twenty types tells of them once. Opening a scene tells at once."""


class TypeNews:
    """Waits for the end of a series of uploads."""

    def __init__(self) -> None:
        self._timer: asyncio.TimerHandle | None = None
        self._telling: set[asyncio.Task[None]] = set()

    async def taken(self, services: "Services") -> None:
        """Take in what was written to storage; clients are told when it has been quiet for a while."""
        await services.types.take_in()
        if self._timer is not None:
            self._timer.cancel()
        self._timer = asyncio.get_running_loop().call_later(QUIET, self._begin, services)

    def _begin(self, services: "Services") -> None:
        self._timer = None
        task = asyncio.create_task(self._tell(services), name="news of object types")
        self._telling.add(task)
        task.add_done_callback(self._telling.discard)

    @staticmethod
    async def _tell(services: "Services") -> None:
        from arcor2_server.rpc.object_types import change_events  # it needs Services, of which this is a part

        for event in change_events(await services.types.refresh()):
            services.hub.broadcast(event)

    async def close(self) -> None:
        """End with the server."""
        if self._timer is not None:
            self._timer.cancel()
        for task in self._telling:
            task.cancel()
        await asyncio.gather(*self._telling, return_exceptions=True)
