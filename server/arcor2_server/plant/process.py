"""Runs a process for plant systems: restarts it when it ends, sends it changes of the cell, answers its messages."""

import asyncio
import socket
import time
from collections.abc import Callable, Coroutine, Sequence
from typing import Any, Final

import msgspec
import structlog

from arcor2_hw.framing import PREFIX_SIZE, body_length
from arcor2_hw.plant.messages import BEAT_PERIOD, MAX_MESSAGE, Update, encode
from arcor2_server.alarms.service import Alarms
from arcor2_server.background import BackgroundTasks
from arcor2_server.child_process import ChildProcess, describe_exit
from arcor2_server.plant.feed import FeedReader

log = structlog.get_logger(__name__)

PERIOD: Final = 0.1
"""Shortest time between two updates, s."""
MAX_UNSENT: Final = 256 * 1024
"""Number of unsent bytes above which changes are merged instead of sent."""
EXIT_TIMEOUT: Final = 3.0
"""Time limit for the process to end after its socket is closed, s."""
FIRST_PAUSE: Final = 0.5
MAX_PAUSE: Final = 30.0
"""Shortest and longest time before a restart, s. It doubles each time, until the process has run for MAX_PAUSE."""
ALARM_AFTER: Final = 3
"""Number of consecutive ends after which an alarm is raised. The alarm ends when a process has run for MAX_PAUSE."""
EMPTY: Final = Update()


class PlantProcess:
    """A process for plant systems, from `start` to `close`.

    Args:
        name: its name in logs and alarms.
        module: the Python module that it runs.
        reader: changes that it has not received yet.
        alarms: the alarms.
        alarm: code of the alarm when it ends repeatedly.
        setup: returns the first message to it.
        received: handles a message of it. It returns the answer, or None.
    """

    def __init__(
        self,
        name: str,
        module: str,
        reader: FeedReader,
        alarms: Alarms,
        alarm: str,
        setup: Callable[[], Any],
        received: Callable[[bytes], Coroutine[Any, Any, Any]],
    ) -> None:
        self._name, self._module, self._reader = name, module, reader
        self._alarms, self._alarm = alarms, alarm
        self._setup, self._received = setup, received
        self._background = BackgroundTasks()
        self.running = False
        """Whether the process is running."""
        self.ends = 0
        """Number of unexpected ends."""

    def start(self, *, inherited: Sequence[int] = ()) -> None:
        """Start the process in the background, with file descriptors that it inherits."""
        self._background.spawn(self._keep_running(inherited), self._name)

    async def close(self) -> None:
        """End the process."""
        await self._background.cancel()

    async def _keep_running(self, inherited: Sequence[int]) -> None:
        pause, ends = FIRST_PAUSE, 0
        while True:
            lasting = self._background.spawn(self._clear_later(), f"alarm of the {self._name}")
            started = time.monotonic()
            try:
                await self._run(inherited)
            except (OSError, ValueError) as error:
                log.error(f"{self._name} failed", reason=str(error))
            self.running = False
            self.ends += 1
            lasted = time.monotonic() - started > MAX_PAUSE
            lasting.cancel()
            pause = FIRST_PAUSE if lasted else min(2.0 * pause, MAX_PAUSE)
            ends = 1 if lasted else ends + 1
            if ends == ALARM_AFTER:
                self._alarms.system(self._alarm, True)
            await asyncio.sleep(pause)

    async def _clear_later(self) -> None:
        await asyncio.sleep(MAX_PAUSE)
        self._alarms.system(self._alarm, False)

    async def _run(self, inherited: Sequence[int]) -> None:
        """Run the process until it ends.

        Raises:
            OSError: it cannot be started.
            ValueError: it sends a message that is too long.
        """
        ours, theirs = socket.socketpair()
        reader, writer = await asyncio.open_unix_connection(sock=ours)
        tasks = BackgroundTasks()
        process = None
        try:
            process = await ChildProcess.start(("-P", "-m", self._module), theirs, inherited=inherited)
            log.info(f"{self._name} starts", pid=process.pid)
            self.running = True
            writer.write(encode(self._setup()))
            tasks.spawn(self._log_output(process), f"output of the {self._name}")
            sending = tasks.spawn(self._send(writer), f"updates of the {self._name}")
            sending.add_done_callback(lambda _: writer.transport.abort())
            while True:
                size = body_length(await reader.readexactly(PREFIX_SIZE), MAX_MESSAGE)
                body = await reader.readexactly(size)
                tasks.spawn(self._answer(body, writer), f"message of the {self._name}")
        except (asyncio.IncompleteReadError, ConnectionError):
            pass  # the process has ended
        finally:
            writer.transport.abort()
            if process is not None:
                status = await process.wait_or_kill(EXIT_TIMEOUT)
                write = log.warning if status else log.info
                write(f"{self._name} ended", pid=process.pid, status=str(describe_exit(status)))
            await tasks.cancel()

    async def _send(self, writer: asyncio.StreamWriter) -> None:
        """Send the state of the cell, then changes. A slow process receives merged changes, never a queue."""
        writer.write(encode(await self._reader.everything()))
        sent = time.monotonic()
        while True:
            await asyncio.sleep(PERIOD)
            if writer.is_closing():
                return
            if writer.transport.get_write_buffer_size() > MAX_UNSENT:
                continue
            update = await self._reader.changes()
            if update != EMPTY or time.monotonic() - sent > BEAT_PERIOD:
                writer.write(encode(update))
                sent = time.monotonic()

    async def _answer(self, body: bytes, writer: asyncio.StreamWriter) -> None:
        try:
            answer = await self._received(body)
        except msgspec.DecodeError as error:
            log.error(f"message of the {self._name} not understood", reason=str(error))
            return
        if answer is not None and not writer.is_closing():
            writer.write(encode(answer))

    async def _log_output(self, process: ChildProcess) -> None:
        async for line in process.output():
            log.info(f"{self._name} output", pid=process.pid, text=line)
