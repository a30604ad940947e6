"""The records of the ring of recent values, and their conversion to the content of a recording."""

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Final

import msgspec
from msgspec import UNSET, Struct
from msgspec.structs import replace

from arcor2_hw.data.position import MAIN_BRANCH
from arcor2_hw.data.recordings import RecordedAction, RecordedValues, Signal, SignalKind
from arcor2_hw.messages import Message
from arcor2_hw.runtime.ring import records

Value = bool | float | None


class Names(Struct, frozen=True, tag=0, array_like=True):
    """The values that a source has from now on. `source` counts the sources: a kind of values of an object."""

    source: int
    kind: SignalKind
    object_id: str
    object_name: str
    names: list[str]
    units: list[str]


class Values(Struct, frozen=True, tag=1, array_like=True):
    """All values of a source, in the order of its names. stamp: on the monotonic clock, s."""

    stamp: float
    source: int
    values: list[Value]


class ActionStarted(Struct, frozen=True, tag=2, array_like=True):
    """An action was announced, or a call has started; see RecordedAction."""

    stamp: float
    number: int
    name: str
    action_id: str = ""
    object_id: str = ""
    object_name: str = ""
    branch: str = MAIN_BRANCH
    call: int = 0


class ActionEnded(Struct, frozen=True, tag=3, array_like=True):
    """An action has ended. waited: time between its announcement and start, s. event: ActionStateAfter, encoded."""

    stamp: float
    number: int
    waited: float = 0.0
    error: Message | None = None
    event: bytes = b""


Record = Names | Values | ActionStarted | ActionEnded

encode: Final = msgspec.msgpack.Encoder().encode
_decode: Final = msgspec.msgpack.Decoder(Record).decode


def shifted(record: bytes | memoryview, offset: float) -> bytes:
    """Return an encoded record with its time on another clock. offset: difference of the clocks, s."""
    decoded = _decode(record)
    return bytes(record) if isinstance(decoded, Names) else encode(replace(decoded, stamp=decoded.stamp + offset))


class _Results(Struct):
    results: list[str] = []


class _After(Struct):
    data: _Results


_decode_after: Final = msgspec.json.Decoder(_After).decode


class _Column:
    """The values of one signal. Equal values that follow each other are stored once."""

    def __init__(self) -> None:
        self.times: list[int] = []
        self.values: list[Value] = []

    def add(self, time: int, value: Value) -> None:
        if isinstance(value, float) and not math.isfinite(value):
            value = None  # JSON has no such numbers
        if self.values and type(self.values[-1]) is type(value) and self.values[-1] == value:
            return
        if self.times and time < self.times[-1]:
            return  # the reading was delayed; a newer value is known
        self.times.append(time)
        self.values.append(value)

    def cut(self, begin: int, end: int) -> None:
        """Remove values after the end, and all but the last value before the begin."""
        while self.times and self.times[-1] > end:
            self.times.pop()
            self.values.pop()
        first = next((n for n in range(len(self.times) - 1, -1, -1) if self.times[n] <= begin), 0)
        del self.times[:first], self.values[:first]


class _Action:
    def __init__(self, started: ActionStarted) -> None:
        self.started = started
        self.ended: ActionEnded | None = None


def converted(rings: Sequence[Iterable[bytes]], event: float, begin: float, end: float) -> tuple[RecordedValues, int]:
    """Return the content of a recording, and its start time, ms after the event.

    Args:
        rings: the segments of the ring of each host, oldest first. Each host records its own objects.
        event: the event to which times are relative, on the monotonic clock, s.
        begin: start of the recorded time, on the same clock; the values of a full ring may start later.
        end: end of the recorded time.
    """
    columns: dict[tuple[SignalKind, str, str], tuple[Signal, _Column]] = {}
    actions: dict[int, _Action] = {}
    rows: dict[tuple[int, int], list[_Column]] = {}
    first: dict[int, float] = {}
    for host, encoded in ((host, each) for host, ring in enumerate(rings) for part in ring for each in records(part)):
        try:
            record = _decode(encoded)
        except msgspec.MsgspecError:
            continue  # overwritten while it was copied
        match record:
            case Names():
                rows[host, record.source] = _columns_of(record, columns)
            case Values():
                first.setdefault(host, record.stamp)
                time = round((record.stamp - event) * 1000)
                for column, value in zip(rows.get((host, record.source), ()), record.values, strict=False):
                    column.add(time, value)
            case ActionStarted():
                number = _number(record, host, len(rings))
                actions.setdefault(number, _Action(replace(record, number=number)))
            case ActionEnded() if (number := _number(record, host, len(rings))) in actions:
                actions[number].ended = record
    starts = round((max(begin, min(first.values(), default=begin)) - event) * 1000)
    ends = round((end - event) * 1000)
    signals = []
    for signal, column in columns.values():
        column.cut(starts, ends)
        if column.times:
            signals.append(msgspec.structs.replace(signal, times=column.times, values=column.values))
    return RecordedValues(signals, _actions(actions, event, starts, ends)), starts


def _number(record: ActionStarted | ActionEnded, host: int, hosts: int) -> int:
    """Return a number that no action of another host has. Only the main host has actions of a program."""
    return record.number if record.number > 0 else record.number * hosts - host


def _columns_of(names: Names, columns: dict[tuple[SignalKind, str, str], tuple[Signal, _Column]]) -> list[_Column]:
    found = []
    for name, unit in zip(names.names, names.units, strict=True):
        key = names.kind, names.object_id, name
        if key not in columns:
            columns[key] = Signal(names.kind, names.object_id, names.object_name, name, unit, [], []), _Column()
        found.append(columns[key][1])
    return found


def _actions(actions: Mapping[int, _Action], event: float, begin: int, end: int) -> list[RecordedAction]:
    found = []
    for action in actions.values():
        started, ended = action.started, action.ended
        start = round((started.stamp + (0.0 if ended is None else ended.waited) - event) * 1000)
        stop = None if ended is None else round((ended.stamp - event) * 1000)
        if start > end or (stop is not None and stop < begin):
            continue
        of: dict[str, Any] = {}
        if ended is not None and ended.error is not None:
            of["error"] = ended.error.text
            if ended.error.values:
                of["error_message"] = ended.error
        elif ended is not None and ended.event:
            of["results"] = _decode_after(ended.event).data.results or UNSET
        found.append(
            RecordedAction(
                started.number,
                started.name,
                start,
                UNSET if stop is None or stop > end else stop,
                started.action_id or UNSET,
                started.object_id or UNSET,
                started.object_name or UNSET,
                UNSET if started.branch == MAIN_BRANCH else started.branch,
                started.call or UNSET,
                **of,
            )
        )
    return sorted(found, key=lambda each: (each.begin, each.number))
