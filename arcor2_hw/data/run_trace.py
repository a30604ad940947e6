"""The trace of a run: the actions of each device with their times, also as a Chrome trace."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Final

from msgspec import UNSET, field

from arcor2_hw.data.base import Data, Timestamp, Unset
from arcor2_hw.data.held import ActionHold


class Span(Data, frozen=True):
    """One executed action.

    number: number of the action in the run from 1, in the order of their start. device: id of the object. start: since
    the first action of the run, s. duration: s. branch: value of the condition after which the action followed the one
    before it, as JSON; omitted without a condition. error: reason why the action failed. thread_id: omitted in the main
    thread of the script. call: number of the call of the function that contains the action; omitted in the program
    itself. The span of a call has no device. attempt: number of the attempt of a retried action; omitted for the first
    one. lane: id of the branch that executed the action at the same time as others; omitted in the program itself.
    hold: the hold of the program at the action, which is not part of its duration.
    """

    number: int
    action_id: str
    name: str
    device: str
    start: float
    duration: float
    branch: str | Unset = UNSET
    error: str | Unset = UNSET
    thread_id: int | Unset = UNSET
    call: int | Unset = UNSET
    attempt: int | Unset = UNSET
    lane: str | Unset = UNSET
    hold: ActionHold | Unset = UNSET


class TracedDevice(Data, frozen=True):
    """A device of a trace. busy: sum of the durations of its actions, s."""

    id: str
    name: str
    busy: float


class RunTrace(Data, frozen=True):
    """The executed actions of a run in the order of their start, and their devices in the order of their first action.

    started: start of the first action. omitted: number of actions at the start of a long run that are not stored.
    """

    run: int
    started: Timestamp | Unset = UNSET
    devices: list[TracedDevice] = field(default_factory=list)
    spans: list[Span] = field(default_factory=list)
    omitted: int = 0


def traced_devices(spans: Sequence[Span], names: Mapping[str, str]) -> list[TracedDevice]:
    """Return the devices of spans in the order of their first span. Devices without a name get their id."""
    busy: dict[str, float] = {}
    for span in (span for span in spans if span.device):  # the call of a function has none
        busy[span.device] = busy.get(span.device, 0.0) + span.duration
    return [TracedDevice(key, names.get(key, key), round(sum_, 6)) for key, sum_ in busy.items()]


def chrome_trace(name: str, devices: Sequence[TracedDevice], spans: Sequence[Span]) -> dict[str, Any]:
    """Return spans in the Trace Event Format, which chrome://tracing and Perfetto open. Each device is a thread.

    Spans of a device that overlap, because a script uses several threads, are shown in further rows of the device.
    Calls of functions have rows of their own. If branches ran at the same time, a second process shows all spans again,
    with a lane for the program and for each branch.

    Args:
        name: Name of the process in the viewer.
        devices: The devices, in the order of the rows.
        spans: The spans, in the order of their start.
    """
    names = {device.id: device.name for device in devices}
    rows: dict[str, list[tuple[int, float]]] = {device.id: [] for device in devices}
    events: list[dict[str, Any]] = []
    titles: list[tuple[int, str]] = []
    for span in spans:
        of_device = rows.setdefault(span.device, [])
        end = span.start + span.duration
        row = next((row for row, (_, busy_until) in enumerate(of_device) if busy_until <= span.start + 1e-6), None)
        if row is None:
            row = len(of_device)
            title = names.get(span.device, span.device or "functions")
            titles.append((len(titles) + 1, title if row == 0 else f"{title} ({row + 1})"))
            of_device.append((titles[-1][0], end))
        thread = of_device[row][0]
        of_device[row] = (thread, end)
        details = {"number": span.number, "action_id": span.action_id, "branch": span.branch, "error": span.error}
        details["call"] = span.call
        event = {
            "ph": "X",
            "cat": "action",
            "name": span.name,
            "pid": _DEVICES,
            "tid": thread,
            "ts": round(span.start * 1e6),
            "dur": round(span.duration * 1e6),
            "args": {key: value for key, value in details.items() if not isinstance(value, Unset)},
        }
        events.append(event)
    heads = _named(_DEVICES, name, titles)
    lanes = lanes_of(spans)
    if lanes:
        numbers = {lane: number for number, lane in enumerate(["", *lanes], 1)}
        heads += _named(_BRANCHES, "branches", enumerate(["program", *lanes.values()], 1))
        events += [
            event | {"pid": _BRANCHES, "tid": numbers[span.lane or ""]}
            for event, span in zip(list(events), spans, strict=True)
        ]
    return {"traceEvents": [*heads, *events], "displayTimeUnit": "ms"}


_DEVICES: Final = 1
"""Number of the process of the devices in a Chrome trace."""
_BRANCHES: Final = 2
"""Number of the process of the branches in a Chrome trace."""


def _named(process: int, name: str, threads: Iterable[tuple[int, str]]) -> list[dict[str, Any]]:
    """Return the events that name a process and its threads."""
    found = [{"ph": "M", "name": "process_name", "pid": process, "tid": 0, "args": {"name": name}}]
    for thread, title in threads:
        found.append({"ph": "M", "name": "thread_name", "pid": process, "tid": thread, "args": {"name": title}})
    return found


def lanes_of(spans: Iterable[Span]) -> dict[str, str]:
    """Return the branches of spans that ran at the same time: their ids, and the names of the calls that they ran."""
    found: dict[str, str] = {}
    for span in spans:
        if not isinstance(span.lane, Unset):
            name = span.name if span.action_id == span.lane else found.get(span.lane, span.lane)
            found[span.lane] = name
    return found
