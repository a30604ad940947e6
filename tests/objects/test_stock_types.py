"""The stock object types: flow, time, logic, counters, random numbers."""

import importlib
import inspect
import itertools
import threading
import time
from importlib.metadata import entry_points

import pytest

from arcor2_hw.actions import deadline_of, metadata_of
from arcor2_hw.exceptions import Cancelled, InvalidData, NotFound, ProgramFinished
from arcor2_hw.objects import Generic
from arcor2_hw.objects.stock.counter_actions import CounterActions, CounterSettings
from arcor2_hw.objects.stock.flow_actions import FlowActions
from arcor2_hw.objects.stock.logic_actions import LogicActions
from arcor2_hw.objects.stock.random_actions import RandomActions, RandomSettings
from arcor2_hw.objects.stock.time_actions import TimeActions
from tests.waiting import WITHIN

STOCK = [CounterActions, FlowActions, LogicActions, RandomActions, TimeActions]


@pytest.mark.parametrize("cls", STOCK)
def test_every_stock_type_is_installed_and_can_be_added(cls: type[Generic]) -> None:
    (found,) = [e for e in entry_points(group="arcor2_hw.object_types") if e.name == cls.__name__]
    assert found.value == f"{cls.__module__}:{cls.__name__}"
    assert getattr(importlib.import_module(cls.__module__), cls.__name__) is cls
    assert not cls.abstract()
    actions = [method for _, method in inspect.getmembers(cls, inspect.isfunction) if metadata_of(method)]
    assert actions
    assert all(inspect.getdoc(method) for method in actions)
    assert set(cls.CANCEL_MAPPING) <= {method.__name__ for method in actions}


def test_an_except_clause_does_not_catch_finish() -> None:
    def script() -> None:
        try:
            FlowActions("obj", "flow").finish(an="end")
        except Exception:
            pytest.fail("an except clause has caught the end of the program")

    with pytest.raises(ProgramFinished):
        script()


@pytest.mark.parametrize(("obj", "method"), [(FlowActions("o", "flow"), "wait"), (TimeActions("o", "time"), "sleep")])
def test_a_wait_ends_in_time_or_when_cancelled(obj: FlowActions | TimeActions, method: str) -> None:
    wait = getattr(obj, method)
    assert deadline_of(wait) is None
    start = time.monotonic()
    wait(0.02, an="a")
    assert time.monotonic() - start >= 0.02

    errors: list[BaseException] = []

    def run() -> None:
        try:
            wait(3600.0, an="a")
        except Cancelled as error:
            errors.append(error)

    thread = threading.Thread(target=run)
    thread.start()
    deadline = time.monotonic() + WITHIN
    while thread.is_alive() and time.monotonic() < deadline:  # a cancel before the wait has no effect
        getattr(obj, type(obj).CANCEL_MAPPING[method])()
        thread.join(0.001)
    assert not thread.is_alive()
    assert len(errors) == 1
    wait(0.0, an="a")  # the cancelled wait has no later effect
    with pytest.raises(AssertionError):
        wait(-1.0, an="a")


def test_repeat_counts_separately_for_each_action() -> None:
    flow = FlowActions("obj", "flow")
    outer = [flow.repeat(2, an="outer") for _ in range(7)]
    assert outer == [True, True, False, True, True, False, True]
    assert [flow.repeat(1, an="inner") for _ in range(3)] == [True, False, True]
    assert flow.repeat(2, an="outer") is True
    assert flow.repeat(0, an="never") is False


def test_a_message_is_logged(caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level("INFO"):
        FlowActions("obj", "flow").show_message("Refill 100 % of {labels}", an="refill")
    assert caplog.messages == ["flow: message: Refill 100 % of {labels}"]


def test_counters_count_compare_and_reset() -> None:
    counter = CounterActions("obj", "boards", CounterSettings(start=3))
    assert counter.value(an="a") == 3
    assert counter.increment(2, an="a") == 5
    assert (counter.below(6, an="a"), counter.below(5, an="a")) == (True, False)
    assert (counter.reached(6, an="a"), counter.reached(5, an="a")) == (False, True)
    assert counter.decrement(an="a") == 4
    counter.set_value(-2, an="a")
    assert counter.value(an="a") == -2
    counter.reset(an="a")
    assert counter.value(an="a") == 3
    assert CounterActions("obj", "other").value(an="a") == 0


def test_logic_actions_compare_and_combine_values() -> None:
    logic = LogicActions("obj", "logic")
    assert logic.equals(0.1 + 0.2, 0.3, an="a")
    assert not logic.equals(1.0, 1.1, an="a")
    assert logic.equals(1.0, 1.1, 0.2, an="a")
    for a, b in itertools.product((1, 2), repeat=2):
        assert logic.greater_than(float(a), float(b)) is logic.integer_greater_than(a, b) is (a > b)
        assert logic.less_than(float(a), float(b)) is logic.integer_less_than(a, b) is (a < b)
        assert logic.integer_equals(a, b) is (a == b)
    assert [logic.within(x, 1.0, 2.0) for x in (0.9, 1.0, 2.0, 2.1)] == [False, True, True, False]
    assert [logic.integer_within(x, 1, 2) for x in (0, 1, 2, 3)] == [False, True, True, False]
    assert (logic.integer(3), logic.number(0.5), logic.text("a"), logic.boolean(True)) == (3, 0.5, "a", True)
    assert (logic.add_integers(3), logic.add_integers(3, -5), logic.add_numbers(0.5, 1.0)) == (4, -2, 1.5)
    assert logic.string_equals("a", "a")
    assert not logic.string_equals("a", "A")
    assert logic.string_contains("board 7", "7")
    for a, b in itertools.product((False, True), repeat=2):
        assert logic.logical_and(a, b) is (a and b)
        assert logic.logical_or(a, b) is (a or b)
        assert logic.logical_xor(a, b) is (a != b)
    assert logic.logical_not(False)


def test_random_numbers_keep_their_range_and_seed() -> None:
    def draw(seed: int) -> list[int]:
        chance = RandomActions("obj", "chance", RandomSettings(seed))
        return [chance.random_integer(1, 6) for _ in range(50)]

    assert draw(7) == draw(7) != draw(8)
    assert set(draw(7)) <= set(range(1, 7))
    assert draw(0) != draw(0)
    chance = RandomActions("obj", "chance")
    assert all(2.0 <= chance.random_double(2.0, 3.0) <= 3.0 for _ in range(50))
    assert {chance.random_bool(1.0) for _ in range(50)} == {True}
    assert {chance.random_bool(0.0) for _ in range(50)} == {False}
    with pytest.raises(InvalidData, match="chance"):
        chance.random_integer(2, 1)
    with pytest.raises(InvalidData):
        chance.random_double(2.0, 1.0)


def test_time_actions_return_the_time_and_elapsed_time() -> None:
    timer = TimeActions("obj", "time")
    before = time.time_ns()
    assert before <= timer.time_ns(an="a") <= time.time_ns()
    timer.start_stopwatch("lap", an="a")
    time.sleep(0.01)
    first = timer.elapsed("lap", an="a")
    assert 0.01 <= first <= timer.elapsed("lap", an="a")
    with pytest.raises(NotFound, match="other"):
        timer.elapsed("other", an="a")
