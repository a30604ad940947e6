"""Decides which values of points are recorded: those that have changed by more than their dead band."""

from collections.abc import Iterable, Sequence
from fnmatch import fnmatchcase
from typing import Final

import structlog

from arcor2_hw.compute.history_tasks import REPEATED_AFTER_MS
from arcor2_hw.data.base import Unset
from arcor2_hw.data.points import LivePoint, PointQuality, PointUse, PointValue
from arcor2_server.settings import DeadBand

log = structlog.get_logger(__name__)

MAX_POINTS: Final = 2000
"""Maximum number of recorded points."""
MAX_WAITING: Final = 100_000
"""Maximum number of values that wait until they are stored. Beyond it the oldest are lost."""
MAX_TEXT: Final = 200
"""Maximum length of a recorded text, characters."""
_NUMBERS: Final = {quality: number for number, quality in enumerate(PointQuality)}
_UNKNOWN: Final = (PointQuality.BAD, PointQuality.NOT_CONNECTED)
"""Qualities with which a value is treated as unknown."""


class RecordedPoint:
    """A point and its last recorded value. number: number in the database, 0 until it is known."""

    __slots__ = ("band", "digital", "name", "number", "object_id", "object_name", "quality", "time", "unit", "use",
                 "value")  # fmt: skip

    def __init__(self, object_id: str, object_name: str, point: LivePoint, band: float) -> None:
        self.object_id, self.object_name, self.name = object_id, object_name, point.name
        self.use: PointUse = point.use
        self.unit = point.unit
        self.digital = isinstance(point.value, bool)
        self.band = band
        self.number = 0
        self.value: PointValue = None
        self.quality: PointQuality | None = None
        self.time = -10 * REPEATED_AFTER_MS


Waiting = tuple[RecordedPoint, int, float | None, str | None, int]
"""A value that waits until it is stored: point, time in ms since 1970, number, text, code of the quality."""


class PointRecorder:
    """Collects the values to be stored, until `take` returns them.

    Args:
        interval: least time between two values of a point, s.
        bands: dead bands; the first one that matches counts.
    """

    def __init__(self, interval: float, bands: Sequence[DeadBand] = ()) -> None:
        self._interval = round(interval * 1000)
        self._bands = bands
        self._points: dict[str, dict[str, RecordedPoint]] = {}
        self._count = 0
        self._waiting: list[Waiting] = []
        self.dropped = 0
        """Number of values that were lost because they could not be stored."""

    def device_reported(self, object_id: str, object_name: str, points: Iterable[LivePoint], at: int) -> None:
        """Record the changed points of a device. at: time of the report, ms since 1970."""
        known = self._points.setdefault(object_id, {})
        for point in points:
            recorded = known.get(point.name)
            if recorded is None:
                if self._count >= MAX_POINTS:
                    continue
                recorded = known[point.name] = self._added(object_id, object_name, point)
            time = at if isinstance(point.age, Unset) else at - round(point.age * 1000)
            value = None if point.quality in _UNKNOWN else point.value
            if isinstance(value, str):
                value = value[:MAX_TEXT]
            since = at - recorded.time
            if recorded.quality is point.quality and _within_band(recorded.value, value, recorded.band):
                if 0 <= since < REPEATED_AFTER_MS:
                    continue
                time = at
            elif 0 <= since < self._interval and recorded.quality is point.quality:
                continue  # the next report records the change if it persists
            self._record(recorded, time, value, point.quality)

    def values_unknown(self, object_id: str, quality: PointQuality, at: int) -> None:
        """Record that the values of a device are unknown, since it is not connected or cannot read them."""
        for recorded in self._points.get(object_id, {}).values():
            if recorded.quality not in _UNKNOWN:
                self._record(recorded, at, None, quality)

    def device_removed(self, object_id: str, at: int) -> None:
        """Record that a device is no longer in operation."""
        self.values_unknown(object_id, PointQuality.NOT_CONNECTED, at)
        self._count -= len(self._points.pop(object_id, {}))

    def _added(self, object_id: str, object_name: str, point: LivePoint) -> RecordedPoint:
        self._count += 1
        if self._count == MAX_POINTS:
            log.warning("further points are not recorded", most=MAX_POINTS)
        name = f"{object_name}.{point.name}"
        band = next((each.band for each in self._bands if fnmatchcase(name, each.pattern)), 0.0)
        return RecordedPoint(object_id, object_name, point, band)

    def _record(self, recorded: RecordedPoint, time: int, value: PointValue, quality: PointQuality) -> None:
        if (
            recorded.time - 2000 < time <= recorded.time
        ):  # two values in one ms; a clock set back by more than that is accepted
            time = recorded.time + 1
        if isinstance(value, bool):
            recorded.digital = True
        recorded.value, recorded.quality, recorded.time = value, quality, time
        number = None if value is None or isinstance(value, str) else float(value)
        text = value if isinstance(value, str) else None
        self._waiting.append((recorded, time, number, text, _NUMBERS[quality]))
        if len(self._waiting) > MAX_WAITING:
            dropped = MAX_WAITING // 10
            del self._waiting[:dropped]
            self.dropped += dropped

    def take(self) -> list[Waiting]:
        """Remove and return the waiting values."""
        waiting, self._waiting = self._waiting, []
        return waiting

    def put_back(self, values: list[Waiting]) -> None:
        """Put back values that could not be written, before newer ones."""
        kept = values[max(0, len(values) + len(self._waiting) - MAX_WAITING) :]
        self.dropped += len(values) - len(kept)
        self._waiting = kept + self._waiting


def _within_band(a: PointValue, b: PointValue, band: float) -> bool:
    if isinstance(a, bool | int | float) and isinstance(b, bool | int | float):
        return abs(a - b) <= band
    return a == b
