"""Run `arcor2-hw demo` and other commands as processes."""

import asyncio
import signal
import sys
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import msgspec

from arcor2_server.demo.control import ask


class Run:
    """One `arcor2-hw demo` process, its output and its addresses."""

    def __init__(self, process: asyncio.subprocess.Process, data_dir: Path) -> None:
        self.process = process
        self.data_dir = data_dir
        self.output = ""

    async def read(self) -> None:
        assert self.process.stdout is not None
        while chunk := await self.process.stdout.read(4096):
            self.output += chunk.decode()

    def at(self) -> dict[str, Any] | None:
        file = self.data_dir / "demo.json"
        return msgspec.json.decode(file.read_bytes()) if file.exists() else None

    async def command_fake(self, name: str, do: str, /, **arguments: Any) -> Any:
        at = self.at()
        assert at is not None
        return await ask(at[name]["control"], do, **arguments)

    async def command(self, *words: str) -> tuple[int, str]:
        """Run `arcor2-hw` with these arguments and the demo's data directory; return status and output."""
        return await arcor2_hw(*words, "--data-dir", str(self.data_dir))


async def arcor2_hw(*words: str) -> tuple[int, str]:
    """Run `arcor2-hw`; return status and output."""
    process = await asyncio.create_subprocess_exec(
        *(sys.executable, "-m", "arcor2_server.cli.main", *words),
        stdout=asyncio.subprocess.PIPE,
        stderr=asyncio.subprocess.STDOUT,
    )
    output, _ = await asyncio.wait_for(process.communicate(), 60)
    assert process.returncode is not None
    return process.returncode, output.decode()


@asynccontextmanager
async def demo(data_dir: Path, *arguments: str) -> AsyncIterator[Run]:
    """Run a demo at full speed, and stop it at the end of the context."""
    command = [sys.executable, "-m", "arcor2_server.cli.main", "demo", "--fast", "--port", "0"]
    process = await asyncio.create_subprocess_exec(
        *command,
        *("--data-dir", str(data_dir)),
        *arguments,
        stdout=asyncio.subprocess.PIPE,
        stderr=asyncio.subprocess.STDOUT,
    )
    run = Run(process, data_dir)
    reading = asyncio.create_task(run.read())
    try:
        yield run
    finally:
        if process.returncode is None:
            process.send_signal(signal.SIGINT)
            try:
                await asyncio.wait_for(process.wait(), 20)
            except TimeoutError:
                process.kill()
                await process.wait()
        await reading
