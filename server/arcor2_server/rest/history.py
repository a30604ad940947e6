"""The history of points and runs over REST (docs/protocol/history.md)."""

import asyncio
import csv
import io
from collections.abc import Iterable
from dataclasses import dataclass
from datetime import UTC, datetime

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
from arcor2_server.audit.export import as_cell
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
        found = await self._history.values(query)
        rows = zip(map(_time, found.times), found.values, found.qualities, strict=True)
        content = await asyncio.to_thread(_as_csv, ("time", "value", "quality"), rows)
        return Binary(content, "text/csv", f"point-{query.point}.csv")

    @operation("GET", "/api/history/runs", SERVER, Role.OPERATOR, plain=True)
    async def past_runs(self, query: HistoryRunQuery) -> list[PastRun]:
        """Return runs that ended in a period, newest first."""
        return await self._history.runs(query)

    @operation("GET", "/api/history/runs/export", SERVER, Role.OPERATOR, media_type="text/csv")
    async def export_past_runs(self, query: HistoryRunQuery) -> Binary:
        """Return runs that ended in a period as CSV, newest first."""
        found = await self._history.runs(query)
        names = PastRun.__struct_fields__
        rows = (
            [
                _time(value) if name in ("started", "ended") else value
                for name in names
                for value in (getattr(run, name),)
            ]
            for run in found
        )
        return Binary(await asyncio.to_thread(_as_csv, names, rows), "text/csv", "runs.csv")


def _as_csv(header: Iterable[str], rows: Iterable[Iterable[object]]) -> bytes:
    text = io.StringIO()
    writer = csv.writer(text)
    writer.writerow(header)
    writer.writerows(
        ["" if each is None else as_cell(each) if isinstance(each, str) else each for each in row] for row in rows
    )
    return text.getvalue().encode()


def _time(milliseconds: int) -> str:
    return datetime.fromtimestamp(milliseconds / 1000, UTC).isoformat(timespec="milliseconds")
