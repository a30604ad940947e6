"""A recording as CSV."""

import csv
import io
from typing import Final

from arcor2_hw.data.base import Unset
from arcor2_hw.data.recordings import RecordedAction, Recording, Signal
from arcor2_server.audit.export import as_cell

_Value = bool | float | None
_BOOLEANS: Final = {True: "1", False: "0"}


def as_csv(recording: Recording) -> bytes:
    """Return a recording as CSV: a row for each time at which a value has changed or something happened.

    The columns are the time, s after the event; what happened; and one for each signal, which repeats its last value.
    """
    text = io.StringIO()
    writer = csv.writer(text)
    writer.writerow(["time_s", "what", *(as_cell(_title(signal)) for signal in recording.signals)])
    changes: dict[int, list[tuple[int, _Value]]] = {}
    for column, signal in enumerate(recording.signals):
        for time, value in zip(signal.times, signal.values, strict=True):
            changes.setdefault(max(time, recording.begin), []).append((column, value))
    happened = _happened(recording)
    values = [""] * len(recording.signals)
    for time in sorted(changes.keys() | happened.keys()):
        for column, value in changes.get(time, ()):
            values[column] = _shown(value)
        writer.writerow([f"{time / 1000:.3f}", as_cell("; ".join(happened.get(time, ()))), *values])
    return text.getvalue().encode()


def _title(signal: Signal) -> str:
    unit = f" [{signal.unit}]" if signal.unit else ""
    return f"{signal.object_name}: {signal.name}{unit}"


def _shown(value: _Value) -> str:
    if value is None:
        return ""
    return _BOOLEANS[value] if isinstance(value, bool) else repr(value)


def _happened(recording: Recording) -> dict[int, list[str]]:
    found: dict[int, list[str]] = {}
    for alarm in recording.alarms:
        device = "" if isinstance(alarm.object_name, Unset) else f"{alarm.object_name}: "
        found.setdefault(alarm.time, []).append(f"alarm {alarm.number}: {device}{alarm.text}")
    for action in recording.actions:
        found.setdefault(max(action.begin, recording.begin), []).append(f"{action.name} started")
        if not isinstance(action.end, Unset):
            found.setdefault(action.end, []).append(f"{action.name} {_outcome(action)}")
    return found


def _outcome(action: RecordedAction) -> str:
    if not isinstance(action.error, Unset):
        return f"failed: {action.error}"
    return "ended" if isinstance(action.results, Unset) else f"ended: {', '.join(action.results)}"
