"""Tests of the compute workers: started on first use, stopped when idle, independent of each other."""

import asyncio
import os
import signal
from collections.abc import AsyncIterator
from typing import get_args

import psutil
import pytest
import pytest_asyncio

from arcor2_hw.calibration.refusals import CalibrationRefused
from arcor2_hw.compute import calibration_tasks as t, messages as m, task as task_module
from arcor2_hw.compute.dry_run_tasks import DryRunTask
from arcor2_hw.compute.program_walk import END_STEP, Edge, Graph, Step
from arcor2_hw.compute.task import ComputeBusy, ComputeStopped, ComputeTimeout, WorkerKind
from arcor2_hw.compute.tasks import AnyTask
from arcor2_hw.compute.worker import function_of
from arcor2_hw.data.camera import CameraParameters
from arcor2_hw.data.geometry import Pose, Position
from arcor2_hw.exceptions import Arcor2Error, InvalidData, NotFound
from arcor2_hw.messages import Message
from arcor2_server.compute import process, workers as compute_module
from arcor2_server.compute.process import ComputeProcess, error_of
from arcor2_server.compute.workers import Compute

KNOWN = [Position(0, 0, 0), Position(1, 0, 0), Position(0, 1, 0), Position(1, 1, 0)]


def frame_task(offset: float = 0.25) -> t.FrameByPoints:
    """Return a task that computes a frame with the origin (offset, 0, 0), m."""
    return t.FrameByPoints(KNOWN, [point + Position(offset, 0, 0) for point in KNOWN])


@pytest_asyncio.fixture
async def compute() -> AsyncIterator[Compute]:
    created = Compute(idle=60.0)
    yield created
    await created.close()


async def until(condition: object, timeout: float = 20.0) -> None:
    assert callable(condition)
    async with asyncio.timeout(timeout):
        while not condition():
            await asyncio.sleep(0.01)


async def test_a_worker_starts_on_first_use_and_is_reused(compute: Compute) -> None:
    assert compute.pid(WorkerKind.CALIBRATION) is None
    assert (await compute.run(frame_task())).pose.position.x == pytest.approx(0.25)
    pid = compute.pid(WorkerKind.CALIBRATION)
    assert (await compute.run(frame_task(0.5))).pose.position.x == pytest.approx(0.5)
    assert compute.pid(WorkerKind.CALIBRATION) == pid
    assert compute.pid(WorkerKind.KINEMATICS) is None


async def test_an_idle_worker_ends_and_restarts_on_demand() -> None:
    compute = Compute(idle=0.2)
    try:
        await compute.run(frame_task())
        pid = compute.pid(WorkerKind.CALIBRATION)
        assert pid is not None
        await until(lambda: compute.pid(WorkerKind.CALIBRATION) is None)
        await until(lambda: not psutil.pid_exists(pid))
        assert (await compute.run(frame_task(0.5))).pose.position.x == pytest.approx(0.5)
    finally:
        await compute.close()


async def test_a_killed_worker_fails_only_the_running_task(compute: Compute) -> None:
    await compute.run(frame_task())
    pid = compute.pid(WorkerKind.CALIBRATION)
    assert pid is not None
    os.kill(pid, signal.SIGSTOP)  # it will be in the middle of the next task
    hit = asyncio.create_task(compute.run(frame_task(1.0)))
    waiting = [asyncio.create_task(compute.run(frame_task(float(each)))) for each in (2, 3)]
    await asyncio.sleep(0.1)
    os.kill(pid, signal.SIGKILL)
    with pytest.raises(ComputeStopped, match=r"was killed by SIGKILL while it worked on a frame by touch") as raised:
        await hit
    assert str(pid) in raised.value.detail
    assert [(await each).pose.position.x for each in waiting] == pytest.approx([2.0, 3.0])
    assert compute.pid(WorkerKind.CALIBRATION) not in (None, pid)


async def test_killing_an_idle_worker_fails_no_task(compute: Compute) -> None:
    await compute.run(frame_task())
    pid = compute.pid(WorkerKind.CALIBRATION)
    assert pid is not None
    os.kill(pid, signal.SIGKILL)
    await until(lambda: compute.pid(WorkerKind.CALIBRATION) is None)
    assert (await compute.run(frame_task(0.5))).pose.position.x == pytest.approx(0.5)


async def test_a_frozen_worker_is_replaced(compute: Compute, monkeypatch: pytest.MonkeyPatch) -> None:
    await compute.run(frame_task())
    pid = compute.pid(WorkerKind.CALIBRATION)
    assert pid is not None
    monkeypatch.setattr(process, "START_TIMEOUT", 0.3)
    os.kill(pid, signal.SIGSTOP)
    with pytest.raises(ComputeTimeout, match=r"Took longer than 0\.1 s, and was cancelled: a frame by touch"):
        await compute.run(frame_task(), within=0.1)
    monkeypatch.undo()
    assert (await compute.run(frame_task(0.5))).pose.position.x == pytest.approx(0.5)
    assert compute.pid(WorkerKind.CALIBRATION) != pid


ENDLESS = """
import sys
from arcor2_hw.compute import worker
worker.KILL_DELAY = 0.1
worker.function_of = lambda task: lambda *_: 7 ** 10**9  # in C, with the interpreter lock held
worker.main(sys.argv[1:])
"""


async def test_an_endless_task_is_ended_at_its_deadline(compute: Compute, monkeypatch: pytest.MonkeyPatch) -> None:
    """The kernel enforces the deadline, also for a library call that never returns."""
    monkeypatch.setattr(process, "COMMAND", ("-P", "-c", ENDLESS))
    with pytest.raises(ComputeTimeout, match=r"longer than 0\.2 s"):
        await compute.run(frame_task(), within=0.2)
    monkeypatch.undo()
    assert (await compute.run(frame_task(0.5))).pose.position.x == pytest.approx(0.5)


NONSENSE = """
import socket, sys
socket.socket(fileno=int(sys.argv[2])).sendall(b"\\xff" * 64)
print("a library says why")
"""


async def test_a_worker_that_sends_garbage_is_ended(compute: Compute, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(process, "COMMAND", ("-P", "-c", NONSENSE))
    with pytest.raises(ComputeStopped) as raised:
        await compute.run(frame_task())
    assert "a library says why" in raised.value.detail
    monkeypatch.undo()
    assert (await compute.run(frame_task(0.5))).pose.position.x == pytest.approx(0.5)


async def test_a_cancelled_caller_does_not_block_the_others(compute: Compute) -> None:
    await compute.run(frame_task())
    pid = compute.pid(WorkerKind.CALIBRATION)
    assert pid is not None
    os.kill(pid, signal.SIGSTOP)
    tasks = [asyncio.create_task(compute.run(frame_task(float(each)))) for each in range(3)]
    await asyncio.sleep(0.05)
    for each in tasks[:2]:  # one that is being worked on, and one that waits
        each.cancel()
    await asyncio.gather(*tasks[:2], return_exceptions=True)
    os.kill(pid, signal.SIGCONT)
    assert (await tasks[2]).pose.position.x == pytest.approx(2.0)
    assert compute.pid(WorkerKind.CALIBRATION) == pid


async def test_background_tasks_wait_for_all_others(compute: Compute) -> None:
    await compute.run(frame_task())
    pid = compute.pid(WorkerKind.CALIBRATION)
    assert pid is not None
    os.kill(pid, signal.SIGSTOP)
    order: list[str] = []

    async def run(name: str, background: bool) -> None:
        await compute.run(frame_task(), background=background)
        order.append(name)

    tasks = [asyncio.create_task(run("first", False))]
    await asyncio.sleep(0.05)
    for name, background in (("back 1", True), ("back 2", True), ("front", False)):
        tasks.append(asyncio.create_task(run(name, background)))
    await asyncio.sleep(0.05)
    os.kill(pid, signal.SIGCONT)
    await asyncio.gather(*tasks)
    assert order == ["first", "front", "back 1", "back 2"]


async def test_too_many_waiting_tasks_are_refused(compute: Compute, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(compute_module, "MAX_WAITING", 2)
    tasks = [asyncio.create_task(compute.run(frame_task())) for _ in range(3)]
    await asyncio.sleep(0)
    # the first has not been taken yet
    with pytest.raises(ComputeBusy, match="2 computations are already waiting"):
        await asyncio.gather(*tasks)
    await asyncio.gather(*tasks, return_exceptions=True)


async def test_errors_keep_their_type(compute: Compute) -> None:
    with pytest.raises(InvalidData, match="3 to 1000 known points"):
        await compute.run(t.FrameByPoints([], []))
    line = [Position(float(each), 0, 0) for each in range(4)]
    with pytest.raises(CalibrationRefused) as raised:
        await compute.run(t.FrameByPoints(line, line))
    assert raised.value.reason == "degenerate"
    assert raised.value.code == "calibration_refused"
    with pytest.raises(InvalidData):
        await compute.run(t.TipByTouches([Pose()] * 2))


def test_an_unknown_error_becomes_its_nearest_known_base() -> None:
    error = error_of(m.Failed(["marker_twice", "not_found", "error"], "There are two.", "detail"))
    assert isinstance(error, NotFound)
    assert (error.code, str(error), error.detail) == ("marker_twice", "There are two.", "detail")
    assert type(error_of(m.Failed(["alien"], "What?"))) is Arcor2Error


async def test_large_pictures_do_not_block_the_server(compute: Compute) -> None:
    """Forty megabytes are sent in pieces, so the server continues meanwhile."""
    await compute.run(frame_task())
    picture = b"no picture" * 4_000_000
    ticks = 0

    async def tick() -> None:
        nonlocal ticks
        while True:
            await asyncio.sleep(0.001)
            ticks += 1

    ticking = asyncio.create_task(tick())
    parameters = CameraParameters(1, 1, 1, 1, [0, 0, 0, 0])
    with pytest.raises(Arcor2Error):
        await compute.run(t.FindMarkers(picture, parameters))
    ticking.cancel()
    await asyncio.gather(ticking, return_exceptions=True)
    assert ticks > 10


async def test_closing_ends_a_busy_worker() -> None:
    compute = Compute(idle=60.0)
    await compute.run(frame_task())
    pid = compute.pid(WorkerKind.CALIBRATION)
    assert pid is not None
    os.kill(pid, signal.SIGSTOP)
    tasks = [asyncio.create_task(compute.run(frame_task())) for _ in range(2)]
    await asyncio.sleep(0.05)
    await compute.close()
    assert not psutil.pid_exists(pid)
    for each in tasks:
        with pytest.raises(ComputeStopped, match="server is ending"):
            await each
    with pytest.raises(ComputeStopped):
        await compute.run(frame_task())


async def test_a_worker_ends_with_its_server() -> None:
    process = await ComputeProcess.start(WorkerKind.CALIBRATION)
    try:
        await process.compute(frame_task(), 10.0, None, None)
        process._writer.transport.abort()  # as when the server was killed
        async with asyncio.timeout(20):
            assert await process.process.wait() == 0
    finally:
        await process.close()


def test_every_task_has_a_worker_and_a_description() -> None:
    """The worker finds every task of the union, and each has a description."""
    kinds = get_args(AnyTask)
    assert len({kind.__name__ for kind in kinds}) == len(kinds) > 5
    for kind in kinds:
        assert issubclass(kind, task_module.Task)
        assert callable(function_of(kind)), kind
        assert isinstance(kind.label, Message)
        assert kind.timeout > 0


async def test_a_cancellable_task_stops_its_worker(compute: Compute) -> None:
    """The next task runs in a new process."""
    targets = [*range(1, 4), END_STEP]
    steps = [Step(f"act_{n}", str(n), "arm", [Edge(target)]) for n, target in enumerate(targets)]
    task = DryRunTask(Graph(steps), {"arm": "arm"})
    running = asyncio.create_task(compute.run(task))
    await until(lambda: compute.pid(WorkerKind.DRY_RUN) is not None)
    pid = compute.pid(WorkerKind.DRY_RUN)
    assert pid is not None
    running.cancel()
    await asyncio.gather(running, return_exceptions=True)
    await until(lambda: not psutil.pid_exists(pid))
    assert [span.name for span in (await compute.run(task)).prediction.trace.spans] == ["0", "1", "2", "3"]
    assert compute.pid(WorkerKind.DRY_RUN) != pid
