"""The activity of the cell over time, and its effectiveness."""

import asyncio
import time
from collections.abc import Callable
from datetime import UTC, datetime
from typing import Final

import structlog

from arcor2_hw.data.base import UNSET, Timestamp, Unset
from arcor2_hw.data.rpc import GetProductionArgs
from arcor2_hw.data.units import CellActivity, Effectiveness, Production, UnitCounts, UnitState
from arcor2_hw.exceptions import InvalidData, StorageError
from arcor2_server.background import BackgroundTasks
from arcor2_server.execution.service import Execution
from arcor2_server.storage.units import UnitStore

log = structlog.get_logger(__name__)

PERIOD: Final = 30.0
"""Time between two stores of the present time, s. If the server crashes, at most this time is lost."""
RETENTION: Final = 400 * 86_400.0
"""Time for which activities are stored, s."""
DEFAULT_PERIOD: Final = 8 * 3600.0
"""Period of a query that states no start, s: one shift."""

_ACTIVITIES: Final = {
    "undefined": CellActivity.IDLE,
    "stopped": CellActivity.IDLE,
    "started": CellActivity.STARTING,
    "running": CellActivity.RUNNING,
    "resuming": CellActivity.RUNNING,
    "pausing": CellActivity.RUNNING,
    "paused": CellActivity.PAUSED,
    "stopping": CellActivity.STOPPING,
}


def activity_of(execution: Execution) -> CellActivity:
    """Return the present activity of the cell."""
    return CellActivity.HELD if execution.hold.present is not None else _ACTIVITIES[execution.state.value]


class CellTime:
    """Records the activity of the cell over time. Queries may raise StorageError.

    Args:
        store: stores the times, and the units that were produced.
        activity: returns the present activity of the cell.
        clock: the time, s since the epoch.
    """

    def __init__(
        self, store: UnitStore, activity: Callable[[], CellActivity], clock: Callable[[], float] = time.time
    ) -> None:
        self._store, self._activity, self._clock = store, activity, clock
        self._present = CellActivity.IDLE
        self._since = clock()
        self._unwritten: dict[float, tuple[float, CellActivity]] = {}
        self._writing = asyncio.Lock()
        self._background = BackgroundTasks()

    def start(self) -> None:
        """Start to store times."""
        self._background.spawn(self._repeat(), "times of the cell")

    async def close(self) -> None:
        """Store the time until now."""
        async with self._writing:  # a write is not interrupted
            await self._background.cancel()
        await self._store_present()

    def changed(self) -> None:
        """Handle a possible change of the activity."""
        if (activity := self._activity()) is not self._present:
            at = self._clock()
            self._unwritten[self._since] = at, self._present
            self._present, self._since = activity, at
            self._background.spawn(self._write(), "time of the cell")

    async def _repeat(self) -> None:
        while True:
            await self._store_present()
            await asyncio.sleep(PERIOD)

    async def _store_present(self) -> None:
        self._unwritten[self._since] = self._clock(), self._present
        await self._write()

    async def _write(self) -> None:
        async with self._writing:
            try:
                for start in list(self._unwritten):
                    end, activity = self._unwritten[start]
                    if end > start:
                        await self._store.put_time(start, end, activity)
                    if self._unwritten.get(start) == (end, activity):
                        del self._unwritten[start]
                await self._store.delete_times(self._clock() - RETENTION)
            except StorageError as error:
                log.warning("times of the cell not stored", reason=str(error))

    async def production(self, args: GetProductionArgs) -> Production:
        """Return the production of the cell in a period.

        Raises:
            InvalidData: the period ends before it starts.
        """
        until = min(self._clock(), self._clock() if isinstance(args.until, Unset) else _seconds(args.until))
        since = until - DEFAULT_PERIOD if isinstance(args.since, Unset) else _seconds(args.since)
        if since >= until:
            raise InvalidData("The period has to start before it ends, and in the past.")
        await self._store_present()
        seconds = dict.fromkeys(CellActivity, 0.0)
        for start, end, activity in await self._store.times(since, until):
            seconds[activity] += max(0.0, min(end, until) - max(start, since))
        seconds[CellActivity.OFF] = max(0.0, until - since - sum(seconds.values()))
        left = await self._store.left_between(_stamp(since), _stamp(until))
        counts = dict.fromkeys(UnitState, 0)
        for state, _, count in left:
            counts[state] += count
        return Production(
            _stamp(since),
            _stamp(until),
            UnitCounts(
                counts[UnitState.GOOD],
                counts[UnitState.BAD],
                counts[UnitState.REJECTED],
                counts[UnitState.UNKNOWN],
                await self._store.count_in_cell(),
            ),
            {activity: round(each, 3) for activity, each in seconds.items()},
            effectiveness(until - since, seconds[CellActivity.RUNNING], left),
        )


def effectiveness(period: float, running: float, left: list[tuple[UnitState, float | None, int]]) -> Effectiveness:
    """Return the overall equipment effectiveness of a period.

    Args:
        period: the time that was planned for production, s.
        running: the time for which the program ran, s.
        left: numbers of units that left the cell, by state and planned rate, 1/h.
    """
    availability = running / period if period > 0.0 else UNSET
    produced = sum(count for _, _, count in left)
    good = sum(count for state, _, count in left if state is UnitState.GOOD)
    quality = good / produced if produced else UNSET
    planned = sum(count * 3600.0 / rate for _, rate, count in left if rate)
    complete = all(rate for _, rate, _ in left)
    performance = planned / running if produced and complete and running > 0.0 else UNSET
    if isinstance(availability, Unset) or isinstance(quality, Unset) or isinstance(performance, Unset):
        oee: float | Unset = UNSET
    else:
        oee = availability * performance * quality
    return Effectiveness(*(each if isinstance(each, Unset) else round(each, 4) for each in
                           (availability, performance, quality, oee)))  # fmt: skip


def _seconds(stamp: Timestamp) -> float:
    return datetime.fromisoformat(stamp).timestamp()


def _stamp(seconds: float) -> Timestamp:
    return datetime.fromtimestamp(seconds, UTC).isoformat(timespec="microseconds")
