"""The alarm book: opens, merges, clears and groups records. It does no I/O and has no clock of its own."""

from collections.abc import Iterable, Iterator
from typing import Any, Final

from msgspec import UNSET, Struct
from msgspec.structs import replace

from arcor2_hw.data.alarms import (
    PRIORITY_OF,
    AlarmCategory,
    AlarmFilter,
    AlarmFrequency,
    AlarmKind,
    AlarmRecord,
)
from arcor2_hw.data.base import Timestamp, Unset
from arcor2_hw.data.device import Severity
from arcor2_hw.exceptions import NotFound, Refused
from arcor2_hw.messages import Message
from arcor2_server.alarms.kinds import UNDECLARED

MAX_RECORDS: Final = 5000
"""Maximum number of records. Beyond it the oldest ones that need no attention are deleted."""
SAME_CAUSE_PERIOD: Final = 10.0
"""Time after the last alarm of a group within which a further alarm counts as its consequence, s."""
SAME_FAULT_PERIOD: Final = 3.0
"""Time within which the error of an action and the condition that its device reports are the same alarm, s. Conditions
are queried every second."""
UNSPECIFIC: Final = frozenset(
    {"cancelled", "connection_lost", "device", "device_fault", "device_timeout", "error", "not_connected"}
    | {"not_in_control", "refused", "stale"}
)
"""Codes of errors that an active condition of the same device explains."""


class Occurrence(Struct, frozen=True):
    """Something that raises an alarm.

    source: object id, empty for the system and the program. stamp: monotonic clock of this computer, s. momentary: an
    error or event without an end, not a condition that persists. session: run or online scene that the alarms of a
    group have in common.
    """

    source: str
    code: str
    kind: AlarmKind
    at: Timestamp
    stamp: float
    text: Message | None = None
    remedy: Message | None = None
    severity: Severity | None = None
    name: str = ""
    object_type: str = ""
    run: int = 0
    action: str = ""
    momentary: bool = False
    session: str = ""


class _Entry:
    """An open record with its temporary data."""

    def __init__(self, record: AlarmRecord, occurrence: Occurrence | None) -> None:
        self.record = record
        self.stamp = 0.0 if occurrence is None else occurrence.stamp
        self.last = self.stamp
        self.session = None if occurrence is None else occurrence.session
        self.momentary = occurrence is not None and occurrence.momentary


class AlarmBook:
    """The records of alarms. Every method returns the records that it has changed.

    Args:
        records: the stored records, oldest first. Conditions of the last run of the server count as ended.
        at: the present time.
    """

    def __init__(self, records: Iterable[AlarmRecord] = (), at: Timestamp = "") -> None:
        self._entries = {record.number: _Entry(record, None) for record in records}
        self.deleted: set[int] = set()
        """Numbers of records that were deleted and are still stored."""
        self.restored = [
            self._put(entry, active=False, cleared=at) for entry in self._entries.values() if entry.record.active
        ]
        """The records that changed by the restart."""

    # -------------------------------------------------------------------------------- queries
    def get(self, number: int) -> AlarmRecord:
        """Return a record. Raise NotFound if there is none."""
        return self._entry(number).record

    def records(self, which: AlarmFilter = AlarmFilter.ALL) -> Iterator[AlarmRecord]:
        """Return the selected records, newest first."""
        for entry in reversed(self._entries.values()):
            record = entry.record
            shelved = record.shelved_until is not UNSET
            if (
                which is AlarmFilter.ALL
                or (which is AlarmFilter.SHELVED and shelved)
                or (which is AlarmFilter.RETAINED and record.retain and not shelved)
            ):
                yield record

    def frequencies(self, since: Timestamp, at: float, seconds_of: Any) -> list[AlarmFrequency]:
        """Return the number of occurrences and the active time of each alarm of each object since a time.

        Args:
            since: the start of the period.
            at: the present time, s.
            seconds_of: converts a time stamp to s.
        """
        found: dict[tuple[str, str], AlarmFrequency] = {}
        start = seconds_of(since)
        for entry in self._entries.values():
            record = entry.record
            end = at if isinstance(record.cleared, Unset) else seconds_of(record.cleared)
            if end < start:
                continue
            duration = max(0.0, end - max(start, seconds_of(record.raised)))
            key = _owner(record), record.code
            before = found.get(key)
            found[key] = AlarmFrequency(
                record.kind,
                record.code,
                record.text,
                record.count + (before.count if before else 0),
                round(duration + (before.duration if before else 0.0), 3),
                record.text_message,
                record.object_id,
                record.object_name,
            )
        return list(found.values())

    # -------------------------------------------------------------------------------- occurrences
    def raised(self, occurrence: Occurrence) -> list[AlarmRecord]:
        """Handle an occurrence: open a record, or continue the open one of the same alarm or the same fault."""
        if (entry := self._open(occurrence.source, occurrence.code)) is not None:
            return self._again(entry, occurrence)
        if occurrence.source and (entry := self._same_fault(occurrence)) is not None:
            return self._merge(entry, occurrence)
        return self._new(occurrence)

    def ended(self, source: str, code: str, at: Timestamp) -> list[AlarmRecord]:
        """Handle the end of a condition."""
        return [
            self._put(entry, active=False, cleared=at)
            for entry in self._active(source)
            if entry.record.code == code and not entry.momentary
        ]

    def all_ended(self, sources: Iterable[str], at: Timestamp) -> list[AlarmRecord]:
        """Handle the end of the observation of the devices of a scene or program."""
        return [
            self._put(entry, active=False, cleared=at) for source in sources for entry in list(self._active(source))
        ]

    def _active(self, source: str) -> list[_Entry]:
        return [entry for entry in self._entries.values() if entry.record.active and _owner(entry.record) == source]

    def _open(self, source: str, code: str) -> _Entry | None:
        """Return the newest record of an alarm that needs attention or is shelved."""
        for entry in reversed(self._entries.values()):
            record = entry.record
            if (
                _owner(record) == source
                and record.code == code
                and (record.retain or record.shelved_until is not UNSET)
            ):
                return entry
        return None

    def _again(self, entry: _Entry, occurrence: Occurrence) -> list[AlarmRecord]:
        record = entry.record
        entry.last = occurrence.stamp
        context = _context(occurrence)
        if record.active or (
            occurrence.momentary and entry.momentary and occurrence.stamp - entry.stamp < SAME_FAULT_PERIOD
        ):
            return [self._put(entry, **context)] if context.items() - _fields(record).items() else []
        entry.momentary = occurrence.momentary
        again = {"acknowledged": False, "acknowledged_by": UNSET, "acknowledged_at": UNSET, "count": record.count + 1}
        state: dict[str, Any] = {} if occurrence.momentary else {"active": True, "cleared": UNSET}
        return [self._put(entry, **context, **again, **state)]

    def _same_fault(self, occurrence: Occurrence) -> _Entry | None:
        """Return the open record of the same device that an occurrence belongs to, if any."""
        for entry in reversed(self._entries.values()):
            record = entry.record
            if record.object_id != occurrence.source or not record.retain:
                continue
            if occurrence.momentary and occurrence.code in UNSPECIFIC and record.active and not entry.momentary:
                return entry  # the active condition explains the error
            near = entry.session is not None and abs(occurrence.stamp - entry.stamp) <= SAME_FAULT_PERIOD
            if not occurrence.momentary and entry.momentary and near and record.code in UNSPECIFIC:
                return entry  # the device reports why the action failed
        return None

    def _merge(self, entry: _Entry, occurrence: Occurrence) -> list[AlarmRecord]:
        if occurrence.momentary:
            return [self._put(entry, **_context(occurrence))]
        entry.momentary = False
        entry.stamp = min(entry.stamp, occurrence.stamp)
        changed = self._put(entry, **_described(occurrence), active=True, cleared=UNSET)
        return self._regroup([changed], entry)

    def _new(self, occurrence: Occurrence) -> list[AlarmRecord]:
        number = max(next(reversed(self._entries), 0), max(self.deleted, default=0)) + 1
        active = not occurrence.momentary
        record = AlarmRecord(
            number=number,
            raised=occurrence.at,
            first_up=number,
            object_id=occurrence.source or UNSET,
            object_name=occurrence.name or UNSET,
            object_type=occurrence.object_type or UNSET,
            active=active,
            cleared=UNSET if active else occurrence.at,
            retain=True,
            **_described(occurrence),
            **_context(occurrence),
        )
        entry = self._entries[number] = _Entry(record, occurrence)
        changed = [self._put(entry)]
        while len(self._entries) > MAX_RECORDS and (oldest := self._deletable()) is not None:
            del self._entries[oldest]
            self.deleted.add(oldest)
        return self._regroup(changed, entry)

    def _deletable(self) -> int | None:
        return next((number for number, entry in self._entries.items() if not entry.record.retain), None)

    # -------------------------------------------------------------------------------- first-up
    def _regroup(self, changed: list[AlarmRecord], entry: _Entry) -> list[AlarmRecord]:
        """Add a record to the group of alarms with the same cause; the one with the earliest stamp is its first-up."""
        members = [
            each
            for each in self._entries.values()
            if each.session is not None and each.session == entry.session and each.record.retain
        ]
        members.sort(key=lambda each: (each.stamp, each.record.number))
        at = members.index(entry) if entry in members else -1
        if at < 0:
            return changed
        first = last = at
        while first > 0 and members[first].stamp - members[first - 1].last <= SAME_CAUSE_PERIOD:
            first -= 1
        while last + 1 < len(members) and members[last + 1].stamp - members[last].last <= SAME_CAUSE_PERIOD:
            last += 1
        group = members[first : last + 1]
        regrouped = {
            each.record.number: self._put(each, first_up=group[0].record.number)
            for each in group
            if each.record.first_up != group[0].record.number
        }
        numbers = {record.number for record in changed}
        return [regrouped.get(record.number, record) for record in changed] + [
            record for number, record in regrouped.items() if number not in numbers
        ]

    # -------------------------------------------------------------------------------- users
    def acknowledged(self, number: int, by: str, note: str, at: Timestamp) -> list[AlarmRecord]:
        """Acknowledge a record. Raise Refused if it is acknowledged, or NotFound."""
        entry = self._entry(number)
        record = entry.record
        if record.acknowledged:
            raise Refused(
                "Alarm {number} was already acknowledged by {user}.", number=number, user=record.acknowledged_by
            )
        return [self._put(entry, acknowledged=True, acknowledged_by=by, acknowledged_at=at, note=note or record.note)]

    def shelved(self, number: int, until: Timestamp | None, by: str, note: str) -> list[AlarmRecord]:
        """Shelve a record until a time; None ends the shelving. Raise Refused for a safety stop, or NotFound."""
        entry = self._entry(number)
        record = entry.record
        if until is None:
            return [self._put(entry, shelved_until=UNSET)] if record.shelved_until is not UNSET else []
        if not record.can_be_shelved:
            raise Refused("{alarm} is a safety stop and cannot be shelved.", alarm=_text(record))
        if not record.retain:
            raise Refused("Alarm {number} has ended and cannot be shelved.", number=number)
        return [self._put(entry, shelved_until=until, shelved_by=by, note=note or record.note)]

    # -------------------------------------------------------------------------------- records
    def _entry(self, number: int) -> _Entry:
        if (entry := self._entries.get(number)) is None:
            raise NotFound("Alarm {number} does not exist.", number=number)
        return entry

    def _put(self, entry: _Entry, **values: Any) -> AlarmRecord:
        record = replace(entry.record, **values)
        retain = record.active or (record.latching and not record.acknowledged)
        entry.record = record = replace(record, retain=retain)
        return record


def _owner(record: AlarmRecord) -> str:
    """Return the id of the object; empty for an alarm of the system or the program."""
    return "" if isinstance(record.object_id, Unset) else record.object_id


def _text(record: AlarmRecord) -> Message:
    return Message.of(record.text) if isinstance(record.text_message, Unset) else record.text_message


def _fields(record: AlarmRecord) -> dict[str, Any]:
    return {"run": record.run, "action": record.action}


def _context(occurrence: Occurrence) -> dict[str, Any]:
    """Return the run and action of an occurrence, as far as they are known."""
    return {name: value for name, value in (("run", occurrence.run), ("action", occurrence.action)) if value}


def _described(occurrence: Occurrence) -> dict[str, Any]:
    """Return the description of the alarm for its record. Texts of the declaration take precedence."""
    kind = occurrence.kind
    text = Message.of(kind.text) if kind.text else occurrence.text or Message.of(occurrence.code)
    remedy = Message.of(kind.remedy) if kind.remedy else occurrence.remedy or Message.of("")
    priority = kind.priority
    if occurrence.severity is not None and kind is UNDECLARED:
        priority = PRIORITY_OF[occurrence.severity]
    return {
        "kind": f"{kind.group}-{kind.number}",
        "code": occurrence.code,
        "priority": priority,
        "category": kind.category,
        "text": text.text,
        "text_message": text if text.values else UNSET,
        "cause": kind.cause,
        "remedy": remedy.text,
        "remedy_message": remedy if remedy.values else UNSET,
        "latching": kind.latching or kind.category is AlarmCategory.SAFETY or occurrence.momentary,
        "acknowledge": kind.acknowledge,
        "can_be_shelved": kind.can_be_shelved,
        "picture": kind.picture or UNSET,
    }
