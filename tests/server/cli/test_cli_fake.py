"""`arcor2-hw fake`: the list of fakes, one in the foreground, and injected faults."""

import json
import re
import signal
import subprocess
import sys
from collections.abc import Iterator
from importlib.metadata import EntryPoint
from pathlib import Path

import pytest

import arcor2_server.cli.installed_fakes
from arcor2_server.cli.installed_fakes import InstalledFake, installed_fakes
from tests import commands

CLI = [sys.executable, "-m", "arcor2_server.cli.main", "fake"]
FAULTS_OF_EVERY_WIRE = {"silence", "reset", "half_frame", "garbage", "slow", "refuse", "heal"}


def arcor2_hw_fake(*words: str) -> subprocess.CompletedProcess[str]:
    return commands.run(commands.CLI, "fake", *words)


class Running:
    """A process that runs `arcor2-hw fake run`."""

    def __init__(self, *words: str) -> None:
        self.process = subprocess.Popen([*CLI, "run", *words], stdout=subprocess.PIPE, text=True)
        assert self.process.stdout is not None
        self.greeting = self.process.stdout.readline()
        self.addresses: dict[str, str] = {}
        while "control" not in self.addresses:
            key, value = self.process.stdout.readline().split(maxsplit=1)
            self.addresses[key] = value.strip()

    def end(self, number: signal.Signals = signal.SIGINT) -> int:
        if self.process.poll() is None:
            self.process.send_signal(number)
        assert self.process.stdout is not None
        self.process.stdout.close()
        return self.process.wait(15)


@pytest.fixture(scope="module")
def tester() -> Iterator[Running]:
    running = Running("functional_tester", "--", "--test-time", "0.5")
    yield running
    running.end()


# ---------------------------------------------------------------------------------------------------- list
def test_every_fake_in_the_tree_is_listed_with_wire_and_text() -> None:
    listed = arcor2_hw_fake("list")
    assert listed.returncode == 0, listed.stderr
    folder = Path(arcor2_server.cli.installed_fakes.__file__).parents[2] / "fakes" / "arcor2_fakes"
    committed = {main.parent.name for main in folder.glob("*/__main__.py") if _committed(main)}
    found = {fake.name: fake for fake in installed_fakes()}
    assert committed <= set(found)
    for name in committed:
        assert found[name].problem == ""
        assert found[name].wire, name
        assert found[name].description, name
        assert re.search(rf"^{name} +{re.escape(found[name].wire)}", listed.stdout, re.MULTILINE), name


def _committed(main: Path) -> bool:
    """Return whether a fake is committed, unlike one that is just being written."""
    return (main.parent / "__init__.py").exists() and "WIRE" in (main.parent / "__init__.py").read_text()


def test_listing_loads_no_fake() -> None:
    code = "import sys; from arcor2_server.cli.fake import list_fakes; list_fakes(); print([m for m in sys.modules if"
    ran = subprocess.run(
        [sys.executable, "-c", f"{code} 'arcor2_fakes' in m or 'pymodbus' in m])"],
        capture_output=True,
        text=True,
        timeout=60,
        check=True,
    )
    assert ran.stdout.splitlines()[-1] == "[]"


@pytest.mark.parametrize(
    ("source", "expected"),
    [
        ('"""A thing.\n\nMore."""\nWIRE: str = "two wires"\n', InstalledFake("x", "fakery.x", "two wires", "A thing.")),
        ("x = 1\n", InstalledFake("x", "fakery.x")),
        ("def (:\n", "cannot be read"),
        (None, "is not installed"),
    ],
)
def test_a_fake_of_another_distribution_is_listed(
    source: str | None, expected: InstalledFake | str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "fakery").mkdir()
    (tmp_path / "fakery" / "__init__.py").write_text("raise AssertionError('imported')\n")
    if source is not None:
        (tmp_path / "fakery" / "x.py").write_text(source)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(
        arcor2_server.cli.installed_fakes,
        "entry_points",
        lambda group: [EntryPoint("x", "fakery.x", group)] if group else [],
    )
    (found,) = installed_fakes()
    if isinstance(expected, str):
        assert expected in found.problem
    else:
        assert found == expected


# ---------------------------------------------------------------------------------------------------- run
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_fake_in_the_foreground_prints_its_address_and_ends_cleanly(number: signal.Signals) -> None:
    running = Running("conveyor", "--", "--node", "7")
    assert running.greeting == "conveyor is ready; press Ctrl-C to stop it\n"
    assert running.addresses["node"] == "7"
    assert re.fullmatch(r"127\.0\.0\.1:\d+", running.addresses["can"])
    assert running.end(number) == 0


def test_run_reports_errors() -> None:
    unknown = arcor2_hw_fake("run", "toaster")
    assert unknown.returncode == 9
    assert unknown.stderr.startswith("arcor2-hw fake run: fake toaster does not exist; installed: ")
    assert arcor2_hw_fake("run", "conveyor", "--", "--node", "700").returncode == 2
    assert arcor2_hw_fake("run", "conveyor", "--", "--host", "203.0.113.1").returncode == 1


# ---------------------------------------------------------------------------------------------------- fault
def test_a_fault_is_injected_and_its_answer_printed(tester: Running) -> None:
    control = tester.addresses["control"]
    done = arcor2_hw_fake("fault", control, "slow", "--seconds", "0.2", "--wire", "modbus")
    assert (done.returncode, done.stdout) == (0, f"{control}: slow done\n")
    assert arcor2_hw_fake("fault", control, "heal").returncode == 0
    assert arcor2_hw_fake("fault", control, "push_door", "opening=true").returncode == 0
    assert arcor2_hw_fake("fault", control, "put_board", "code=PCB-1", "defect=short").returncode == 0
    truth = arcor2_hw_fake("fault", control, "truth")
    assert json.loads(truth.stdout)["board"] == "PCB-1"


def test_without_a_fault_the_available_ones_are_listed(tester: Running) -> None:
    listed = arcor2_hw_fake("fault", tester.addresses["control"])
    assert listed.returncode == 0
    commands = {line.split()[0]: line for line in listed.stdout.splitlines()[2:]}
    assert set(commands) >= FAULTS_OF_EVERY_WIRE
    assert re.match(
        r"slow +\[wire\] seconds=1\.0 +Let the wire send everything so many seconds late\.", commands["slow"]
    )
    assert re.match(r"put_board +code \[defect\]", commands["put_board"])


@pytest.mark.parametrize(
    ("words", "status", "message"),
    [
        (["toast"], 1, "refuses: toast: unknown command"),
        (["silence", "--wire", "toast"], 1, "wire 'toast' does not exist; available: modbus"),
        (["slow", "--seconds", "1000"], 1, "seconds must be 0 to 600"),
        (["put_board"], 1, "code"),
        (["put_board", "PCB-1"], 2, "'PCB-1' must be key=value"),
    ],
)
def test_an_unknown_fault_is_reported_in_one_line(tester: Running, words: list[str], status: int, message: str) -> None:
    ran = arcor2_hw_fake("fault", tester.addresses["control"], *words)
    assert ran.returncode == status
    assert message in ran.stderr
    assert ran.stderr.startswith("arcor2-hw fake fault: ")
    assert len(ran.stderr.splitlines()) == 1


def test_names_are_read_from_the_running_demo(tester: Running, tmp_path: Path) -> None:
    demo = {
        "url": "ws://127.0.0.1:1",
        "tester": {"control": tester.addresses["control"]},
        "reader": {"control": "127.0.0.1:1"},
    }
    no_demo = arcor2_hw_fake("fault", "tester", "heal", "--data-dir", str(tmp_path))
    assert (no_demo.returncode, "no demo is running" in no_demo.stderr) == (9, True)
    (tmp_path / "demo.json").write_text(json.dumps(demo))
    assert arcor2_hw_fake("fault", "tester", "heal", "--data-dir", str(tmp_path)).returncode == 0
    unknown = arcor2_hw_fake("fault", "url", "heal", "--data-dir", str(tmp_path))
    assert (unknown.returncode, "the demo has no url; it has tester, reader" in unknown.stderr) == (9, True)
    gone = arcor2_hw_fake("fault", "reader", "heal", "--data-dir", str(tmp_path))
    assert gone.returncode == 7
    assert "127.0.0.1:1 does not answer: connection refused" in gone.stderr
