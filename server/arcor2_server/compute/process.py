"""One compute worker: a process that computes one task at a time."""

import asyncio
import os
import signal
import socket
from collections import deque
from collections.abc import Callable, Mapping
from typing import Any, Final

import msgspec
import structlog

from arcor2_hw import exceptions
from arcor2_hw.calibration.refusals import CalibrationRefused
from arcor2_hw.collision.description import WorldDescription, WorldItem
from arcor2_hw.compute import messages as m
from arcor2_hw.compute.task import ComputeStopped, ComputeTimeout, NotInstalled, Task, WorkerKind
from arcor2_hw.exceptions import Arcor2Error
from arcor2_hw.framing import PREFIX_SIZE
from arcor2_server.child_process import ChildProcess, describe_exit

log = structlog.get_logger(__name__)

ProgressCallback = Callable[[float, str], None]
"""Receives the progress of a computation, 0 to 1, and its present step."""

START_TIMEOUT: Final = 15.0
"""Time added to the limit of a task for the start of Python on a busy machine, s. The process itself uses the limit."""
EXIT_TIMEOUT: Final = 3.0
"""Time limit for a process to end after its socket is closed, before it is killed, s."""
COMMAND: Final = ("-P", "-m", "arcor2_hw.compute")
CHUNK_SIZE: Final = 256 * 1024
"""Maximum number of bytes written to the socket at once."""
MAX_WORLDS: Final = 16
"""Maximum number of worlds cached by a process."""
MAX_LINE: Final = 4096
"""Maximum length of an output line, bytes."""
REPORTED_LINES: Final = 30
"""Number of output lines reported when a process ends unexpectedly."""


class ComputeProcess:
    """A running worker, created by `start`. It computes one task at a time."""

    def __init__(self, process: ChildProcess, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self.process = process
        self._reader = reader
        self._writer = writer
        self._sent_worlds: dict[str, dict[str, WorldItem]] = {}
        """The worlds cached by the process, in the order of their last use."""
        self._lines: deque[str] = deque(maxlen=REPORTED_LINES)
        self._output = asyncio.create_task(self._read_output(), name=f"output of compute worker {process.pid}")

    @classmethod
    async def start(cls, kind: WorkerKind, environment: Mapping[str, str] = os.environ) -> "ComputeProcess":
        """Start a process.

        Raises:
            OSError: it cannot be started.
        """
        ours, theirs = socket.socketpair()
        try:
            reader, writer = await asyncio.open_unix_connection(sock=ours)
        except BaseException:
            ours.close()
            theirs.close()
            raise
        try:
            process = await ChildProcess.start(COMMAND, theirs, environment)
        except BaseException:
            writer.transport.abort()
            raise
        log.info("compute worker started", kind=kind.value, pid=process.pid)
        return cls(process, reader, writer)

    @property
    def alive(self) -> bool:
        """Whether the process can compute tasks."""
        return self.process.returncode is None and not self._reader.at_eof() and not self._writer.is_closing()

    async def compute(
        self,
        task: Task[Any],
        within: float,
        world: WorldDescription | None,
        on_progress: ProgressCallback | None,
        place: str = "",
    ) -> Any:
        """Return the result of a task.

        Raises:
            Arcor2Error: the error of the computation.
            ComputeStopped: the process ended.
            ComputeTimeout: the task took longer than `within` s.
        """
        try:
            async with asyncio.timeout(within + START_TIMEOUT):
                if world is not None:
                    await self._send_world(world, place)
                await self._send(m.RunTask(task, within, place))  # type: ignore[arg-type]
                while isinstance(message := await self._read(), m.Progress):
                    if on_progress is not None:
                        on_progress(message.share, message.message)
        except TimeoutError:
            await self.close()
            raise ComputeTimeout(_TOO_LONG, task=task.label, within=within) from None
        except (OSError, EOFError, msgspec.MsgspecError, ValueError) as error:
            raise await self._missing_answer(task, within, error) from error
        if isinstance(message, m.Failed):
            raise error_of(message)
        return msgspec.msgpack.decode(message.value, type=task.result_type)

    async def _send_world(self, world: WorldDescription, place: str) -> None:
        """Send the changes of a world since its last task."""
        known = self._sent_worlds.pop(place, {})
        put = [body for key, body in world.items() if (old := known.get(key)) is not body and old != body]
        remove = [key for key in known if key not in world]
        if put or remove:
            await self._send(m.ChangeWorld(place, put, remove))
        self._sent_worlds[place] = dict(world)
        while len(self._sent_worlds) > MAX_WORLDS:
            oldest = next(iter(self._sent_worlds))
            del self._sent_worlds[oldest]
            await self._send(m.ForgetWorld(oldest))

    async def _send(self, message: m.ToWorker) -> None:
        data = memoryview(m.encode(message))
        for start in range(0, len(data), CHUNK_SIZE):
            self._writer.write(data[start : start + CHUNK_SIZE])
            await self._writer.drain()

    async def _read(self) -> m.FromWorker:
        size = m.body_length(await self._reader.readexactly(PREFIX_SIZE))
        message: m.FromWorker = m.decode_from_worker(await self._reader.readexactly(size))
        return message

    async def _missing_answer(self, task: Task[Any], within: float, error: Exception) -> Arcor2Error:
        """Return the error for a missing answer, after the end of the process."""
        self._writer.transport.abort()
        code = await self.process.wait_or_kill(EXIT_TIMEOUT)
        await asyncio.wait({self._output}, timeout=EXIT_TIMEOUT)
        detail = "\n".join([f"pid {self.process.pid}: {error!r}", *self._lines])
        log.error("compute worker ended", pid=self.process.pid, task=type(task).__name__, status=code, detail=detail)
        if code == -signal.SIGALRM:
            return ComputeTimeout(_TOO_LONG, detail, task=task.label, within=within)
        return ComputeStopped(
            "The compute worker {code} while it worked on {label}.", detail, code=describe_exit(code), label=task.label
        )

    async def close(self) -> None:
        """Kill the process and wait for its end. It stores nothing."""
        self._writer.transport.abort()
        self.process.kill()
        await self.process.wait()
        await asyncio.gather(self._output, return_exceptions=True)

    async def _read_output(self) -> None:
        """Log the output of libraries."""
        async for line in self.process.output(MAX_LINE):
            self._lines.append(line)
            log.info("compute worker output", pid=self.process.pid, text=line)


_TOO_LONG: Final = "Took longer than {within:g} s, and was cancelled: {task}."
_CLASSES: Final[dict[str, type[Arcor2Error]]] = {
    kind.code: kind
    for kind in (*vars(exceptions).values(), CalibrationRefused, NotInstalled)
    if isinstance(kind, type) and issubclass(kind, Arcor2Error)
}
"""Error classes by code."""


def error_of(failed: m.Failed) -> Arcor2Error:
    """Return the error of a computation, with its code and reason, as the most specific known class."""
    kind = next((_CLASSES[code] for code in failed.codes if code in _CLASSES), Arcor2Error)
    error = kind.__new__(kind)
    Arcor2Error.__init__(error, failed.message, failed.detail)
    error.code = failed.codes[0]  # type: ignore[misc]
    if failed.reason:
        error.reason = failed.reason  # type: ignore[attr-defined]
    return error
