"""The file of the server of the fleet: known cells, and the units and alarms of all cells. Its methods block."""

import contextlib
import sqlite3
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Final, NamedTuple

import msgspec
import structlog

from arcor2_hw.data.base import Data, Timestamp
from arcor2_hw.exceptions import StorageError
from arcor2_server.files import ensure_private
from arcor2_server.fleet import columns
from arcor2_server.fleet.registry import StoredCell
from arcor2_server.fleet.summaries import Columns

log = structlog.get_logger(__name__)

FILE: Final = "fleet.sqlite"
"""Name in the data directory."""
MAX_RESULTS: Final = 1_000_000
"""Maximum number of stored results. Beyond it the oldest are deleted."""
_VERSION: Final = 3
_SCHEMA: Final = """
create table if not exists cell (
  name text not null, identity text not null, document blob not null, primary key (name, identity)
) without rowid;
create table if not exists result (
  id integer primary key autoincrement, cell text not null, identity text not null, kind text not null,
  number integer not null, since text not null, stamp integer not null, document blob not null,
  unique (identity, kind, number, since)
);
create index if not exists result_of_cell on result (cell, kind, id);
"""
_encode = msgspec.json.Encoder().encode
_decode = msgspec.json.Decoder(StoredCell).decode


class ReceivedResult(NamedTuple):
    """A result of a cell.

    number, since: of the record, and when the unit entered or the alarm was raised; a cell whose data was restored may
    use a number again. stamp: when the broker stored it, µs since the epoch. document: the record as JSON.
    columns: what queries use, from the record.
    """

    cell: str
    identity: str
    kind: str
    number: int
    since: Timestamp
    stamp: int
    document: bytes
    columns: Columns


class FleetResult(Data, frozen=True):
    """A stored result. id: grows with the time of arrival of its first version."""

    id: int
    cell: str
    identity: str
    kind: str
    record: msgspec.Raw


class FleetFile:
    """The file. All methods may raise StorageError; one thread at a time may call them."""

    def __init__(self, path: Path) -> None:
        self.path = path
        with self._guarded():
            ensure_private(path)
            self._connection = sqlite3.connect(path, isolation_level=None, check_same_thread=False, timeout=5.0)
            self._connection.execute("pragma journal_mode=wal")
            self._connection.execute("pragma synchronous=full")
            version = self._connection.execute("pragma user_version").fetchone()[0]
            if version > _VERSION:
                raise StorageError("{file} was written by a newer version. Update arcor2-hw.", file=path)
            self._connection.executescript(_SCHEMA)
            if version < _VERSION:
                with self._connection:
                    self._connection.execute("begin immediate")
                    columns.upgrade_schema(self._connection, version)
                    self._connection.execute(f"pragma user_version={_VERSION}")

    def close(self) -> None:
        """Close the file."""
        self._connection.close()

    @contextlib.contextmanager
    def _guarded(self) -> Iterator[None]:
        try:
            yield
        except (sqlite3.Error, OSError) as error:
            raise StorageError("{file} cannot be used: {reason}.", file=self.path, reason=error) from error

    @contextlib.contextmanager
    def _transaction(self) -> Iterator[None]:
        with self._guarded(), self._connection:
            self._connection.execute("begin immediate")
            yield

    # -------------------------------------------------------------------------------- cells
    def cells(self) -> list[StoredCell]:
        """Return the stored cells, without unreadable ones."""
        with self._guarded():
            rows = self._connection.execute("select document from cell order by name, identity").fetchall()
        found = []
        for (document,) in rows:
            try:
                found.append(_decode(document))
            except msgspec.MsgspecError as error:
                log.warning("stored cell left out", reason=str(error))
        return found

    def put_cells(self, cells: Iterable[StoredCell]) -> None:
        """Store cells."""
        rows = [(each.name, each.state.identity, _encode(each)) for each in cells]
        with self._transaction():
            self._connection.executemany("insert or replace into cell values (?, ?, ?)", rows)

    def remove_cell(self, name: str, identity: str) -> None:
        """Forget a cell. Its results stay."""
        with self._transaction():
            self._connection.execute("delete from cell where name = ? and identity = ?", (name, identity))

    # -------------------------------------------------------------------------------- results
    def put_results(self, results: Sequence[ReceivedResult]) -> None:
        """Store results durably. A stored result is replaced only by a newer version."""
        with self._transaction():
            self._connection.executemany(columns.PUT_RESULT, [(*each[:-1], *each.columns) for each in results])
            self._connection.execute("delete from result where id <= (select max(id) from result) - ?", (MAX_RESULTS,))

    def results(self, cell: str, kind: str, before: int, limit: int) -> list[FleetResult]:
        """Return results, newest first.

        Args:
            cell: name of the cell; empty: of all cells.
            kind: "unit" or "alarm"; empty: both.
            before: id of the first result that is left out; 0: none.
            limit: maximum number of results.
        """
        where, values = [], list[str | int]()
        for column, value in (("cell", cell), ("kind", kind)):
            if value:
                where.append(f"{column} = ?")
                values.append(value)
        if before:
            where.append("id < ?")
            values.append(before)
        condition = f"where {' and '.join(where)} " if where else ""
        query = f"select id, cell, identity, kind, document from result {condition}order by id desc limit ?"  # noqa: S608 (only texts from above)
        with self._guarded():
            rows = self._connection.execute(query, (*values, limit)).fetchall()
        return [FleetResult(row[0], row[1], row[2], row[3], msgspec.Raw(row[4])) for row in rows]

    def count(self) -> int:
        """Return the number of stored results."""
        with self._guarded():
            found: int = self._connection.execute("select count(*) from result").fetchone()[0]
        return found
