"""The page of the figures names each figure that there is, with its goal, and no other; and each room."""

import re
from pathlib import Path

import pytest

from benchmarks.__main__ import GROUPS
from benchmarks.metrics import GOALS

PAGE = (Path(__file__).parents[2] / "docs" / "benchmarks.md").read_text()
ROWS = dict(re.findall(r"^\| `(\w+)` \| .*? \| ([^|]*) \| [^|]* \|$", PAGE, re.MULTILINE))


def test_the_page_has_every_figure_and_no_other() -> None:
    assert set(ROWS) == set(GOALS)


@pytest.mark.parametrize("name", GOALS)
def test_the_page_has_the_goal(name: str) -> None:
    goal = GOALS[name][1].replace("<=", "≤").replace(">=", "≥")
    relation, _, number = goal.partition(" ")
    if not number:
        assert ROWS[name].startswith(goal)
        return
    said, what, *_ = ROWS[name].split()
    assert (said, float(what)) == (relation, float(number))


def test_the_page_has_every_room() -> None:
    assert set(re.findall(r"^## Group `(\w+)`", PAGE, re.MULTILINE)) == set(GROUPS)
