"""One compute worker as the server sees it: a process and a socket that is asked one thing at a time."""

import asyncio
import contextlib
import os
import signal
import socket
import sys
from collections import deque
from collections.abc import Callable, Iterator, Mapping
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

log = structlog.get_logger(__name__)

Told = Callable[[float, str], None]
"""Takes how far a computation is, 0..1, and what it does."""

START_WITHIN: Final = 15.0
"""Seconds for the start of Python and the first imports on a machine that is busy, and for the end beyond the
deadline, which the process has to keep by itself.
"""
GOES_WITHIN: Final = 3.0
"""Seconds that a process may take to go once its socket is closed; then it is killed."""
COMMAND: Final = ("-P", "-m", "arcor2_hw.compute")
PIECE: Final = 256 * 1024
"""Bytes that are handed to the socket at once."""
WORLDS: Final = 16
"""Worlds that a process keeps."""
LONGEST_LINE: Final = 4096
LINES: Final = 30
"""Lines of output that tell why a process ended."""


class ComputeProcess:
    """Made by `start`. Not for two questions at once."""

    def __init__(
        self, process: asyncio.subprocess.Process, reader: asyncio.StreamReader, writer: asyncio.StreamWriter
    ) -> None:
        self.process = process
        self._reader = reader
        self._writer = writer
        self._told: dict[str, dict[str, WorldItem]] = {}
        """The worlds as this process knows them, the one that was asked of last at the end."""
        self._lines: deque[str] = deque(maxlen=LINES)
        self._output = asyncio.create_task(self._read_output(), name=f"output of compute worker {process.pid}")

    @classmethod
    async def start(cls, kind: WorkerKind, environment: Mapping[str, str] = os.environ) -> "ComputeProcess":
        """Start a process. OSError when that cannot be done."""
        ours, theirs = socket.socketpair()
        try:
            reader, writer = await asyncio.open_unix_connection(sock=ours)
        except BaseException:
            ours.close()
            theirs.close()
            raise
        try:
            process = await asyncio.create_subprocess_exec(
                sys.executable, *COMMAND, "--fd", str(theirs.fileno()),
                pass_fds=[theirs.fileno()],
                stdin=asyncio.subprocess.DEVNULL,
                stdout=asyncio.subprocess.PIPE,
                stderr=asyncio.subprocess.STDOUT,
                env={"OPENBLAS_NUM_THREADS": "1", **environment},
                start_new_session=True,  # Ctrl-C is for the server, which ends the worker in order
            )  # fmt: skip
        except BaseException:
            writer.transport.abort()
            raise
        finally:
            theirs.close()
        log.info("compute worker started", kind=kind.value, pid=process.pid)
        return cls(process, reader, writer)

    @property
    def alive(self) -> bool:
        """Tell whether the process can be asked."""
        return self.process.returncode is None and not self._reader.at_eof() and not self._writer.is_closing()

    async def ask(
        self, task: Task[Any], within: float, world: WorldDescription | None, told: Told | None, place: str = ""
    ) -> Any:
        """Give the answer. Raises what the computation raises; ComputeStopped, ComputeTimeout when there is none."""
        try:
            async with asyncio.timeout(within + START_WITHIN):
                if world is not None:
                    await self._send_world(world, place)
                await self._send(m.Work(task, within, place))  # type: ignore[arg-type]
                while isinstance(message := await self._read(), m.Progress):
                    if told is not None:
                        told(message.share, message.message)
        except TimeoutError:
            await self.close()
            raise ComputeTimeout(_too_long(task, within)) from None
        except (OSError, EOFError, msgspec.MsgspecError, ValueError) as error:
            raise await self._why(task, within, error) from error
        if isinstance(message, m.Failed):
            raise error_of(message)
        return msgspec.msgpack.decode(message.value, type=task.result_type)

    async def _send_world(self, world: WorldDescription, place: str) -> None:
        """Tell the process what changed since it was told last."""
        known = self._told.pop(place, {})
        put = [body for key, body in world.items() if (old := known.get(key)) is not body and old != body]
        remove = [key for key in known if key not in world]
        if put or remove:
            await self._send(m.ChangeWorld(place, put, remove))
        self._told[place] = dict(world)
        while len(self._told) > WORLDS:
            oldest = next(iter(self._told))
            del self._told[oldest]
            await self._send(m.ForgetWorld(oldest))

    async def _send(self, message: m.ToWorker) -> None:
        data = memoryview(m.encode(message))
        for start in range(0, len(data), PIECE):
            self._writer.write(data[start : start + PIECE])
            await self._writer.drain()

    async def _read(self) -> m.FromWorker:
        size = m.body_length(await self._reader.readexactly(PREFIX_SIZE))
        message: m.FromWorker = m.decode_from_worker(await self._reader.readexactly(size))
        return message

    async def _why(self, task: Task[Any], within: float, error: Exception) -> Arcor2Error:
        """Say why there is no answer."""
        self._writer.transport.abort()
        code = await self._gone()
        await asyncio.wait({self._output}, timeout=GOES_WITHIN)
        detail = "\n".join([f"pid {self.process.pid}: {error!r}", *self._lines])
        log.error("compute worker ended", pid=self.process.pid, task=type(task).__name__, status=code, detail=detail)
        if code == -signal.SIGALRM:
            return ComputeTimeout(_too_long(task, within), detail)
        how = f"by {signal.Signals(-code).name}" if -code in list(signal.Signals) else f"with status {code}"
        return ComputeStopped(f"The compute worker ended {how} while it worked on {task.label}.", detail)

    # -------------------------------------------------------------------------------- ending
    async def close(self) -> None:
        """End the process, and wait until it is gone. It keeps nothing: it is killed."""
        self._writer.transport.abort()
        self._kill()
        await self._gone()
        await asyncio.gather(self._output, return_exceptions=True)

    async def _gone(self) -> int:
        try:
            async with asyncio.timeout(GOES_WITHIN):
                return await self.process.wait()
        except BaseException:
            self._kill()
            raise_again = not isinstance(sys.exception(), TimeoutError)
            code = await self.process.wait()
            if raise_again:
                raise
            return code

    def _kill(self) -> None:
        with contextlib.suppress(ProcessLookupError):
            self.process.kill()

    async def _read_output(self) -> None:
        """Take what libraries print."""
        assert self.process.stdout is not None
        rest = b""
        while chunk := await self.process.stdout.read(65536):
            *lines, rest = (rest + chunk).split(b"\n")
            rest = rest[:LONGEST_LINE]
            for line in lines:
                text = line[:LONGEST_LINE].decode(errors="backslashreplace")
                self._lines.append(text)
                log.info("compute worker", pid=self.process.pid, text=text)


def _too_long(task: Task[Any], within: float) -> str:
    what = task.label[:1].upper() + task.label[1:]
    return f"{what} took longer than {within:g} s, and was given up."


def _tree(kind: type[Arcor2Error]) -> Iterator[type[Arcor2Error]]:
    yield kind
    for below in kind.__subclasses__():
        if below.__module__ == exceptions.__name__:
            yield from _tree(below)


_KNOWN: Final[list[type[Arcor2Error]]] = [*_tree(Arcor2Error), CalibrationRefused, NotInstalled]
_KINDS: Final = {kind.code: kind for kind in _KNOWN}


def error_of(failed: m.Failed) -> Arcor2Error:
    """Give the error of a computation, as the nearest class that is known here, with its own code and reason."""
    kind = next((_KINDS[code] for code in failed.codes if code in _KINDS), Arcor2Error)
    error = kind.__new__(kind)
    Arcor2Error.__init__(error, failed.message, failed.detail)
    error.code = failed.codes[0]  # type: ignore[misc]
    if failed.reason:
        error.reason = failed.reason  # type: ignore[attr-defined]
    return error
