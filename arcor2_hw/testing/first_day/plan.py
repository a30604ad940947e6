"""The groups of cases of the first day, in a safe order."""

from collections.abc import Callable
from typing import Final, NamedTuple

from arcor2_hw.data.base import Unset
from arcor2_hw.objects import Generic
from arcor2_hw.testing import capabilities
from arcor2_hw.testing.acting_cases import ActingCases
from arcor2_hw.testing.connecting_cases import ConnectingCases
from arcor2_hw.testing.loss_cases import LossCases
from arcor2_hw.testing.maintenance_cases import MaintenanceCases
from arcor2_hw.testing.written_cases import WrittenCases


class Suite(ActingCases, LossCases, MaintenanceCases, ConnectingCases, WrittenCases):
    """The cases of the conformance suite, without pytest."""


class Group(NamedTuple):
    """Cases of one risk. `title` and `text` are shown before the person confirms them."""

    title: str
    text: str
    cases: tuple[str, ...]


GROUPS: Final = (
    Group(
        "Reading",
        "The driver connects, reads and disconnects. It takes no control, and nothing acts on the device.",
        (
            *("described", "translations_match", "alarms_declared", "types_complete", "long_actions_can_be_stopped"),
            *("capabilities_declared", "constructor_opens_nothing", "connect_is_idempotent"),
            *("disconnect_is_idempotent", "connecting_observes", "readings_can_be_read", "absent_device"),
            *("units_and_frames", "points_declared", "identity", "parameters"),
        ),
    ),
    Group(
        "Refusing",
        "The driver takes control, and has to refuse commands. Nothing should move; a faulty driver might.",
        ("nothing_is_left_behind", "control_is_refused", "limits_are_refused"),
    ),
    Group(
        "Small motion",
        "The device acts for the first time.",
        ("command_needs_control", "results_are_current", "capabilities_work"),
    ),
    Group(
        "Full motion",
        "The device moves for several seconds, and is stopped several times.",
        (
            *("stop_passes", "one_act_at_a_time", "cancelling_leaves_the_line_usable", "stop_at_random_phases"),
            "disconnecting_ends_an_act",
        ),
    ),
    Group(
        "Connection loss",
        "The connection is interrupted, first at standstill, then during a motion.",
        (
            *("connecting_to_a_silent_device", "stale_is_an_error", "observation_comes_back", "reset_and_back"),
            *("silence_in_a_call", "half_a_frame", "control_does_not_come_back", "nothing_resumes", "loss_reaction"),
        ),
    ),
)
ALL: Final = tuple(case for group in GROUPS for case in group.cases)
"""All cases in the order of the groups."""
_ACTING: Final = {"command": "small", "run_long": "full", "orphan": "full"}
"""Hooks that act, with the motion of the declaration that they execute."""
_OWN: Final = frozenset({"works", "results"})
"""Hooks of a bench of one's own that act."""


def case(name: str) -> Callable[..., None]:
    """Return a case by its name."""
    found: Callable[..., None] = getattr(Suite(), f"test_{name}")
    return found


def summary(name: str) -> str:
    """Return the first line of the description of a case."""
    return (case(name).__doc__ or name).strip().splitlines()[0]


def acts(name: str, kind: type[Generic], ask: str | Unset) -> list[str]:
    """Return the motions that a case executes: `small`, `full`, or a hook of the bench.

    Args:
        name: Name of the case.
        kind: The object type.
        ask: The `ask` of the declaration.
    """
    needed = getattr(case(name), "needs", ())
    found = {_ACTING[hook] for hook in needed if hook in _ACTING} | (_OWN & set(needed))
    if ask == "small" and ("ask" in needed or name == "cancelling_leaves_the_line_usable"):
        found.add("small")
    if not capabilities.to_be_shown(kind):
        found.discard("works")
    return sorted(found, reverse=True)
