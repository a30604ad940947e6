"""Child processes of the demo: started together, identified by their ready line, terminated in order."""

import asyncio
import contextlib
import signal
import sys
from pathlib import Path
from typing import IO, Any, Final

import msgspec

from arcor2_hw.exceptions import Arcor2Error

READY_TIMEOUT: Final = 20.0
"""Time limit for a child to report that it is ready, s; interpreters start slowly on a busy machine."""
END_TIMEOUT: Final = 5.0
"""Time limit for a child to end before it is killed, s."""


class ChildFailed(Arcor2Error):
    """A process of the demo did not start, or ended too early."""

    code = "child_failed"


class Child:
    """One child process. Its standard error goes to a log file; its standard output is read for the ready line."""

    def __init__(self, name: str, command: list[str], log: Path) -> None:
        self.name = name
        self._command = command
        self._log = log
        self._process: asyncio.subprocess.Process | None = None
        self._drain: asyncio.Task[None] | None = None

    @property
    def ended(self) -> bool:
        """Return whether the process has ended."""
        return self._process is not None and self._process.returncode is not None

    @property
    def pid(self) -> int:
        """Return the id of the started process."""
        assert self._process is not None
        return self._process.pid

    async def start(self) -> str:
        """Start the process and return the rest of its ready line. Raise ChildFailed with the last line of its log."""
        with self._log.open("wb") as log:
            self._process = await self._launch(log)
        assert self._process.stdout is not None
        try:
            async with asyncio.timeout(READY_TIMEOUT):
                while line := await self._process.stdout.readline():
                    text = line.decode(errors="replace").strip()
                    if text.startswith("ready"):
                        self._drain = asyncio.create_task(self._drain_output(self._process.stdout))
                        return text.removeprefix("ready").strip()
        except TimeoutError:
            await self.stop()
            raise ChildFailed(
                "{name} was not ready within {ready_timeout:g} s.",
                self._last_words(),
                name=self.name,
                ready_timeout=READY_TIMEOUT,
            ) from None
        except asyncio.CancelledError:
            await self.stop()
            raise
        await self._process.wait()
        raise ChildFailed(
            "{name} did not start: {last_words}", name=self.name, last_words=self._last_words() or "it printed no error"
        )

    async def _launch(self, log: IO[bytes]) -> asyncio.subprocess.Process:
        # In a new session: Ctrl-C in the terminal reaches only the demo, which stops the children in order.
        return await asyncio.create_subprocess_exec(
            *self._command,
            stdin=asyncio.subprocess.DEVNULL,
            stdout=asyncio.subprocess.PIPE,
            stderr=log,
            start_new_session=True,
        )

    async def start_json(self) -> dict[str, Any]:
        """Start the process and return the addresses in its ready line."""
        addresses: dict[str, Any] = msgspec.json.decode(await self.start())
        return addresses

    @staticmethod
    async def _drain_output(stream: asyncio.StreamReader) -> None:
        while await stream.read(65536):
            pass

    def _last_words(self) -> str:
        with contextlib.suppress(OSError):
            lines = [line.strip() for line in self._log.read_text(errors="replace").splitlines() if line.strip()]
            return lines[-1] if lines else ""
        return ""

    async def stop(self) -> None:
        """Terminate the process, and kill it after END_TIMEOUT."""
        process = self._process
        if process is None:
            return
        if process.returncode is None:
            with contextlib.suppress(ProcessLookupError):
                process.send_signal(signal.SIGTERM)
            try:
                async with asyncio.timeout(END_TIMEOUT):
                    await process.wait()
            except TimeoutError:
                with contextlib.suppress(ProcessLookupError):
                    process.kill()
                await process.wait()
        if self._drain is not None:
            await self._drain
            self._drain = None


def python_module(name: str, *arguments: str) -> list[str]:
    """Return the command that runs a module with this interpreter."""
    return [sys.executable, "-m", name, *arguments]
