"""`arcor2-hw alarms`: a damaged file is an alarm that is listed, shelved, acknowledged and counted."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from arcor2_server.cli.exit_status import ExitStatus
from tests.server.cli.in_process import Ran, run_app, serving
from tests.server.core.serving import ServerProcess


@pytest.fixture
def server(tmp_path: Path) -> Iterator[ServerProcess]:
    data = tmp_path / "data"
    data.mkdir()
    (data / "markers.json").write_text("damaged")
    with serving(data) as process:
        yield process


def test_alarm_is_listed_shelved_and_acknowledged(server: ServerProcess, capsys: pytest.CaptureFixture[str]) -> None:
    def alarms(*arguments: str) -> Ran:
        return run_app(capsys, "alarms", *arguments, "--url", server.url)

    status, listed, _ = alarms("list")
    assert status == ExitStatus.OK
    head, row, *_ = listed.splitlines()
    assert head.split()[:3] == ["number", "raised", "priority"]
    assert row.startswith("1 ")
    assert "markers.json is damaged" in row

    assert alarms("shelve", "1", "--note", "spare part", "--user", "Theo")[0] == ExitStatus.OK
    assert alarms("list")[1] == "There are no alarms.\n"
    assert "shelved until" in alarms("list", "--show", "shelved")[1]
    assert alarms("shelve", "1", "--hours", "0")[0] == ExitStatus.OK
    assert alarms("shelve", "1", "--hours", "9")[0] != ExitStatus.OK

    assert alarms("acknowledge", "1", "--user", "Theo")[0] == ExitStatus.OK
    assert alarms("list")[1] == "There are no alarms.\n"
    assert "acknowledged by Theo" in alarms("list", "--show", "all")[1]
    status, _, error = alarms("acknowledge", "1")
    assert status == ExitStatus.FAILED
    assert "already acknowledged by Theo" in error
    assert "does not exist" in alarms("acknowledge", "7")[2]

    frequent, longest = alarms("statistics")[1].split("longest")
    assert "markers.json is damaged" in frequent
    assert "none" in longest
