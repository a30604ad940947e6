"""Declared and implemented capabilities of a type, and methods that can be tried without arguments."""

import inspect
from functools import lru_cache
from typing import Any, Final

from arcor2_hw.actions import deadline_of, metadata_of
from arcor2_hw.actions.decorator import is_quick
from arcor2_hw.analysis import Library
from arcor2_hw.exceptions import Arcor2NotImplemented
from arcor2_hw.objects import Axis, Generic
from arcor2_hw.runtime.methods import NO_STOP
from arcor2_hw.testing import declarations

OURS: Final = "arcor2_hw.objects"
STOPPABLE_FROM: Final = 1.0
"""Duration above which an action has to be stoppable, s."""
READS: Final = frozenset(
    {
        *(
            "alarms",
            "counters",
            "identify",
            "machine_state",
            "parameters_dump",
            "permissives",
            "points",
            "state",
            "status",
            "stop_reason",
        ),
        *("unit_mode", "vacuum", "wrench", "joint_limits", "max_tcp_speed", "is_referenced", "kinematic_calibration"),
        *("get_arm_ids", "get_end_effectors_ids", "get_hand_teaching_mode"),
    }
)
"""Methods of the bases that only read, without arguments or control, so that they can be tried on any device."""


@lru_cache(maxsize=64)
def declared(kind: type[Generic]) -> frozenset[str]:
    """Return the optional methods that a type has according to the analysis."""
    return Library([declarations.source_of(kind)]).analyse(kind.__name__).implemented


def hooks(kind: type[Generic]) -> dict[str, Any]:
    """Return the optional methods of our bases that the bases do not implement."""
    found: dict[str, Any] = {}
    for base in kind.__mro__:
        if not base.__module__.startswith(OURS):
            continue
        for name, member in vars(base).items():
            if not name.startswith("_") and inspect.isfunction(member) and _raises_only(member):
                found.setdefault(name, member)
    return found


def _raises_only(function: Any) -> bool:
    try:
        function(*[None] * _required(function))
    except Arcor2NotImplemented:
        return True
    except Exception:  # noqa: BLE001 - it uses its arguments, so it is not only a hook
        return False
    return False


def _required(function: Any) -> int:
    parameters = inspect.signature(function).parameters.values()
    return sum(p.default is p.empty and p.kind in (p.POSITIONAL_ONLY, p.POSITIONAL_OR_KEYWORD) for p in parameters)


@lru_cache(maxsize=64)
def to_be_shown(kind: type[Generic]) -> frozenset[str]:
    """Return the declared optional methods that act, so that the bench has to show that they work."""
    said = declared(kind)
    return (said & set(hooks(kind))) - set(readable(kind, said)) - {"parameters_restore"}  # MaintenanceCases test them


@lru_cache(maxsize=64)
def returning(kind: type[Generic]) -> frozenset[str]:
    """Return the actions of a type, except those of our bases, that return a value."""
    found = Library([declarations.source_of(kind)]).analyse(kind.__name__)
    return frozenset(each.name for each in declarations.own_actions(found) if each.returns)


def contradictions(device: Generic, said: frozenset[str]) -> list[str]:
    """Return a sentence for each difference between the analysis and a disconnected object."""
    kind = type(device)
    wrong = []
    for name, hook in hooks(kind).items():
        here = inspect.getattr_static(device, name, None)
        own = here is not None and here is not hook and (name in said or not _is_base_member(kind, name, here))
        if name in said and not own:
            wrong.append(f"{name} is declared, but does not exist")
        elif name not in said and own and not _raises_not_implemented(device, name):
            wrong.append(f"{name} exists, but the analysis does not find it")
        elif name not in said and not own and not _raises_not_implemented(device, name):
            wrong.append(f"{name} is not declared, but does not raise Arcor2NotImplemented")
    return wrong


def _is_base_member(kind: type, name: str, member: object) -> bool:
    return any(vars(base).get(name) is member for base in kind.__mro__ if base.__module__.startswith(OURS))


def _raises_not_implemented(device: Generic, name: str) -> bool:
    """Return whether an optional method raises Arcor2NotImplemented on a disconnected object."""
    method = getattr(device, name)
    try:
        method(*[None] * _required(method))
    except Arcor2NotImplemented:
        return True
    except Exception:  # noqa: BLE001 - any other error
        return False
    return False


def readable(kind: type[Generic], said: frozenset[str]) -> list[str]:
    """Return the methods of a type that can be tried on a connected device."""
    mandatory = {name for base in kind.__mro__ for name in getattr(base, "__abstractmethods__", ())}
    return sorted(
        name
        for name in READS & (said | mandatory)
        if callable(getattr(kind, name, None)) and not _required_beyond_self(getattr(kind, name))
    )


def _required_beyond_self(function: Any) -> bool:
    return _required(function) > 1


def unstoppable(kind: type[Generic]) -> list[str]:
    """Return the actions of a type that may last longer than STOPPABLE_FROM and cannot be stopped.

    An action is stopped by `stop()` of its type (`halt()` of an axis), or by the method in CANCEL_MAPPING.
    """
    stop = getattr(kind, "stop", None)
    if issubclass(kind, Axis) or (callable(stop) and stop not in NO_STOP):
        return []
    found = []
    for name in dir(kind):
        member = getattr(kind, name, None)
        if metadata_of(member) is None or getattr(member, "__module__", "").startswith(OURS) or is_quick(member):
            continue
        deadline = deadline_of(member)
        if deadline is not None and deadline <= STOPPABLE_FROM:
            continue
        if not callable(getattr(kind, kind.CANCEL_MAPPING.get(name, ""), None)):
            found.append(name)
    return found


def unhinted(kind: type[Generic]) -> list[str]:
    """Return the public methods and properties of a type and its bases, except ours, without a type hint."""
    lacking = []
    for base in kind.__mro__:
        if base.__module__.startswith("arcor2_hw.") or base.__module__ in ("builtins", "abc", "typing"):
            continue
        for name, member in vars(base).items():
            plain = _function(member)
            if plain is None or (name.startswith("_") and name != "__init__"):
                continue
            hints = plain.__annotations__
            parameters = list(inspect.signature(plain).parameters)[0 if isinstance(member, staticmethod) else 1 :]
            missing = [each for each in parameters if each not in hints]
            missing += [] if "return" in hints or name == "__init__" else ["its result"]
            lacking += [f"{base.__name__}.{name}: {each}" for each in missing]
    return sorted(set(lacking))


def _function(member: Any) -> Any:
    if isinstance(member, property):
        member = member.fget
    if isinstance(member, staticmethod | classmethod):
        member = member.__func__
    member = inspect.unwrap(member) if callable(member) else member
    return member if inspect.isfunction(member) else None
