"""Feeding of watchdogs by a child process, and time limits in running time."""

import asyncio
import os
import select
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from concurrent.futures import Future
from pathlib import Path

import pytest

from arcor2_hw.keep_alive import (
    KeepAlive,
    RunningTime,
    acquire_within,
    awaited_within,
    once_within,
    pulse,
    result_within,
)
from arcor2_hw.keep_alive_process import FROZEN_AFTER, NICENESS, Parent, ParentEnd
from tests.drivers.stall import BUSY, stall
from tests.waiting import WITHIN, wait_for

MESSAGE = b"kick\r"
SESSION = Path("/proc/self/autogroup")
OWNER = """
import sys, time
from arcor2_hw.keep_alive import KeepAlive
keep_alive = KeepAlive(1, b"kick", 0.02)
while True:
    keep_alive.pulse()
    time.sleep(0.02)
"""


@pytest.fixture
def line() -> Iterator[tuple[int, int]]:
    """Both ends of the line: the child writes to one, the device reads from the other."""
    reading, writing = os.pipe()
    yield writing, reading
    os.close(reading)
    os.close(writing)


def last_message(reading: int, silence: float) -> float:
    """Return the time of the last message, after `silence` s without a message."""
    last = 0.0
    while select.select([reading], [], [], silence)[0] and os.read(reading, 4096):
        last = time.monotonic()
    return last


def test_messages_are_written_only_while_pulses_arrive(line: tuple[int, int]) -> None:
    writing, reading = line
    keep_alive = KeepAlive(writing, MESSAGE, 0.02)
    try:
        until = time.monotonic() + 0.3
        while time.monotonic() < until:
            keep_alive.pulse()
            time.sleep(0.05)
        assert os.read(reading, 65536)
        stall(BUSY)
        assert len(os.read(reading, 65536)) >= 3 * len(MESSAGE), "a busy process interrupts the messages"
        keep_alive.pulse()
        pulsed = time.monotonic()
        assert last_message(reading, 2.0) - pulsed > FROZEN_AFTER / 2.0
    finally:
        keep_alive.close()
        keep_alive.close()
        keep_alive.pulse()


def test_no_message_is_written_while_the_line_is_in_use(line: tuple[int, int]) -> None:
    writing, reading = line
    keep_alive = KeepAlive(writing, MESSAGE, 0.02, quiet=0.4)
    try:
        until = time.monotonic() + 0.6
        while time.monotonic() < until:
            keep_alive.pulse()
            time.sleep(0.02)
        assert not select.select([reading], [], [], 0.0)[0]
        assert select.select([reading], [], [], WITHIN)[0]
    finally:
        keep_alive.close()


def test_messages_stop_at_once_when_the_parent_dies() -> None:
    with subprocess.Popen([sys.executable, "-c", OWNER], stdout=subprocess.PIPE) as owner:
        assert owner.stdout is not None
        assert owner.stdout.read(4) == b"kick"
        owner.kill()
        os.read(owner.stdout.fileno(), 65536)
        messages = owner.stdout.read()  # reads to the end: the child has closed the line, too
        assert messages.count(b"kick") < FROZEN_AFTER / 2.0 / 0.02, "it considered the owner frozen, not ended"


def test_the_time_of_sending_a_pulse_counts() -> None:
    reading, writing = os.pipe()
    try:
        parent = Parent(reading)
        os.write(writing, b'{"n": 1}\n' + pulse() + b"half")
        assert parent.lines(1.0) == [b'{"n": 1}']
        parent.pulse -= FROZEN_AFTER  # as if this child had not been scheduled during this time
        os.write(writing, b" a line\n" + pulse())
        assert parent.lines(0.0) == [b"half a line"]
        assert (parent.ended, parent.lines(0.0)) == (None, [])
        parent.pulse -= FROZEN_AFTER
        assert parent.lines(1.0) == []
        assert parent.ended is ParentEnd.FROZEN
        parent = Parent(reading)
        os.close(writing)
        assert parent.lines(1.0) == []
        assert parent.ended is ParentEnd.GONE
    finally:
        os.close(reading)


def test_a_stall_does_not_count_as_waiting() -> None:
    clock, future, lock, ready = RunningTime(), Future[int](), threading.Lock(), threading.Event()
    results: list[object] = []
    lock.acquire()

    def answer() -> None:
        """Answer 0.1 s after the stall, when the wall-clock time limit of the others has passed."""
        ready.wait()
        time.sleep(0.1)
        future.set_result(1)
        lock.release()

    limit = 2.0
    waiters = [
        threading.Thread(target=lambda: results.append(result_within(future, limit))),
        threading.Thread(target=lambda: results.append(acquire_within(lock, limit))),
        threading.Thread(target=lambda: results.append(once_within(future.done, limit, 0.01))),
    ]
    answering = threading.Thread(target=answer)
    for thread in (*waiters, answering):
        thread.start()
    stall(1.5 * limit)
    assert clock() < limit
    ready.set()
    for thread in (*waiters, answering):
        thread.join()
    assert sorted(map(bool, results)) == [True, True, True]
    with pytest.raises(TimeoutError):
        result_within(Future(), 0.05)
    assert not acquire_within(lock, 0.05)
    assert not once_within(lambda: False, 0.05, 0.01)


@pytest.mark.skipif(not SESSION.exists(), reason="the kernel does not group processes by session")
def test_the_child_and_its_session_have_priority() -> None:
    reading, writing = os.pipe()
    keep_alive = KeepAlive(writing, MESSAGE, 0.02)
    try:
        try:
            os.setpriority(os.PRIO_PROCESS, keep_alive.pid, NICENESS + 1)
        except PermissionError:
            pytest.skip("not permitted")
        wait_for(lambda: Path(f"/proc/{keep_alive.pid}/autogroup").read_text().endswith(f"nice {NICENESS}\n"))
    finally:
        keep_alive.close()
        os.close(reading)
        os.close(writing)


async def test_time_limits_in_an_event_loop_do_not_count_a_stall_of_this_process() -> None:
    async def answer() -> int:
        await asyncio.sleep(0.05)
        stall(0.5)
        return 7

    assert await awaited_within(answer(), 0.3) == 7
    ended: list[bool] = []

    async def never() -> None:
        try:
            await asyncio.Event().wait()
        finally:
            ended.append(True)

    with pytest.raises(TimeoutError):
        await awaited_within(never(), 0.05)
    await asyncio.sleep(0)
    assert ended == [True]
