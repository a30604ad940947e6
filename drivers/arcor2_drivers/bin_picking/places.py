"""Places of a grid: which have a part, which is next. Knows nothing of poses; a file may keep it."""

import os
import tempfile
from pathlib import Path
from typing import Final

import msgspec

VERSION: Final = 1


class BadState(Exception):
    """The file does not hold the state of this grid."""


class _Kept(msgspec.Struct, forbid_unknown_fields=True):
    version: int
    rows: int
    columns: int
    full: str


class Places:
    """Rows and columns, counted along the columns; with `snake` every second row backwards.

    With a file, every change is on the disk before the call returns.
    """

    def __init__(self, rows: int, columns: int, snake: bool, starts_full: bool, file: Path | None = None) -> None:
        self.rows, self.columns = rows, columns
        self._snake, self._file = snake, file
        self._full = [starts_full] * (rows * columns)

    def load(self) -> None:
        """Read the file, where there is one. Raises BadState, OSError."""
        if self._file is None:
            return
        try:
            data = self._file.read_bytes()
        except FileNotFoundError:
            self._keep()  # whether it can be written is better known now than after the first part
            return
        try:
            kept = msgspec.json.decode(data, type=_Kept)
        except msgspec.DecodeError as error:
            raise BadState(f"{self._file} is not readable: {error}") from error
        if kept.version != VERSION or (kept.rows, kept.columns) != (self.rows, self.columns):
            raise BadState(f"{self._file} is of {kept.rows} rows and {kept.columns} columns (version {kept.version})")
        if len(kept.full) != len(self._full) or set(kept.full) - {"0", "1"}:
            raise BadState(f"{self._file} does not hold {len(self._full)} places")
        self._full = [each == "1" for each in kept.full]

    @property
    def count(self) -> int:
        """Return how many places have a part."""
        return sum(self._full)

    def next(self, full: bool) -> tuple[int, int] | None:
        """Return row and column of the next place with a part, or without; None when there is none."""
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
        """Note that a place has a part, or has none. Raises IndexError, OSError; then nothing has changed."""
        changed = list(self._full)
        changed[self._index(row, column)] = full
        self._change(changed)

    def set_all(self, full: bool) -> None:
        """Note that all places have a part, or that none has. Raises OSError."""
        self._change([full] * len(self._full))

    def _index(self, row: int, column: int) -> int:
        if not (0 <= row < self.rows and 0 <= column < self.columns):
            raise IndexError(f"there is no row {row}, column {column} in {self.rows} rows and {self.columns} columns")
        return row * self.columns + column

    def _change(self, new: list[bool]) -> None:
        before, self._full = self._full, new
        try:
            self._keep()
        except OSError:
            self._full = before
            raise

    def _keep(self) -> None:
        if self._file is None:
            return
        kept = _Kept(VERSION, self.rows, self.columns, "".join("1" if each else "0" for each in self._full))
        descriptor, name = tempfile.mkstemp(dir=self._file.parent, prefix=f".{self._file.name}.")
        try:
            with os.fdopen(descriptor, "wb") as file:
                file.write(msgspec.json.encode(kept))
                file.flush()
                os.fsync(file.fileno())
            Path(name).replace(self._file)
        except BaseException:
            Path(name).unlink(missing_ok=True)
            raise
