"""Points: inputs, outputs, registers and signals of devices with their present values, and outputs that are forced."""

import enum
from typing import Final

from msgspec import field

from arcor2_hw.data.base import UNSET, Data, Timestamp, TranslatableData, Unset

MIN_FORCE_MS: Final = 500
MAX_FORCE_MS: Final = 10_000
"""Limits of the time after which a force that is not renewed ends, ms."""

PointValue = bool | float | str | None
"""Value of a point; None if it is not known."""


class PointUse(enum.StrEnum):
    """Kind of a point: an input or output of the device, one of its registers, or another reported value."""

    INPUT = "input"
    OUTPUT = "output"
    REGISTER = "register"
    SIGNAL = "signal"


class PointQuality(enum.StrEnum):
    """Reliability of the value of a point."""

    GOOD = "good"
    UNCERTAIN = "uncertain"
    STALE = "stale"
    BAD = "bad"
    NOT_CONNECTED = "not_connected"


class ForceKind(enum.StrEnum):
    """The kind of value to which an output can be forced."""

    DIGITAL = "digital"
    ANALOG = "analog"


class LivePoint(Data, frozen=True):
    """A point of a device with its newest known value.

    name: the user's name of an input or output; of a signal, the name of its method or English words. age: of the
    value, s; omitted if it is not known. force: the kind of value to which the point can be forced; omitted if it
    cannot be forced.
    """

    name: str
    use: PointUse
    value: PointValue = None
    unit: str = ""
    quality: PointQuality = PointQuality.GOOD
    age: float | Unset = UNSET
    force: ForceKind | Unset = UNSET


class ObjectPointsData(TranslatableData, frozen=True):
    """Data of the event ObjectPoints: all points of a device.

    time_ms: time of reading on the steady clock of the cell. reason: why the points are not known.
    """

    object_id: str
    time_ms: float
    points: list[LivePoint] = field(default_factory=list)
    reason: str | Unset = UNSET


class ForcedPoint(Data, frozen=True):
    """An output that a person forces.

    object, point: names of the device and of its output. unit: of the value. user: the user who forces it. since: start
    of the force.
    """

    id: str
    object_id: str
    object: str
    point: str
    value: bool | float
    unit: str
    user: str
    since: Timestamp


class ForcesChangedData(Data, frozen=True):
    """Data of the event ForcesChanged: all forced outputs."""

    forces: list[ForcedPoint]


# Names before version 0.2.
LONGEST_FORCE_MS, SHORTEST_FORCE_MS = MAX_FORCE_MS, MIN_FORCE_MS
