"""Common data of all devices: readings, identity, connection, health and alarms."""

import enum
import time
from typing import Any, Final, Generic, TypeVar

from arcor2_hw.data.base import UNSET, Data, Timestamp, Unset, now
from arcor2_hw.messages import Message

T = TypeVar("T")
DEVICE_FILES: Final = "ARCOR2_HW_DEVICE_FILES"
"""Environment variable with the directories, separated by `:`, that settings of devices may refer to.

The server sets it for its cell hosts. A script that is started by hand runs without it and may use any file.
"""


class Quality(enum.StrEnum):
    """Reliability of a reading (good, uncertain, bad, as in OPC UA)."""

    GOOD = "good"
    UNCERTAIN = "uncertain"
    BAD = "bad"


class Reading(Data, Generic[T], frozen=True):
    """A value with its time: UTC for display, the monotonic clock (s) for its age."""

    value: T
    stamp: Timestamp
    monotonic: float
    quality: Quality = Quality.GOOD

    @classmethod
    def of(cls, value: T, quality: Quality = Quality.GOOD) -> "Reading[T]":
        """Return a reading taken now."""
        return cls(value, now(), time.monotonic(), quality)

    @property
    def age(self) -> float:
        """Return the age in s."""
        return time.monotonic() - self.monotonic


class Observation(Data, frozen=True):
    """A value of a device for display and trends. It is None if its quality is bad.

    name: English words, which clients translate, or the user's name of a point. unit: SI; empty for a boolean.
    """

    name: str
    value: float | bool | None
    unit: str = ""
    quality: Quality = Quality.GOOD

    @classmethod
    def of(cls, name: str, reading: "Reading[Any]", unit: str = "") -> "Observation":
        """Return the value of a reading."""
        bad = reading.quality is Quality.BAD
        return cls(name, None if bad else reading.value, unit, reading.quality)


class Identity(Data, frozen=True):
    """Identity of a device; unknown fields are empty."""

    vendor: str = ""
    model: str = ""
    serial: str = ""
    firmware: str = ""

    def differences(self, other: "Identity") -> list[str]:
        """Return the names of the fields that both devices report, with different values."""
        pairs = ((name, getattr(self, name), getattr(other, name)) for name in self.__struct_fields__)
        return [name for name, mine, theirs in pairs if mine and theirs and mine != theirs]


class Connection(enum.StrEnum):
    """State of a connection."""

    OFFLINE = "offline"
    CONNECTING = "connecting"
    ONLINE = "online"
    LOST = "lost"
    BACK = "back"
    FAILED = "failed"


class Health(enum.StrEnum):
    """Condition of a device (NAMUR NE 107)."""

    NORMAL = "normal"
    CHECK_FUNCTION = "check_function"
    OFF_SPEC = "off_spec"
    MAINTENANCE_REQUIRED = "maintenance_required"
    FAILURE = "failure"


class Severity(enum.StrEnum):
    """Severity of an alarm."""

    INFO = "info"
    WARNING = "warning"
    ERROR = "error"
    CRITICAL = "critical"


class Alarm(Data, frozen=True):
    """A condition that needs attention; `remedy` says what to do.

    text_message, remedy_message: the text and the remedy with the data for their translation, if they have values.
    """

    code: str
    severity: Severity
    text: str
    remedy: str
    since: Timestamp
    text_message: Message | Unset = UNSET
    remedy_message: Message | Unset = UNSET

    @classmethod
    def of(cls, code: str, severity: Severity, text: str | Message, remedy: str | Message, since: Timestamp) -> "Alarm":
        """Return an alarm whose text and remedy may be messages with values."""
        messages = [each if isinstance(each, Message) and each.values else UNSET for each in (text, remedy)]
        return cls(code, severity, str(text), str(remedy), since, *messages)


class LossKind(enum.StrEnum):
    """Reaction of a device to a connection loss."""

    STOPS_WITHIN = "stops_within"
    HOLDS = "holds"
    CONTINUES = "continues"


class LossReaction(Data, frozen=True):
    """The declared reaction of a device to a connection loss; `within` in s if the device stops."""

    kind: LossKind
    within: float = 0.0

    @classmethod
    def stops_within(cls, seconds: float) -> "LossReaction":
        """Declare that motion ends within a time after the connection loss, s."""
        return cls(LossKind.STOPS_WITHIN, seconds)

    @classmethod
    def holds(cls) -> "LossReaction":
        """Declare that the device keeps its last outputs and starts nothing new."""
        return cls(LossKind.HOLDS)

    @classmethod
    def continues(cls) -> "LossReaction":
        """Declare that the device continues."""
        return cls(LossKind.CONTINUES)
