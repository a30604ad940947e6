"""Records points and runs, moves them to Parquet files, deletes old ones, and answers queries."""

import asyncio
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from datetime import UTC, datetime
from functools import partial
from typing import Final, TypeVar

import msgspec
import structlog

from arcor2_hw.compute.history_tasks import (
    POINTS,
    RUNS,
    ColdFile,
    ReadPoint,
    ReadRuns,
    SummarizePoint,
    WriteColdFile,
)
from arcor2_hw.data.base import Timestamp, Unset
from arcor2_hw.data.device import Connection
from arcor2_hw.data.editor import Run
from arcor2_hw.data.history import (
    HistoryPoint,
    HistoryPointQuery,
    HistoryQuery,
    HistoryRunQuery,
    HistoryState,
    PastRun,
    PointSummary,
    PointValues,
)
from arcor2_hw.data.points import ObjectPointsData, PointQuality
from arcor2_hw.exceptions import Arcor2Error, InvalidData, NotFound, StorageError
from arcor2_hw.messages import Message, translatable
from arcor2_hw.runtime.messages import DeviceChanged
from arcor2_server.background import BackgroundTasks
from arcor2_server.compute.workers import Compute
from arcor2_server.errors import RequestRefused
from arcor2_server.history.recorder import PointRecorder, Waiting
from arcor2_server.hosts.session import HostSession
from arcor2_server.hosts.streams import POINTS as POINT_STREAM
from arcor2_server.settings import DeadBand, ServerSettings
from arcor2_server.storage.history import HistoryFile

log = structlog.get_logger(__name__)
R = TypeVar("R")

WRITE_PERIOD: Final = 0.5
"""Time for which values are collected before they are stored together, s. The end of the process loses them."""
MAINTAIN_PERIOD: Final = 60.0
"""Time between two checks for data that can be moved or deleted, s."""
HOUR: Final = 3_600_000
DAY: Final = 24 * HOUR
LATE: Final = 60_000
"""Time after the end of an hour at which its values are moved, ms: some may still wait to be stored."""
MAX_MERGED_ROWS: Final = 5_000_000
"""Maximum number of rows of a merged file, because queries wait while it is written."""
FEW_RUNS: Final = 10_000
"""Number of runs below which a file is merged with newer runs."""
MAX_RUNS_WAITING: Final = 1000
_CONNECTED: Final = (Connection.ONLINE, Connection.BACK)
_OWNER: Final = "history"
NOT_RECORDED: Final = translatable("The server records no history. Start it with --history.")


class _Points(msgspec.Struct):
    data: ObjectPointsData


_decode_points: Final = msgspec.json.Decoder(_Points).decode


class History:
    """The history of points and runs. Without `settings.point_history` it records nothing and refuses queries.

    Args:
        settings: interval, dead bands and retention.
        compute: runs DuckDB.
        hosts: the hosts of the scene and of the program, whose points are recorded.
        clock: returns the time, s since 1970.
    """

    def __init__(
        self,
        settings: ServerSettings,
        compute: Compute,
        hosts: Sequence[HostSession] = (),
        clock: Callable[[], float] = time.time,
    ) -> None:
        self._settings, self._compute, self._hosts, self._clock = settings, compute, hosts, clock
        self._file = HistoryFile(settings.point_history_dir)
        self._recorder = PointRecorder(settings.point_history_interval, dead_bands(settings))
        self._runs: list[PastRun] = []
        self._thread = ThreadPoolExecutor(1, "history")
        self._background = BackgroundTasks()
        self._writing, self._maintaining = asyncio.Lock(), asyncio.Lock()
        self._problem: Message | None = None
        self._open = False

    @property
    def configured(self) -> bool:
        """Whether the server was started with the history."""
        return self._settings.point_history

    async def open(self) -> None:
        """Open the history and start to record. If the history cannot be used, only the log reports it."""
        if not self._settings.point_history:
            return
        try:
            await self._in_thread(self._file.open)
        except StorageError as error:
            self._failed(error)
            return
        self._open = True
        for host in self._hosts:
            host.board.on_report.append(partial(self._device_reported, host))
            host.board.on_clear.append(self._devices_gone)
        self._background.spawn(self._write_periodically(), "history")
        self._background.spawn(self._maintain_periodically(), "retention of the history")

    async def close(self) -> None:
        """Store what waits, and close the history."""
        await self._background.cancel()
        if self._open:
            await self.flush()
        await self._in_thread(self._file.close)
        self._thread.shutdown()

    async def _in_thread(self, function: Callable[..., R], *arguments: object) -> R:
        return await asyncio.get_running_loop().run_in_executor(self._thread, partial(function, *arguments))

    def _failed(self, error: Arcor2Error) -> None:
        """Log a problem once."""
        if self._problem != error.message:
            self._problem = error.message
            log.warning("history not stored", reason=str(error))

    def _now(self) -> int:
        return round(self._clock() * 1000)

    # -------------------------------------------------------------------------------- recording
    def _device_reported(self, host: HostSession, report: DeviceChanged) -> None:
        if report.connection not in _CONNECTED:
            return
        rate = 1.0 / self._settings.point_history_interval
        receive = partial(self._received, host)
        host.streams.observe(report.object_id, POINT_STREAM, rate, receive, owner=_OWNER)

    def _devices_gone(self, objects: list[str]) -> None:
        for object_id in objects:
            self._recorder.device_removed(object_id, self._now())

    def _received(self, host: HostSession, encoded: bytes) -> None:
        data = _decode_points(encoded).data
        if data.reason:
            self._recorder.values_unknown(data.object_id, PointQuality.BAD, self._now())
            return
        try:
            name = host.board.object(data.object_id).name
        except NotFound:
            return
        self._recorder.device_reported(data.object_id, name, data.points, self._now())

    def run_ended(self, run: Run) -> None:
        """Record a run that has ended."""
        if self._settings.point_history:
            self._runs = [*self._runs, past_run(run)][-MAX_RUNS_WAITING:]

    async def flush(self) -> None:
        """Store what waits."""
        async with self._writing:
            values, runs = self._recorder.take(), self._runs
            if not values and not runs:
                return
            try:
                await self._in_thread(self._store, values, runs)
            except StorageError as error:
                self._recorder.put_back(values)
                self._failed(error)
            else:
                self._runs = self._runs[len(runs) :]
                self._problem = None

    def _store(self, values: list[Waiting], runs: list[PastRun]) -> None:
        self._file.require_space()
        new = list(dict.fromkeys(point for point, *_ in values if not point.number))
        if new:
            described = [
                HistoryPoint(
                    0, each.object_id, each.object_name, each.name, each.use, each.unit, each.digital, each.time
                )
                for each in new
            ]
            for point, number in zip(new, self._file.number_points(described), strict=True):
                point.number = number
        self._file.put([(point.number, *rest) for point, *rest in values], runs)  # type: ignore[misc]

    async def _write_periodically(self) -> None:
        while True:
            await asyncio.sleep(WRITE_PERIOD)
            await self.flush()

    # -------------------------------------------------------------------------------- Parquet files
    async def _maintain_periodically(self) -> None:
        while True:
            await asyncio.sleep(MAINTAIN_PERIOD)
            try:
                await self.maintain()
            except Arcor2Error as error:
                self._failed(error)
            except OSError as error:  # the worker cannot be started
                self._failed(StorageError("The history cannot be moved to files: {reason}", reason=error))

    async def maintain(self) -> None:
        """Move closed hours to files, merge the files of closed days, and delete data beyond the limits.

        Raises:
            Arcor2Error: the files cannot be written. Nothing was lost.
        """
        await self.flush()
        async with self._maintaining:
            await self._retain()
            await self._in_thread(self._file.require_space)
            while not await self._in_thread(self._file.clear):
                pass
            now = self._now()
            await self._move(POINTS, (now - LATE) // HOUR * HOUR)
            for files in _mergeable(await self._in_thread(self._file.files, POINTS), now // DAY):
                await self._write_file(POINTS, 0, files)
            runs = await self._in_thread(self._file.files, RUNS)
            await self._move(RUNS, now // DAY * DAY, [each for each in runs[-1:] if each.rows < FEW_RUNS])

    async def _move(self, kind: str, before: int, merged: Sequence[ColdFile] = ()) -> None:
        oldest = await self._in_thread(self._file.oldest, kind)
        if oldest is not None and oldest < before:
            await self._write_file(kind, before, merged)

    async def _write_file(self, kind: str, before: int, merged: Sequence[ColdFile]) -> None:
        newest = merged[-1].last if not before else before - 1
        day = datetime.fromtimestamp(newest / 1000, UTC).strftime("%Y%m%d")
        name = await self._in_thread(self._file.unused_name, kind, day)
        names = [each.name for each in merged]
        task = WriteColdFile(str(self._file.directory.absolute()), kind, name, before, names)
        written = await self._compute.run(task, background=True)
        await self._in_thread(self._file.add, written, before, names)
        while not await self._in_thread(self._file.clear):
            pass
        if written.file is not None:
            log.info("history moved", file=name, rows=written.file.rows, size=written.file.size, merged=len(names))

    async def _retain(self) -> None:
        """Delete data older than the limit, and the oldest files while the total size exceeds the limit."""
        before = self._now() - self._settings.point_history_days * DAY
        hot, size, *_ = await self._in_thread(self._file.sizes)
        limit = self._settings.point_history_megabytes * 1_000_000
        removed = []
        files = await self._in_thread(self._file.files, POINTS) + await self._in_thread(self._file.files, RUNS)
        for file in sorted(files, key=lambda each: each.last):
            if file.last < before or size + hot > limit:
                removed.append(file.name)
                size -= file.size
        if removed:
            await self._in_thread(self._file.remove, removed)
            log.info("history deleted", files=removed)
        # Rows stay in the database only if they cannot be moved.
        surplus = 100_000 if hot > limit else 0
        await self._in_thread(self._file.forget, before, surplus)

    # -------------------------------------------------------------------------------- queries
    def _require_recording(self) -> None:
        if not self._open:
            raise RequestRefused(self._problem or NOT_RECORDED)

    def _period(self, since: Timestamp | Unset, until: Timestamp | Unset, length: int) -> tuple[int, int]:
        """Return a period in ms since 1970. Raise InvalidData if a time is invalid."""
        end = self._now() + 1 if isinstance(until, Unset) else _milliseconds(until)
        begin = end - length if isinstance(since, Unset) else _milliseconds(since)
        if begin >= end:
            raise InvalidData("The period is empty: it ends at or before its start.")
        return begin, end

    async def points(self, query: HistoryPointQuery) -> list[HistoryPoint]:
        """Return the recorded points. Raise RequestRefused if nothing is recorded."""
        self._require_recording()
        await self.flush()
        found = await self._in_thread(self._file.points)
        return [each for each in found if query.object_id in (msgspec.UNSET, each.object_id)]

    async def summary(self, query: HistoryQuery) -> PointSummary:
        """Return the values of a point in equal parts of a period, by default the last hour.

        Raises:
            RequestRefused: nothing is recorded.
            NotFound: the point is unknown.
            InvalidData: the period is empty.
            Arcor2Error: the files cannot be read.
        """
        since, until = await self._prepared(query)
        return await self._compute.run(
            SummarizePoint(str(self._file.directory.absolute()), query.point, since, until, query.buckets)
        )

    async def values(self, query: HistoryQuery) -> PointValues:
        """Return the recorded values of a point in a period, oldest first. Raise what `summary` raises."""
        since, until = await self._prepared(query)
        return await self._compute.run(
            ReadPoint(str(self._file.directory.absolute()), query.point, since, until, query.limit)
        )

    async def _prepared(self, query: HistoryQuery) -> tuple[int, int]:
        self._require_recording()
        period = self._period(query.since, query.until, HOUR)
        await self.flush()
        await self._in_thread(self._file.require_point, query.point)
        return period

    async def runs(self, query: HistoryRunQuery) -> list[PastRun]:
        """Return runs that ended in a period, by default in the retained time. Raise what `summary` raises."""
        self._require_recording()
        since, until = self._period(query.since, query.until, (self._settings.point_history_days + 1) * DAY)
        await self.flush()
        package = "" if isinstance(query.package_id, Unset) else query.package_id
        return await self._compute.run(
            ReadRuns(str(self._file.directory.absolute()), since, until, query.limit, package)
        )

    async def state(self) -> HistoryState:
        """Return whether the history is recorded, and its size."""
        if not self._open:
            return HistoryState(recording=False, problem=str(self._problem or ""))
        sizes = await self._in_thread(self._file.sizes)
        return HistoryState(True, *sizes, self._recorder.dropped, str(self._problem or ""))


def dead_bands(settings: ServerSettings) -> list[DeadBand]:
    """Return the dead bands in order of precedence: those of cell.yaml, then those of the environment variable."""
    devices = [] if settings.cell is None else settings.cell.devices
    of_devices = [
        DeadBand(f"{device.name}.{point}", band)
        for device in devices
        if not isinstance(device.dead_bands, Unset)
        for point, band in device.dead_bands.items()
    ]
    return of_devices + [DeadBand.parse(each) for each in settings.point_history_dead_bands]


def _milliseconds(stamp: Timestamp) -> int:
    try:
        parsed = datetime.fromisoformat(stamp)
        return round((parsed if parsed.tzinfo else parsed.replace(tzinfo=UTC)).timestamp() * 1000)
    except (ValueError, OverflowError) as error:
        raise InvalidData("{time!r} is not a time such as 2026-01-31T08:00:00Z.", time=stamp[:40]) from error


def _mergeable(files: Sequence[ColdFile], today: int) -> list[list[ColdFile]]:
    """Return the files of each closed day with several files."""
    days: dict[int, list[ColdFile]] = {}
    for file in files:
        if file.last // DAY < today:
            days.setdefault(file.last // DAY, []).append(file)
    return [each for each in days.values() if len(each) > 1 and sum(file.rows for file in each) <= MAX_MERGED_ROWS]


def past_run(run: Run) -> PastRun:
    """Return the stored data of a past run."""
    recipe, statistics = run.recipe, run.statistics
    numbers = {}
    if not isinstance(statistics, Unset):
        numbers = {
            name: value
            for name in ("cycles", "good", "bad")
            if not isinstance(value := getattr(statistics, name), Unset)
        }
    started = _milliseconds(run.started)
    return PastRun(
        run.number,
        started,
        started if isinstance(run.ended, Unset) else _milliseconds(run.ended),
        run.end,
        run.package_id,
        run.package_name,
        "" if isinstance(run.project_name, Unset) else run.project_name,
        "" if isinstance(run.started_by, Unset) else run.started_by,
        "" if isinstance(recipe, Unset) else recipe.product,
        0 if isinstance(recipe, Unset) else recipe.revision,
        "" if isinstance(run.order, Unset) else run.order,
        "" if isinstance(run.error, Unset) else run.error,
        run.actions,
        **numbers,
    )
