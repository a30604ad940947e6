"""The service manager is notified that the server is ready, that its event loop runs, and that it ends."""

import asyncio
import contextlib
import os
import shutil
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from packaging.version import Version

from arcor2_server import deployment
from arcor2_server.deployment import installation, upgrade
from arcor2_server.deployment.service_manager import ServiceManager
from tests.server.core.serving import running

FOLDER = Path(deployment.__file__).parent
UNITS = [FOLDER / name for name in installation.UNITS]
COMMAND = (sys.executable, "-P", "-m", "arcor2_server.cli.main")
NO_BROKER = ("--broker", "nats://127.0.0.1:1")
START_TIME = 3
"""Time that a start of the server takes, s, with a margin for a slow computer."""


@pytest.fixture
def listener(tmp_path: Path) -> Iterator[socket.socket]:
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


async def test_a_server_reports_its_states(listener: socket.socket, tmp_path: Path) -> None:
    environment = {"NOTIFY_SOCKET": str(tmp_path / "notify"), "WATCHDOG_USEC": "300000", "WATCHDOG_PID": ""}
    async with running(tmp_path / "data", **environment) as server:
        assert [await _next(listener) for _ in range(3)] == ["READY=1", "WATCHDOG=1", "WATCHDOG=1"]
        server.process.send_signal(15)
        while (state := await _next(listener)) != "STOPPING=1":
            assert state == "WATCHDOG=1"
        assert await server.ended() == 0


@pytest.mark.parametrize("command", ["node run press", "fleet serve --port 0"])
async def test_a_node_and_the_page_of_a_fleet_report_their_states(
    listener: socket.socket, tmp_path: Path, command: str
) -> None:
    """Both are ready before they can reach the broker."""
    environment = os.environ | {"NOTIFY_SOCKET": str(tmp_path / "notify"), "WATCHDOG_USEC": "300000"}
    arguments = (*command.split(), *NO_BROKER, "--data-dir", str(tmp_path / "data"))
    process = await asyncio.create_subprocess_exec(*COMMAND, *arguments, env=environment, stdout=subprocess.DEVNULL)
    try:
        assert [await _next(listener) for _ in range(3)] == ["READY=1", "WATCHDOG=1", "WATCHDOG=1"]
        process.send_signal(15)
        while (state := await _next(listener)) != "STOPPING=1":
            assert state == "WATCHDOG=1"
        async with asyncio.timeout(30):
            assert await process.wait() == 0
    finally:
        with contextlib.suppress(ProcessLookupError):
            process.kill()


async def test_an_event_loop_that_hangs_is_not_reported(listener: socket.socket, tmp_path: Path) -> None:
    ServiceManager(str(tmp_path / "notify"), 0.03).ready()
    assert await _next(listener) == "READY=1"
    assert await _next(listener) == "WATCHDOG=1"
    _drain(listener)
    time.sleep(0.1)  # the event loop hangs
    with pytest.raises(BlockingIOError):
        listener.recv(4096)
    assert await _next(listener) == "WATCHDOG=1"


async def test_a_socket_in_the_abstract_namespace_is_notified() -> None:
    with contextlib.closing(socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)) as listener:
        name = f"arcor2-hw-test-{os.getpid()}"
        listener.bind(f"\0{name}")
        listener.setblocking(False)
        ServiceManager(f"@{name}", 0).stopping()
        assert await _next(listener) == "STOPPING=1"


def settings(unit: Path) -> dict[str, str]:
    return dict(line.split("=", 1) for line in unit.read_text().splitlines() if "=" in line and line[0].isupper())


@pytest.mark.parametrize("file", UNITS, ids=installation.UNITS)
def test_the_units_restart_a_process_that_hangs_within_10_s(file: Path) -> None:
    unit = settings(file)
    assert (unit["Type"], unit["Restart"]) == ("notify", "always")
    assert int(unit["WatchdogSec"]) + int(unit["RestartSec"]) + START_TIME <= 10


@pytest.mark.skipif(shutil.which("systemd-analyze") is None, reason="systemd is not installed")
@pytest.mark.parametrize("file", UNITS, ids=installation.UNITS)
def test_the_units_are_hardened(file: Path) -> None:
    command = ["systemd-analyze", "security", "--offline=true", "--threshold=30", "--no-pager", str(file)]
    checked = subprocess.run(command, capture_output=True, text=True, check=False)
    assert checked.returncode == 0, checked.stdout + checked.stderr


def test_the_services_cannot_read_the_data_of_each_other() -> None:
    for unit in UNITS:
        found = settings(unit)
        others = {f"-/var/lib/{each}" for each in (installation.NAME, installation.NODE, installation.FLEET)}
        assert set(found["InaccessiblePaths"].split()) == others - {f"-/var/lib/{found['StateDirectory']}"}
        assert found["WorkingDirectory"] == f"/var/lib/{found['StateDirectory']}"


def test_an_installation_has_all_units(tmp_path: Path) -> None:
    command = tmp_path / "opt/arcor2-hw/0.1.0/bin/arcor2-hw"
    command.parent.mkdir(parents=True)
    command.touch()
    installation.Installation(tmp_path).select(Version("0.1.0"))
    found = {path.name: path.read_text() for path in (tmp_path / "etc/systemd/system").iterdir()}
    assert sorted(found) == sorted(installation.UNITS)
    assert all("/opt/arcor2-hw/current/bin/arcor2-hw" in text for text in found.values())


@pytest.mark.parametrize("server", ["enabled", "disabled"])
def test_an_upgrade_restarts_the_services_that_ran(server: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """A computer that is only a node has a disabled server, which must not start."""
    active = {"arcor2-hw-node@press.service"} | ({"arcor2-hw.service"} if server == "enabled" else set())

    def systemctl(command: list[str], *_: object) -> str:
        match command[1:]:
            case ["list-units", *_]:
                lines = [f"{unit} loaded active running it runs" for unit in active if unit.startswith("arcor2-hw-")]
                return "\n".join(lines)
            case ["show", *_]:
                return f"UnitFileState={server}\n"
            case ["stop", *units]:
                active.difference_update(units)
            case ["start", *units]:
                active.update(units)
        return ""

    monkeypatch.setattr(upgrade, "run", systemctl)
    before, services = set(active), upgrade.Systemd()
    services.stop(1.0)
    assert active == set()
    services.stop(1.0)  # of a new version that did not start
    services.start(1.0)
    assert active == before


@pytest.mark.parametrize(("process", "reports"), [("", True), ("own", True), ("1", False)])
async def test_only_the_watched_process_reports(
    process: str, reports: bool, listener: socket.socket, tmp_path: Path
) -> None:
    process = str(os.getpid()) if process == "own" else process
    environment = {"NOTIFY_SOCKET": str(tmp_path / "notify"), "WATCHDOG_USEC": "30000", "WATCHDOG_PID": process}
    ServiceManager.from_environment(environment).ready()
    assert environment == {}, "children do not report to the service manager"
    assert await _next(listener) == "READY=1"
    if reports:
        assert await _next(listener) == "WATCHDOG=1"
    else:
        with pytest.raises(BlockingIOError):
            listener.recv(4096)


async def test_without_a_service_manager_nothing_is_sent() -> None:
    manager = ServiceManager.from_environment({})
    manager.ready()
    manager.stopping()


async def test_a_missing_service_manager_does_not_end_the_server(tmp_path: Path) -> None:
    ServiceManager(str(tmp_path / "missing"), 0).ready()
