"""Extracts from the record of a result the data that lists and counts need."""

from datetime import datetime
from typing import Final, NamedTuple

import msgspec
from msgspec import field

from arcor2_hw.data.alarms import AlarmRecord
from arcor2_hw.data.base import UNSET, Data, Timestamp, Unset
from arcor2_hw.data.units import UnitRecord, UnitState, UnitStep
from arcor2_hw.messages import Message
from arcor2_server.fleet.records import Translations

BAD: Final = (UnitState.BAD, UnitState.REJECTED)
_encode = msgspec.json.Encoder().encode
_FALSE: Final = "false"
"""Result of an action that has tested a part and found it bad, as JSON."""
_MAX_ERROR_LENGTH: Final = 1000
"""Maximum size of the text of an error, characters."""


class UnitSummary(Data, frozen=True):
    """A unit without its steps.

    step, error: the action that explains why it is bad, and the error of this action; empty if there is none. message:
    the error as a message, unless it is too long. translations: of the errors of all steps by the cell.
    """

    number: int
    serial: str
    part: int
    state: UnitState
    entered: Timestamp
    left: Timestamp | Unset = UNSET
    verdict: bool | Unset = UNSET
    order: str = ""
    product: str = ""
    program: str = ""
    step: str = ""
    error: str = ""
    message: Message | Unset = UNSET
    translations: Translations = field(default_factory=dict)


class Columns(NamedTuple):
    """The columns of a result that queries use.

    at: when the unit left or the alarm was raised, s since the epoch. until: when the alarm ended, s; None while it is
    active, and for units. state: of the unit, or the priority of the alarm. label: serial number, or what alarms with
    the same cause have in common. times: how often the alarm occurred. summary: what a list shows, as JSON.
    """

    at: int
    until: int | None
    state: str
    label: str
    program: str
    product: str
    times: int
    summary: bytes


def unit_columns(record: UnitRecord, translations: Translations, received: int) -> Columns:
    """Return the columns of a unit.

    Args:
        record: the unit.
        translations: of its texts by its cell.
        received: when it was stored first, s; used if its time cannot be read.
    """
    product = "" if isinstance(record.recipe, Unset) else record.recipe.product
    left = record.entered if isinstance(record.left, Unset) else record.left
    step = _reason(record)
    error = ""
    message: Message | Unset = UNSET
    if step is not None and not isinstance(step.error, Unset):
        error = step.error[:_MAX_ERROR_LENGTH]
        if step.error == error and not isinstance(step.key, Unset):
            message = step.as_message(error)
    summary = UnitSummary(
        record.number,
        record.serial,
        record.part,
        record.state,
        record.entered,
        record.left,
        record.verdict,
        record.order,
        product,
        record.package_name,
        "" if step is None else step.name,
        error,
        message,
        translations,
    )
    at = _seconds(left, received)
    return Columns(at, None, record.state, record.serial, record.package_name, product, 1, _encode(summary))


def _reason(record: UnitRecord) -> UnitStep | None:
    """Return the step that explains why a unit is bad: the last one that failed, else the last test that found it."""
    if record.state not in BAD:
        return None
    for fits in (
        lambda step: not isinstance(step.error, Unset),
        lambda step: not isinstance(step.results, Unset) and step.results[:1] == [_FALSE],
    ):
        if (found := next(filter(fits, reversed(record.steps)), None)) is not None:
            return found
    return None


class AlarmSummary(Data, frozen=True):
    """An alarm with the translations of its texts by its cell."""

    record: AlarmRecord
    translations: Translations = field(default_factory=dict)


def alarm_columns(record: AlarmRecord, translations: Translations, received: int) -> Columns:
    """Return the columns of an alarm. For the arguments see `unit_columns`."""
    device = "" if isinstance(record.object_id, Unset) else record.object_id
    at = _seconds(record.raised, received)
    until = None
    if not isinstance(record.cleared, Unset):
        until = max(at, _seconds(record.cleared, at))
    elif not record.active:
        until = at
    cause = f"{record.kind}/{record.code}/{device}"
    summary = _encode(AlarmSummary(record, translations))
    return Columns(at, until, record.priority, cause, "", "", record.count, summary)


def _seconds(time: Timestamp, default: int) -> int:
    try:
        return int(datetime.fromisoformat(time).timestamp())
    except (ValueError, OverflowError, OSError):
        return default
