"""Recordings: points, joints and actions around an alarm or the end of a run (docs/protocol/recordings.md)."""

import enum
from typing import Annotated

from msgspec import UNSET, Meta, field

from arcor2_hw.data.base import Data, Timestamp, Unset
from arcor2_hw.messages import Message


class SignalKind(enum.StrEnum):
    """What a signal of a recording is."""

    POINT = "point"
    """An observation or a shown value of a device."""
    JOINT = "joint"
    STATE = "state"
    """Whether a device is connected."""


class RecordedAlarm(Data, frozen=True):
    """An alarm in a recording.

    number: of its record. time: time at which it was raised, ms after the event of the recording.
    """

    number: int
    time: int
    text: str
    text_message: Message | Unset = UNSET
    object_id: str | Unset = UNSET
    object_name: str | Unset = UNSET


class RecordingInfo(Data, frozen=True):
    """A stored recording without its values.

    number: of the recording, from 1. at: time of the event, to which all times are relative. stamp: the same on the
    monotonic clock of the computer, s. begin, end: the recorded time, ms after the event. size: of its file, bytes.
    complete: false while the recording continues, and for a recording that was cut off by the end of the server.
        run: number of the run; omitted in an online scene. run_failed: whether the run ended with an error or was
        interrupted. error: its reason.
    alarms: the recorded ones, the event first.
    """

    number: int
    at: Timestamp
    stamp: float
    begin: int
    end: int
    size: int = 0
    complete: bool = True
    run: int | Unset = UNSET
    run_failed: bool = False
    error: str | Unset = UNSET
    error_message: Message | Unset = UNSET
    alarms: list[RecordedAlarm] = field(default_factory=list)


class Signal(Data, frozen=True):
    """The values of one point or joint. A value is valid until the next one; null: unknown.

    times: ms after the event, ascending; the first one may be before `begin`. unit: SI; empty for booleans.
    """

    kind: SignalKind
    object_id: str
    object_name: str
    name: str
    unit: str
    times: list[int]
    values: list[bool | float | None]


class RecordedAction(Data, frozen=True):
    """An action, or a call of a method of a device in an online scene.

    number: of the action in its run; negative for a call. begin, end: ms after the event; `end` is omitted if it was
    running at the end of the recording. error: reason of a failure. results: each as JSON. branch: of the program.
    """

    number: int
    name: str
    begin: int
    end: int | Unset = UNSET
    action_id: str | Unset = UNSET
    object_id: str | Unset = UNSET
    object_name: str | Unset = UNSET
    branch: str | Unset = UNSET
    call: int | Unset = UNSET
    error: str | Unset = UNSET
    error_message: Message | Unset = UNSET
    results: list[str] | Unset = UNSET


class RecordedValues(Data, frozen=True):
    """The content of a recording."""

    signals: list[Signal] = field(default_factory=list)
    actions: list[RecordedAction] = field(default_factory=list)


class Recording(RecordingInfo, frozen=True, kw_only=True):
    """A stored recording with its content."""

    signals: list[Signal]
    actions: list[RecordedAction]


class RecordingQuery(Data, frozen=True):
    """Selects recordings, newest first.

    limit: maximum number. alarm: only those with this alarm. run: only those of this run.
    """

    limit: Annotated[int, Meta(ge=1, le=1000)] = 100
    alarm: int | Unset = UNSET
    run: int | Unset = UNSET


class RecordingChangedData(Data, frozen=True):
    """A recording was stored or has changed.

    deleted: numbers of the recordings that were deleted because there are newer ones.
    """

    recording: RecordingInfo
    deleted: list[int] = field(default_factory=list)
