"""Outcomes: what became of each case on each bench, and the level that follows; a claim is checked, not believed."""

import enum
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final

from arcor2_hw.testing.quality import Level

LEVEL_CASE: Final = "level"
"""The case that judges the others."""
RECOVERY: Final = frozenset({"silence_in_a_call", "observation_comes_back", "reset_and_back", "half_a_frame"})
"""The cases that silver cannot do without, whatever reason is given."""
PROPERTY: Final = "arcor2_case"
"""The property of a pytest report that says of which bench and case it is."""


class Kind(enum.StrEnum):
    """What became of a case. NOT_RUN: with a reason in quality.yaml. LACKING: without a hook, which bronze allows."""

    PASSED = "passed"
    FAILED = "failed"
    NOT_RUN = "not run"
    LACKING = "lacking"


@dataclass
class Ran:
    """What ran on one bench: outcomes and reasons by case."""

    type_name: str
    real: bool = False
    address: str = ""
    identity: Mapping[str, str] = field(default_factory=dict)
    outcomes: dict[str, tuple[Kind, str]] = field(default_factory=dict)
    claimed: Level = Level.NONE
    reached: Level | None = None
    missing: Sequence[str] = ()

    def count(self, kind: Kind) -> int:
        """Count the cases that ended so."""
        return sum(each is kind for each, _ in self.outcomes.values())


class Outcomes(dict[str, Ran]):
    """All that ran, by the name of the bench."""

    def add(self, properties: Sequence[tuple[str, Any]], passed: bool, failed: bool, when: str, text: str) -> None:
        """Note a report of pytest; one that is not of the suite is left alone."""
        told: dict[str, Any] = next((value for key, value in reversed(properties) if key == PROPERTY), {})
        if not told:
            return
        ran = self.setdefault(told["bench"], Ran(told["type"], told["real"]))
        ran.address = told.get("address", ran.address)
        ran.identity = told.get("identity", ran.identity)
        case = told["case"]
        if case == LEVEL_CASE:
            if "reached" in told:
                ran.claimed, ran.reached = Level(told["claimed"]), Level(told["reached"])
                ran.missing = told["missing"]
        elif failed:
            ran.outcomes[case] = Kind.FAILED, text
        elif passed and when == "call":
            ran.outcomes[case] = Kind.PASSED, ""
        elif not passed and "kind" in told:
            ran.outcomes[case] = Kind(told["kind"]), told["reason"]


@dataclass(frozen=True)
class Verdict:
    """The level of one bench. not_judged: why it could not be told. missing: what the next level asks for."""

    claimed: Level = Level.NONE
    reached: Level = Level.NONE
    missing: Sequence[str] = ()
    not_judged: str = ""


def judge(
    outcomes: Mapping[str, tuple[Kind, str]], tests_missing: Sequence[str], report_missing: Sequence[str]
) -> tuple[Level, list[str]]:
    """Give the level that is reached, and what the next one lacks. outcomes: of all cases of the suite."""
    if lacks := [f"{case} failed" for case, (kind, _) in sorted(outcomes.items()) if kind is Kind.FAILED]:
        return Level.NONE, lacks
    lacks = [f"{case}: {why}" for case, (kind, why) in sorted(outcomes.items()) if kind is Kind.LACKING]
    lacks += [
        f"{case} is not run, and silver cannot do without"
        for case in sorted(RECOVERY)
        if outcomes[case][0] is Kind.NOT_RUN
    ]
    if lacks := [*lacks, *tests_missing]:
        return Level.BRONZE, lacks
    if report_missing:
        return Level.SILVER, list(report_missing)
    return Level.GOLD, []
