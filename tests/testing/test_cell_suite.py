"""`pytest --pyargs arcor2_hw.testing --device my_cell.yaml`, as an integrator runs it, without a test file."""

import os
from collections.abc import Iterator
from pathlib import Path

import msgspec
import pytest

from arcor2_drivers.functional_tester.functional_tester import FunctionalTester
from arcor2_drivers.functional_tester.settings import FunctionalTesterSettings
from arcor2_hw.data.cell import CellDevice
from arcor2_hw.data.geometry import Pose
from arcor2_hw.exceptions import Arcor2Error
from arcor2_hw.testing.cell_bench import bench_of, benches_of_files
from arcor2_hw.testing.frames import ModbusTcp
from arcor2_hw.testing.outcomes import Kind
from arcor2_hw.testing.report import Report
from arcor2_hw.testing.tcp_wire import TcpWire
from tests import commands
from tests.fakes.conftest import FakeProcess

ROOT = Path(__file__).resolve().parents[2]
SOURCE_FOLDERS = [ROOT, *(ROOT / each for each in ("drivers", "fakes", "server"))]
CANNOT_BE_GUESSED = {
    "cancelling_leaves_the_line_usable",
    "capabilities_work",
    "command_needs_control",
    "control_does_not_come_back",
    "control_is_refused",
    "disconnecting_ends_an_act",
    "loss_reaction",
    "nothing_resumes",
    "one_act_at_a_time",
    "results_are_current",
    "stop_at_random_phases",
    "stop_passes",
    "units_and_frames",
}
BENCH = """
from arcor2_hw.testing.cell_bench import CellBench


class KnowsMore(CellBench):
    def command(self, device):
        return device.open_door()
"""


@pytest.fixture(scope="module")
def tester() -> Iterator[FakeProcess]:
    fake = FakeProcess("functional_tester", "--seed", "1")
    yield fake
    fake.end()


@pytest.fixture(scope="module")
def reader(tmp_path_factory: pytest.TempPathFactory) -> Iterator[FakeProcess]:
    link = tmp_path_factory.mktemp("reader") / "ttyREADER"
    fake = FakeProcess("barcode_reader", "--link", str(link), "--timeout", "0.5")
    yield fake
    fake.end()


def at(fake: FakeProcess) -> dict[str, object]:
    host, _, port = str(fake.ready["modbus"]).rpartition(":")
    return {"host": host, "port": int(port), "watchdog_ms": 600, "request_timeout": 0.2}


def run(folder: Path, cell: list[dict[str, object]], *arguments: str) -> str:
    (folder / "my_cell.yaml").write_bytes(msgspec.yaml.encode({"devices": cell}))
    (folder / "pytest.ini").write_text(f"[pytest]\npythonpath = {' '.join(map(str, [folder, *SOURCE_FOLDERS]))}\n")
    environment = {key: value for key, value in os.environ.items() if not key.startswith(("PYTEST_", "COV_"))}
    environment["PYTEST_DISABLE_PLUGIN_AUTOLOAD"] = "1"
    options = ["-q", "-rs", "-p", "arcor2_hw.testing.plugin", "-p", "no:cacheprovider"]
    options += ["--pyargs", "arcor2_hw.testing", *(["--device", "my_cell.yaml"] if cell else []), *arguments]
    ended = commands.run(commands.PYTEST, *options, cwd=folder, env=environment)
    return ended.stdout + ended.stderr


def test_every_device_of_a_cell_is_tested_and_reported(
    tmp_path: Path, tester: FakeProcess, reader: FakeProcess
) -> None:
    cell: list[dict[str, object]] = [
        {"name": "tester", "type": "FunctionalTester", "settings": at(tester)},
        {"name": "reader", "type": "BarcodeReader", "settings": {"port": reader.ready["port"], "answer_timeout": 0.25}},
        {"name": "far", "type": "FunctionalTester", "settings": {"host": "192.0.2.7"}},
    ]
    output = run(tmp_path, cell, "--report", "report.json")
    assert "failed" not in output, output
    assert "far is a real device. Use --real --real-device far." in output
    report = msgspec.json.decode((tmp_path / "report.json").read_bytes(), type=Report)
    by_name = {each.device: each for each in report.devices}
    assert by_name["tester"].identity.firmware
    assert not by_name["tester"].real
    assert by_name["far"].cases == {}
    results = {case: each.result for case, each in by_name["tester"].cases.items()}
    assert results["connecting_observes"] is Kind.PASSED
    assert {case for case, result in results.items() if result is Kind.LACKING} == CANNOT_BE_GUESSED
    assert {result for case, result in results.items() if case not in CANNOT_BE_GUESSED} <= {Kind.PASSED, Kind.NOT_RUN}
    reached = by_name["reader"].cases
    assert {reached[case].result for case in ("half_a_frame", "reset_and_back", "connecting_observes")} == {Kind.PASSED}


def test_a_bench_class_of_the_cell_is_used(tmp_path: Path, tester: FakeProcess) -> None:
    (tmp_path / "my_bench.py").write_text(BENCH)
    entry = {"name": "tester", "type": "FunctionalTester", "settings": at(tester), "bench": "my_bench:KnowsMore"}
    output = run(tmp_path, [entry], "-k", "control_does_not_come_back or command_needs_control")
    assert "2 passed" in output, output


def test_an_entry_may_be_declared_real(tmp_path: Path, tester: FakeProcess) -> None:
    entry = {"name": "tester", "type": "FunctionalTester", "settings": at(tester), "real": True}
    one = ("-k", "connect_is_idempotent and not disconnect")
    assert "1 skipped" in run(tmp_path, [entry], *one, "--real-device", "tester")
    assert "1 passed" in run(tmp_path, [entry], *one, "--real", "--real-device", "tester")


def test_a_missing_cell_file_is_an_error(tmp_path: Path) -> None:
    assert "name a cell.yaml by --device FILE" in run(tmp_path, [])


@pytest.mark.parametrize(
    ("changes", "problem"),
    [
        ({"type": "Nonsense"}, "far: object type Nonsense is not installed and was not uploaded"),
        ({"settings": {"hots": "127.0.0.1"}}, "far: Functional tester has no setting hots"),
        ({"settings": {"host": "127.0.0.1"}, "wire": ["gate"]}, "far: wire names 'gate'"),
        ({"bench": "no_such_module:Bench"}, "far: the bench no_such_module:Bench cannot be imported"),
        (
            {"bench": "arcor2_hw.testing.life:BackgroundCall"},
            "far: arcor2_hw.testing.life:BackgroundCall is not a bench",
        ),
    ],
)
def test_an_error_in_a_cell_names_the_device(changes: dict[str, object], problem: str) -> None:
    entry = {"name": "far", "type": "FunctionalTester", "settings": {"host": "127.0.0.1"}} | changes
    with pytest.raises(Arcor2Error, match=problem):
        bench_of(msgspec.convert(entry, CellDevice))


def test_a_name_in_two_cells_is_refused(tmp_path: Path) -> None:
    for file in ("a.yaml", "b.yaml"):
        (tmp_path / file).write_text("devices: [{name: far, type: FunctionalTester, settings: {host: 127.0.0.1}}]\n")
    with pytest.raises(Arcor2Error, match=r"several cell\.yaml files have devices of the same name: far"):
        benches_of_files([str(tmp_path / "a.yaml"), str(tmp_path / "b.yaml")])


def test_the_wire_records_acting_frames(tester: FakeProcess) -> None:
    """The recorded frames show which calls observe and which act, without access to the fake."""
    host, _, port = str(tester.ready["modbus"]).rpartition(":")
    wire = TcpWire(host, [int(port)])
    wire.start()
    settings = FunctionalTesterSettings(wire.host, wire.ports[0], watchdog_ms=600, request_timeout=0.2)
    device = FunctionalTester("id", "tester", Pose(), None, settings=settings)
    try:
        device.connect()
        device.board_present()
        assert wire.frames(ModbusTcp())
        assert wire.acting(ModbusTcp()) == []
        device.take_control()
        assert [words.partition(" (")[0] for words in wire.acting(ModbusTcp())] == ["function 16"]
    finally:
        device.disconnect()
        wire.close()
