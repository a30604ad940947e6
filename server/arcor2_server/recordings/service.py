"""Stores a recording of each alarm and each failed run, from the rings of the cell hosts."""

import asyncio
import time
from collections.abc import Callable
from datetime import UTC, datetime
from typing import Final

import structlog
from msgspec.structs import asdict, replace

from arcor2_hw.data.alarms import AlarmRecord
from arcor2_hw.data.base import UNSET, Timestamp, Unset
from arcor2_hw.data.recordings import (
    RecordedAlarm,
    RecordedValues,
    Recording,
    RecordingChangedData,
    RecordingInfo,
    RecordingQuery,
)
from arcor2_hw.exceptions import StorageError
from arcor2_hw.messages import Message
from arcor2_hw.runtime.ring import Rings
from arcor2_hw.runtime.ring_records import converted
from arcor2_server.background import BackgroundTasks
from arcor2_server.events import EventHub, make_event
from arcor2_server.storage.recordings import RecordingFiles, SavedRing, not_found

log = structlog.get_logger(__name__)

TIME_BEFORE: Final = 60.0
"""Recorded time before the event, s."""
TIME_AFTER: Final = 5.0
"""Recorded time after the event, s."""
MAX_PER_ALARM: Final = 5
"""Maximum number of recordings of one record of an alarm, whose condition keeps returning."""
RECORDING: Final = "RecordingChanged"
"""The additional event with a stored recording."""


class _Open:
    """A recording that continues."""

    def __init__(self, info: RecordingInfo, rings: Rings) -> None:
        self.info, self.rings = info, rings
        self.ended: float | None = None
        """Time at which the host ended, on the monotonic clock, s."""
        self.over = asyncio.Event()


class Recordings:
    """Stores recordings. Alarms that follow within TIME_AFTER belong to the same one.

    Args:
        hub: publishes RecordingChanged.
        files: stores the recordings.
        rings: returns the rings of the program, or of the online scene; None if no host runs.
    """

    def __init__(self, hub: EventHub, files: RecordingFiles, rings: Callable[[], Rings | None]) -> None:
        self._hub = hub
        self._files = files
        self._rings = rings
        self._stored: dict[int, RecordingInfo] = {}
        self._next = 1
        self._open: _Open | None = None
        self._background = BackgroundTasks()
        self._counts: dict[int, int] = {}
        """Number of occurrences of each alarm since the start of the server."""
        self._writing = asyncio.Lock()
        self._closed = False

    async def open(self, error_of: Callable[[int], Message | None]) -> None:
        """Read the list of recordings, and store recordings of runs that were interrupted by the end of the server.

        Args:
            error_of: returns why a run has failed; None if it has not.
        """
        found, self._next, rings = await asyncio.to_thread(self._read)
        self._stored = {info.number: info for info in found}
        if rings:
            self._background.spawn(self._adopt(rings, error_of), "recordings of interrupted runs")

    def _read(self) -> tuple[list[RecordingInfo], int, list[SavedRing]]:
        return self._files.all(), self._files.next_number(), self._files.saved_rings()

    async def _adopt(self, rings: list[SavedRing], error_of: Callable[[int], Message | None]) -> None:
        for saved in rings:
            if not any(info.run == saved.run and info.run_failed for info in self._stored.values()):
                info = RecordingInfo(
                    self._take_number(),
                    _time(saved.wall),
                    saved.monotonic,
                    round(-TIME_BEFORE * 1000),
                    0,
                    run=saved.run,
                )
                info = _failed(info, error_of(saved.run))
                await self._store(info, saved, saved.monotonic)
            for path in saved.paths:
                await asyncio.to_thread(self._files.discard, path)

    async def close(self) -> None:
        """Store the recording that continues. Nothing is recorded afterwards."""
        self._closed = True
        if self._open is not None:
            self._open.over.set()
        await self._background.settled()

    # -------------------------------------------------------------------------------- events
    def alarm(self, record: AlarmRecord, stamp: float) -> None:
        """Record an alarm that was raised, or raised again. stamp: when, on the monotonic clock, s."""
        before, self._counts[record.number] = self._counts.get(record.number), record.count
        if before == record.count or not isinstance(record.shelved_until, Unset):
            return
        rings = self._rings()
        if rings is None or self._closed or time.monotonic() - stamp > TIME_BEFORE:
            return
        opened = self._continue(rings) or self._begin(rings, stamp, record.run)
        if any(alarm.number == record.number for alarm in opened.info.alarms):
            return
        opened.info = replace(
            opened.info,
            run=record.run if isinstance(opened.info.run, Unset) else opened.info.run,
            alarms=[
                *opened.info.alarms,
                RecordedAlarm(
                    record.number,
                    round((stamp - opened.info.stamp) * 1000),
                    record.text,
                    record.text_message,
                    record.object_id,
                    record.object_name,
                ),
            ],
        )

    def run_failed(self, run: int, error: Message | None, rings: Rings | None) -> None:
        """Record that a run has failed. Its hosts end. rings: of its hosts."""
        if rings is None or self._closed:
            return
        moment = time.monotonic()
        opened = self._continue(rings) or self._begin(rings, moment, run)
        opened.ended = moment
        opened.info = _failed(replace(opened.info, run=run), error)
        opened.over.set()

    def _continue(self, rings: Rings) -> _Open | None:
        opened = self._open
        return opened if opened is not None and opened.rings is rings and not opened.over.is_set() else None

    def _begin(self, rings: Rings, stamp: float, run: int | Unset) -> _Open:
        wall = time.time() - time.monotonic() + stamp
        begin, end = round(-TIME_BEFORE * 1000), round((time.monotonic() - stamp) * 1000)
        info = RecordingInfo(self._take_number(), _time(wall), stamp, begin, end, complete=False, run=run)
        if self._open is not None:
            self._open.over.set()
        opened = self._open = _Open(info, rings)
        self._background.spawn(self._record(opened), f"recording {info.number}")
        return opened

    def _take_number(self) -> int:
        self._next += 1
        return self._next - 1

    # -------------------------------------------------------------------------------- storing
    async def _record(self, opened: _Open) -> None:
        """Store a recording at once, so that it survives a killed server, and again when it is complete."""
        await asyncio.sleep(0)  # alarms that are raised together
        await self._write(opened)
        try:
            async with asyncio.timeout(TIME_AFTER):
                await opened.over.wait()
        except TimeoutError:
            opened.over.set()
        opened.info = replace(opened.info, complete=True)
        await self._write(opened)
        if self._open is opened:
            self._open = None

    async def _write(self, opened: _Open) -> None:
        await self._store(opened.info, opened.rings, opened.ended or time.monotonic())

    async def _store(self, info: RecordingInfo, source: Rings | SavedRing, end: float) -> None:
        try:
            async with self._writing:
                stored = await asyncio.to_thread(self._convert, info, source, end)
                self._stored[stored.number] = stored
                deleted = self._superfluous(stored) + await asyncio.to_thread(self._files.delete_oldest)
        except StorageError as error:
            log.warning("recording not stored", number=info.number, reason=str(error))
            return
        for number in deleted:
            self._stored.pop(number, None)
        self._hub.broadcast(make_event(RECORDING, RecordingChangedData(stored, deleted)))

    def _convert(self, info: RecordingInfo, source: Rings | SavedRing, end: float) -> RecordingInfo:
        rings = source.rings if isinstance(source, SavedRing) else [ring.segments() for ring in source]
        values, begin = converted(rings, info.stamp, info.stamp - TIME_BEFORE, end)
        return self._files.put(replace(info, begin=begin, end=round((end - info.stamp) * 1000)), values)

    def _superfluous(self, newest: RecordingInfo) -> list[int]:
        """Delete a recording of an alarm that has too many. The first one and the newest ones are kept."""
        if not newest.alarms:
            return []
        alarm = newest.alarms[0].number
        same = [info for info in self._stored.values() if info.alarms and info.alarms[0].number == alarm]
        deleted = [info.number for info in same[1 : max(1, len(same) - MAX_PER_ALARM + 1)]]
        for number in deleted:
            self._files.delete(number)
        return deleted

    # -------------------------------------------------------------------------------- queries
    def find(self, query: RecordingQuery) -> list[RecordingInfo]:
        """Return the selected recordings, newest first."""
        found = [
            info
            for info in reversed(self._stored.values())
            if query.run in (UNSET, info.run)
            and (isinstance(query.alarm, Unset) or any(alarm.number == query.alarm for alarm in info.alarms))
        ]
        return found[: query.limit]

    async def get(self, number: int) -> Recording:
        """Return a recording with its content. Raise NotFound if there is none, StorageError if it is damaged."""
        if (info := self._stored.get(number)) is None:
            raise not_found(number)
        values: RecordedValues = await asyncio.to_thread(self._files.values, number)
        return Recording(**asdict(info), signals=values.signals, actions=values.actions)


def _failed(info: RecordingInfo, error: Message | None) -> RecordingInfo:
    if error is None:
        return replace(info, run_failed=True)
    return replace(info, run_failed=True, error=error.text, error_message=error if error.values else UNSET)


def _time(wall: float) -> Timestamp:
    return datetime.fromtimestamp(wall, UTC).isoformat(timespec="microseconds")
