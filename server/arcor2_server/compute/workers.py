"""The compute workers: one process per numerical package, started on first use and stopped when idle."""

import asyncio
from collections import deque
from dataclasses import dataclass, field
from typing import Any, Final, TypeVar

import structlog

from arcor2_hw.collision.description import WorldDescription
from arcor2_hw.compute.task import ComputeBusy, ComputeStopped, Task, WorkerKind
from arcor2_server.compute.process import ComputeProcess, ProgressCallback

log = structlog.get_logger(__name__)
R = TypeVar("R")

MAX_WAITING: Final = 1000
"""Maximum number of computations that wait for a worker; more are refused."""


@dataclass(slots=True)
class _Job:
    task: Task[Any]
    within: float
    world: WorldDescription | None
    on_progress: ProgressCallback | None
    place: str = ""
    result: asyncio.Future[Any] = field(default_factory=lambda: asyncio.get_running_loop().create_future())


class _Worker:
    """The queue of one worker process. Background jobs run only while no other job waits."""

    def __init__(self, kind: WorkerKind, idle: float) -> None:
        self.kind = kind
        self.process: ComputeProcess | None = None
        self._idle = idle
        self._waiting: tuple[deque[_Job], deque[_Job]] = (deque(), deque())
        """Waiting jobs and waiting background jobs."""
        self._wake = asyncio.Event()
        self._serving: asyncio.Task[None] | None = None
        self._tasks: set[asyncio.Task[None]] = set()
        """The serving task, and one that may still be closing its process."""

    def put(self, job: _Job, *, background: bool) -> None:
        """Queue a job. Raise ComputeBusy if the queue is full."""
        queue = self._waiting[background]
        if len(queue) >= MAX_WAITING:
            raise ComputeBusy(
                "{count} computations are already waiting. {label} is not started.",
                count=len(queue),
                label=job.task.label,
            )
        queue.append(job)
        self._wake.set()
        if self._serving is None:
            self._serving = asyncio.create_task(self._serve(), name=f"compute worker {self.kind.value}")
            self._tasks.add(self._serving)
            self._serving.add_done_callback(self._tasks.discard)

    async def close(self) -> None:
        """Cancel all jobs and stop the process."""
        if self._serving is not None:
            self._serving.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)

    async def _serve(self) -> None:
        try:
            while (job := await self._next()) is not None:
                if not job.result.done():  # the future is done if the caller was cancelled
                    await self._run(job)
        finally:
            self._serving = None
            process, self.process = self.process, None
            for queue in self._waiting:
                while queue:
                    _fail(queue.popleft(), ComputeStopped("The server is ending."))
            if process is not None:
                await process.close()

    async def _next(self) -> _Job | None:
        """Wait for the next job; return None if there is none within the idle time."""
        while True:
            for queue in self._waiting:
                if queue:
                    return queue.popleft()
            self._wake.clear()
            try:
                async with asyncio.timeout(self._idle):
                    await self._wake.wait()
            except TimeoutError:
                if not self._wake.is_set():
                    return None

    async def _run(self, job: _Job) -> None:
        try:
            process = await self._running_process()
            computing = asyncio.create_task(
                process.compute(job.task, job.within, job.world, job.on_progress, job.place)
            )
            if job.task.cancellable:
                job.result.add_done_callback(lambda result: result.cancelled() and computing.cancel())
            try:
                value = await computing
            finally:
                if not computing.done():
                    computing.cancel()
        except asyncio.CancelledError:
            serving = asyncio.current_task()
            if job.result.cancelled() and (serving is None or not serving.cancelling()):
                stopped, self.process = self.process, None
                if stopped is not None:
                    await stopped.close()
                return
            _fail(job, ComputeStopped("The server is ending."))
            raise
        except Exception as error:  # noqa: BLE001 - `run` raises it in the caller
            _fail(job, error)
        else:
            if not job.result.done():
                job.result.set_result(value)

    async def _running_process(self) -> ComputeProcess:
        if self.process is not None and not self.process.alive:
            ended, self.process = self.process, None
            await ended.close()
        if self.process is None:
            self.process = await ComputeProcess.start(self.kind)
        return self.process


def _fail(job: _Job, error: Exception) -> None:
    if not job.result.done():
        job.result.set_exception(error)


class Compute:
    """Runs tasks in the workers. If a worker crashes, only its current task fails."""

    def __init__(self, idle: float) -> None:
        self._workers = {kind: _Worker(kind, idle) for kind in WorkerKind}
        self._closed = False

    def pid(self, kind: WorkerKind) -> int | None:
        """Return the id of a worker's process, None while no process is running."""
        process = self._workers[kind].process
        return None if process is None or not process.alive else process.process.pid

    async def run(
        self,
        task: Task[R],
        *,
        within: float | None = None,
        world: WorldDescription | None = None,
        place: str = "",
        on_progress: ProgressCallback | None = None,
        background: bool = False,
    ) -> R:
        """Return the result of a task.

        If the caller is cancelled, a started computation still runs to its end. Only for a cancellable task, the
        worker is stopped.

        Args:
            task: the task.
            within: time limit, s; the default is the limit of the task.
            world: the collision world, by id of the object, if the task needs it.
            place: the name of the world. The worker caches worlds by name, so that only changes are sent.
            on_progress: receives the progress.
            background: run the task only while no other task waits.

        Raises:
            Arcor2Error: the error of the computation.
            ComputeStopped: the worker or the server ended.
            ComputeTimeout: the task took too long.
            ComputeBusy: too many tasks wait.
            NotInstalled: the worker's library is not installed.
        """
        if self._closed:
            raise ComputeStopped("The server is ending.")
        job = _Job(task, task.timeout if within is None else within, world, on_progress, place)
        self._workers[task.worker].put(job, background=background)
        result: R = await job.result
        return result

    async def close(self) -> None:
        """Stop the workers."""
        self._closed = True
        await asyncio.gather(*(worker.close() for worker in self._workers.values()))
