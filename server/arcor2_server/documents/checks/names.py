"""Checks of the names of objects, action points, actions and results."""

from collections import Counter
from collections.abc import Iterable

from arcor2_hw.data.base import is_valid_name
from arcor2_hw.exceptions import InvalidData
from arcor2_hw.messages import Message


def check_name(name: str, what: str) -> None:
    """Raise InvalidData for a name that is not valid in a program; `what` is what it names ("action point")."""
    if not is_valid_name(name):
        raise InvalidData(
            "{name!r} cannot name {item}: use letters, digits and _, no digit first, no Python keyword.",
            name=name,
            item=f"an {what}" if what[0] in "aeiou" else f"a {what}",
        )


def duplicate_names(names: Iterable[str], what: str) -> list[Message]:
    """Return a problem for each name that occurs more than once; `what` is what the names name ("action point")."""
    return [
        Message.of("More than one {what} is named {name}.", what=what, name=name)
        for name, count in Counter(names).items()
        if count > 1
    ]
