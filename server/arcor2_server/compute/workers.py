"""The compute workers: one process per package of numerics, started on first use and ended when idle."""

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

MOST_WAITING: Final = 1000
"""Computations that wait for one worker; further ones are refused."""


@dataclass(slots=True)
class _Question:
    task: Task[Any]
    within: float
    world: WorldDescription | None
    on_progress: ProgressCallback | None
    place: str = ""
    answer: asyncio.Future[Any] = field(default_factory=lambda: asyncio.get_running_loop().create_future())


class _Worker:
    """The questions to one room, in the order in which they came; those in the background only while no other waits."""

    def __init__(self, kind: WorkerKind, idle: float) -> None:
        self.kind = kind
        self.process: ComputeProcess | None = None
        self._idle = idle
        self._waiting: tuple[deque[_Question], deque[_Question]] = (deque(), deque())
        self._wake = asyncio.Event()
        self._serving: asyncio.Task[None] | None = None
        self._tasks: set[asyncio.Task[None]] = set()
        """The one that serves, and one that may be ending its process still."""

    def put(self, question: _Question, *, background: bool) -> None:
        """Let a question wait; ComputeBusy."""
        queue = self._waiting[background]
        if len(queue) >= MOST_WAITING:
            raise ComputeBusy(
                "{count} computations wait already: {label} is not begun.", count=len(queue), label=question.task.label
            )
        queue.append(question)
        self._wake.set()
        if self._serving is None:
            self._serving = asyncio.create_task(self._serve(), name=f"compute worker {self.kind.value}")
            self._tasks.add(self._serving)
            self._serving.add_done_callback(self._tasks.discard)

    async def close(self) -> None:
        """Refuse waiting tasks and end the process."""
        if self._serving is not None:
            self._serving.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)

    async def _serve(self) -> None:
        try:
            while (question := await self._next()) is not None:
                # Who asked may have gone meanwhile.
                if not question.answer.done():
                    await self._answer(question)
        finally:
            self._serving = None
            process, self.process = self.process, None
            for queue in self._waiting:
                while queue:
                    _settle(queue.popleft(), ComputeStopped("The server is ending."))
            if process is not None:
                await process.close()

    async def _next(self) -> _Question | None:
        """Return the next question, None when none came for long."""
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

    async def _answer(self, question: _Question) -> None:
        try:
            process = await self._ready()
            value = await process.ask(
                question.task, question.within, question.world, question.on_progress, question.place
            )
        except asyncio.CancelledError:
            _settle(question, ComputeStopped("The server is ending."))
            raise
        except Exception as error:  # noqa: BLE001 - it is for who asked
            _settle(question, error)
        else:
            if not question.answer.done():
                question.answer.set_result(value)

    async def _ready(self) -> ComputeProcess:
        if self.process is not None and not self.process.alive:
            gone, self.process = self.process, None
            await gone.close()
        if self.process is None:
            self.process = await ComputeProcess.start(self.kind)
        return self.process


def _settle(question: _Question, error: Exception) -> None:
    if not question.answer.done():
        question.answer.set_exception(error)


class Compute:
    """Runs tasks in the workers. A crash of a worker fails only the task that it computes."""

    def __init__(self, idle: float) -> None:
        self._workers = {kind: _Worker(kind, idle) for kind in WorkerKind}
        self._closed = False

    def pid(self, kind: WorkerKind) -> int | None:
        """Return the process that is there for a room, None while there is none."""
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

        within: seconds, where not as the task has it. world: what stands in the way, by id, where the task asks for
        it. place: the name of that world; what is kept of it is worth keeping while the same things stand in it. told:
        called with the progress. background: wait for everything else. Raises what the computation raises;
        ComputeStopped, ComputeTimeout, ComputeBusy, NotInstalled. Who is cancelled leaves a computation that runs to
        its end.
        """
        if self._closed:
            raise ComputeStopped("The server is ending.")
        question = _Question(task, task.timeout if within is None else within, world, on_progress, place)
        self._workers[task.worker].put(question, background=background)
        answer: R = await question.answer
        return answer

    async def close(self) -> None:
        """End the workers."""
        self._closed = True
        await asyncio.gather(*(worker.close() for worker in self._workers.values()))
