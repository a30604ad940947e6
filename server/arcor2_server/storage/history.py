"""The newest rows of the history in an SQLite file, and the list of the Parquet files with older rows.

All methods block and belong to one thread. A Parquet file counts as soon as it is listed; the same transaction states
which rows of the database it contains. These rows are then ignored, and deleted later in small steps.
"""
# ruff: noqa: S608 - statements contain only fixed names, and file names in quotation marks

import contextlib
import shutil
import sqlite3
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Final

import structlog

from arcor2_hw.compute.history_tasks import DATABASE, POINTS, RUNS, ColdFile, ColdFileResult
from arcor2_hw.data.base import now
from arcor2_hw.data.history import HistoryPoint, PastRun
from arcor2_hw.data.points import PointUse
from arcor2_hw.exceptions import NotFound, StorageError
from arcor2_server.files import DIRECTORY_MODE, damaged_copy_path, ensure_private

log = structlog.get_logger(__name__)

MIN_FREE_SPACE: Final = 100_000_000
"""Free space of the disk below which nothing is stored, bytes."""
CLEARED_AT_ONCE: Final = 10_000
"""Number of rows that are deleted in one transaction."""
_BUSY_TIMEOUT: Final = 5.0
_SCHEMA: Final = """
create table if not exists point (
    number integer primary key, object_id text not null, object_name text not null, name text not null,
    use text not null, unit text not null, digital integer not null, last integer not null, unique (object_id, name)
) strict;
create table if not exists sample (
    id integer primary key autoincrement, point integer not null, time integer not null, value real, text text,
    quality integer not null
) strict;
create index if not exists sample_of_point on sample (point, time);
create table if not exists run (
    id integer primary key autoincrement, number integer not null, started integer not null, time integer not null,
    "end" text not null, package_id text not null, package_name text not null, project text not null,
    started_by text not null, product text not null, revision integer not null, order_id text not null,
    error text not null, actions integer not null, cycles integer not null, good integer not null, bad integer not null
) strict;
create table if not exists cold (
    id integer primary key autoincrement, kind text not null, name text not null unique, first integer not null,
    last integer not null, rows integer not null, size integer not null, last_id integer not null,
    before integer not null, clearing integer not null
) strict;
"""
_TABLES: Final = {POINTS: "sample", RUNS: "run"}
_POINT: Final = "number, object_id, object_name, name, use, unit, digital, last"
_COLD: Final = "kind, name, first, last, rows, size"

Sample = tuple[int, int, float | None, str | None, int]
"""Number of the point, time in ms since 1970, value, text, number of the quality."""


class HistoryFile:
    """The database of the history, opened by `open`. All methods raise StorageError if it cannot be used.

    Args:
        directory: the directory of the history.
    """

    def __init__(self, directory: Path) -> None:
        self.directory = directory
        self._connection: sqlite3.Connection | None = None

    def open(self) -> None:
        """Open or create the database, and delete Parquet files that are not listed. A damaged history is renamed."""
        try:
            try:
                self._open()
            except sqlite3.DatabaseError as error:
                self.close()
                if isinstance(error, sqlite3.OperationalError):
                    raise
                stored = damaged_copy_path(self.directory, now())
                self.directory.rename(stored)
                log.error("the history was damaged; a new one is started", stored=stored.name, reason=str(error))
                self._open()
        except (sqlite3.Error, OSError) as error:
            self.close()
            raise self._unusable(error) from error

    def _open(self) -> None:
        self.directory.mkdir(parents=True, exist_ok=True, mode=DIRECTORY_MODE)
        path = self.directory / DATABASE
        ensure_private(path)
        self._connection = connection = sqlite3.connect(
            path, timeout=_BUSY_TIMEOUT, isolation_level=None, check_same_thread=False
        )
        # The end of the process loses no committed row; a power cut may lose the rows of the last minutes.
        for pragma in ("journal_mode=wal", "synchronous=normal"):
            connection.execute(f"pragma {pragma}")
        if (verdict := connection.execute("pragma quick_check(1)").fetchone()[0]) != "ok":
            raise sqlite3.DatabaseError(verdict)
        connection.executescript(_SCHEMA)
        listed = {name for (name,) in connection.execute("select name from cold")}
        present = {each.name for each in self.directory.iterdir() if each.suffix == ".parquet"}
        for name in present - listed:
            (self.directory / name).unlink()
        for name in listed - present:
            log.error("file of the history is missing", file=name)
            connection.execute("delete from cold where name = ?", (name,))
        for each in self.directory.glob(".*.new"):
            each.unlink()
        shutil.rmtree(self.directory / ".spilled", ignore_errors=True)

    def close(self) -> None:
        """Close the database."""
        if self._connection is not None:
            self._connection.close()
            self._connection = None

    @contextlib.contextmanager
    def _transaction(self) -> Iterator[sqlite3.Connection]:
        if self._connection is None:
            raise StorageError("The history is closed.")
        try:
            self._connection.execute("begin immediate")
            try:
                yield self._connection
            except BaseException:
                self._connection.execute("rollback")
                raise
            self._connection.execute("commit")
        except (sqlite3.Error, OSError) as error:
            raise self._unusable(error) from error

    def _unusable(self, error: Exception) -> StorageError:
        return StorageError(
            "The history in {directory} cannot be used: {reason}", directory=self.directory, reason=error
        )

    # -------------------------------------------------------------------------------- recording
    def require_space(self) -> None:
        """Raise StorageError if the disk is nearly full."""
        if shutil.disk_usage(self.directory).free < MIN_FREE_SPACE:
            raise StorageError("The disk of the server is nearly full. The history is not recorded.")

    def number_points(self, points: Sequence[HistoryPoint]) -> list[int]:
        """Store points under their object and name; return their numbers."""
        numbers = []
        with self._transaction() as connection:
            for each in points:
                (number,) = connection.execute(
                    f"insert into point ({_POINT}) values (null, ?, ?, ?, ?, ?, ?, ?) "
                    "on conflict (object_id, name) do update set object_name = excluded.object_name, "
                    "use = excluded.use, unit = excluded.unit, digital = excluded.digital returning number",
                    (each.object_id, each.object_name, each.name, each.use.value, each.unit, each.digital, each.last),
                ).fetchone()
                numbers.append(number)
        return numbers

    def put(self, samples: Sequence[Sample], runs: Iterable[PastRun] = ()) -> None:
        """Store values of points, and runs."""
        with self._transaction() as connection:
            connection.executemany("insert into sample values (null, ?, ?, ?, ?, ?)", samples)
            newest = {point: time for point, time, *_ in samples}
            connection.executemany(
                "update point set last = max(last, ?) where number = ?",
                [(time, point) for point, time in newest.items()],
            )
            for run in runs:
                values = [getattr(run, name) for name in PastRun.__struct_fields__]
                connection.execute(f"insert into run values (null{', ?' * len(values)})", values)

    # -------------------------------------------------------------------------------- Parquet files
    def oldest(self, kind: str) -> int | None:
        """Return the time of the row that was stored first, ms since 1970; None without rows."""
        with self._transaction() as connection:
            row = connection.execute(f"select time from {_TABLES[kind]} order by id limit 1").fetchone()
        return None if row is None else row[0]

    def files(self, kind: str) -> list[ColdFile]:
        """Return the listed files, oldest first."""
        with self._transaction() as connection:
            rows = connection.execute(
                f"select {_COLD} from cold where kind = ? order by first, id",
                (kind,),
            ).fetchall()
        return [ColdFile(*row) for row in rows]

    def unused_name(self, kind: str, day: str) -> str:
        """Return a name for a new file that no other file has had."""
        with self._transaction() as connection:
            row = connection.execute("select seq from sqlite_sequence where name = 'cold'").fetchone()
        return f"{kind}-{day}-{(row[0] if row else 0) + 1:06}.parquet"

    def add(self, written: ColdFileResult, before: int, replaced: Sequence[str] = ()) -> None:
        """List a file with the rows of the database before a time, and with those of the files that it replaces."""
        with self._transaction() as connection:
            connection.executemany("delete from cold where name = ?", [(name,) for name in replaced])
            if (file := written.file) is not None:
                row = (file.kind, file.name, file.first, file.last, file.rows, file.size)
                connection.execute(
                    f"insert into cold ({_COLD}, last_id, before, clearing) values (?, ?, ?, ?, ?, ?, ?, ?, 1)",
                    (*row, written.last_id, before),
                )
        self._unlink(replaced)

    def clear(self) -> bool:
        """Delete some of the rows that are in a listed file. Return whether none is left."""
        with self._transaction() as connection:
            found = connection.execute("select id, kind, last_id, before from cold where clearing limit 1").fetchone()
            if found is None:
                return True
            cold, kind, last_id, before = found
            deleted = connection.execute(
                f"delete from {_TABLES[kind]} where id in (select id from {_TABLES[kind]} "
                "where id <= ? and time < ? order by id limit ?)",
                (last_id, before, CLEARED_AT_ONCE),
            ).rowcount
            if deleted < CLEARED_AT_ONCE:
                connection.execute("update cold set clearing = 0 where id = ?", (cold,))
        return False

    def remove(self, names: Sequence[str]) -> None:
        """Delete files whose time is over."""
        with self._transaction() as connection:
            connection.executemany("delete from cold where name = ?", [(name,) for name in names])
        self._unlink(names)

    def forget(self, before: int, rows: int = 0) -> None:
        """Delete points without newer values, ms since 1970, and the given number of rows that were stored first."""
        with self._transaction() as connection:
            connection.execute("delete from point where last < ?", (before,))
            connection.execute("delete from sample where id in (select id from sample order by id limit ?)", (rows,))

    def _unlink(self, names: Iterable[str]) -> None:
        for name in names:
            with contextlib.suppress(OSError):  # the next start deletes it
                (self.directory / name).unlink(missing_ok=True)

    # -------------------------------------------------------------------------------- queries
    def points(self) -> list[HistoryPoint]:
        """Return all points, by the names of device and point."""
        with self._transaction() as connection:
            rows = connection.execute(f"select {_POINT} from point order by object_name, name").fetchall()
        return [
            HistoryPoint(number, object_id, object_name, name, PointUse(use), unit, bool(digital), last)
            for number, object_id, object_name, name, use, unit, digital, last in rows
        ]

    def require_point(self, number: int) -> HistoryPoint:
        """Return a point. Raise NotFound if it does not exist."""
        found = next((each for each in self.points() if each.number == number), None)
        if found is None:
            raise NotFound("The history contains no point with the number {number}.", number=number)
        return found

    def sizes(self) -> tuple[int, int, int, int]:
        """Return the size of the database and of the files, bytes, the number of files, and that of their rows."""
        with self._transaction() as connection:
            pages, page = (connection.execute(f"pragma {each}").fetchone()[0] for each in ("page_count", "page_size"))
            free = connection.execute("pragma freelist_count").fetchone()[0]
            files, size, rows = connection.execute(
                "select count(*), coalesce(sum(size), 0), coalesce(sum(rows), 0) from cold"
            ).fetchone()
        return (pages - free) * page, size, files, rows
