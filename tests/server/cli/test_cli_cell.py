"""`arcor2-hw cell`: mode, authority and jobs of a running server."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from arcor2_server.cli.exit_status import ExitStatus
from tests.server.cli.in_process import run_app, serving
from tests.server.core.serving import ServerProcess


@pytest.fixture
def server(tmp_path: Path) -> Iterator[ServerProcess]:
    with serving(tmp_path / "data", "--plc-modbus", "127.0.0.1:0") as process:
        yield process


def test_mode_authority_and_jobs_are_shown_and_changed(
    server: ServerProcess, capsys: pytest.CaptureFixture[str]
) -> None:
    def cell(*arguments: str) -> str:
        ran = run_app(capsys, "cell", *arguments, "--url", server.url)
        assert ran.status == ExitStatus.OK, ran.err
        return ran.out

    assert "state stopped, mode produce, authority hub" in cell("show")
    assert "mode changeover" in cell("mode", "changeover")
    cell("job", "7", "pkg_b")
    assert [line.split() for line in cell("job", "3", "pkg_a").splitlines()[-2:]] == [["3", "pkg_a"], ["7", "pkg_b"]]
    assert "pkg_b" not in cell("job", "7")
    shown = cell("authority", "plc")
    assert "authority plc" in shown
    assert "PLC not connected, its life counter does not change" in shown


def test_an_address_without_a_port_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    ran = run_app(capsys, "serve", "--plc-modbus", "127.0.0.1")
    assert (ran.status, "--plc-modbus" in ran.err) == (ExitStatus.USAGE, True)
