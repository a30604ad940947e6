"""The history of points and runs over REST (docs/protocol/history.md)."""

import asyncio
from dataclasses import dataclass

from arcor2_hw.data.history import (
    HistoryPoint,
    HistoryPointQuery,
    HistoryQuery,
    HistoryRunQuery,
    HistoryState,
    PastRun,
    PointSummary,
    PointValues,
)
from arcor2_hw.data.role import Role
from arcor2_server.history.service import History
from arcor2_server.rest.general import SERVER
from arcor2_server.rest.operations import Binary, operation


@dataclass(frozen=True, slots=True)
class HistoryOperations:
    """The history of points and runs over REST."""

    _history: History

    @operation("GET", "/api/history", SERVER, Role.OPERATOR, plain=True)
    async def state(self) -> HistoryState:
        """Return whether the history is recorded, and its size."""
        return await self._history.state()

    @operation("GET", "/api/history/points", SERVER, Role.OPERATOR, plain=True)
    async def points(self, query: HistoryPointQuery) -> list[HistoryPoint]:
        """Return the recorded points, by device and name."""
        return await self._history.points(query)

    @operation("GET", "/api/history/summary", SERVER, Role.OPERATOR, plain=True)
    async def summary(self, query: HistoryQuery) -> PointSummary:
        """Return the lowest, highest and mean value of a point in equal parts of a period."""
        return await self._history.summary(query)

    @operation("GET", "/api/history/values", SERVER, Role.OPERATOR, plain=True)
    async def values(self, query: HistoryQuery) -> PointValues:
        """Return the recorded values of a point in a period, oldest first."""
        return await self._history.values(query)

    @operation("GET", "/api/history/values/export", SERVER, Role.OPERATOR, media_type="text/csv")
    async def export_values(self, query: HistoryQuery) -> Binary:
        """Return the recorded values of a point in a period as CSV, oldest first."""
        from arcor2_server.history.export import (
            values_as_csv,
        )  # with a module that is not needed at the start of the server

        found = await self._history.values(query)
        return Binary(await asyncio.to_thread(values_as_csv, found), "text/csv", f"point-{query.point}.csv")

    @operation("GET", "/api/history/runs", SERVER, Role.OPERATOR, plain=True)
    async def past_runs(self, query: HistoryRunQuery) -> list[PastRun]:
        """Return runs that ended in a period, newest first."""
        return await self._history.runs(query)

    @operation("GET", "/api/history/runs/export", SERVER, Role.OPERATOR, media_type="text/csv")
    async def export_past_runs(self, query: HistoryRunQuery) -> Binary:
        """Return runs that ended in a period as CSV, newest first."""
        from arcor2_server.history.export import (
            runs_as_csv,
        )  # with a module that is not needed at the start of the server

        found = await self._history.runs(query)
        return Binary(await asyncio.to_thread(runs_as_csv, found), "text/csv", "runs.csv")
