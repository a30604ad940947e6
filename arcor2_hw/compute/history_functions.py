"""Reads the history and moves it to Parquet files, with DuckDB, in the worker process.

Rows are in an SQLite file first, which also lists the Parquet files. Both are read in one transaction of SQLite, so
each row is seen exactly once, also while rows are moved: files that are not listed are ignored.
"""
# ruff: noqa: S608 - statements contain only fixed names, and file names in quotation marks

import sqlite3
from collections.abc import Iterator, Sequence
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any, Final

import duckdb
import numpy as np

from arcor2_hw.compute.history_tasks import (
    DATABASE,
    POINTS,
    RUNS,
    VALID_MS,
    ColdFile,
    ColdFileResult,
    ReadPoint,
    ReadRuns,
    SummarizePoint,
    WriteColdFile,
)
from arcor2_hw.compute.worker_state import WorkerState
from arcor2_hw.data.editor import RunEnd
from arcor2_hw.data.history import PastRun, PointSummary, PointValues
from arcor2_hw.data.points import PointQuality
from arcor2_hw.exceptions import StorageError
from arcor2_hw.files import sync

MEMORY: Final = "256MB"
"""Maximum memory of DuckDB. Larger sorts continue on the disk."""
THREADS: Final = 2
BATCH: Final = 50_000
"""Number of rows that are passed from SQLite to DuckDB at once."""
ATTEMPTS: Final = 3
"""Number of attempts to read; a file may be replaced by a larger one between its listing and its reading."""
ROW_GROUP: Final = 122_880
"""Number of rows of a row group, which is skipped if it has only other points or times."""
QUALITIES: Final = tuple(PointQuality)
"""The qualities, by their number in the files."""
_POINT_COLUMNS: Final = (
    ("point", "INTEGER"), ("time", "BIGINT"), ("value", "DOUBLE"), ("text", "VARCHAR"), ("quality", "UTINYINT"),
)  # fmt: skip
_RUN_COLUMNS: Final = (
    ("number", "INTEGER"), ("started", "BIGINT"), ("time", "BIGINT"), ('"end"', "VARCHAR"), ("package_id", "VARCHAR"),
    ("package_name", "VARCHAR"), ("project", "VARCHAR"), ("started_by", "VARCHAR"), ("product", "VARCHAR"),
    ("revision", "INTEGER"), ("order_id", "VARCHAR"), ("error", "VARCHAR"), ("actions", "INTEGER"),
    ("cycles", "INTEGER"), ("good", "INTEGER"), ("bad", "INTEGER"),
)  # fmt: skip
_COLUMNS: Final = {POINTS: _POINT_COLUMNS, RUNS: _RUN_COLUMNS}
_TABLES: Final = {POINTS: "sample", RUNS: "run"}
_ORDER: Final = {POINTS: "point, time", RUNS: "time"}


# -------------------------------------------------------------------------------- writing
def write_cold_file(task: WriteColdFile, _state: WorkerState) -> ColdFileResult:
    """Write a Parquet file, complete and flushed to the disk before it has its name.

    Raises:
        StorageError: a file cannot be read or written.
    """
    directory = Path(task.directory)
    target, temporary = directory / task.name, directory / f".{task.name}.new"
    try:
        with _snapshot(directory) as recent, _engine(directory, threads=1) as engine:
            last_id, count = recent.execute(
                f"select coalesce(max(id), 0), count(*) from {_TABLES[task.kind]} where time < ?", (task.before,)
            ).fetchone()
            if not count and not task.merged:
                return ColdFileResult(None)
            _load(engine, task.kind, recent, "time < ? and id <= ?", (task.before, last_id))
            rows = _all_rows(task.kind, [str(directory / name) for name in task.merged])
            if task.kind == POINTS:
                _load_names(engine, recent)
                rows = f"select r.*, n.* exclude (number) from ({rows}) r left join names n on n.number = r.point"
            engine.execute(
                f"copy ({rows} order by {_ORDER[task.kind]}) to '{_quoted(temporary)}' (format parquet, "
                f"compression zstd, compression_level 19, parquet_version v2, row_group_size {ROW_GROUP})"
            )
            summary = f"select count(*), min(time), max(time) from read_parquet('{_quoted(temporary)}')"
            found = engine.execute(summary).fetchone()
            assert found is not None
        temporary.chmod(0o600)
        sync(temporary)
        temporary.rename(target)
        sync(directory)
        return ColdFileResult(
            ColdFile(task.kind, task.name, found[1], found[2], found[0], target.stat().st_size), last_id
        )
    except (duckdb.Error, sqlite3.Error, OSError) as error:
        raise _unusable(directory, error) from error
    finally:
        temporary.unlink(missing_ok=True)


def _load_names(engine: duckdb.DuckDBPyConnection, recent: sqlite3.Connection) -> None:
    """Load the names of the points, so that other programs can use the files without the database."""
    engine.execute("create table names (number integer, object_id text, object_name text, name text, unit text)")
    names = recent.execute("select number, object_id, object_name, name, unit from point").fetchall()
    if names:
        engine.executemany("insert into names values (?, ?, ?, ?, ?)", names)


# -------------------------------------------------------------------------------- reading
_SUMMARY: Final = """
with changes as (
    select time, value, least(coalesce(lead(time) over (order by time), $until), time + $valid, $until) as ending
    from ({rows})
), parts as (
    select time, value, greatest(time, $since) as start, ending
    from changes where value is not null and ending > greatest(time, $since)
), split as (
    select *, unnest(range((start - $since) // $width, (ending - 1 - $since) // $width + 1)) as bucket from parts
), cut as (
    select bucket, value, time >= $since + bucket * $width as recorded,
        least(ending, $since + (bucket + 1) * $width) - greatest(start, $since + bucket * $width) as lasting
    from split
)
select bucket, min(value), max(value), sum(value * lasting) / sum(lasting), count(*) filter (where recorded)
from cut group by bucket order by bucket
"""


def summarize_point(task: SummarizePoint, _state: WorkerState) -> PointSummary:
    """Return the values of a point in equal parts of a period. Raise StorageError."""
    width = max(1, -(-(task.until - task.since) // task.buckets))
    earliest = task.since - VALID_MS

    def read(engine: duckdb.DuckDBPyConnection, rows: str) -> list[tuple[Any, ...]]:
        values = {"since": task.since, "until": task.until, "valid": VALID_MS, "width": width}
        return engine.execute(_SUMMARY.format(rows=rows), values).fetchall()

    condition, arguments = "point = ? and time >= ? and time < ?", (task.point, earliest, task.until)
    found = _read(Path(task.directory), POINTS, condition, arguments, (earliest, task.until), read)
    buckets, lowest, highest, mean, counts = zip(*found, strict=True) if found else ((),) * 5
    times = [task.since + bucket * width for bucket in buckets]
    return PointSummary(task.since, task.until, times, list(lowest), list(highest), list(mean), list(counts))


def read_point(task: ReadPoint, _state: WorkerState) -> PointValues:
    """Return the recorded values of a point in a period. Raise StorageError."""

    def read(engine: duckdb.DuckDBPyConnection, rows: str) -> list[tuple[Any, ...]]:
        statement = f"select time, value, text, quality from ({rows}) order by time limit {task.limit + 1}"
        return engine.execute(statement).fetchall()

    condition, arguments = "point = ? and time >= ? and time < ?", (task.point, task.since, task.until)
    found = _read(Path(task.directory), POINTS, condition, arguments, (task.since, task.until), read)
    rows = found[: task.limit]
    return PointValues(
        [row[0] for row in rows],
        [row[1] if row[2] is None else row[2] for row in rows],
        [QUALITIES[row[3]] for row in rows],
        len(rows) == len(found),
    )


def read_runs(task: ReadRuns, _state: WorkerState) -> list[PastRun]:
    """Return the newest runs that ended in a period. Raise StorageError."""

    def read(engine: duckdb.DuckDBPyConnection, rows: str) -> list[tuple[Any, ...]]:
        return engine.execute(f"select * from ({rows}) order by time desc, number desc limit {task.limit}").fetchall()

    condition, arguments = "time >= ? and time < ?", (task.since, task.until)
    if task.package_id:
        condition, arguments = f"{condition} and package_id = ?", (*arguments, task.package_id)  # type: ignore[assignment]
    found = _read(Path(task.directory), RUNS, condition, arguments, (task.since, task.until), read)
    return [PastRun(row[0], row[1], row[2], RunEnd(row[3]), *row[4:]) for row in found]


def _read(
    directory: Path, kind: str, condition: str, arguments: Sequence[Any], period: tuple[int, int], read: Any
) -> list[tuple[Any, ...]]:
    """Return the values that `read` selects from rows that meet a condition, in database and files of a period."""
    attempt = 1
    while True:
        try:
            with _engine(directory, THREADS) as engine:
                with _snapshot(directory) as recent:
                    # Rows that are already in a file are ignored here and deleted later in small steps.
                    covered = recent.execute(
                        "select last_id, before from cold where kind = ? and clearing", (kind,)
                    ).fetchone() or (0, 0)
                    listed = "select name from cold where kind = ? and last >= ? and first < ? order by first"
                    files = [str(directory / name) for (name,) in recent.execute(listed, (kind, *period))]
                    hot = f"{condition} and not (id <= ? and time < ?)"
                    _load(engine, kind, recent, hot, (*arguments, *covered))
                rows: list[tuple[Any, ...]] = read(engine, _all_rows(kind, files, _with(condition, arguments)))
                return rows
        except duckdb.IOException as error:
            if attempt == ATTEMPTS:
                raise _unusable(directory, error) from error
            attempt += 1
        except (duckdb.Error, sqlite3.Error, OSError) as error:
            raise _unusable(directory, error) from error


def _with(condition: str, arguments: Sequence[Any]) -> str:
    """Return a condition with its arguments inserted: integers, and texts in quotation marks."""
    values = iter(arguments)
    parts = condition.split("?")
    texts = [str(int(each)) if isinstance(each, int) else f"'{_quoted(each)}'" for each in values]
    return "".join(part + text for part, text in zip(parts, [*texts, ""], strict=True))


def _quoted(text: object) -> str:
    return str(text).replace("'", "''")


def _names(kind: str) -> str:
    return ", ".join(name for name, _ in _COLUMNS[kind])


def _all_rows(kind: str, files: Sequence[str], condition: str = "true") -> str:
    """Return the statement that selects the loaded rows of the database and those of files."""
    rows = f"select {_names(kind)} from hot"
    if not files:
        return rows
    listed = ", ".join(f"'{_quoted(each)}'" for each in files)
    return f"{rows} union all select {_names(kind)} from read_parquet([{listed}]) where {condition}"


def _load(
    engine: duckdb.DuckDBPyConnection, kind: str, recent: sqlite3.Connection, condition: str, arguments: Sequence[Any]
) -> None:
    """Load rows of the database into the table `hot`."""
    columns = _COLUMNS[kind]
    engine.execute(f"create table hot ({', '.join(f'{name} {sql_type}' for name, sql_type in columns)})")
    chosen = ", ".join(
        f"nullif({name}, 'nan'::double)" if sql_type == "DOUBLE" else f"{name}::{sql_type}"
        for name, sql_type in columns
    )
    cursor = recent.execute(f"select {_names(kind)} from {_TABLES[kind]} where {condition}", arguments)
    for rows in iter(lambda: cursor.fetchmany(BATCH), []):
        batch = {
            name.strip('"'): np.array(values, dtype=_DTYPES[sql_type])
            for (name, sql_type), values in zip(columns, zip(*rows, strict=True), strict=True)
        }
        engine.register("batch", batch)
        engine.execute(f"insert into hot select {chosen} from batch")
        engine.unregister("batch")


_DTYPES: Final[dict[str, Any]] = {
    "INTEGER": np.int32,
    "BIGINT": np.int64,
    "DOUBLE": np.float64,
    "UTINYINT": np.uint8,
    "VARCHAR": object,
}


@contextmanager
def _snapshot(directory: Path) -> Iterator[sqlite3.Connection]:
    """Open the database in one transaction that only reads."""
    address = f"{(directory / DATABASE).absolute().as_uri()}?mode=ro"
    with closing(sqlite3.connect(address, uri=True, isolation_level=None)) as connection:
        connection.execute("begin")
        yield connection


@contextmanager
def _engine(directory: Path, threads: int) -> Iterator[duckdb.DuckDBPyConnection]:
    """Start DuckDB in memory. It may access only the directory of the history, and loads no extensions."""
    with closing(duckdb.connect(":memory:", config={"threads": threads, "memory_limit": MEMORY})) as engine:
        engine.execute(f"set allowed_directories = ['{_quoted(directory)}/']")
        engine.execute(f"set temp_directory = '{_quoted(directory)}/.spilled'")
        engine.execute("set enable_external_access = false")
        engine.execute("set lock_configuration = true")
        yield engine


def _unusable(directory: Path, error: Exception) -> StorageError:
    reason = str(error).partition("\n")[0]
    return StorageError("The history in {directory} cannot be used: {reason}", directory=directory, reason=reason)
