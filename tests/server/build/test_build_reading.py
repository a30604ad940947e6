"""A script goes back into the project that it was made from; edited by hand, into the project that it says."""

import random
from typing import Any

from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from msgspec.structs import replace

from arcor2_server.build.reading import from_script
from arcor2_server.build.script import from_logic
from tests.server.build.projects import SCENE, TYPES, random_draft, walk


def _oracle(seed: int) -> Any:
    def results(name: str, number: int) -> tuple[bool, ...]:
        rng = random.Random(f"{seed} {name} {number}")
        return rng.random() < 0.5, rng.random() < 0.5

    return results


@settings(max_examples=300, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(
    st.integers(0, 2**32),
    st.integers(1, 30),
    st.sampled_from([0.0, 0.2, 0.5, 0.9]),
    st.sampled_from([0.0, 0.1, 0.3]),
    st.sampled_from([1, 2, 3, 20]),
)
def test_there_and_back(seed: int, size: int, joining: float, ending: float, window: int) -> None:
    project = random_draft(random.Random(seed), size, joining, ending, window).project()
    source = from_logic(SCENE, project, TYPES)
    back = from_script(source, SCENE, project, TYPES)
    steps = [(item.start, item.end) for item in project.logic]
    if len(steps) == len(set(steps)):
        assert back == project, source
    # Two steps from one action to the same one, which no editor makes, may become one.
    assert back.action_points == project.action_points
    [point] = project.action_points
    fresh = from_script(source, SCENE, replace(project, action_points=[replace(point, actions=[])], logic=[]), TYPES)
    for draw in range(3):
        expected = walk(project, _oracle(seed + draw), 3 * size)
        assert walk(back, _oracle(seed + draw), 3 * size) == expected, source
        assert walk(fresh, _oracle(seed + draw), 3 * size) == expected, source
