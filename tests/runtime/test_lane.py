"""Lanes: order, deadlines, late results and stops. Each call ends exactly once, also in a race."""

import random
import threading
import time
from collections.abc import Iterator

import pytest

from arcor2_hw.exceptions import Cancelled, DeviceFault, DeviceTimeout
from arcor2_hw.runtime.lane import Job, Lane, on_any_lane
from arcor2_hw.testing.own_time import own_time


@pytest.fixture
def lane() -> Iterator[Lane]:
    lane = Lane("arm")
    yield lane
    lane.close()
    assert lane.join(5)


def test_calls_run_in_order_on_one_thread(lane: Lane) -> None:
    threads = set()

    def number(n: int) -> int:
        threads.add(threading.get_ident())
        assert on_any_lane()
        return lane.call("inner", lambda: n)  # on the lane itself a call does not wait for the lane

    jobs = [Job("number", number, (n,)) for n in range(100)]
    for job in jobs:
        lane.submit(job)
    assert [job.wait(5) and job.outcome() for job in jobs] == list(range(100))
    assert len(threads) == 1
    assert not on_any_lane()


def test_the_caller_receives_errors(lane: Lane) -> None:
    def fail(error: BaseException) -> None:
        raise error

    for error in (DeviceFault("broken"), ValueError("odd"), SystemExit(3), KeyboardInterrupt()):
        with pytest.raises(type(error)):
            lane.call("fail", fail, (error,))
    assert lane.call("after", lambda: 1) == 1


def test_a_late_result_is_dropped_and_the_lane_is_usable_again(lane: Lane) -> None:
    gate = threading.Event()
    with pytest.raises(DeviceTimeout, match=r"arm: slow did not finish within 0\.05 s"):
        lane.call("slow", lambda: gate.wait(5), deadline=0.05)
    assert lane.hung
    began = own_time()
    with pytest.raises(DeviceTimeout, match="still busy with slow"):
        lane.call("next", lambda: 1, deadline=5.0)
    assert own_time() - began < 1.0
    gate.set()
    deadline = time.monotonic() + 5
    while lane.hung and time.monotonic() < deadline:
        time.sleep(0.001)
    assert lane.call("next", lambda: 2, deadline=5.0) == 2


def test_a_queued_call_that_expired_never_runs(lane: Lane) -> None:
    gate = threading.Event()
    ran: list[int] = []
    first = Job("first", lambda: gate.wait(5))
    lane.submit(first)
    with pytest.raises(DeviceTimeout, match="busy with first"):
        lane.call("second", lambda: ran.append(1), deadline=0.05)
    gate.set()
    assert lane.call("third", lambda: 3) == 3
    assert ran == []


def test_a_stop_cancels_queued_and_running_calls(lane: Lane) -> None:
    gate, begun = threading.Event(), threading.Event()
    ran: list[int] = []

    def move() -> str:
        begun.set()
        gate.wait(5)
        return "arrived"

    moving, waiting = Job("move", move), Job("wait", lambda: ran.append(1))
    for job in (moving, waiting):
        lane.submit(job)
    assert begun.wait(5)
    assert lane.interrupt() is moving
    assert waiting.wait(1)
    gate.set()
    assert moving.wait(5)
    for job in (moving, waiting):
        assert isinstance(job.error, Cancelled)
    assert ran == []
    assert lane.call("next", lambda: 1) == 1


def test_a_stopped_call_keeps_the_error_of_the_device(lane: Lane) -> None:
    begun, gate = threading.Event(), threading.Event()

    def move() -> None:
        begun.set()
        gate.wait(5)
        raise DeviceFault("drive 3")

    job = Job("move", move)
    lane.submit(job)
    begun.wait(5)
    lane.interrupt()
    gate.set()
    assert job.wait(5)
    assert isinstance(job.error, DeviceFault)


def test_no_call_from_before_a_stop_runs_after_it(lane: Lane) -> None:
    """Only the call that was just starting may run, and it ends as cancelled."""
    source = random.Random(7)
    cut = 0
    for _ in range(300):
        began: dict[int, float] = {}

        def move(n: int, began: dict[int, float] = began) -> None:
            began[n] = time.perf_counter()

        jobs = [Job("move", move, (n,)) for n in range(5)]
        for job in jobs:
            lane.submit(job)
        spin = time.perf_counter() + source.random() * 2e-4
        while time.perf_counter() < spin:
            pass
        lane.interrupt()
        stopped = time.perf_counter()
        assert all(job.wait(5) for job in jobs)
        late = [n for n, moment in began.items() if moment > stopped]
        assert len(late) <= 1
        assert all(isinstance(jobs[n].error, Cancelled) for n in late)
        assert all(isinstance(job.error, Cancelled) for n, job in enumerate(jobs) if n not in began)
        cut += len(began) < len(jobs)
    assert cut  # the moments did hit
    assert lane.call("next", lambda: 1) == 1


def test_a_call_ends_exactly_once() -> None:
    ends: list[Job] = []
    for _ in range(200):
        job = Job("x", lambda: None, notify=ends.append)
        start = threading.Barrier(3)
        wins: list[bool] = []

        def race(result: int, job: Job = job, start: threading.Barrier = start, wins: list[bool] = wins) -> None:
            start.wait()
            wins.append(job.finish(result) if result else job.give_up(DeviceTimeout("late")))

        threads = [threading.Thread(target=race, args=(n,)) for n in range(3)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        assert sorted(wins) == [False, False, True]
    assert len(ends) == 200


def test_a_driver_can_check_whether_its_call_is_still_wanted(lane: Lane) -> None:
    lane.check_wanted()  # outside of a call it has nothing to check
    begun, gate = threading.Event(), threading.Event()

    def act(*, wait: bool) -> str:
        if wait:
            begun.set()
            gate.wait(5)
        lane.check_wanted()
        return "acted"

    assert lane.call("act", act, keywords={"wait": False}) == "acted"

    stopped = Job("act", act, keywords={"wait": True})
    lane.submit(stopped)
    assert begun.wait(5)
    lane.interrupt()
    gate.set()
    assert stopped.wait(5)
    with pytest.raises(Cancelled, match=r"act was stopped before it began"):
        stopped.outcome()


def test_a_call_that_was_given_up_is_not_wanted_either(lane: Lane) -> None:
    gate = threading.Event()
    reactions: list[BaseException] = []

    def act() -> None:
        gate.wait(5)
        try:
            lane.check_wanted()
        except Cancelled as error:
            reactions.append(error)

    with pytest.raises(DeviceTimeout):
        lane.call("act", act, deadline=0.02)
    gate.set()
    while lane.hung:
        time.sleep(0.001)
    assert len(reactions) == 1


def test_the_running_method_is_known(lane: Lane) -> None:
    assert lane.busy_with == ""
    assert lane.call("act", lambda: lane.busy_with) == "act"
    assert lane.call("act", lambda: lane.current and lane.current.method) == "act"
    assert lane.current is None


def test_calls_behind_a_hung_one_fail_at_once_and_say_since_when_it_hangs(lane: Lane) -> None:
    gate = threading.Event()
    hanging, waiting = Job("slow", lambda: gate.wait(5)), Job("next", lambda: 1)
    lane.submit(hanging)
    while lane.current is not hanging:
        time.sleep(0.001)
    lane.submit(waiting)
    lane.expire(hanging, 0.5)
    try:
        assert waiting.wait(5)
        assert isinstance(waiting.error, DeviceTimeout)
        assert float(waiting.error.detail.split()[2]) < 60
    finally:
        gate.set()


def test_giving_up_returns_whether_it_ended_the_call() -> None:
    job = Job("act", lambda: None)
    assert job.give_up(DeviceTimeout("late"))
    assert job.given_up
    ended = Job("act", lambda: None)
    assert ended.finish(1)
    assert not ended.give_up(DeviceTimeout("late"))
    assert not ended.given_up
    assert ended.outcome() == 1


def test_a_stop_after_closing_does_not_keep_the_thread_alive() -> None:
    lane, gate = Lane("arm"), threading.Event()
    running = Job("act", lambda: gate.wait(5))
    lane.submit(running)
    while lane.current is not running:
        time.sleep(0.001)
    lane.close()
    lane.cancel_waiting()
    assert not lane.join(0)
    gate.set()
    assert lane.join(5)


@pytest.mark.parametrize(("error", "detail"), [(None, ""), (ValueError("bad"), "ValueError('bad')")])
def test_a_stopped_call_names_the_error_that_the_driver_raised(
    lane: Lane, error: Exception | None, detail: str
) -> None:
    begun, gate = threading.Event(), threading.Event()

    def act() -> None:
        begun.set()
        gate.wait(5)
        if error is not None:
            raise error

    job = Job("act", act)
    lane.submit(job)
    assert begun.wait(5)
    lane.interrupt()
    gate.set()
    assert job.wait(5)
    assert isinstance(job.error, Cancelled)
    assert job.error.detail == detail
