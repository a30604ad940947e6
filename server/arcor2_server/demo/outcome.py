"""Checks the outcome of a demo run against the simulated world and the planning service."""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any


@dataclass
class Outcome:
    """The outcome of a run: what the program reported, and the errors found afterwards."""

    boards: int = 0
    passed: int = 0
    failed: int = 0
    seconds: float = 0.0
    finished: bool = False
    errors: list[str] = field(default_factory=list)

    @property
    def successful(self) -> bool:
        """Whether the program finished, and all boards are in the right box, labelled and reported."""
        return self.finished and not self.errors

    def summary(self) -> str:
        """Return a summary in one line."""
        return f"cycle complete: {self.boards} boards, {self.passed} passed, {self.failed} failed, {self.seconds:.1f} s"


def board_errors(world: Mapping[str, Any]) -> list[str]:
    """Return a message for each board in the wrong box or with a wrong label."""
    errors = []
    for board in world["boards"]:
        code, good, label = board["code"], not board["defect"], board["label"]
        box = "good" if good else "bad"
        if board["place"] != box:
            errors.append(f"board {code} is in {board['place']}, not in {box}")
        if good and label is None:
            errors.append(f"board {code} has no label")
        elif good and label["code"] != code:
            errors.append(f"board {code} has the label of {label['code']}")
        elif good and not label["pressed"]:
            errors.append(f"the label of board {code} is not pressed on")
        elif not good and label is not None:
            errors.append(f"board {code} failed and has a label")
    errors += [f"a label of {code} is not on any board" for code in world["spilled_labels"]]
    return errors


def report_errors(world: Mapping[str, Any], erp: Mapping[str, Any]) -> list[str]:
    """Return a message for each board that was not reported to the planning service once with the right result."""
    reports = Counter((result["serial"], result["passed"]) for result in erp["results"])
    errors = []
    for board in world["boards"]:
        code, good = board["code"], not board["defect"]
        right, wrong = reports.pop((code, good), 0), reports.pop((code, not good), 0)
        if right != 1 or wrong:
            errors.append(f"board {code} was reported {right} times correctly and {wrong} times wrongly")
    errors += [f"board {serial} was reported, but does not exist" for serial, _ in reports]
    return errors
