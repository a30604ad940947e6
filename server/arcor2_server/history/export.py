"""The history as CSV."""

import csv
import io
from collections.abc import Iterable
from datetime import UTC, datetime

from arcor2_hw.data.history import PastRun, PointValues
from arcor2_server.audit.export import as_cell

_TIMES = ("started", "ended")


def values_as_csv(found: PointValues) -> bytes:
    """Return the values of a point as CSV, one line each."""
    rows = zip(map(_time, found.times), found.values, found.qualities, strict=True)
    return _as_csv(("time", "value", "quality"), rows)


def runs_as_csv(runs: Iterable[PastRun]) -> bytes:
    """Return runs as CSV, one line each."""
    names = PastRun.__struct_fields__
    rows = ([_time(getattr(run, name)) if name in _TIMES else getattr(run, name) for name in names] for run in runs)
    return _as_csv(names, rows)


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
