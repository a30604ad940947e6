"""Tasks of the history worker, which reads and writes Parquet files with DuckDB. Imports no DuckDB."""

from typing import ClassVar, Final

from msgspec import field

from arcor2_hw.compute.task import Task, WorkerKind
from arcor2_hw.data.base import Data
from arcor2_hw.data.history import PastRun, PointSummary, PointValues
from arcor2_hw.messages import Message

DATABASE: Final = "recent.sqlite"
"""Name of the SQLite file with the newest rows, and with the list of the Parquet files."""
REPEATED_AFTER_MS: Final = 600_000
"""Time after which an unchanged value is recorded again, ms."""
VALID_MS: Final = 660_000
"""Longest time for which a recorded value is in effect, ms. Afterwards it is unknown, for example after a power cut."""
POINTS: Final = "points"
RUNS: Final = "runs"


class ColdFile(Data, frozen=True):
    """A Parquet file.

    Attributes:
        kind: POINTS or RUNS.
        name: Its name.
        first: Time of its oldest row, ms since 1970.
        last: Time of its newest row, ms since 1970.
        rows: Number of its rows.
        size: Size, bytes.
    """

    kind: str
    name: str
    first: int
    last: int
    rows: int
    size: int


class ColdFileResult(Data, frozen=True):
    """The result of WriteColdFile.

    Attributes:
        file: The file; None if no rows were found.
        last_id: Id of the newest row of the database that it contains.
    """

    file: ColdFile | None
    last_id: int = 0


class WriteColdFile(Task[ColdFileResult], frozen=True):
    """Write rows of the database and the content of other Parquet files into a new Parquet file.

    Attributes:
        directory: Directory of the history.
        kind: POINTS or RUNS.
        name: Name of the new file.
        before: Time before which rows of the database are included, ms since 1970; 0 for none.
        merged: Names of the Parquet files whose rows are included.
    """

    result_type: ClassVar = ColdFileResult
    function: ClassVar = "arcor2_hw.compute.history_functions:write_cold_file"
    worker: ClassVar = WorkerKind.HISTORY
    timeout: ClassVar = 600.0
    label: ClassVar = Message.of("moving the history to files")

    directory: str
    kind: str
    name: str
    before: int = 0
    merged: list[str] = field(default_factory=list)


class SummarizePoint(Task[PointSummary], frozen=True):
    """Return the smallest, largest and mean value of a point in equal parts of a period, ms since 1970."""

    result_type: ClassVar = PointSummary
    function: ClassVar = "arcor2_hw.compute.history_functions:summarize_point"
    worker: ClassVar = WorkerKind.HISTORY
    timeout: ClassVar = 30.0
    label: ClassVar = Message.of("the history of a point")

    directory: str
    point: int
    since: int
    until: int
    buckets: int


class ReadPoint(Task[PointValues], frozen=True):
    """Return the recorded values of a point in a period, ms since 1970."""

    result_type: ClassVar = PointValues
    function: ClassVar = "arcor2_hw.compute.history_functions:read_point"
    worker: ClassVar = WorkerKind.HISTORY
    timeout: ClassVar = 30.0
    label: ClassVar = Message.of("the history of a point")

    directory: str
    point: int
    since: int
    until: int
    limit: int


class ReadRuns(Task[list[PastRun]], frozen=True):
    """Return the newest runs that ended in a period, ms since 1970. package_id: empty for all packages."""

    result_type: ClassVar = list[PastRun]
    function: ClassVar = "arcor2_hw.compute.history_functions:read_runs"
    worker: ClassVar = WorkerKind.HISTORY
    timeout: ClassVar = 30.0
    label: ClassVar = Message.of("the history of runs")

    directory: str
    since: int
    until: int
    limit: int
    package_id: str = ""


HistoryTask = ReadPoint | ReadRuns | SummarizePoint | WriteColdFile
