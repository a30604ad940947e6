"""Every operation gets valid and invalid input: no status 500, nothing undocumented."""

import asyncio
import os
import threading
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings, strategies as st

from arcor2_server.app import create_app, running_server
from arcor2_server.rest import OPERATIONS
from arcor2_server.rest.operations import Operation
from arcor2_server.settings import ServerSettings
from tests import forked_children
from tests.server.core.serving import until
from tests.server.rest.rest_client import TRANSLATION, start_workers

EXAMPLES = 8
"""Number of examples for each of about seventy operations."""


class Loop:
    """An event loop in its own thread for the server's parts, because schemathesis has none."""

    def __init__(self, directory: Path) -> None:
        self._directory = directory
        self._loop = asyncio.new_event_loop()
        self._up = threading.Event()
        self._end = asyncio.Event()
        self._thread = threading.Thread(target=self._run, name="server")
        self.app: Any = None

    def _run(self) -> None:
        with asyncio.Runner(loop_factory=lambda: self._loop) as runner:
            runner.run(self._serve())

    async def _serve(self) -> None:
        self._loop.set_default_executor(ThreadPoolExecutor(1))
        # schemathesis calls an application in this process "testserver".
        settings = ServerSettings(data_dir=self._directory, allowed_hosts=frozenset({"testserver"}))
        async with running_server(settings) as services:
            services.hosts.prepare()
            await until(lambda: forked_children.children(os.getpid(), "arcor2_hw.runtime.host"))
            await start_workers(services)
            self.app = create_app(services)
            self._up.set()
            await self._end.wait()

    def __enter__(self) -> "Loop":
        self._thread.start()
        assert self._up.wait(30)
        return self

    def __exit__(self, *_: object) -> None:
        self._loop.call_soon_threadsafe(self._end.set)
        self._thread.join(20)

    async def __call__(self, scope: Any, receive: Any, send: Any) -> None:
        """Act as an ASGI application for any event loop."""
        caller_loop = asyncio.get_running_loop()

        async def take() -> Any:
            return await asyncio.wrap_future(asyncio.run_coroutine_threadsafe(receive(), caller_loop))

        async def send_on(message: Any) -> None:
            await asyncio.wrap_future(asyncio.run_coroutine_threadsafe(send(message), caller_loop))

        work = asyncio.run_coroutine_threadsafe(self.app(scope, take, send_on), self._loop)
        await asyncio.wrap_future(work)


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Loop]:
    with Loop(tmp_path_factory.mktemp("schemathesis")) as loop:
        yield loop


@pytest.fixture(scope="module")
def api(server: Loop) -> Any:
    import schemathesis  # not by each worker that collects the tests

    return schemathesis.openapi.from_asgi("/openapi", server)


@pytest.fixture(scope="module")
def checks() -> list[Any]:
    from schemathesis.checks import not_a_server_error
    from schemathesis.specs.openapi import checks

    return [
        checks.content_type_conformance,
        checks.negative_data_rejection,
        not_a_server_error,
        checks.response_schema_conformance,
        checks.status_code_conformance,
    ]


@pytest.mark.parametrize("declared", OPERATIONS, ids=lambda one: f"{one.method} {one.path}")
def test_every_response_matches_its_schema(api: Any, checks: list[Any], declared: Operation) -> None:
    from schemathesis import GenerationMode

    operation = api[declared.path][declared.method]

    @settings(max_examples=EXAMPLES, deadline=None, database=None, derandomize=True, suppress_health_check=HealthCheck)
    @given(st.one_of([operation.as_strategy(mode) for mode in GenerationMode]))
    def ask(case: Any) -> None:
        answer = case.call_and_validate(checks=checks)
        if answer.status_code >= 400:
            assert set(answer.json()) - TRANSLATION == {"service", "message", "type", "description"}

    ask()
