"""The command line in the process of a test, and a server for it."""

import asyncio
import contextlib
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import pytest

from arcor2_server.cli.main import app
from tests.server.core.serving import ServerProcess


class Ran(NamedTuple):
    """The exit status and the output of a command."""

    status: int
    out: str
    err: str


def run_app(capsys: pytest.CaptureFixture[str], *arguments: str | Path) -> Ran:
    """Run a command, and return its status and its output."""
    capsys.readouterr()
    status = app([str(each) for each in arguments])
    return Ran(status, *capsys.readouterr())


@contextlib.contextmanager
def serving(data_dir: Path, *arguments: str) -> Iterator[ServerProcess]:
    """Run a server in its own process, for tests without an event loop."""
    process = ServerProcess(data_dir, *arguments)
    with asyncio.Runner() as runner:
        runner.run(process.start())
        try:
            yield process
        finally:
            runner.run(process.stop())
