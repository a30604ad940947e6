"""One server process for the tests of a module."""

import asyncio
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.postgresql import lasting
from tests.server.core.serving import ServerProcess


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ServerProcess]:
    """Start a server with short time-outs of locks."""
    directory: Path = tmp_path_factory.mktemp("server") / "data"
    with lasting(directory), asyncio.Runner() as runner:
        process = ServerProcess(
            directory,
            ARCOR2_ARSERVER_LOCK_TIMEOUT="0.3",
            ARCOR2_ARSERVER_LOCK_RETRIES="2",
            ARCOR2_ARSERVER_LOCK_RETRY_WAIT="0.05",
        )
        runner.run(process.start())
        yield process
        assert runner.run(process.stop()) == 0
