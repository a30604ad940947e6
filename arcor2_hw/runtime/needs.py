"""Reads the observations that interlocks need, and compares them. Unknown and old values count as not met."""

import enum
import time
from collections.abc import Callable
from typing import Any, Final, NamedTuple

import msgspec

from arcor2_hw.actions.decorator import is_observation
from arcor2_hw.actions.json_values import encode
from arcor2_hw.data.base import Unset
from arcor2_hw.data.device import Connection, Quality, Reading
from arcor2_hw.data.interlocks import InterlockCondition, Need
from arcor2_hw.data.operator import Operator
from arcor2_hw.exceptions import NotFound, message_of
from arcor2_hw.messages import Message
from arcor2_hw.runtime.device import Device

MAX_VALUE_AGE: Final = 1.0
"""Maximum age of a valid value, s. Drivers poll their devices about ten times per second."""

Key = tuple[str, str, str]
"""Object, observation and point."""


class CachedValue(NamedTuple):
    """The last known value of an observation, its time (monotonic, s), and the reason why no newer value is known."""

    value: Any = None
    at: float = 0.0
    problem: Message | None = None


class Verdict(NamedTuple):
    """Whether a need is met, and the sentence for users if it is not."""

    state: InterlockCondition
    text: Message | None = None


def key_of(need: Need) -> Key:
    """Return the object and the observation of a need."""
    return need.object_id, need.observation, need.point


def read(device: Device, observation: str, point: str, before: CachedValue) -> CachedValue:
    """Read an observation. On failure, return the previous value with the reason."""
    asked = time.monotonic()
    try:
        if not is_observation(getattr(device.recipe.cls, observation, None)):
            raise NotFound("{device} has no observation {observation}", device=device.name, observation=observation)
        instance = device.require()
        if instance.connection not in (Connection.ONLINE, Connection.BACK):
            return before._replace(problem=Message.of("the connection is lost"))
        value = getattr(instance, observation)(*([point] if point else []))
    except Exception as error:  # noqa: BLE001 - a driver may raise anything
        return before._replace(problem=message_of(error))
    if isinstance(value, Reading):
        if value.quality is not Quality.GOOD:
            return before._replace(problem=Message.of("the value is not reliable"))
        value, asked = value.value, value.monotonic
    return CachedValue(value.value if isinstance(value, enum.Enum) else value, asked)


def verdict(need: Need, seen: CachedValue | None, device: str) -> Verdict:
    """Compare a need with the last known value.

    Args:
        need: the need.
        seen: the last known value; None if the observation was never read.
        device: name of the object.
    """
    shown = shown_need(need)
    if seen is None or not seen.at:
        text = Message.of("{device}: {need} is not confirmed, no value is known", device=device, need=shown)
        return Verdict(InterlockCondition.UNKNOWN, text)
    age = time.monotonic() - seen.at
    if age > MAX_VALUE_AGE:
        text = Message.of(
            "{device}: {need} is not confirmed, last known {age:.0f} s ago", device=device, need=shown, age=age
        )
        return Verdict(InterlockCondition.UNKNOWN, text)
    try:
        met = compare(need, seen.value)
    except (TypeError, msgspec.MsgspecError):
        met = False
    if met:
        return Verdict(InterlockCondition.MET)
    if isinstance(seen.value, bool):
        return Verdict(InterlockCondition.NOT_MET, Message.of("{device}: {need} is not met", device=device, need=shown))
    value = _shown(encode(seen.value))
    text = Message.of("{device}: {need} is not met, it is {value}", device=device, need=shown, value=value)
    return Verdict(InterlockCondition.NOT_MET, text)


def compare(need: Need, value: Any) -> bool:
    """Return whether a value fulfills a need. Raises TypeError for a value of another type, MsgspecError."""
    limit = msgspec.json.decode(need.value)
    if isinstance(limit, bool) != isinstance(value, bool) or isinstance(limit, str) != isinstance(value, str):
        raise TypeError("values of different types cannot be compared")
    upper = None if isinstance(need.upper, Unset) else msgspec.json.decode(need.upper)
    found: Callable[[], bool] = {
        Operator.EQUAL: lambda: value == limit,
        Operator.DIFFERENT: lambda: value != limit,
        Operator.LESS: lambda: value < limit,
        Operator.LESS_EQUAL: lambda: value <= limit,
        Operator.GREATER: lambda: value > limit,
        Operator.GREATER_EQUAL: lambda: value >= limit,
        Operator.CLOSED: lambda: limit <= value <= upper,
        Operator.RIGHT_OPEN: lambda: limit <= value < upper,
        Operator.LEFT_OPEN: lambda: limit < value <= upper,
        Operator.OPEN: lambda: limit < value < upper,
    }[need.operator]
    return bool(found())


def shown_need(need: Need) -> str:
    """Return a need without its device as users read it, such as `door open` or `velocity < 0.1`."""
    name = need.point or need.observation.replace("_", " ")
    if need.operator is Operator.EQUAL and need.value == "true":
        return name
    if not isinstance(need.upper, Unset):
        brackets = need.operator.value
        return f"{name} in {brackets[0]}{_shown(need.value)}, {_shown(need.upper)}{brackets[-1]}"
    operator = "=" if need.operator is Operator.EQUAL else need.operator.value
    return f"{name} {operator} {_shown(need.value)}"


def _shown(value: str) -> str:
    return value.strip('"')
