"""The columns of stored results that reports use, counts of units by quarter of an hour, and an index for searching."""

import sqlite3
from typing import Final

import msgspec

from arcor2_hw.data.alarms import AlarmRecord
from arcor2_hw.data.units import UnitRecord
from arcor2_server.fleet.summaries import Columns, alarm_columns, unit_columns

SLOT: Final = 900
"""Time for which units are counted together, s. All time zones differ by a multiple of it."""
_COLUMNS: Final = {
    "at": "integer not null default 0",
    "until": "integer",
    "state": "text not null default ''",
    "label": "text not null default '' collate nocase",
    "program": "text not null default ''",
    "product": "text not null default ''",
    "times": "integer not null default 1",
    "summary": "blob not null default ''",
}
"""The fields of `Columns`."""
_FIELDS: Final = ("cell", "identity", "kind", "number", "since", "stamp", "document", *_COLUMNS)
_REPLACED: Final = ("document", "stamp", *_COLUMNS)
PUT_RESULT: Final = (
    f"insert into result ({', '.join(_FIELDS)}) values ({', '.join('?' * len(_FIELDS))}) "  # noqa: S608 (names from above)
    "on conflict (identity, kind, number, since) do update set "
    f"{', '.join(f'{name} = excluded.{name}' for name in _REPLACED)} where excluded.stamp > stamp"
)
"""Stores a result, or replaces it by a newer version."""
_BATCH: Final = 10_000


def _count_statement(row: str, sign: str) -> str:
    """Return a statement of a trigger that adds a row to the counts (sign +), or subtracts it (-)."""
    parts = ("good", "bad", "rejected")
    values = ", ".join(f"{sign}({row}.state = '{part}')" for part in parts)
    return (
        "insert into unit_count values "  # noqa: S608 (only texts from above)
        f"({row}.at / {SLOT}, {row}.cell, {row}.program, {row}.product, "
        f"{values}) on conflict do update set "
        f"{', '.join(f'{part} = {part} + excluded.{part}' for part in parts)};"
    )


_REPORTS: Final = (
    """create table unit_count (
      slot integer not null, cell text not null, program text not null, product text not null,
      good integer not null, bad integer not null, rejected integer not null, primary key (slot, cell, program, product)
    ) without rowid""",
    "create index bad_unit_at on result (at, id, cell) where kind = 'unit' and state in ('bad', 'rejected')",
    "create index bad_unit_of_cell on result (cell, at, id) where kind = 'unit' and state in ('bad', 'rejected')",
    "create index alarm_at on result (at, id, cell, label, times, until) where kind = 'alarm'",
    f"create trigger unit_added after insert on result when new.kind = 'unit' begin {_count_statement('new', '+')} end",
    "create trigger unit_removed after delete on result when old.kind = 'unit' "
    f"begin {_count_statement('old', '-')} end",
    "create trigger unit_changed after update of at, state, program, product on result when new.kind = 'unit' "
    f"begin {_count_statement('old', '-')} {_count_statement('new', '+')} end",
)
COUNT_ALL: Final = (
    f"insert into unit_count select at / {SLOT}, cell, program, product, "  # noqa: S608 (a number from above)
    "sum(state = 'good'), sum(state = 'bad'), sum(state = 'rejected') "
    "from result where kind = 'unit' group by 1, 2, 3, 4"
)
MIN_SEARCH_LENGTH: Final = 3
"""Minimum number of characters of a text that `unit_text` finds."""
_TEXT: Final = "{row}.id, {row}.label, '/' || {row}.cell || '/'"
_INDEXED: Final = f"insert into unit_text (rowid, serial, cell) values ({_TEXT.format(row='new')});"  # noqa: S608
_NOT_INDEXED: Final = (
    f"insert into unit_text (unit_text, rowid, serial, cell) values ('delete', {_TEXT.format(row='old')});"  # noqa: S608
)
INDEX_ALL: Final = (
    f"insert into unit_text (rowid, serial, cell) select {_TEXT.format(row='result')} from result "  # noqa: S608
    "where kind = 'unit' order by id"
)
_SEARCH: Final = (
    "drop index if exists unit_at",
    "create index unit_by_id on result (id, label, cell) where kind = 'unit'",
    "create virtual table unit_text using fts5(serial, cell, content='', columnsize=0, tokenize='trigram')",
    INDEX_ALL,
    f"create trigger unit_text_added after insert on result when new.kind = 'unit' begin {_INDEXED} end",
    f"create trigger unit_text_removed after delete on result when old.kind = 'unit' begin {_NOT_INDEXED} end",
    "create trigger unit_text_changed after update of label on result when new.kind = 'unit' "
    f"and new.label is not old.label begin {_NOT_INDEXED} {_INDEXED} end",
)


def upgrade_schema(connection: sqlite3.Connection, version: int) -> None:
    """Add the columns and tables that a file of an older version lacks.

    A million results of version 1 take about a minute.

    Raises:
        sqlite3.Error: the file cannot be changed.
    """
    if version < 2:
        _add_reports(connection)
    for statement in _SEARCH:
        connection.execute(statement)


def search_expression(serial: str, cell: str) -> str:
    """Return the expression with which `unit_text` finds units by a part of their serial number.

    Args:
        serial: at least MIN_SEARCH_LENGTH characters.
        cell: name of a cell; empty for all.
    """
    found = f"serial : {_quoted(serial)}"
    return f"{found} AND cell : {_quoted(f'/{cell}/')}" if cell else found


def _quoted(text: str) -> str:
    return '"' + text.replace('"', '""') + '"'


def _add_reports(connection: sqlite3.Connection) -> None:
    for name, kind in _COLUMNS.items():
        connection.execute(f"alter table result add column {name} {kind}")
    change = f"update result set {', '.join(f'{name} = ?' for name in _COLUMNS)} where id = ?"  # noqa: S608 (names)
    select = "select id, kind, stamp, document from result where id > ? order by id limit ?"
    last = -1
    while rows := connection.execute(select, (last, _BATCH)).fetchall():
        connection.executemany(change, [(*columns_of(*row[1:]), row[0]) for row in rows])
        last = rows[-1][0]
    for statement in _REPORTS:
        connection.execute(statement)
    connection.execute(COUNT_ALL)


def columns_of(kind: str, stamp: int, document: bytes) -> Columns:
    """Return the columns of a stored record."""
    received = stamp // 1_000_000
    if kind == "unit":
        return unit_columns(msgspec.json.decode(document, type=UnitRecord), {}, received)
    return alarm_columns(msgspec.json.decode(document, type=AlarmRecord), {}, received)
