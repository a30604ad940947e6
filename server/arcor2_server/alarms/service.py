"""The alarm service: turns reports of devices, programs and the system into records, and publishes them."""

import asyncio
import time
from collections import Counter
from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from pathlib import Path
from zlib import crc32

import structlog

from arcor2_hw.data.alarms import AcknowledgeRole, AlarmCategory, AlarmFilter, AlarmRecord, Priority
from arcor2_hw.data.base import UNSET, Timestamp, Unset, now
from arcor2_hw.data.device import Alarm, Connection
from arcor2_hw.data.held import HoldDecidedData
from arcor2_hw.data.role import Role
from arcor2_hw.data.rpc import AlarmStatisticsArgs, AlarmStatisticsData, ListAlarmsArgs
from arcor2_hw.exceptions import Arcor2Error, NotFound, Refused, StorageError
from arcor2_hw.messages import Message
from arcor2_hw.runtime.messages import DeviceChanged, ErrorData
from arcor2_server.alarms.book import AlarmBook, Occurrence
from arcor2_server.alarms.kinds import AlarmKinds
from arcor2_server.events import EventHub, make_event
from arcor2_server.hosts.devices import DeviceBoard
from arcor2_server.storage.alarms import AlarmStore

log = structlog.get_logger(__name__)

_CONNECTION = {Connection.LOST: "connection_lost", Connection.FAILED: "not_connected"}
"""Codes of the alarms of connections."""


class Alarms:
    """Records alarms. Methods raise Refused or NotFound if a request cannot be served.

    Args:
        hub: publishes AlarmChanged.
        store: stores the records.
        kinds: finds declarations.
        run: returns the number of the running program, 0 for none.
    """

    def __init__(self, hub: EventHub, store: AlarmStore, kinds: AlarmKinds, run: Callable[[], int]) -> None:
        self._hub = hub
        self._store = store
        self._kinds = kinds
        self._run = run
        self._book = AlarmBook()
        self._seen: dict[tuple[str, str], set[str]] = {}
        self._unwritten: dict[int, AlarmRecord] = {}
        self._refused: tuple[dict[int, AlarmRecord], set[int]] = ({}, set())
        """Changed and deleted records that could not be stored, for the next write."""
        self._writing: asyncio.Task[None] | None = None
        self._shelved: dict[int, asyncio.TimerHandle] = {}
        self.on_changed: list[Callable[[AlarmRecord], None]] = []
        """Called with each changed record after it was stored."""
        self.on_raised: list[Callable[[AlarmRecord, float], None]] = []
        """Called with the record of each occurrence and its time on the monotonic clock, s."""

    async def open(self) -> None:
        """Read the stored records. Conditions that were active when the server ended count as ended.

        Raises:
            StorageError: the records cannot be read.
        """
        self._book = AlarmBook(await self._store.all(), now())
        self._changed(self._book.restored)
        for record in self._book.records(AlarmFilter.SHELVED):
            self._end_shelving_later(record)

    async def close(self) -> None:
        """Store the remaining changes."""
        for handle in self._shelved.values():
            handle.cancel()
        await self.flush()

    async def flush(self) -> None:
        """Wait until all changes are stored, or could not be stored."""
        if self._writing is None and any(self._refused):
            self._writing = asyncio.get_running_loop().create_task(self._write(), name="alarms")
        if self._writing is not None:
            await asyncio.gather(self._writing, return_exceptions=True)

    # -------------------------------------------------------------------------------- devices
    def watch(self, board: DeviceBoard, source: str) -> None:
        """Record the alarms of devices. `source` names the online scene or the program."""
        board.on_report.append(lambda report: self._reported(board, source, report))
        board.on_clear.append(lambda objects: self._gone(source, objects))

    def _session(self) -> str:
        """Return the run or online scene to which alarms with the same cause belong."""
        return f"run {run}" if (run := self._run()) else "scene"

    def _reported(self, board: DeviceBoard, source: str, report: DeviceChanged) -> None:
        try:
            device = board.object(report.object_id)
        except Arcor2Error:
            return  # the names are not known yet; the board repeats its reports when they are
        key = (source, report.object_id)
        before = self._seen.get(key, set())
        alarms = {alarm.code: alarm for alarm in report.alarms}
        codes = set(alarms)
        if (lost := _CONNECTION.get(report.connection)) is not None:
            # The driver may know why the device does not answer, such as a printer without labels.
            known = {each for each in codes | before if self._explains_loss(device.type, each)}
            codes = before - set(_CONNECTION.values()) | (known if known and lost not in before else {lost})
        self._seen[key] = codes
        for ended in sorted(before - codes):
            self._changed(self._book.ended(report.object_id, ended, now()))
        stamps = dict.fromkeys(_CONNECTION.values(), report.stamp) | report.raised
        for code in sorted(codes - before, key=lambda each: stamps.get(each, 0.0)):
            alarm: Alarm | None = alarms.get(code)
            stamp = stamps.get(code) or time.monotonic()
            self._raised(
                Occurrence(
                    report.object_id,
                    code,
                    self._kinds.of_device(device.type, code),
                    _at(stamp) if alarm is None else alarm.since,
                    stamp,
                    report.reason if alarm is None else _message(alarm.text, alarm.text_message),
                    None if alarm is None else _message(alarm.remedy, alarm.remedy_message),
                    None if alarm is None else alarm.severity,
                    device.name,
                    device.type,
                    self._run(),
                    session=self._session(),
                )
            )

    def _explains_loss(self, object_type: str, code: str) -> bool:
        """Return whether a driver declares an alarm that states why its device cannot be reached."""
        declared = self._kinds.declares(object_type, code)
        return declared and self._kinds.of_device(object_type, code).category is AlarmCategory.CONNECTION

    def _gone(self, source: str, objects: list[str]) -> None:
        for object_id in objects:
            self._seen.pop((source, object_id), None)
        self._changed(self._book.all_ended(objects, now()))

    # -------------------------------------------------------------------------------- program and system
    def failed(self, error: ErrorData, run: int, action: str) -> None:
        """Record the error that ended a program."""
        code = error.code
        if error.object_id:
            specific = error.fault and self._kinds.declares(error.object_type, error.fault)
            code = error.fault if error.code == "safety_stop" or specific else error.code
            kind = self._kinds.of_device(error.object_type, code or error.code)
        else:
            code, kind = "program_failed", self._kinds.of_system("program_failed")
        stamp = error.stamp or time.monotonic()
        self._raised(
            Occurrence(
                error.object_id,
                code or error.code,
                kind,
                _at(stamp),
                stamp,
                error.message,
                name=error.object_name,
                object_type=error.object_type,
                run=run,
                action=action,
                momentary=True,
                session=f"run {run}",
            )
        )

    def decided(self, decided: HoldDecidedData) -> None:
        """Acknowledge the ended alarms of a run, as far as operators may: a person has decided about their cause."""
        for record in self._book.records(AlarmFilter.RETAINED):
            if (
                record.run == decided.run
                and not record.active
                and not record.acknowledged
                and record.acknowledge is AcknowledgeRole.OPERATOR
            ):
                self._changed(self._book.acknowledged(record.number, decided.by, "", now()))

    def system(
        self, code: str, active: bool | None, text: Message | None = None, *, with_devices: bool = False
    ) -> None:
        """Record an alarm of the system.

        Args:
            code: code of its declaration.
            active: whether its condition exists; None for an event without an end.
            text: what happened, if it has values.
            with_devices: whether alarms of devices may be its consequences.
        """
        if active is False:
            self._changed(self._book.ended("", code, now()))
            return
        kind = self._kinds.of_system(code)
        session = self._session() if with_devices else f"system {code}"
        momentary = active is None
        moment = time.monotonic()
        run = self._run()
        what = Occurrence("", code, kind, now(), moment, text, run=run, momentary=momentary, session=session)
        self._raised(what)

    def data_damaged(self, notice: Message) -> None:
        """Record that a file of the data directory is damaged. Each file has its own alarm."""
        self.system(f"data_damaged:{crc32(notice.text.encode()):08x}", None, notice)

    # -------------------------------------------------------------------------------- requests
    async def find(self, args: ListAlarmsArgs) -> list[AlarmRecord]:
        """Return the selected records, newest first, as they are stored."""
        await self.flush()
        found: list[AlarmRecord] = []
        for record in self._book.records(args.show):
            if len(found) == args.limit:
                break
            if (
                (isinstance(args.before, Unset) or record.number < args.before)
                and args.object_id in (UNSET, record.object_id)
                and args.run in (UNSET, record.run)
            ):
                found.append(record)
        return found

    def active_by_priority(self) -> Counter[Priority]:
        """Return the number of alarms whose condition persists, without shelved ones."""
        return Counter(each.priority for each in self._book.records(AlarmFilter.RETAINED) if each.active)

    async def acknowledge(self, number: int, by: str, role: Role, note: str) -> None:
        """Acknowledge an alarm. It changes nothing at the device."""
        record = self._book.get(number)
        if record.acknowledge is AcknowledgeRole.TECHNICIAN and role < Role.TECHNICIAN:
            raise Refused("Alarm {number} needs the role technician to be acknowledged.", number=number)
        self._changed(self._book.acknowledged(number, by, note, now()))
        log.warning("alarm acknowledged", number=number, code=record.code, object=record.object_name or "", user=by)
        await self.flush()

    async def shelve(self, number: int, seconds: float, by: str, note: str) -> None:
        """Shelve an alarm for some time, s; 0 ends the shelving."""
        until = (datetime.now(UTC) + timedelta(seconds=seconds)).isoformat(timespec="microseconds") if seconds else None
        self._changed(self._book.shelved(number, until, by, note))
        log.warning("alarm shelved", number=number, seconds=seconds, user=by)
        self._end_shelving_later(self._book.get(number))
        await self.flush()

    def picture(self, number: int) -> Path:
        """Return the file of the picture of an alarm. Raise NotFound if it has none."""
        record = self._book.get(number)
        found = None
        if not isinstance(record.picture, Unset):
            object_type = "" if isinstance(record.object_type, Unset) else record.object_type
            found = self._kinds.picture(record.picture, object_type)
        if found is None:
            raise NotFound("Alarm {number} has no picture.", number=number)
        return found

    def statistics(self, args: AlarmStatisticsArgs) -> AlarmStatisticsData:
        """Return the alarms that occurred most often, and those that were active longest."""
        at = datetime.now(UTC)
        since = (at - timedelta(days=args.days)).isoformat(timespec="microseconds")
        found = self._book.frequencies(since, at.timestamp(), _seconds)
        by_count = sorted(found, key=lambda each: each.count, reverse=True)[: args.limit]
        by_duration = sorted(found, key=lambda each: each.duration, reverse=True)[: args.limit]
        return AlarmStatisticsData(since, by_count, [each for each in by_duration if each.duration > 0])

    # -------------------------------------------------------------------------------- changes
    def _end_shelving_later(self, record: AlarmRecord) -> None:
        if (handle := self._shelved.pop(record.number, None)) is not None:
            handle.cancel()
        if not isinstance(until := record.shelved_until, Unset):
            delay = max(0.0, _seconds(until) - time.time())
            loop = asyncio.get_running_loop()
            self._shelved[record.number] = loop.call_later(delay, self._end_shelving, record.number)

    def _end_shelving(self, number: int) -> None:
        self._shelved.pop(number, None)
        self._changed(self._book.shelved(number, None, "", ""))

    def _raised(self, occurrence: Occurrence) -> None:
        changed = self._book.raised(occurrence)
        for record in changed[:1]:  # the other records have a new first-up
            for notify in self.on_raised:
                notify(record, occurrence.stamp)
        self._changed(changed)

    def _changed(self, records: list[AlarmRecord]) -> None:
        self._unwritten |= {record.number: record for record in records}
        if (self._unwritten or self._book.deleted) and self._writing is None:
            self._writing = asyncio.get_running_loop().create_task(self._write(), name="alarms")

    async def _write(self) -> None:
        """Store changes until none is left, and publish them. A change that cannot be stored is published too."""
        while self._unwritten or self._book.deleted or any(self._refused):
            records, self._unwritten = self._unwritten, {}
            deleted, self._book.deleted = self._book.deleted, set()
            changed, removed = self._refused[0] | records, self._refused[1] | deleted
            self._refused = ({}, set())
            try:
                await self._store.put(changed.values(), removed)
            except StorageError as error:
                log.warning("alarms not stored", reason=str(error))
                self._refused = changed, removed
            for record in records.values():
                self._hub.broadcast(make_event("AlarmChanged", record))
                for notify in self.on_changed:
                    notify(record)
            if any(self._refused) and not (self._unwritten or self._book.deleted):
                break
        self._writing = None


def _seconds(stamp: Timestamp) -> float:
    return datetime.fromisoformat(stamp).timestamp()


def _at(stamp: float) -> Timestamp:
    """Return the time of a stamp of the monotonic clock, s."""
    return datetime.fromtimestamp(time.time() - time.monotonic() + stamp, UTC).isoformat(timespec="microseconds")


def _message(text: str, message: Message | Unset) -> Message:
    return Message.of(text) if isinstance(message, Unset) else message
