"""What every device tells of itself: readings, identity, connection, health and alarms."""

import enum
import time
from typing import Final, Generic, TypeVar

from arcor2_hw.data.base import Data, Timestamp, now

T = TypeVar("T")
DEVICE_FILES: Final = "ARCOR2_HW_DEVICE_FILES"
"""Environment variable with the directories, separated by `:`, in which the settings of devices may name files.

The server sets it for its cell hosts. A script that is started by hand runs without it and may name any file.
"""


class Quality(enum.StrEnum):
    """How far a reading can be trusted (OPC UA's good, uncertain, bad)."""

    GOOD = "good"
    UNCERTAIN = "uncertain"
    BAD = "bad"


class Reading(Data, Generic[T], frozen=True):
    """A value with when it was taken: UTC for people, the monotonic clock (s) for its age."""

    value: T
    stamp: Timestamp
    monotonic: float
    quality: Quality = Quality.GOOD

    @classmethod
    def of(cls, value: T, quality: Quality = Quality.GOOD) -> "Reading[T]":
        """Make a reading taken at this moment."""
        return cls(value, now(), time.monotonic(), quality)

    @property
    def age(self) -> float:
        """Give the seconds since it was taken."""
        return time.monotonic() - self.monotonic


class Identity(Data, frozen=True):
    """Who a device says it is; a field it does not tell is empty."""

    vendor: str = ""
    model: str = ""
    serial: str = ""
    firmware: str = ""


class Connection(enum.StrEnum):
    """The life of a connection."""

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
    """How bad an alarm is."""

    INFO = "info"
    WARNING = "warning"
    ERROR = "error"
    CRITICAL = "critical"


class Alarm(Data, frozen=True):
    """Something a person should deal with; `remedy` says how."""

    code: str
    severity: Severity
    text: str
    remedy: str
    since: Timestamp


class LossKind(enum.StrEnum):
    """What a device does when it loses us."""

    STOPS_WITHIN = "stops_within"
    HOLDS = "holds"
    CONTINUES = "continues"


class LossReaction(Data, frozen=True):
    """The declared reaction of a device to losing us; `within` in s for one that stops."""

    kind: LossKind
    within: float = 0.0

    @classmethod
    def stops_within(cls, seconds: float) -> "LossReaction":
        """Declare that motion has ended that long after we are gone."""
        return cls(LossKind.STOPS_WITHIN, seconds)

    @classmethod
    def holds(cls) -> "LossReaction":
        """Declare that it keeps its last outputs and does nothing new."""
        return cls(LossKind.HOLDS)

    @classmethod
    def continues(cls) -> "LossReaction":
        """Declare that it goes on with what it was doing."""
        return cls(LossKind.CONTINUES)
