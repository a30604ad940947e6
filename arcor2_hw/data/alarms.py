"""Alarms: their declaration next to a driver, and the records of their occurrences (docs/protocol/alarms.md)."""

import enum
from typing import Annotated, Final

from msgspec import Meta, field

from arcor2_hw.data.base import UNSET, Data, Timestamp, Unset
from arcor2_hw.data.device import Severity
from arcor2_hw.messages import Message


class Priority(enum.StrEnum):
    """Urgency of an alarm (ISA-18.2), lowest first."""

    LOW = "low"
    MEDIUM = "medium"
    HIGH = "high"
    URGENT = "urgent"


PRIORITIES: Final = list(Priority)
"""The priorities, least first."""
PRIORITY_OF: Final = {
    Severity.INFO: Priority.LOW,
    Severity.WARNING: Priority.MEDIUM,
    Severity.ERROR: Priority.HIGH,
    Severity.CRITICAL: Priority.URGENT,
}
"""Priority of an alarm that only its device describes."""


class AlarmCategory(enum.StrEnum):
    """What an alarm is about."""

    CONNECTION = "connection"
    CONTROL = "control"
    SAFETY = "safety"
    DEVICE = "device"
    SUPPLY = "supply"
    PROCESS = "process"
    PROGRAM = "program"
    SYSTEM = "system"


class AcknowledgeRole(enum.StrEnum):
    """The least role that may acknowledge an alarm."""

    OPERATOR = "operator"
    TECHNICIAN = "technician"


class AlarmKind(Data, frozen=True, forbid_unknown_fields=True):
    """The declaration of an alarm in `alarms.toml`. Texts are English and the keys of their translations.

    number: unique in the file. code: of the condition or error that raises it; `*` stands for any characters, `?` for
    one.
    text: the event; empty: the text that the device reports. cause: the usual cause. remedy: what to do;
    empty: the one that the device reports. latching: whether it stays until it is acknowledged, after its condition has
    ended. picture: an SVG file next to `alarms.toml`. group: name under which lists show it; by default the folder.
    """

    number: Annotated[int, Meta(ge=1, le=9999)]
    code: Annotated[str, Meta(min_length=1, max_length=60)]
    priority: Priority
    category: AlarmCategory
    text: Annotated[str, Meta(max_length=200)] = ""
    cause: Annotated[str, Meta(max_length=400)] = ""
    remedy: Annotated[str, Meta(max_length=400)] = ""
    latching: bool = False
    acknowledge: AcknowledgeRole = AcknowledgeRole.OPERATOR
    picture: Annotated[str, Meta(max_length=100)] = ""
    group: Annotated[str, Meta(max_length=60)] = ""

    @property
    def can_be_shelved(self) -> bool:
        """Whether users may shelve it. Safety stops always stay visible."""
        return self.category is not AlarmCategory.SAFETY


class AlarmRecord(Data, frozen=True):
    """One occurrence of an alarm.

    number: number of the record. kind: group and number of its declaration, such as `conveyor-3`. object_id,
    object_name: omitted for alarms of the program and the system. remedy_message, text_message: for translation, if the
    text or the remedy has values. active: whether its condition persists. cleared: when the condition ended. retain:
    whether it still needs attention: it is active, or it latches and is not acknowledged. first_up: number of the
    record that came first of those with the same cause; its own number for the first one. count: number of
    occurrences of the condition while the record was open. run: number of the run. action: name of the action that
    failed.
    """

    number: int
    kind: str
    code: str
    priority: Priority
    category: AlarmCategory
    text: str
    raised: Timestamp
    first_up: int
    cause: str = ""
    remedy: str = ""
    text_message: Message | Unset = UNSET
    remedy_message: Message | Unset = UNSET
    object_id: str | Unset = UNSET
    object_name: str | Unset = UNSET
    object_type: str | Unset = UNSET
    latching: bool = False
    acknowledge: AcknowledgeRole = AcknowledgeRole.OPERATOR
    can_be_shelved: bool = True
    active: bool = True
    acknowledged: bool = False
    retain: bool = True
    count: int = 1
    cleared: Timestamp | Unset = UNSET
    acknowledged_at: Timestamp | Unset = UNSET
    acknowledged_by: str | Unset = UNSET
    note: str | Unset = UNSET
    shelved_until: Timestamp | Unset = UNSET
    shelved_by: str | Unset = UNSET
    run: int | Unset = UNSET
    action: str | Unset = UNSET
    picture: str | Unset = UNSET


class AlarmFrequency(Data, frozen=True):
    """Number and duration in s of the activations of an alarm of an object in a period."""

    kind: str
    code: str
    text: str
    count: int
    duration: float
    text_message: Message | Unset = UNSET
    object_id: str | Unset = UNSET
    object_name: str | Unset = UNSET


class AlarmFilter(enum.StrEnum):
    """Selection of alarms: those that need attention, the shelved ones, or the whole history."""

    RETAINED = "retained"
    SHELVED = "shelved"
    ALL = "all"


class AlarmFile(Data, frozen=True, forbid_unknown_fields=True):
    """The content of `alarms.toml`: the declarations, and the group of those without one."""

    alarm: list[AlarmKind] = field(default_factory=list)
    group: Annotated[str, Meta(max_length=60)] = ""
