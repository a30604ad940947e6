"""Places: which places of a grid have a part, optionally stored in a file."""

from pathlib import Path
from typing import Final

import msgspec

from arcor2_hw.files import replace_file

VERSION: Final = 1


class BadState(Exception):
    """The file does not contain the state of this grid."""


class _Stored(msgspec.Struct, forbid_unknown_fields=True):
    version: int
    rows: int
    columns: int
    full: str


class Places:
    """Places in rows and columns, counted row by row; with `snake`, every second row backwards.

    With a file, every change is on disk when the method returns.
    """

    def __init__(self, rows: int, columns: int, snake: bool, starts_full: bool, file: Path | None = None) -> None:
        self.rows, self.columns = rows, columns
        self._snake, self._file = snake, file
        self._full = [starts_full] * (rows * columns)

    def load(self) -> None:
        """Read the file, if there is one. Raises BadState, OSError."""
        if self._file is None:
            return
        try:
            data = self._file.read_bytes()
        except FileNotFoundError:
            self._store()  # report now, not after the first part, that the file cannot be written
            return
        try:
            stored = msgspec.json.decode(data, type=_Stored)
        except msgspec.DecodeError as error:
            raise BadState(f"{self._file} is not readable: {error}") from error
        if stored.version != VERSION or (stored.rows, stored.columns) != (self.rows, self.columns):
            raise BadState(
                f"{self._file} is of {stored.rows} rows and {stored.columns} columns (version {stored.version})"
            )
        if len(stored.full) != len(self._full) or set(stored.full) - {"0", "1"}:
            raise BadState(f"{self._file} does not hold {len(self._full)} places")
        self._full = [each == "1" for each in stored.full]

    @property
    def count(self) -> int:
        """Return the number of parts."""
        return sum(self._full)

    def next(self, full: bool) -> tuple[int, int] | None:
        """Return row and column of the next place with a part (`full`) or without; None when there is none."""
        for number in range(self.rows * self.columns):
            row, column = divmod(number, self.columns)
            if self._snake and row % 2:
                column = self.columns - 1 - column
            if self.full(row, column) == full:
                return row, column
        return None

    def full(self, row: int, column: int) -> bool:
        """Return whether a place has a part. Raises IndexError."""
        return self._full[self._index(row, column)]

    def set(self, row: int, column: int, full: bool) -> None:
        """Set whether a place has a part. Raises IndexError, OSError; nothing has changed then."""
        changed = list(self._full)
        changed[self._index(row, column)] = full
        self._change(changed)

    def set_all(self, full: bool) -> None:
        """Set whether all places have a part. Raises OSError; nothing has changed then."""
        self._change([full] * len(self._full))

    def _index(self, row: int, column: int) -> int:
        if not (0 <= row < self.rows and 0 <= column < self.columns):
            raise IndexError(f"row {row}, column {column} is outside of the {self.rows} x {self.columns} places")
        return row * self.columns + column

    def _change(self, new: list[bool]) -> None:
        before, self._full = self._full, new
        try:
            self._store()
        except OSError:
            self._full = before
            raise

    def _store(self) -> None:
        if self._file is None:
            return
        stored = _Stored(VERSION, self.rows, self.columns, "".join("1" if each else "0" for each in self._full))
        replace_file(self._file, msgspec.json.encode(stored))
