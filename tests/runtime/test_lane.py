"""Lanes: order, deadlines, late results and stops. Each call ends exactly once, also in a race."""

import random
import threading
import time
from collections.abc import Iterator

import pytest

from arcor2_hw.exceptions import Cancelled, DeviceFault, DeviceTimeout
from arcor2_hw.runtime.lane import Job, Lane, on_any_lane
from tests.waiting import WITHIN, wait_for


@pytest.fixture
def lane() -> Iterator[Lane]:
    lane = Lane("arm")
    yield lane
    lane.close()
    assert lane.join(WITHIN)


def test_calls_run_in_order_on_one_thread(lane: Lane) -> None:
    threads = set()

    def number(n: int) -> int:
        threads.add(threading.get_ident())
        assert on_any_lane()
        return lane.call("inner", lambda: n)  # in the lane's own thread a call does not wait for the lane

    jobs = [Job("number", number, (n,)) for n in range(100)]
    for job in jobs:
        lane.submit(job)
    assert [job.wait(WITHIN) and job.outcome() for job in jobs] == list(range(100))
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
    lane.call("first", lambda: None)  # the thread is running
    with pytest.raises(DeviceTimeout, match=r"arm: slow did not finish within 0\.5 s"):
        lane.call("slow", gate.wait, deadline=0.5)
    assert lane.hung
    with pytest.raises(DeviceTimeout, match="still busy with slow"):
        lane.call("next", lambda: 1)  # without a deadline it would wait for the gate
    gate.set()
    wait_for(lambda: not lane.hung)
    assert lane.call("next", lambda: 2, deadline=WITHIN) == 2


def test_a_queued_call_that_expired_never_runs(lane: Lane) -> None:
    gate = threading.Event()
    ran: list[int] = []
    first = Job("first", gate.wait)
    lane.submit(first)
    wait_for(lambda: lane.current is first)
    with pytest.raises(DeviceTimeout, match="busy with first"):
        lane.call("second", lambda: ran.append(1), deadline=0.05)
    gate.set()
    assert lane.call("third", lambda: 3) == 3
    assert ran == []


def test_a_stop_cancels_queued_and_running_calls(lane: Lane) -> None:
    gate, started = threading.Event(), threading.Event()
    ran: list[int] = []

    def move() -> str:
        started.set()
        gate.wait(WITHIN)
        return "arrived"

    moving, waiting = Job("move", move), Job("wait", lambda: ran.append(1))
    for job in (moving, waiting):
        lane.submit(job)
    assert started.wait(WITHIN)
    assert lane.interrupt() is moving
    assert waiting.wait(WITHIN)
    gate.set()
    assert moving.wait(WITHIN)
    for job in (moving, waiting):
        assert isinstance(job.error, Cancelled)
    assert ran == []
    assert lane.call("next", lambda: 1) == 1


def test_a_stopped_call_keeps_the_error_of_the_device(lane: Lane) -> None:
    started, gate = threading.Event(), threading.Event()

    def move() -> None:
        started.set()
        gate.wait(WITHIN)
        raise DeviceFault("drive 3")

    job = Job("move", move)
    lane.submit(job)
    started.wait(WITHIN)
    lane.interrupt()
    gate.set()
    assert job.wait(WITHIN)
    assert isinstance(job.error, DeviceFault)


def test_no_call_from_before_a_stop_runs_after_it(lane: Lane) -> None:
    """Only a call that was just starting may run, and it ends as cancelled."""
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
        assert all(job.wait(WITHIN) for job in jobs)
        late = [n for n, moment in began.items() if moment > stopped]
        assert len(late) <= 1
        assert all(isinstance(jobs[n].error, Cancelled) for n in late)
        assert all(isinstance(job.error, Cancelled) for n, job in enumerate(jobs) if n not in began)
        cut += len(began) < len(jobs)
    assert cut  # some cuts hit the right moment
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
    lane.check_wanted()  # outside of a call there is nothing to check
    started, gate = threading.Event(), threading.Event()

    def act(*, wait: bool) -> str:
        if wait:
            started.set()
            gate.wait(WITHIN)
        lane.check_wanted()
        return "acted"

    assert lane.call("act", act, keywords={"wait": False}) == "acted"

    stopped = Job("act", act, keywords={"wait": True})
    lane.submit(stopped)
    assert started.wait(WITHIN)
    lane.interrupt()
    gate.set()
    assert stopped.wait(WITHIN)
    with pytest.raises(Cancelled, match=r"act was stopped before it began"):
        stopped.outcome()


def test_an_abandoned_call_counts_as_cancelled(lane: Lane) -> None:
    gate = threading.Event()
    reactions: list[BaseException] = []

    def act() -> None:
        gate.wait(WITHIN)
        try:
            lane.check_wanted()
        except Cancelled as error:
            reactions.append(error)

    job = Job("act", act)
    lane.submit(job)
    wait_for(lambda: lane.current is job)
    lane.expire(job, 0.02)
    assert isinstance(job.error, DeviceTimeout)
    gate.set()
    wait_for(lambda: not lane.hung)
    assert len(reactions) == 1


def test_the_running_method_is_known(lane: Lane) -> None:
    assert lane.busy_with == ""
    assert lane.call("act", lambda: lane.busy_with) == "act"
    assert lane.call("act", lambda: lane.current and lane.current.method) == "act"
    assert lane.current is None


def test_calls_behind_a_hung_one_fail_at_once_and_state_since_when_it_hangs(lane: Lane) -> None:
    gate = threading.Event()
    hanging, waiting = Job("slow", gate.wait), Job("next", lambda: 1)
    lane.submit(hanging)
    wait_for(lambda: lane.current is hanging)
    lane.submit(waiting)
    hanging.since = time.monotonic() - 5
    lane.expire(hanging, 0.5)
    refused = Job("refused", lambda: 1)
    assert not lane.submit_or_fail(refused)
    try:
        for job in (waiting, refused):
            assert job.wait(WITHIN)
            assert isinstance(job.error, DeviceTimeout)
            assert 5 <= float(job.error.detail.split()[2]) < 60
    finally:
        gate.set()


def test_a_job_is_queued_while_the_lane_works(lane: Lane) -> None:
    job = Job("act", lambda: 1)
    assert lane.submit_or_fail(job)
    assert job.wait(WITHIN)
    assert job.outcome() == 1


@pytest.mark.parametrize(("purpose", "name"), [("", "arm"), ("observing", "arm observing")])
def test_the_thread_is_named_and_does_not_keep_the_process_alive(purpose: str, name: str) -> None:
    lane = Lane("arm", purpose)
    thread = lane.call("act", threading.current_thread)
    assert (thread.name, thread.daemon) == (name, True)
    lane.close()
    assert lane.join(WITHIN)


@pytest.mark.parametrize("timeout", [0.0, -0.5])
def test_a_wait_without_time_returns_at_once(timeout: float) -> None:
    job = Job("act", lambda: 1)
    assert not job.wait(timeout)
    job.finish()
    assert job.wait(timeout)
    assert job.wait(None)


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
    running = Job("act", gate.wait)
    lane.submit(running)
    wait_for(lambda: lane.current is running)
    lane.close()
    lane.cancel_waiting()
    assert not lane.join(0)
    gate.set()
    assert lane.join(WITHIN)


@pytest.mark.parametrize(("error", "detail"), [(None, ""), (ValueError("bad"), "ValueError('bad')")])
def test_a_stopped_call_names_the_error_that_the_driver_raised(
    lane: Lane, error: Exception | None, detail: str
) -> None:
    started, gate = threading.Event(), threading.Event()

    def act() -> None:
        started.set()
        gate.wait(WITHIN)
        if error is not None:
            raise error

    job = Job("act", act)
    lane.submit(job)
    assert started.wait(WITHIN)
    lane.interrupt()
    gate.set()
    assert job.wait(WITHIN)
    assert isinstance(job.error, Cancelled)
    assert job.error.detail == detail
