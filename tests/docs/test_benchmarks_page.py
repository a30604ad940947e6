"""Tests of docs/benchmarks.md: it lists exactly the metrics and groups of the benchmarks, with their goals."""

import re
from pathlib import Path

import pytest

from benchmarks.__main__ import GROUPS
from benchmarks.metrics import GOALS

PAGE = (Path(__file__).parents[2] / "docs" / "benchmarks.md").read_text()
ROWS = dict(re.findall(r"^\| `(\w+)` \| .*? \| ([^|]*) \| [^|]* \|$", PAGE, re.MULTILINE))


def test_the_page_lists_exactly_the_metrics() -> None:
    assert set(ROWS) == set(GOALS)


@pytest.mark.parametrize("name", GOALS)
def test_the_page_shows_the_goal(name: str) -> None:
    goal = GOALS[name][1].replace("<=", "≤").replace(">=", "≥")
    relation, _, number = goal.partition(" ")
    if not number:
        assert ROWS[name].startswith(goal)
        return
    shown_relation, shown_number, *_ = ROWS[name].split()
    assert (shown_relation, float(shown_number)) == (relation, float(number))


def test_the_page_lists_exactly_the_groups() -> None:
    assert set(re.findall(r"^## Group `(\w+)`", PAGE, re.MULTILINE)) == set(GROUPS)
