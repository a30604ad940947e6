"""The audit trail as CSV."""

import csv
import io
from collections.abc import Iterable, Iterator
from typing import Final

import msgspec

from arcor2_hw.data.audit import AuditEntry

COLUMNS: Final = tuple(field.name for field in msgspec.structs.fields(AuditEntry))
LINES_AT_ONCE: Final = 1000
"""Number of entries in one chunk of an export."""


def csv_chunks(entries: Iterable[AuditEntry]) -> Iterator[bytes]:
    """Return entries as CSV, in chunks. The changes of an entry are JSON."""
    text = io.StringIO()
    writer = csv.writer(text)
    writer.writerow(COLUMNS)
    for number, entry in enumerate(entries, 1):
        fields = msgspec.structs.asdict(entry)
        fields["changes"] = msgspec.json.encode(entry.changes).decode() if entry.changes else ""
        writer.writerow(as_cell(fields[name]) for name in COLUMNS)
        if number % LINES_AT_ONCE == 0:
            yield text.getvalue().encode()
            text.seek(0)
            text.truncate()
    yield text.getvalue().encode()


def as_cell(value: object) -> str:
    """Return a value as text that a spreadsheet does not take for a formula."""
    text = str(value)
    return f"'{text}" if text.startswith(("=", "+", "-", "@", "\t", "\r")) else text
