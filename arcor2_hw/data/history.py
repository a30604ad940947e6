"""The history of points and runs (docs/protocol/history.md). Times in answers are ms since 1970 (UTC)."""

from typing import Annotated, Final

from msgspec import Meta

from arcor2_hw.data.base import UNSET, Data, Timestamp, Unset
from arcor2_hw.data.editor import RunEnd
from arcor2_hw.data.points import PointQuality, PointUse

MAX_BUCKETS: Final = 2000
"""Maximum number of buckets in an answer."""
MAX_VALUES: Final = 100_000
"""Maximum number of values or runs in an answer."""


class HistoryQuery(Data, frozen=True):
    """Selects the values of a point.

    point: its number. since, until: default to the last hour. buckets: number of equal parts of the period. limit:
    maximum number of values that are not summarized.
    """

    point: int
    since: Timestamp | Unset = UNSET
    until: Timestamp | Unset = UNSET
    buckets: Annotated[int, Meta(ge=1, le=MAX_BUCKETS)] = 400
    limit: Annotated[int, Meta(ge=1, le=MAX_VALUES)] = 10_000


class HistoryPointQuery(Data, frozen=True):
    """Selects points. object_id: of one device only."""

    object_id: str | Unset = UNSET


class HistoryRunQuery(Data, frozen=True):
    """Selects runs that have ended, newest first. since, until: of their end. package_id: of one package only."""

    since: Timestamp | Unset = UNSET
    until: Timestamp | Unset = UNSET
    package_id: str | Unset = UNSET
    limit: Annotated[int, Meta(ge=1, le=MAX_VALUES)] = 100


class HistoryPoint(Data, frozen=True):
    """A point that was recorded.

    number: identifies it in queries. name: as in ObjectPoints. digital: whether its values are on (1) and off (0).
    last: time of its newest value.
    """

    number: int
    object_id: str
    object_name: str
    name: str
    use: PointUse
    unit: str
    digital: bool
    last: int


class PointSummary(Data, frozen=True):
    """The values of a point in equal parts of a period: one entry in each list for each part with a known value.

    times: start of the part. lowest, highest: of all values that were in effect. mean: weighted by the time for
    which each value was in effect. counts: number of recorded values.
    """

    since: int
    until: int
    times: list[int]
    lowest: list[float]
    highest: list[float]
    mean: list[float]
    counts: list[int]


class PointValues(Data, frozen=True):
    """The recorded values of a point, oldest first.

    values: number, text, or null if it was not known. complete: false if there are more than the limit.
    """

    times: list[int]
    values: list[float | str | None]
    qualities: list[PointQuality]
    complete: bool


class PastRun(Data, frozen=True):
    """A run that has ended.

    number: of the run, for `/api/runs/{number}/summary` and `/api/units?run=`. error: empty if it did not fail. cycles,
    good, bad: as in RunStatistics.
    """

    number: int
    started: int
    ended: int
    end: RunEnd
    package_id: str
    package_name: str
    project: str = ""
    started_by: str = ""
    product: str = ""
    revision: int = 0
    order_id: str = ""
    error: str = ""
    actions: int = 0
    cycles: int = 0
    good: int = 0
    bad: int = 0


class HistoryState(Data, frozen=True):
    """Content of the history, and whether it is being recorded.

    recording: false if the server was started without `--history`. hot_bytes, cold_bytes: sizes of the database and of
    the Parquet files. rows: number of values and runs in these files. dropped: values that could not be stored since
    the start of the server. problem: reason why no data is stored at present; empty if there is none.
    """

    recording: bool
    hot_bytes: int = 0
    cold_bytes: int = 0
    files: int = 0
    rows: int = 0
    dropped: int = 0
    problem: str = ""


# Names before version 0.2.
MOST_BUCKETS, MOST_VALUES = MAX_BUCKETS, MAX_VALUES
