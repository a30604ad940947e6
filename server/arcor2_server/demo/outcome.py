"""The outcome of a run according to the script, the simulated world and the planning service."""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any


@dataclass
class Outcome:
    """Readings taken apart: what the script found, and what is wrong in the end."""

    boards: int = 0
    passed: int = 0
    failed: int = 0
    seconds: float = 0.0
    finished: bool = False
    wrong: list[str] = field(default_factory=list)

    @property
    def right(self) -> bool:
        """Return whether the program ended as meant with every board where it belongs, labelled and reported."""
        return self.finished and not self.wrong

    def summary(self) -> str:
        """Return the line that ends the cycle."""
        return f"cycle complete: {self.boards} boards, {self.passed} passed, {self.failed} failed, {self.seconds:.1f} s"


def wrong_boards(world: Mapping[str, Any]) -> list[str]:
    """Return a sentence for each board that is not where it belongs, or bears not what it should."""
    found = []
    for board in world["boards"]:
        code, good, label = board["code"], not board["defect"], board["label"]
        wanted = "good" if good else "bad"
        if board["place"] != wanted:
            found.append(f"board {code} lies in {board['place']}, not in {wanted}")
        if good and label is None:
            found.append(f"board {code} has no label")
        elif good and label["code"] != code:
            found.append(f"board {code} has the label of {label['code']}")
        elif good and not label["pressed"]:
            found.append(f"the label of board {code} is not pressed on")
        elif not good and label is not None:
            found.append(f"board {code} failed and has a label")
    found += [f"a label of {code} came down on no board" for code in world["spilled_labels"]]
    return found


def wrong_results(world: Mapping[str, Any], erp: Mapping[str, Any]) -> list[str]:
    """Return a sentence for each board that the planning service was not told of exactly once and rightly."""
    told = Counter((result["serial"], result["passed"]) for result in erp["results"])
    found = []
    for board in world["boards"]:
        code, good = board["code"], not board["defect"]
        times, otherwise = told.pop((code, good), 0), told.pop((code, not good), 0)
        if times != 1 or otherwise:
            found.append(f"board {code} was reported {times} times rightly and {otherwise} times wrongly")
    found += [f"{serial} was reported, which is no board" for serial, _ in told]
    return found
