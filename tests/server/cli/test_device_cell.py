"""`arcor2-hw device export`, `check` and `scan`, from the command line, on fakes."""

import asyncio
import json
import os
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from arcor2_hw.client import Client
from arcor2_hw.data import rpc
from arcor2_hw.data.cell import Cell, CellDevice, read_cell, write_cell
from arcor2_hw.data.geometry import Pose
from arcor2_hw.data.parameter import Parameter
from arcor2_server.cli.main import app
from tests import commands
from tests.fakes.conftest import FakeProcess
from tests.server.core.serving import running

UNREACHABLE = "socket://127.0.0.1:9"


def arcor2_hw(*arguments: str, **environment: str) -> "subprocess.CompletedProcess[str]":
    return commands.run(commands.CLI, *arguments, env=os.environ | environment)


@pytest.fixture(scope="module")
def scale() -> Iterator[FakeProcess]:
    fake = FakeProcess("scale", "--tcp", "127.0.0.1:0")
    fake.control.do("heal")
    yield fake
    fake.end()


def cell_file(directory: Path, *devices: CellDevice) -> str:
    file = directory / "cell.yaml"
    file.write_bytes(write_cell(Cell(list(devices))))
    return str(file)


# ------------------------------------------------------------------------------------------------ check
def test_a_reachable_device_is_checked(tmp_path: Path, scale: FakeProcess) -> None:
    port = scale.ready["port"]
    received = len(scale.truth()["received"])
    done = arcor2_hw("device", "check", cell_file(tmp_path, CellDevice("balance", "MtSicsScale", {"port": port})))
    assert done.returncode == 0, done.stderr
    header, row = done.stdout.splitlines()
    assert header.split()[:6] == ["name", "type", "address", "connection", "identity", "health"]
    for word in ("balance", "MtSicsScale", port, "online", "MS3002S", "normal"):
        assert word in row
    commands = set(scale.truth()["received"][received:])
    assert commands, "the device received no commands"
    assert not [line for line in commands if line.split()[0] in ("T", "Z", "TI", "ZI", "TA", "TAC", "@")], commands


def test_every_problem_is_reported(tmp_path: Path, scale: FakeProcess) -> None:
    file = cell_file(
        tmp_path,
        CellDevice("balance", "MtSicsScale", {"port": scale.ready["port"]}),
        CellDevice("printer", "ZplPrinter", {"port": UNREACHABLE}),
        CellDevice("stranger", "Unknown"),
        CellDevice("typo", "MtSicsScale", {"prt": 7}),
    )
    done = arcor2_hw("device", "check", file, "--json")
    assert done.returncode == 12, done.stdout
    assert done.stderr == "arcor2-hw device check: not ready: printer, stranger, typo\n"
    found: dict[str, Any] = {one["name"]: one for one in json.loads(done.stdout)}
    assert list(found) == ["balance", "printer", "stranger", "typo"], "in the order of the file"
    assert found["balance"]["problem"] == ""
    assert found["balance"]["connection"] == "online"
    assert 0.0 < found["balance"]["seconds"] < 10.0
    assert "printer" in found["printer"]["problem"]
    assert UNREACHABLE in found["printer"]["problem"]
    assert found["printer"]["connection"] == "failed"
    assert found["stranger"]["problem"] == "object type Unknown is not installed and was not uploaded"
    assert "typo: Mettler Toledo scale has no setting prt" in found["typo"]["problem"]


CRASHER = """
import os
from arcor2_hw.objects import Generic
class Crasher(Generic):
    _ABSTRACT = False
    def connect(self, timeout: float = 1.0) -> None:
        os.kill(os.getpid(), 9)
"""


def test_a_crashing_driver_does_not_hide_other_results(tmp_path: Path, scale: FakeProcess) -> None:
    package = tmp_path / "object_types"
    package.mkdir()
    (package / "__init__.py").touch()
    (package / "crasher.py").write_text(CRASHER)
    balance = CellDevice("balance", "MtSicsScale", {"port": scale.ready["port"]})
    file = cell_file(tmp_path, CellDevice("bad", "Crasher"), balance)
    done = arcor2_hw("device", "check", file, "--json", PYTHONPATH=str(tmp_path))
    assert done.returncode == 12, done.stdout
    found = {one["name"]: one for one in json.loads(done.stdout)}
    assert "ended the process with status -9" in found["bad"]["problem"]
    assert found["balance"]["problem"] == ""


@pytest.mark.parametrize(("text", "status"), [(None, 9), ("devices: 3", 11)])
def test_an_invalid_file_is_reported_in_one_line(tmp_path: Path, text: str | None, status: int) -> None:
    file = tmp_path / "cell.yaml"
    if text is not None:
        file.write_text(text)
    done = arcor2_hw("device", "check", str(file))
    assert done.returncode == status
    assert len(done.stderr.splitlines()) == 1
    assert "cell.yaml" in done.stderr


# ------------------------------------------------------------------------------------------------ export
async def test_a_scene_becomes_a_cell_file_that_can_be_read(tmp_path: Path) -> None:
    async with running(tmp_path / "data") as server, Client(server.url, "ann") as client:
        none = await asyncio.to_thread(arcor2_hw, "device", "export", "--url", server.url)
        assert none.returncode == 9
        assert "has no scenes" in none.stderr
        await client.call("NewScene", rpc.NewSceneArgs("bench"))
        port = [Parameter("port", "string", f'"{UNREACHABLE}"'), Parameter("baud_rate", "integer", "4800")]
        await client.call("AddObjectToScene", rpc.AddObjectToSceneArgs("balance", "MtSicsScale", parameters=port))
        host = [Parameter("host", "string", '"127.0.0.1"')]
        tester = rpc.AddObjectToSceneArgs("tester", "FunctionalTester", Pose(), parameters=host)
        await client.call("AddObjectToScene", tester)
        await client.call("SaveScene")
        for arguments in ([], ["--scene", "bench"]):
            done = await asyncio.to_thread(arcor2_hw, "device", "export", *arguments, "--url", server.url)
            assert done.returncode == 0, done.stderr
        missing = await asyncio.to_thread(arcor2_hw, "device", "export", "--scene", "moon", "--url", server.url)
        assert missing.returncode == 9
        assert "moon" in missing.stderr
    file = tmp_path / "cell.yaml"
    file.write_text(done.stdout)
    cell = read_cell(file)
    assert [(each.name, each.type) for each in cell.devices] == [
        ("balance", "MtSicsScale"),
        ("tester", "FunctionalTester"),
    ]
    balance, tester_device = cell.devices
    assert balance.settings["port"] == UNREACHABLE
    assert balance.settings["baud_rate"] == 4800
    assert tester_device.pose == Pose()


def test_a_missing_server_is_reported() -> None:
    done = arcor2_hw("device", "export", "--url", "ws://127.0.0.1:9")
    assert done.returncode == 7
    assert "ws://127.0.0.1:9" in done.stderr


# ------------------------------------------------------------------------------------------------ scan
@pytest.fixture(scope="module")
def belt() -> Iterator[FakeProcess]:
    fake = FakeProcess("conveyor", "--node", "17")
    fake.control.do("heal")
    yield fake
    fake.end()


SERIAL = """
from types import SimpleNamespace as N
def comports():
    nothing = Port("/dev/ttyS0", "n/a", "n/a", None, None, None)
    return [nothing, Port("/dev/ttyUSB3", "Scale", "USB", 0x403, 0x6001, "A5")]
class Port(tuple):
    def __new__(cls, *fields):
        return super().__new__(cls, fields)
    device, description, hwid, vid, pid, serial_number = (property(lambda self, i=i: self[i]) for i in range(6))
"""
DEPTHAI = """
from types import SimpleNamespace as N
class Device:
    @staticmethod
    def getAllAvailableDevices():
        print("[warning] a library that prints")
        where = N(name="X_LINK_UNBOOTED"), N(name="X_LINK_USB_VSC")
        return [N(name="3.1", state=where[0], protocol=where[1], getDeviceId=lambda: "18443010")]
"""


@pytest.fixture
def libraries(tmp_path: Path) -> str:
    """Write simulated vendor libraries that report connected devices, and return their directory."""
    (tmp_path / "serial" / "tools").mkdir(parents=True)
    for empty in ("serial/__init__.py", "serial/tools/__init__.py"):
        (tmp_path / empty).touch()
    (tmp_path / "serial" / "tools" / "list_ports.py").write_text(SERIAL)
    (tmp_path / "depthai.py").write_text(DEPTHAI)
    return str(tmp_path)


def test_scan_lists_ports_and_cameras(libraries: str) -> None:
    done = arcor2_hw("device", "scan", PYTHONPATH=libraries)
    assert done.returncode == 0, done.stderr
    _, *rows = done.stdout.splitlines()
    assert [row.split()[:3] for row in rows] == [["serial", "port", "/dev/ttyUSB3"], ["OAK", "camera", "3.1"]]
    assert "0403:6001" in rows[0]
    assert "18443010" in rows[1]


@pytest.mark.parametrize("adapter", ["slcan:socket://{can}", "socketcand:{socketcand}/can0"])
def test_scan_lists_the_nodes_of_a_can_bus(belt: FakeProcess, adapter: str) -> None:
    before = belt.truth()
    bus = adapter.format(**belt.ready)
    done = arcor2_hw("device", "scan", "--no-oak", "--can", bus, "--json")
    assert done.returncode == 0, done.stderr
    (node,) = [one for one in json.loads(done.stdout) if one["kind"] == "CAN node"]
    assert node["address"] == bus
    assert node["description"].startswith("node 17, ")
    assert "profile 402" in node["description"]
    assert node["serial"]
    after = belt.truth()
    assert after["state"] == before["state"], "the scan only reads"


@pytest.mark.parametrize(
    ("bus", "expected"),
    [
        ("can0", "is not a CAN bus"),
        ("slcan:/dev/ttyX@fast", "is not a bit rate"),
        ("slcan:/dev/does-not-exist", "cannot be opened"),
    ],
)
def test_an_unusable_bus_is_reported(bus: str, expected: str) -> None:
    done = arcor2_hw("device", "scan", "--no-oak", "--can", bus)
    assert done.returncode == 1
    (line,) = done.stderr.splitlines()
    assert bus in line
    assert expected in line


def test_a_crashing_library_does_not_hide_other_results(libraries: str) -> None:
    (Path(libraries) / "depthai.py").write_text("import os\nos.kill(os.getpid(), 9)\n")
    done = arcor2_hw("device", "scan", PYTHONPATH=libraries)
    assert done.returncode == 0
    assert "/dev/ttyUSB3" in done.stdout
    assert "OAK cameras" in done.stderr


def test_types_are_listed_with_their_display_names(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "200")
    assert app(["device", "list"]) == 0
    lines = [line.split()[:3] for line in capsys.readouterr().out.splitlines()]
    assert ["Luxonis", "OAK-D", "OakD"] in lines
