"""Results of each case on each bench, and the resulting level."""

import enum
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final

from arcor2_hw.testing.quality import Level

LEVEL_CASE: Final = "level"
"""The case that judges the others."""
RECOVERY: Final = frozenset({"silence_in_a_call", "observation_comes_back", "reset_and_back", "half_a_frame"})
"""Cases required for silver, even if quality.yaml gives a reason."""
PROPERTY: Final = "arcor2_case"
"""Property of a pytest report that names bench and case."""


class Kind(enum.StrEnum):
    """Result of a case. NOT_RUN: with a reason in quality.yaml. LACKING: without a hook, which bronze allows."""

    PASSED = "passed"
    FAILED = "failed"
    NOT_RUN = "not run"
    LACKING = "lacking"


@dataclass
class Ran:
    """Results of one bench: results and reasons by case, durations by case, s. `folder`: that of the driver."""

    type_name: str
    real: bool = False
    address: str = ""
    identity: Mapping[str, str] = field(default_factory=dict)
    folder: str = ""
    outcomes: dict[str, tuple[Kind, str]] = field(default_factory=dict)
    seconds: dict[str, float] = field(default_factory=dict)
    claimed: Level = Level.NONE
    reached: Level | None = None
    missing: Sequence[str] = ()

    def count(self, kind: Kind) -> int:
        """Return the number of cases with that result."""
        return sum(each is kind for each, _ in self.outcomes.values())


class Outcomes(dict[str, Ran]):
    """All results, by the name of the bench."""

    def add(
        self,
        properties: Sequence[tuple[str, Any]],
        passed: bool,
        failed: bool,
        when: str,
        text: str,
        seconds: float = 0.0,
    ) -> None:
        """Add a report of pytest; reports of other tests are ignored."""
        values: dict[str, Any] = next((value for key, value in reversed(properties) if key == PROPERTY), {})
        if not values:
            return
        ran = self.setdefault(values["bench"], Ran(values["type"], values["real"]))
        ran.address = values.get("address", ran.address)
        ran.identity = values.get("identity", ran.identity)
        ran.folder = values.get("folder", ran.folder)
        case = values["case"]
        if when == "call":
            ran.seconds[case] = seconds
        if case == LEVEL_CASE:
            if "reached" in values:
                ran.claimed, ran.reached = Level(values["claimed"]), Level(values["reached"])
                ran.missing = values["missing"]
        elif failed:
            ran.outcomes[case] = Kind.FAILED, text
        elif passed and when == "call":
            ran.outcomes[case] = Kind.PASSED, ""
        elif not passed and "kind" in values:
            ran.outcomes[case] = Kind(values["kind"]), values["reason"]


@dataclass(frozen=True)
class Verdict:
    """The level of one bench.

    Attributes:
        not_judged: Reason why the level could not be determined.
        missing: Requirements for the next level.
    """

    claimed: Level = Level.NONE
    reached: Level = Level.NONE
    missing: Sequence[str] = ()
    not_judged: str = ""


def judge(
    outcomes: Mapping[str, tuple[Kind, str]], tests_missing: Sequence[str], report_missing: Sequence[str]
) -> tuple[Level, list[str]]:
    """Return the level that all cases of the suite show, and the requirements for the next level."""
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
