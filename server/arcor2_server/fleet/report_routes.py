"""The routes of the stored results: units, alarms, and CSV files of them."""

import csv
import io
from collections.abc import AsyncIterator, Awaitable, Callable, Iterable
from typing import Annotated, Any, Final, TypeVar

from litestar import Response, get
from litestar.exceptions import HTTPException
from litestar.params import Parameter
from litestar.response import Stream

from arcor2_hw.data.base import Unset
from arcor2_hw.data.role import Role
from arcor2_hw.exceptions import Arcor2Error, Conflict, NotFound, StorageError
from arcor2_server.access.route_options import ROLE
from arcor2_server.audit.export import as_cell
from arcor2_server.fleet import records
from arcor2_server.fleet.collector import Collector
from arcor2_server.fleet.reports import FleetAlarm, FleetReports, FleetUnit, Period

PAGE_SIZE: Final = 1000
"""Number of results that are read at once for a file."""
_LATEST: Final = 1 << 40
T = TypeVar("T")
Second = Annotated[int, Parameter(ge=0, le=_LATEST)]
CellFilter = Annotated[str, Parameter(max_length=63)]
Serial = Annotated[str, Parameter(max_length=200)]
Before = Annotated[str, Parameter(pattern=r"^(\d{1,13}-\d{1,18})?$")]
Limit = Annotated[int, Parameter(ge=1, le=1000)]
PagePosition = tuple[int, int]
UNIT_COLUMNS: Final = (
    *(
        "cell",
        "number",
        "serial",
        "state",
        "verdict",
        "entered",
        "left",
        "order",
        "product",
        "program",
        "step",
        "error",
    ),
)
ALARM_COLUMNS: Final = (
    *("cell", "number", "raised", "cleared", "duration", "count", "priority", "device", "code", "text", "cause"),
    *("remedy", "acknowledged_by", "note"),
)


def report_routes(collector: Collector) -> list[Any]:
    """Return the routes. All need the role operator."""
    options = {ROLE: Role.OPERATOR}

    async def run_query(work: Callable[[FleetReports], Any]) -> Response[bytes]:
        try:
            return json_response(await collector.report(work))
        except (NotFound, StorageError) as error:
            raise refusal(error) from None

    def units_page(
        period: Period, serial: str
    ) -> Callable[[PagePosition | None, int], Callable[[FleetReports], list[FleetUnit]]]:
        if serial.strip():
            return lambda before, limit: lambda reports: reports.find_units(serial.strip(), period.cell, before, limit)
        return lambda before, limit: lambda reports: reports.bad_units(period, before, limit)

    @get("/api/fleet/production", opt=options)
    async def production(since: Second, until: Second, cell: CellFilter = "") -> Response[bytes]:
        """Return the units of a period by cell, product and program, and over time."""
        return await run_query(lambda reports: reports.production(Period(since, until, cell)))

    @get("/api/fleet/units", opt=options)
    async def units(
        since: Second = 0,
        until: Second = _LATEST,
        cell: CellFilter = "",
        serial: Serial = "",
        before: Before = "",
        limit: Limit = 100,
    ) -> Response[bytes]:
        """Return the bad units of a period, or all units with a text in their serial number; the newest first."""
        page = units_page(Period(since, until, cell), serial)
        return await run_query(page(_page_position(before), limit))

    @get("/api/fleet/units/{number:int}", opt=options)
    async def unit(number: int) -> Response[bytes]:
        """Return the whole record of a unit."""
        return await run_query(lambda reports: reports.unit(number))

    @get("/api/fleet/units/export", opt=options)
    async def export_units(
        since: Second = 0, until: Second = _LATEST, cell: CellFilter = "", serial: Serial = ""
    ) -> Stream:
        """Return the units as CSV that `units` returns."""
        page = units_page(Period(since, until, cell), serial)
        return _file("units.csv", UNIT_COLUMNS, _pages(lambda *position: collector.report(page(*position))), _unit_row)

    @get("/api/fleet/alarms", opt=options)
    async def alarms(
        since: Second = 0, until: Second = _LATEST, cell: CellFilter = "", before: Before = "", limit: Limit = 100
    ) -> Response[bytes]:
        """Return the alarms that were raised in a period, the newest first."""
        period = Period(since, until, cell)
        return await run_query(lambda reports: reports.alarms(period, _page_position(before), limit))

    @get("/api/fleet/causes", opt=options)
    async def causes(since: Second = 0, until: Second = _LATEST, cell: CellFilter = "") -> Response[bytes]:
        """Return the causes of the alarms of a period, the most frequent first."""
        return await run_query(lambda reports: reports.causes(Period(since, until, cell)))

    @get("/api/fleet/alarms/export", opt=options)
    async def export_alarms(since: Second = 0, until: Second = _LATEST, cell: CellFilter = "") -> Stream:
        """Return the alarms of a period as CSV."""
        period = Period(since, until, cell)

        def load(before: PagePosition | None, limit: int) -> Awaitable[list[FleetAlarm]]:
            return collector.report(lambda reports: reports.alarms(period, before, limit))

        return _file("alarms.csv", ALARM_COLUMNS, _pages(load), _alarm_row)

    return [production, units, unit, export_units, alarms, causes, export_alarms]


def json_response(data: object) -> Response[bytes]:
    """Return data as JSON."""
    return Response(records.encode(data), media_type="application/json")


def refusal(error: Arcor2Error) -> HTTPException:
    """Return the answer to a request that failed."""
    status = 404 if isinstance(error, NotFound) else 409 if isinstance(error, Conflict) else 500
    return HTTPException(status_code=status, detail=str(error), extra=error.message.translation())


def _page_position(before: str) -> PagePosition | None:
    if not before:
        return None
    at, _, number = before.partition("-")
    return int(at), int(number)


async def _pages(load: Callable[[PagePosition | None, int], Awaitable[list[T]]]) -> AsyncIterator[list[T]]:
    before: PagePosition | None = None
    while found := await load(before, PAGE_SIZE):
        yield found
        last: Any = found[-1]
        before = last.at, last.id


def _file(
    name: str, columns: Iterable[str], pages: AsyncIterator[list[T]], row: Callable[[T], Iterable[object]]
) -> Stream:
    async def content() -> AsyncIterator[bytes]:
        yield _lines([columns])
        async for page in pages:
            yield _lines(map(row, page))

    return Stream(content, media_type="text/csv", headers={"Content-Disposition": f'attachment; filename="{name}"'})


def _lines(rows: Iterable[Iterable[object]]) -> bytes:
    text = io.StringIO()
    writer = csv.writer(text)
    for row in rows:
        writer.writerow("" if value is None or isinstance(value, Unset) else as_cell(value) for value in row)
    return text.getvalue().encode()


def _unit_row(found: FleetUnit) -> Iterable[object]:
    verdict = "" if isinstance(found.unit.verdict, Unset) else "passed" if found.unit.verdict else "failed"
    values: dict[str, object] = {"cell": found.cell, "state": found.unit.state.value, "verdict": verdict}
    return [values.get(name, getattr(found.unit, name, "")) for name in UNIT_COLUMNS]


def _alarm_row(found: FleetAlarm) -> Iterable[object]:
    record = found.alarm.record
    values: dict[str, object] = {
        "cell": found.cell,
        "duration": found.duration,
        "priority": record.priority.value,
        "device": record.object_name,
    }
    return [values.get(name, getattr(record, name, "")) for name in ALARM_COLUMNS]
