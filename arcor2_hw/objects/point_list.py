"""Parser of named points in a setting: `name=DI... debounce=0.02`, `name=AO... scale=0.01 unit=m/s on_loss=hold`."""

import math
from collections.abc import Sequence
from typing import Final

from arcor2_hw.data.base import UNSET
from arcor2_hw.exceptions import OutOfRange
from arcor2_hw.messages import Message
from arcor2_hw.objects.small import IOPoint, OnLoss, PointDirection, PointKind

OPTIONS: Final = {"DI": ("debounce",), "DO": ("on_loss",), "AI": ("scale", "unit"), "AO": ("scale", "unit", "on_loss")}
"""Options by kind of point: digital or analogue, input or output."""
MAX_DEBOUNCE_TIME: Final = 10.0
"""Longest debounce time, s."""


def entries(text: str, separator: str, parameter: str) -> dict[str, list[str]]:
    """Split a list of `name=word word ...` into words by name. Raises OutOfRange."""
    found: dict[str, list[str]] = {}
    for entry in filter(None, (part.strip() for part in text.split(separator))):
        name, sign, rest = entry.partition("=")
        if not sign or not name.isidentifier() or not rest.strip():
            raise OutOfRange(
                "{parameter} must be a list of name=..., separated by {separator!r}, not {entry!r}",
                parameter=parameter,
                separator=separator,
                entry=entry,
            )
        if name in found:
            raise OutOfRange(
                "{parameter} must contain each name once: {name!r} is in it twice", parameter=parameter, name=name
            )
        found[name] = rest.split()
    return found


def io_point(
    name: str,
    kind: str,
    words: Sequence[str],
    parameter: str,
    *,
    debounce: bool = True,
    safe_states: Sequence[OnLoss] = tuple(OnLoss),
    default_on_loss: OnLoss = OnLoss.OFF,
) -> IOPoint:
    """Return a point.

    Args:
        name: Name of the point.
        kind: DI, DO, AI or AO.
        words: The options, such as `scale=0.001`.
        parameter: Name of the setting, for errors.
        debounce: Whether inputs may be debounced.
        safe_states: Permitted reactions of outputs to a connection loss.
        default_on_loss: Reaction of an output without the option `on_loss`.

    Raises:
        OutOfRange: An option is not valid.
    """
    known = [option for option in OPTIONS[kind] if debounce or option != "debounce"]
    options: dict[str, str] = {}
    for word in words:
        key, sign, value = word.partition("=")
        if not sign or not value or key not in known or key in options:
            allowed = ", ".join(sorted(known)) or Message.of("no options")
            raise OutOfRange(
                "{parameter} must give {name} ({type}) only {allowed}, each once, not {word!r}",
                parameter=parameter,
                name=name,
                type=kind,
                allowed=allowed,
                word=word,
            )
        options[key] = value
    on_loss = options.get("on_loss", default_on_loss)
    if on_loss not in safe_states:
        raise OutOfRange(
            "{parameter} must set on_loss of {name} to {safe_states}, not {on_loss!r}",
            parameter=parameter,
            name=name,
            safe_states=", ".join(safe_states),
            on_loss=on_loss,
        )
    point = IOPoint(
        name=name,
        direction=PointDirection.INPUT if kind in ("DI", "AI") else PointDirection.OUTPUT,
        kind=PointKind.DIGITAL if kind in ("DI", "DO") else PointKind.ANALOG,
        unit=options.get("unit", ""),
        scale=_number(options.get("scale", "1"), "scale", name, parameter),
        debounce=_number(options.get("debounce", "0"), "debounce", name, parameter),
        on_loss=OnLoss(on_loss) if kind in ("DO", "AO") else UNSET,
    )
    if point.scale == 0.0:
        raise OutOfRange("{parameter} must not set scale of {name} to 0", parameter=parameter, name=name)
    if not 0.0 <= point.debounce <= MAX_DEBOUNCE_TIME:
        raise OutOfRange(
            "{parameter} must set debounce of {name} to a value from 0 to {longest_debounce:g} s",
            parameter=parameter,
            name=name,
            longest_debounce=MAX_DEBOUNCE_TIME,
        )
    return point


def _number(text: str, key: str, name: str, parameter: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise OutOfRange(
            "{parameter} must set {key} of {name} to a number, not {text!r}",
            parameter=parameter,
            name=name,
            key=key,
            text=text,
        )
    return value


# Names before version 0.2.
LONGEST_DEBOUNCE = MAX_DEBOUNCE_TIME
