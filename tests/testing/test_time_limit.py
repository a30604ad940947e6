"""A driver that does not return fails its case by name, and the suite continues or ends."""

import threading
from pathlib import Path

import pytest

from arcor2_hw.testing.time_limit import CallHangs, within
from tests.testing.toy_suite import failed, run

HANGING_METHOD = """
import threading
from concurrent.futures import ThreadPoolExecutor
from broken.toy_press import ToyBench, ToyPress

ToyBench.case_within = 2.0


def never(self, timeout):
    return ThreadPoolExecutor().submit(threading.Event().wait).result()


{type}.{method} = never
"""


def test_results_and_errors_of_a_call_that_returns_are_passed_on() -> None:
    assert within(5.0, lambda: threading.current_thread().name, "a call") == "a call"
    with pytest.raises(ZeroDivisionError):
        within(5.0, lambda: 1 / 0, "a call")
    with pytest.raises(pytest.skip.Exception):
        within(5.0, lambda: pytest.skip("not here"), "a call")


def test_a_call_that_hangs_is_named_with_its_stack() -> None:
    ended = threading.Event()

    def waits() -> None:
        ended.wait()

    with pytest.raises(CallHangs, match=r"a call has not ended within 0.1 s: .*waits\(\) \(test_time_limit.py") as hang:
        within(0.1, waits, "a call")
    assert "ended.wait()" in hang.value.stack
    assert hang.value.thread.daemon
    ended.set()
    hang.value.thread.join(30.0)


def test_a_case_that_hangs_fails_by_name_and_the_next_one_runs(tmp_path: Path) -> None:
    blocks = "connecting_to_a_silent_device__blocks"
    output = run(
        tmp_path, "-rfE", selected="TestBroken and (test_connecting_to_a_silent_device or observation)", cases=[blocks]
    )
    assert f"{blocks}: the case connecting_to_a_silent_device has not ended within 6 s: BrokenPress.connect()" in output
    assert "threading.Event().wait(0.05)" in output
    assert "1 failed, 1 passed" in output


def test_while_a_call_hangs_the_other_cases_of_its_device_fail_and_those_of_others_run(tmp_path: Path) -> None:
    conftest = HANGING_METHOD.format(type="ToyPress", method="_nobody")
    selected = "not TestReactions and (connecting_to_a_silent_device or silence_in_a_call)"
    output = run(tmp_path, "-rA", selected=selected, conftest=conftest, cases=["stop_passes"])
    assert "ToyPress: the case connecting_to_a_silent_device has not ended within 2 s: ToyPress.connect()" in output
    assert "stop_passes: the case connecting_to_a_silent_device has not ended within 2 s: BrokenPress.conn" in output
    assert "was not run, because of a call that hangs: the case connecting_to_a_silent_device has not" in output


def test_a_disconnect_that_hangs_is_named(tmp_path: Path) -> None:
    hangs = HANGING_METHOD.format(type="ToyPress", method="_end").replace("never(self, timeout)", "never(self, thread)")
    output = run(tmp_path, selected="TestToy and readings_can_be_read", conftest=hangs)
    assert "1 error in" in output
    assert "ToyPress: disconnecting after the case readings_can_be_read has not ended within 10 s: Toy" in output
    assert "ToyPress.disconnect()" in output


def test_a_bench_that_does_not_start_fails_its_cases(tmp_path: Path) -> None:
    hangs = HANGING_METHOD.format(type="ToyBench", method="start").replace("never(self, timeout)", "never(self)")
    output = run(tmp_path, selected="TestToy and (readings_can_be_read or described)", conftest=hangs)
    assert failed(output) == ["described", "readings_can_be_read"]
    assert "ToyPress: the start of the bench has not ended within 2 s" in output
