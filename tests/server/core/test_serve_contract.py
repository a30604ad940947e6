"""The contract of `arcor2-hw serve` for scripts: ready line, clean end, exit statuses."""

import asyncio
import json
import re
import signal
import socket
import sys
import urllib.request
from collections.abc import Iterator
from pathlib import Path

import psutil
import pytest

from arcor2_server.cli.exit_status import ExitStatus
from tests.server.core import serving
from tests.server.core.serving import COMMAND, ServerProcess, running, talking


@pytest.fixture(scope="module", autouse=True)
def real_command() -> Iterator[None]:
    """Start the real command instead of a fork of a process that has imported it."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(ServerProcess, "forked", False)
        yield


async def run(*arguments: str) -> tuple[int, str, str]:
    process = await asyncio.create_subprocess_exec(
        *COMMAND, *arguments, stdout=asyncio.subprocess.PIPE, stderr=asyncio.subprocess.PIPE
    )
    async with asyncio.timeout(60):
        out, err = await process.communicate()
    assert process.returncode is not None
    return process.returncode, out.decode(), err.decode()


async def refused_start(*arguments: str) -> tuple[int, str]:
    """Start a server that must fail: nothing on standard output, one line on standard error."""
    status, out, err = await run("serve", *arguments)
    assert out == ""
    lines = err.splitlines()
    assert len(lines) == 1, err
    assert lines[0].startswith("arcor2-hw serve: ")
    assert "Traceback" not in err
    return status, lines[0]


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
async def test_ready_line_and_end(tmp_path: Path, number: signal.Signals) -> None:
    server = ServerProcess(tmp_path / "deep" / "data")
    server.log = tmp_path / "log"
    await server.start()
    assert re.fullmatch(r"ws://127\.0\.0\.1:\d+", server.url)
    async with talking(server.url, "ann") as talker:
        await talker.granted("SystemInfo")
        server.process.send_signal(number)
        assert await server.stop() == 0
        await talker.socket.wait_closed()
        assert talker.socket.close_code == 1012
    assert "Traceback" not in server.log.read_text()


async def test_the_test_helper_ends_a_server_that_is_not_ready_in_time(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(serving, "READY_TIMEOUT", 0.01)
    server = ServerProcess(tmp_path / "data")
    with pytest.raises(TimeoutError, match="not ready"):
        await server.start()
    assert not psutil.pid_exists(server.process.pid)


async def test_a_used_port_is_reported(tmp_path: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as other:
        port = str(other.getsockname()[1])
        status, line = await refused_start("--port", port, "--data-dir", str(tmp_path / "data"))
    assert status == ExitStatus.PORT_TAKEN
    assert port in line


async def test_an_address_of_another_machine_is_reported(tmp_path: Path) -> None:
    arguments = ("--host", "192.0.2.1", "--insecure", "--port", "0", "--data-dir", str(tmp_path / "data"))
    status, line = await refused_start(*arguments)
    assert status == ExitStatus.PORT_TAKEN
    assert "192.0.2.1" in line


async def test_a_directory_that_cannot_be_created_is_reported(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("in the way")
    directory = tmp_path / "file" / "data"
    status, line = await refused_start("--port", "0", "--data-dir", str(directory))
    assert status == ExitStatus.DATA_UNUSABLE
    assert str(directory) in line


async def test_a_directory_that_is_not_writable_is_reported() -> None:
    status, line = await refused_start("--port", "0", "--data-dir", "/proc/arcor2-hw")
    assert status == ExitStatus.DATA_UNUSABLE
    assert "/proc/arcor2-hw" in line


async def test_a_corrupt_database_is_reported(tmp_path: Path) -> None:
    (tmp_path / "documents.sqlite").write_bytes(b"\x00garbage" * 1000)
    status, line = await refused_start("--port", "0", "--data-dir", str(tmp_path))
    assert status == ExitStatus.DATABASE_UNUSABLE
    assert str(tmp_path / "documents.sqlite") in line


async def test_a_second_server_on_one_directory_is_refused(tmp_path: Path) -> None:
    async with running(tmp_path / "data"):
        status, line = await refused_start("--port", "0", "--data-dir", str(tmp_path / "data"))
    assert status == ExitStatus.DATA_IN_USE
    assert str(tmp_path / "data") in line


@pytest.mark.parametrize("arguments", [("--port", "x"), ("--port", "70000"), ("--nonsense",)])
async def test_an_invalid_command_line_is_reported(arguments: tuple[str, ...]) -> None:
    status, _, err = await run("serve", *arguments)
    assert status == ExitStatus.USAGE
    assert "Traceback" not in err
    assert err


async def test_an_invalid_environment_is_reported(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ARCOR2_ARSERVER_LOCK_TIMEOUT", "soon")
    status, line = await refused_start("--port", "0", "--data-dir", str(tmp_path))
    assert status == ExitStatus.USAGE
    assert "ARCOR2_ARSERVER_LOCK_TIMEOUT" in line


async def test_killed_server_starts_again(tmp_path: Path) -> None:
    async with running(tmp_path / "data") as server:
        server.process.kill()
        await server.ended()
    async with running(tmp_path / "data") as server, talking(server.url) as talker:
        await talker.granted("ListScenes")


async def test_version_and_help() -> None:
    status, out, _ = await run("--version")
    assert status == 0
    assert re.fullmatch(r"arcor2-hw \d+\.\d+\.\d+\S*\n", out)
    for command in ("serve", "demo", "package", "device", "analyse"):
        status, out, err = await run(command, "--help")
        assert (status, err) == (0, "")
        assert command in out
    status, _, err = await run("no-such-command")
    assert status == ExitStatus.USAGE
    assert "no-such-command" in err


def fetch(url: str) -> tuple[int, bytes]:
    with urllib.request.urlopen(url, timeout=60) as answer:
        return answer.status, answer.read()


async def test_rest_and_websocket_share_the_port(server: ServerProcess) -> None:
    base = server.url.replace("ws://", "http://")
    assert await asyncio.to_thread(fetch, base + "/healthz/ready") == (200, b"")
    status, body = await asyncio.to_thread(fetch, base + "/openapi/openapi.json")
    document = json.loads(body)
    assert status == 200
    assert document["openapi"].startswith("3.0")
    assert "/healthz/ready" in document["paths"]
    with pytest.raises(urllib.error.HTTPError) as missing:
        await asyncio.to_thread(fetch, base + "/no/such/route")
    assert missing.value.code == 404
    missing.value.close()


def test_idle_memory_is_limited(server: ServerProcess) -> None:
    """The whole server, spare host included, needs far less; an unexpected heavy import exceeds the limit."""
    process = psutil.Process(server.process.pid)
    assert process.memory_full_info().pss < 150 * 1024 * 1024


async def test_server_imports_no_driver_and_no_heavy_numerics() -> None:
    code = (
        "import sys, arcor2_server.app\n"
        "heavy = {'scipy', 'cv2', 'open3d', 'pinocchio', 'arcor2_drivers', 'arcor2_fakes', 'alembic'}\n"
        "print(sorted(heavy & set(sys.modules)))"
    )
    process = await asyncio.create_subprocess_exec(sys.executable, "-c", code, stdout=asyncio.subprocess.PIPE)
    out, _ = await process.communicate()
    assert out.decode().strip() == "[]"
