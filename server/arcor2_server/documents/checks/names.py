"""Checks of the names of objects, action points, actions and results."""

from collections import Counter
from collections.abc import Iterable

from arcor2_hw.data.base import is_valid_name
from arcor2_hw.exceptions import InvalidData
from arcor2_hw.messages import Message


def check_name(name: str, kind: str) -> None:
    """Raise InvalidData for a name that is not valid in a program. `kind`: kind of the item, such as "action point"."""
    if not is_valid_name(name):
        raise InvalidData(
            "{name!r} cannot name {item}: use letters, digits and _, no digit first, no Python keyword.",
            name=name,
            item=f"an {kind}" if kind[0] in "aeiou" else f"a {kind}",
        )


def duplicate_names(names: Iterable[str], kind: str) -> list[Message]:
    """Return a problem for each name that occurs more than once. `kind`: kind of the items, such as "action point"."""
    return [
        Message.of("More than one {what} is named {name}.", what=kind, name=name)
        for name, count in Counter(names).items()
        if count > 1
    ]
