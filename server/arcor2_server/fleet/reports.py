"""Queries of the stored results: counts of units, lists, and the most frequent alarms. Its methods block."""

import contextlib
import sqlite3
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

import msgspec

from arcor2_hw.data.base import Data
from arcor2_hw.data.units import UnitRecord
from arcor2_hw.exceptions import NotFound, StorageError
from arcor2_server.fleet.columns import MIN_SEARCH_LENGTH, SLOT, search_expression
from arcor2_server.fleet.summaries import AlarmSummary, UnitSummary

HOUR: Final = 3600
_LONG_PERIOD: Final = 49 * HOUR
"""Length of a period from which it is divided into parts of 6 hours instead of 1 hour, s."""
_MAX_CAUSES: Final = 50
"""Maximum number of causes of alarms."""
_BAD: Final = "state in ('bad', 'rejected')"
_FROM_INDEX: Final = "unit_text join result on result.id = unit_text.rowid where unit_text match ?"
_FROM_SCAN: Final = "result indexed by unit_by_id where kind = 'unit' and label like ? escape '\\'"
_unit = msgspec.json.Decoder(UnitSummary).decode
_alarm = msgspec.json.Decoder(AlarmSummary).decode
_record = msgspec.json.Decoder(UnitRecord).decode


class Period(Data, frozen=True):
    """A period, s since the epoch. until: the first second after it. cell: name of a cell; empty for all."""

    since: int
    until: int
    cell: str = ""


class FleetCount(Data, frozen=True):
    """Units of a cell, product and program that left the cell. product, program: empty if they are not known."""

    cell: str
    product: str
    program: str
    good: int
    bad: int
    rejected: int


class FleetTime(Data, frozen=True):
    """Units in a part of the period that begins `at`, s since the epoch. bad: with rejected ones."""

    at: int
    good: int
    bad: int


class FleetProduction(Data, frozen=True):
    """What cells have produced. since, until: the period in whole quarters of an hour. step: length of its parts, s."""

    since: int
    until: int
    step: int
    counts: list[FleetCount]
    times: list[FleetTime]


class FleetUnit(Data, frozen=True):
    """A unit of a cell. id: of the result. at: when it left, s since the epoch."""

    id: int
    at: int
    cell: str
    unit: UnitSummary


class FleetAlarm(Data, frozen=True):
    """An alarm of a cell. id: of the result. at: when it was raised, s since the epoch. duration: s, up to now."""

    id: int
    at: int
    cell: str
    duration: int
    alarm: AlarmSummary


class FleetCause(Data, frozen=True):
    """Alarms of a cell with the same cause. newest: the last one of them. duration: sum, s."""

    cell: str
    count: int
    duration: int
    newest: AlarmSummary


class FleetReports:
    """Queries. All methods may raise StorageError; one thread at a time may call them.

    Args:
        path: file of the results, which exists.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        with self._guarded():
            self._connection = sqlite3.connect(f"{path.absolute().as_uri()}?mode=ro", uri=True, check_same_thread=False)

    def close(self) -> None:
        """Close the file."""
        self._connection.close()

    @contextlib.contextmanager
    def _guarded(self) -> Iterator[None]:
        try:
            yield
        except sqlite3.Error as error:
            raise StorageError("{file} cannot be used: {reason}.", file=self._path, reason=error) from error

    def _rows(self, query: str, *values: object) -> list[Any]:
        with self._guarded():
            return self._connection.execute(query, values).fetchall()

    def production(self, period: Period) -> FleetProduction:
        """Return the units of a period by cell, product and program, and over time."""
        first, end = period.since // SLOT, -(-period.until // SLOT)
        step = (6 * HOUR if (end - first) * SLOT > _LONG_PERIOD else HOUR) // SLOT
        cell_condition, values = _cell_condition(period)
        where = f"from unit_count where slot >= ? and slot < ?{cell_condition}"
        sums = "sum(good), sum(bad), sum(rejected)"
        counts = self._rows(
            f"select cell, product, program, {sums} {where} group by cell, product, program", first, end, *values
        )
        times = self._rows(
            f"select (slot - ?) / ? part, sum(good), sum(bad) + sum(rejected) {where} group by part",
            *(first, step, first, end, *values),
        )
        return FleetProduction(
            first * SLOT,
            end * SLOT,
            step * SLOT,
            [FleetCount(*row) for row in counts],
            [FleetTime((first + part * step) * SLOT, good, bad) for part, good, bad in times],
        )

    def bad_units(self, period: Period, before: tuple[int, int] | None, limit: int) -> list[FleetUnit]:
        """Return bad and rejected units of a period, the newest first. Arguments: see `alarms`."""
        cell_condition, values = _cell_condition(period)
        where = f"{_BAD} and at >= ? and at < ?{cell_condition}"
        return _units(self._page("unit", where, (period.since, period.until, *values), before, limit))

    def find_units(self, serial: str, cell: str, before: tuple[int, int] | None, limit: int) -> list[FleetUnit]:
        """Return all units whose serial number contains a text, the last stored first. Arguments: see `alarms`."""
        if "\0" in serial + cell:
            return []  # no serial number contains it, and SQLite would end the text there
        indexed = len(serial) >= MIN_SEARCH_LENGTH
        values: list[object] = [search_expression(serial, cell) if indexed else f"%{_escaped(serial)}%"]
        where = f"{_FROM_INDEX if indexed else _FROM_SCAN}{' and result.cell = ?' if cell else ''}"
        values += [cell] if cell else []
        number = "unit_text.rowid" if indexed else "id"
        if before is not None:
            where, values = f"{where} and {number} < ?", [*values, before[1]]
        query = f"select id, at, result.cell, until, summary from {where} order by {number} desc limit ?"  # noqa: S608 (only texts from above)
        return _units(self._rows(query, *values, limit))

    def unit(self, number: int) -> UnitRecord:
        """Return the whole record of a unit by the id of its result. Raise NotFound if there is none."""
        rows = self._rows("select document from result where id = ? and kind = 'unit'", number)
        if not rows:
            raise NotFound("The unit {number} is not stored.", number=number)
        found: UnitRecord = _record(rows[0][0])
        return found

    def alarms(self, period: Period, before: tuple[int, int] | None, limit: int) -> list[FleetAlarm]:
        """Return alarms that were raised in a period, the newest first.

        Args:
            period: the period and cell.
            before: `at` and `id` of the last one of the previous page; None for the first page.
            limit: maximum number.
        """
        cell_condition, values = _cell_condition(period)
        rows = self._page(
            "alarm", f"at >= ? and at < ?{cell_condition}", (period.since, period.until, *values), before, limit
        )
        present = int(time.time())
        return [
            FleetAlarm(number, at, cell, max(0, (present if until is None else until) - at), _alarm(summary))
            for number, at, cell, until, summary in rows
        ]

    def causes(self, period: Period) -> list[FleetCause]:
        """Return the causes of the alarms of a period, the most frequent first."""
        cell_condition, values = _cell_condition(period)
        query = (
            "select cell, sum(times), sum(max(0, coalesce(until, ?) - at)), max(id) "  # noqa: S608 (texts from above)
            "from result "
            f"where kind = 'alarm' and at >= ? and at < ?{cell_condition} "
            "group by cell, label order by 2 desc, 3 desc limit ?"
        )
        rows = self._rows(query, int(time.time()), period.since, period.until, *values, _MAX_CAUSES)
        wanted = ", ".join("?" * len(rows))
        newest = self._rows(f"select id, summary from result where id in ({wanted})", *(row[3] for row in rows))  # noqa: S608
        summaries = {number: _alarm(summary) for number, summary in newest}
        return [
            FleetCause(cell, count, duration, summaries[number])
            for cell, count, duration, number in rows
            if number in summaries  # deleted meanwhile
        ]

    def _page(
        self, kind: str, where: str, values: tuple[object, ...], before: tuple[int, int] | None, limit: int
    ) -> list[Any]:
        if before is not None:
            where, values = f"{where} and (at, id) < (?, ?)", (*values, *before)
        query = (
            "select id, at, cell, until, summary from result "  # noqa: S608 (only texts from above)
            f"where kind = '{kind}' and {where} "
            "order by at desc, id desc limit ?"
        )
        return self._rows(query, *values, limit)


def _units(rows: list[Any]) -> list[FleetUnit]:
    return [FleetUnit(number, at, cell, _unit(summary)) for number, at, cell, _, summary in rows]


def _escaped(text: str) -> str:
    """Return a text that the operator `like` takes literally."""
    return text.replace("\\", "\\\\").replace("%", "\\%").replace("_", "\\_")


def _cell_condition(period: Period) -> tuple[str, tuple[str, ...]]:
    return (" and cell = ?", (period.cell,)) if period.cell else ("", ())
