"""The server's parts in this process, and their REST services without a network."""

import asyncio
import os
from collections.abc import AsyncIterator, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import httpx
import pytest
import pytest_asyncio

from arcor2_server.app import Server, running_server
from arcor2_server.settings import ServerSettings
from tests import forked_children
from tests.server.core.serving import ServerProcess, until
from tests.server.rest.rest_client import rest_client, start_workers


@pytest_asyncio.fixture(scope="module", loop_scope="module")
async def services(tmp_path_factory: pytest.TempPathFactory) -> AsyncIterator[Server]:
    """Start all parts, for the tests of a module."""
    directory: Path = tmp_path_factory.mktemp("rest")
    # Wait for parts that start late, so that no test pays for their start.
    with ThreadPoolExecutor(1) as executor:
        asyncio.get_running_loop().set_default_executor(executor)
        async with running_server(ServerSettings(data_dir=directory)) as parts:
            parts.hosts.prepare()
            await until(lambda: forked_children.children(os.getpid(), "arcor2_hw.runtime.host"))
            await start_workers(parts)
            yield parts


@pytest_asyncio.fixture(scope="module", loop_scope="module")
async def http(services: Server) -> AsyncIterator[httpx.AsyncClient]:
    """Return a REST client of the server's parts."""
    async with rest_client(services) as client:
        yield client


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ServerProcess]:
    """Start a server in its own process."""
    process = ServerProcess(tmp_path_factory.mktemp("server") / "data")
    with asyncio.Runner() as runner:
        runner.run(process.start())
        yield process
        assert runner.run(process.stop()) == 0
