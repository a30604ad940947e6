"""The cycle time, bottleneck and waits of a run, computed from its trace, and the comparison of two runs."""

import itertools
import statistics
from collections.abc import Sequence

from msgspec import UNSET, field

from arcor2_hw.data.base import Data, Unset
from arcor2_hw.data.run_trace import RunTrace, Span, TracedDevice


class DeviceTimes(Data, frozen=True):
    """A device in a run. busy: time during which it executed actions, s. share: `busy` divided by the whole time."""

    id: str
    name: str
    busy: float
    share: float


class ActionTimes(Data, frozen=True):
    """An action in a run. median: of its durations, s. total: sum of its durations, s."""

    action_id: str
    name: str
    device: str
    count: int
    median: float
    total: float


class Wait(Data, frozen=True):
    """A time in which no device executed an action; `before` is the name of the action after it."""

    before: str
    start: float
    duration: float


class DeviceWait(Data, frozen=True):
    """A time in which a device waits between two of its actions while another device executes actions.

    for_device: id of the device that is busy for most of it. before: name of the action after it.
    """

    device: str
    for_device: str
    before: str
    start: float
    duration: float


class TraceSummary(Data, frozen=True):
    """The times of a run, s.

    whole: from the start of the first action to the end of the last one. cycles: number of complete cycles; a cycle
    lasts from the start of the first action to its next start. cycle: median of their durations; without a complete
    cycle, the whole time. devices: the bottleneck, which is busy for the largest share, first. waits: longest first.
    device_waits: the longest one of each device, in the order of the devices.
    """

    whole: float
    cycles: int
    cycle: float
    devices: list[DeviceTimes]
    actions: list[ActionTimes]
    waits: list[Wait]
    device_waits: list[DeviceWait] = field(default_factory=list)


class ActionDifference(Data, frozen=True):
    """The median durations of an action in two runs, s; omitted where a run did not execute it."""

    name: str
    device: str
    first: float | Unset = UNSET
    second: float | Unset = UNSET

    @property
    def difference(self) -> float | None:
        """Return the additional time of the action in the second run, s; None if one run did not execute it."""
        return None if isinstance(self.first, Unset) or isinstance(self.second, Unset) else self.second - self.first


def covered(spans: Sequence[Span]) -> list[tuple[float, float]]:
    """Return start and end of the times in which at least one of the spans was running, in their order."""
    found: list[tuple[float, float]] = []
    for span in sorted(spans, key=lambda one: one.start):
        start, end = span.start, span.start + span.duration
        if found and start <= found[-1][1]:
            found[-1] = found[-1][0], max(found[-1][1], end)
        else:
            found.append((start, end))
    return found


def summarize(trace: RunTrace) -> TraceSummary:
    """Return the times of a run. Overlapping actions of a device, from several threads, count once."""
    spans = sorted(trace.spans, key=lambda span: span.start)
    if not spans:
        return TraceSummary(0.0, 0, 0.0, [], [], [])
    begin = spans[0].start
    whole = max(span.start + span.duration for span in spans) - begin
    starts = [span.start for span in spans if _key(span) == _key(spans[0])]
    cycles = [after - before for before, after in itertools.pairwise(starts)]
    devices = sorted((_times(device, spans, whole) for device in trace.devices), key=lambda device: -device.busy)
    by_action: dict[tuple[str, str], list[Span]] = {}
    for span in spans:
        by_action.setdefault(_key(span), []).append(span)
    on_devices = [span for span in spans if span.device]  # without the calls of functions, which cover waits
    names = {span.start: span.name for span in reversed(on_devices)}
    times = itertools.pairwise(covered(on_devices))
    waits = [Wait(names[after], before, after - before) for (_, before), (after, _) in times]
    return TraceSummary(
        whole,
        len(cycles),
        statistics.median(cycles) if cycles else whole,
        devices,
        [_action_times(same) for same in by_action.values()],
        sorted(waits, key=lambda wait: -wait.duration),
        _device_waits(devices, spans),
    )


def _device_waits(devices: Sequence[DeviceTimes], spans: Sequence[Span]) -> list[DeviceWait]:
    """Return the longest wait of each device between two of its actions for another device."""
    found = []
    for device in devices:
        own = [span for span in spans if span.device == device.id]
        names = {span.start: span.name for span in reversed(own)}
        gaps = [(start, end) for (_, start), (end, _) in itertools.pairwise(covered(own))]
        start, end = max(gaps, key=lambda gap: gap[1] - gap[0], default=(0.0, 0.0))
        busy: dict[str, float] = {}
        for span in spans:
            overlap = min(span.start + span.duration, end) - max(span.start, start)
            if span.device and span.device != device.id and overlap > 0.0:
                busy[span.device] = busy.get(span.device, 0.0) + overlap
        if busy:
            other = max(busy, key=lambda key: busy[key])
            found.append(DeviceWait(device.id, other, names[end], start, end - start))
    return found


def _key(action: Span | ActionTimes) -> tuple[str, str]:
    """Return the key of an action: its id, or its device and name in a script without declared actions."""
    return (action.action_id, "") if action.action_id else (action.device, action.name)


def _times(device: TracedDevice, spans: Sequence[Span], whole: float) -> DeviceTimes:
    busy = sum(end - start for start, end in covered([span for span in spans if span.device == device.id]))
    return DeviceTimes(device.id, device.name, busy, busy / whole if whole > 0.0 else 0.0)


def _action_times(same: Sequence[Span]) -> ActionTimes:
    durations = [span.duration for span in same]
    last = same[-1]
    return ActionTimes(last.action_id, last.name, last.device, len(same), statistics.median(durations), sum(durations))


def compare(first: TraceSummary, second: TraceSummary) -> list[ActionDifference]:
    """Return the actions of two runs side by side, in the order of the second run; removed actions come last.

    An action that was renamed is the same. Actions of a script without declared actions are compared by device and
    name.
    """
    before = {_key(action): action for action in first.actions}
    found = []
    for action in second.actions:
        old = before.pop(_key(action), None)
        found.append(ActionDifference(action.name, action.device, UNSET if old is None else old.median, action.median))
    return found + [ActionDifference(old.name, old.device, old.median) for old in before.values()]
