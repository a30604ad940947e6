"""The service manager is told that the server is ready, that its event loop runs, and that it ends."""

import asyncio
import contextlib
import os
import shutil
import socket
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from arcor2_server import deployment
from arcor2_server.deployment.service_manager import ServiceManager
from tests.server.core.serving import running

UNIT = Path(deployment.__file__).with_name("arcor2-hw.service")
START_TIME = 3
"""Time that a start of the server takes, s, with a margin for a slow computer."""


@pytest.fixture
def received(tmp_path: Path) -> Iterator[socket.socket]:
    """Listen as the service manager at `tmp_path / notify`."""
    with contextlib.closing(socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)) as listener:
        listener.bind(str(tmp_path / "notify"))
        listener.setblocking(False)
        yield listener


async def _next(listener: socket.socket) -> str:
    async with asyncio.timeout(30):
        return (await asyncio.get_running_loop().sock_recv(listener, 4096)).decode()


def _drain(listener: socket.socket) -> None:
    with contextlib.suppress(BlockingIOError):
        while listener.recv(4096):
            pass


async def test_a_server_reports_its_states(received: socket.socket, tmp_path: Path) -> None:
    environment = {"NOTIFY_SOCKET": str(tmp_path / "notify"), "WATCHDOG_USEC": "300000", "WATCHDOG_PID": ""}
    async with running(tmp_path / "data", **environment) as server:
        assert [await _next(received) for _ in range(3)] == ["READY=1", "WATCHDOG=1", "WATCHDOG=1"]
        server.process.send_signal(15)
        while (state := await _next(received)) != "STOPPING=1":
            assert state == "WATCHDOG=1"
        assert await server.ended() == 0


async def test_an_event_loop_that_hangs_is_not_reported(received: socket.socket, tmp_path: Path) -> None:
    ServiceManager(str(tmp_path / "notify"), 0.03).ready()
    assert await _next(received) == "READY=1"
    assert await _next(received) == "WATCHDOG=1"
    _drain(received)
    time.sleep(0.1)  # the event loop hangs
    with pytest.raises(BlockingIOError):
        received.recv(4096)
    assert await _next(received) == "WATCHDOG=1"


async def test_the_abstract_namespace_works() -> None:
    with contextlib.closing(socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)) as listener:
        name = f"arcor2-hw-test-{os.getpid()}"
        listener.bind(f"\0{name}")
        listener.setblocking(False)
        ServiceManager(f"@{name}", 0).stopping()
        assert await _next(listener) == "STOPPING=1"


def test_the_unit_restarts_a_server_that_hangs_within_10_s() -> None:
    unit = dict(
        line.split("=", 1) for line in UNIT.read_text().splitlines() if line.startswith(("Type", "Watch", "Restart"))
    )
    assert (unit["Type"], unit["Restart"]) == ("notify", "always")
    assert int(unit["WatchdogSec"]) + int(unit["RestartSec"]) + START_TIME <= 10


@pytest.mark.skipif(shutil.which("systemd-analyze") is None, reason="systemd is not installed")
def test_the_unit_is_hardened() -> None:
    command = ["systemd-analyze", "security", "--offline=true", "--threshold=30", "--no-pager", str(UNIT)]
    checked = subprocess.run(command, capture_output=True, text=True, check=False)
    assert checked.returncode == 0, checked.stdout + checked.stderr


@pytest.mark.parametrize(("process", "reports"), [("", True), ("own", True), ("1", False)])
async def test_only_the_watched_process_reports(
    process: str, reports: bool, received: socket.socket, tmp_path: Path
) -> None:
    process = str(os.getpid()) if process == "own" else process
    environment = {"NOTIFY_SOCKET": str(tmp_path / "notify"), "WATCHDOG_USEC": "30000", "WATCHDOG_PID": process}
    ServiceManager.from_environment(environment).ready()
    assert environment == {}, "children do not report to the service manager"
    assert await _next(received) == "READY=1"
    if reports:
        assert await _next(received) == "WATCHDOG=1"
    else:
        with pytest.raises(BlockingIOError):
            received.recv(4096)


async def test_without_a_service_manager_nothing_is_sent() -> None:
    manager = ServiceManager.from_environment({})
    manager.ready()
    manager.stopping()


async def test_a_missing_service_manager_does_not_end_the_server(tmp_path: Path) -> None:
    ServiceManager(str(tmp_path / "missing"), 0).ready()
