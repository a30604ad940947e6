"""The decorator that marks a method of an object type as an action."""

import builtins
import enum
import inspect
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any, Final, NamedTuple, TypeVar, overload

from arcor2_hw.data.base import UNSET
from arcor2_hw.data.object_type import ActionMetadata, Again

DEFAULT_DEADLINE: Final = 120.0
"""Time limit of an action, s; longer than any single motion of the demo cell."""

OLDER_DEADLINE: Final = 3600.0
"""Time limit of an action that is declared in the older form, without a time limit, s."""

NOTHING_RENAMED: Final[Mapping[str, str]] = MappingProxyType({})


class PartFlow(NamedTuple):
    """The effect of an action on a part.

    takes_from, puts_to: names of the parameters with the places. serial, order: names of the parameters with the serial
    number of the part and the id of its order. Empty: none.
    """

    takes_from: str = ""
    puts_to: str = ""
    identifies: bool = False
    serial: str = ""
    order: str = ""


F = TypeVar("F", bound=Callable[..., object])
V = TypeVar("V")


class StrEnum(enum.StrEnum):
    """Base of text enumerations that may be the type of an action parameter."""

    @classmethod
    def set(cls) -> builtins.set[str]:
        """Return the values of all members, as object types written for ARCOR2 expect."""
        return {member.value for member in cls}


class IntEnum(enum.IntEnum):
    """Base of integer enumerations that may be the type of an action parameter."""

    @classmethod
    def set(cls) -> builtins.set[int]:
        """Return the values of all members, as object types written for ARCOR2 expect."""
        return {member.value for member in cls}


@overload
def action(method: F, /) -> F: ...
@overload
def action(
    *,
    composite: bool = False,
    hidden: bool = False,
    quick: bool = False,
    deadline: float | None = DEFAULT_DEADLINE,
    category: str = "",
    icon: str = "",
    renamed: Mapping[str, str] = NOTHING_RENAMED,
    verdict: bool = False,
    again: str = Again.ASK,
    takes_from: str = "",
    puts_to: str = "",
    identifies: bool = False,
    serial: str = "",
    order: str = "",
    ends_with_program: bool = False,
) -> Callable[[F], F]: ...


def action(
    method: F | None = None,
    /,
    *,
    composite: bool = False,
    hidden: bool = False,
    quick: bool = False,
    deadline: float | None = DEFAULT_DEADLINE,
    category: str = "",  # noqa: ARG001 - read from the source
    icon: str = "",  # noqa: ARG001
    renamed: Mapping[str, str] = NOTHING_RENAMED,
    verdict: bool = False,
    again: str = Again.ASK,
    takes_from: str = "",
    puts_to: str = "",
    identifies: bool = False,
    serial: str = "",
    order: str = "",
    ends_with_program: bool = False,
) -> F | Callable[[F], F]:
    """Mark a method as an action.

    Args:
        method: The method.
        composite: Whether it may call other actions.
        hidden: Whether it is not offered to users.
        quick: Whether it neither waits nor moves anything and returns within 1 s, so that it need not be stopped.
        deadline: Time limit of a call, s; None for an action that ends only when it is stopped.
        category: Category in the editor; default: that of the type.
        icon: Icon in the editor; default: that of the type.
        renamed: Present names of parameters by former names, which older projects and scripts use.
        verdict: Whether the returned boolean says that a part is good. Good and bad parts of a run are counted.
        again: "safe" if repeating it after it has failed does no harm, so that a program may retry it: it only reads,
            scans or measures. "never" if it must not be repeated, else "ask".
        takes_from: Name of the parameter with the pose at which the device takes a part.
        puts_to: Name of the parameter with the pose at which the device puts its part.
        identifies: Whether the returned text is the serial number of the part at the place of the action.
        serial: Name of the parameter with the serial number of a part, such as that of a label or a report. The action
            then belongs to the record of this part.
        order: Name of the parameter with the id of the order of this part.
        ends_with_program: Whether its effect lasts after the action but ends with the program, such as a running belt.
            An interrupted program that continues repeats it.

    Raises:
        TypeError: The method has no parameter that `takes_from`, `puts_to`, `serial` or `order` names, or both of the
            former are stated.
    """
    repeated = UNSET if again == Again.ASK else Again(again)
    flow = PartFlow(takes_from, puts_to, identifies, serial, order)

    def mark(function: F) -> F:
        if takes_from or puts_to:
            if takes_from and puts_to:
                raise TypeError("an action cannot declare both takes_from and puts_to")
            if (takes_from or puts_to) not in inspect.signature(function).parameters:
                raise TypeError(f"the action has no parameter {takes_from or puts_to!r}to name a place")
        for parameter in filter(None, (serial, order)):
            if parameter not in inspect.signature(function).parameters:
                raise TypeError(f"the action has no parameter {parameter!r}")
        function.__action__ = ActionMetadata(composite, hidden, verdict=verdict or UNSET, again=repeated)  # type: ignore[attr-defined]
        function.__deadline__ = deadline  # type: ignore[attr-defined]
        function.__quick__ = quick  # type: ignore[attr-defined]
        function.__renamed__ = renamed  # type: ignore[attr-defined]
        function.__part_flow__ = flow  # type: ignore[attr-defined]
        function.__ends_with_program__ = ends_with_program  # type: ignore[attr-defined]
        return function

    return mark if method is None else mark(method)


def observation(method: F) -> F:
    """Mark a method as an observation that interlocks compare.

    The method returns a boolean, number, text or enumeration, or a Reading of one, and has at most one parameter, the
    name of a point. It is called up to 20 times per second, on a thread of its own, also while an action runs. It
    returns the newest known value, or raises DeviceError (Stale, ConnectionLost) if no recent value is known.
    """
    function: Any = method
    function.__observation__ = True
    return method


def is_observation(method: object) -> bool:
    """Return whether a method is an observation that interlocks compare."""
    return bool(getattr(method, "__observation__", False))


def metadata_of(method: object) -> ActionMetadata | None:
    """Return the metadata of an action, None for any other method."""
    found = getattr(method, "__action__", None)
    return found if isinstance(found, ActionMetadata) else None


def part_flow_of(method: object) -> PartFlow:
    """Return the effect of an action on a part."""
    found = getattr(method, "__part_flow__", None)
    return found if isinstance(found, PartFlow) else PartFlow()


def ends_with_program(method: object) -> bool:
    """Return whether the effect of an action lasts after it, until the program ends."""
    return bool(getattr(method, "__ends_with_program__", False))


def is_quick(method: object) -> bool:
    """Return whether an action declares that it returns within 1 s."""
    return bool(getattr(method, "__quick__", False))


def with_present_names(method: object, given: Mapping[str, V]) -> dict[str, V]:
    """Return arguments of an action by the present names of its parameters."""
    renamed: Mapping[str, str] = getattr(method, "__renamed__", NOTHING_RENAMED)
    return {renamed.get(name, name): value for name, value in given.items()}


def deadline_of(method: object) -> float | None:
    """Return the time limit of a call of `method`, s; None: no limit."""
    otherwise = DEFAULT_DEADLINE if metadata_of(method) is None else OLDER_DEADLINE
    found: float | None = getattr(method, "__deadline__", otherwise)
    return found
