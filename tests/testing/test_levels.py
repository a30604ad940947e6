"""Levels require cases, tests and a report. Addresses and wires are found in settings."""

import hashlib
from pathlib import Path
from typing import Any

import msgspec
import pytest

from arcor2_hw.data.device import Identity
from arcor2_hw.testing import report, rules
from arcor2_hw.testing.addresses import places
from arcor2_hw.testing.conformance import Conformance
from arcor2_hw.testing.outcomes import Kind, Outcomes, judge
from arcor2_hw.testing.quality import Level, Quality, VersionsTried
from arcor2_hw.testing.report import CaseResult, DeviceRun, Report, origin

ALL_PASSED = dict.fromkeys(sorted(Conformance.cases()), (Kind.PASSED, ""))
TYPE = "FunctionalTester"


# ------------------------------------------------------------------------------------------------ cases
@pytest.mark.parametrize(
    ("case", "outcome", "level", "problem"),
    [
        ("stop_passes", (Kind.FAILED, "boom"), Level.NONE, "stop_passes failed"),
        ("stop_passes", (Kind.NOT_RUN, "nothing moves"), Level.GOLD, ""),
        ("reset_and_back", (Kind.NOT_RUN, "too hard"), Level.BRONZE, "reset_and_back is not run"),
        ("units_and_frames", (Kind.LACKING, "no hook readings"), Level.BRONZE, "no hook readings"),
    ],
)
def test_failed_and_skipped_cases_lower_the_level(
    case: str, outcome: tuple[Kind, str], level: Level, problem: str
) -> None:
    reached, missing = judge(ALL_PASSED | {case: outcome}, [], [])
    assert reached is level
    assert problem in "; ".join(missing)


def test_silver_requires_tests_and_gold_a_report() -> None:
    assert judge(ALL_PASSED, ["no test"], ["no report"]) == (Level.BRONZE, ["no test"])
    assert judge(ALL_PASSED, [], ["no report"]) == (Level.SILVER, ["no report"])
    assert judge(ALL_PASSED, [], []) == (Level.GOLD, [])


def test_a_failure_in_teardown_counts() -> None:
    outcomes = Outcomes()
    properties = [("arcor2_case", {"bench": "press", "type": "Press", "real": False, "case": "stop_passes"})]
    outcomes.add(properties, True, False, "call", "")
    assert outcomes["press"].outcomes["stop_passes"] == (Kind.PASSED, "")
    outcomes.add(properties, False, True, "teardown", "a thread was left")
    assert outcomes["press"].outcomes["stop_passes"] == (Kind.FAILED, "a thread was left")
    outcomes.add([("other", 1)], True, False, "call", "")
    assert list(outcomes) == ["press"]


# ------------------------------------------------------------------------------------------------ tests of rules
@pytest.mark.parametrize(
    ("named", "problem"),
    [
        ("test_press.py::test_stops", ""),
        ("test_press.py::TestPress::test_holds", ""),
        ("test_press.py::test_gone", "does not exist"),
        ("test_press.py::test_later", "is skipped"),
        ("test_press.py::test_hidden", "is not collected"),
        ("test_press.py::test_gives_up", "is skipped"),
        ("test_press.py::TestOven::test_heats", "is skipped"),
        ("test_press_later.py::test_stops", "is skipped"),
        ("test_oven.py::test_stops", "file test_oven.py does not exist"),
        ("press_tests.py::test_stops", "that pytest does not collect"),
        ("test_press.py::TestSuite::test_stop_passes", ""),
        ("test_press.py::TestSuite::test_loss_reaction", "did not pass"),
        ("test_press.py::TestSuite::test_jumps", "does not exist"),
        ("test_press.py::TestPress::test_stop_passes", "does not exist"),
        ("test_press.py::test_stop_passes", "does not exist"),
    ],
)
def test_the_test_of_a_rule_must_exist_and_run(tmp_path: Path, named: str, problem: str) -> None:
    folder = tmp_path / "press"
    folder.mkdir()
    file = folder / "test_press.py"
    file.write_text(
        "import pytest\n\n\ndef test_stops(): ...\n\n\n@pytest.mark.skip\ndef test_later(): ...\n\n\n"
        "def test_hidden(): ...\n\n\nclass TestPress:\n    def test_holds(self): ...\n"
        "\n\ndef test_gives_up():\n    pytest.skip('no press')\n"
        "\n\nclass TestSuite(Conformance):\n    benches = ()\n"
        "\n\n@pytest.mark.skip\nclass TestOven:\n    def test_heats(self): ...\n"
    )
    (folder / "test_press_later.py").write_text("pytestmark = [pytest.mark.skip]\n\n\ndef test_stops(): ...\n")
    (folder / "press_tests.py").write_text("def test_stops(): ...\n")
    collected = {str(file): frozenset({"test_stops", "test_holds", "test_later", "test_gives_up", "test_heats"})}
    cases = {"stop_passes": True, "loss_reaction": False}
    found = rules.missing_tests({"5 stop": [named]}, [tmp_path], "press", collected, cases)
    assert bool(found) == bool(problem)
    assert problem in "".join(found)


def test_missing_rules_are_reported(tmp_path: Path) -> None:
    assert rules.missing_tests({"1 connecting observes": []}, [tmp_path], "press", {}) == ["rules names no test"]


@pytest.mark.parametrize(
    ("not_run", "instead", "problem"),
    [
        ({"stop_passes": "stop() is tested elsewhere"}, {}, "not_run: stop_passes needs the tests that show it"),
        ({"stop_passes": "see test_press.py for this"}, {}, "not_run: stop_passes needs the tests that show it"),
        ({TYPE: "the code of another type"}, {}, f"not_run: {TYPE} needs the tests that show it"),
        ({}, {"stop_passes": ["test_press.py::test_stops"]}, "instead: not_run has no stop_passes"),
    ],
)
def test_a_claim_without_a_test_is_refused(
    not_run: dict[str, str], instead: dict[str, list[str]], problem: str
) -> None:
    with pytest.raises(ValueError, match=problem):
        claims(not_run=not_run, instead=instead)


def test_the_tests_that_replace_a_case_are_checked(tmp_path: Path) -> None:
    given = claims(not_run={TYPE: "the code of another type"}, instead={TYPE: ["test_press.py::test_gone"]})
    (tmp_path / "test_press.py").write_text("def test_stops(): ...\n")
    found = rules.missing_tests(given.named_tests(), [tmp_path], "press", {})
    assert found == [f"instead of {TYPE}: test_press.py::test_gone does not exist"]


# ------------------------------------------------------------------------------------------------ the report of gold
def claims(**changes: Any) -> Quality:
    tried = VersionsTried("pymodbus", ["fake"], ["FT-100, firmware 2.3"])
    given = {
        "types": [TYPE],
        "protocol": "Modbus TCP",
        "page": "page.md",
        "versions_tried": tried,
        "actions": [],
        "rules": {},
        "outputs_on_loss": "hold",
        "limits": [],
        "report": "evidence/real.json",
    }
    return Quality(**(given | changes))


def write_report(tmp_path: Path, **changes: Any) -> None:
    distribution, version = origin(TYPE)
    given = {
        "device": "tester",
        "type": TYPE,
        "real": True,
        "address": "192.0.2.7:502",
        "identity": Identity("Maker", "FT-100", "7", "2.3"),
        "distribution": distribution,
        "version": version,
        "libraries": {},
        "cases": {case: CaseResult(Kind.PASSED) for case in ALL_PASSED},
        "sources": report.digest(tmp_path),
    }
    run = DeviceRun(**(given | changes))
    whole = Report("2026-01-02T03:04:05+00:00", "0.1.0", "3.11.7", "Linux x86_64", [run])
    (tmp_path / "evidence").mkdir(exist_ok=True)
    (tmp_path / "evidence" / "real.json").write_bytes(msgspec.json.encode(whole))


def test_a_matching_report_reaches_gold(tmp_path: Path) -> None:
    write_report(tmp_path)
    assert report.unmatched(tmp_path, claims(), TYPE, ALL_PASSED) == []


@pytest.mark.parametrize(
    ("changes", "problem"),
    [
        ({"real": False}, "no run on a real FunctionalTester"),
        ({"type": "Other"}, "no run on a real FunctionalTester"),
        ({"identity": Identity("Maker", "FT-100", "7", "")}, "does not say model and firmware"),
        ({"identity": Identity("Maker", "FT-100", "7", "9.9")}, "does not name FT-100 with firmware 9.9"),
        ({"version": "0.0.1"}, "is of version 0.0.1 of the driver"),
        ({"cases": {}}, "stop_passes is not in the report"),
        (
            {"cases": {case: CaseResult(Kind.NOT_RUN, "afraid") for case in ALL_PASSED}},
            "stop_passes is not run there",
        ),
    ],
)
def test_differences_of_a_report_are_named(tmp_path: Path, changes: dict[str, Any], problem: str) -> None:
    write_report(tmp_path, **changes)
    assert problem in "; ".join(report.unmatched(tmp_path, claims(), TYPE, ALL_PASSED))


def test_a_report_is_valid_only_for_unchanged_files_of_the_driver(tmp_path: Path) -> None:
    (tmp_path / "press.py").write_text("FORCE = 100\n")
    (tmp_path / "meshes").mkdir()
    (tmp_path / "meshes" / "press.stl").write_bytes(b"solid")
    write_report(tmp_path)
    (tmp_path / "__pycache__").mkdir()
    for name in ("quality.yaml", "first_day.yaml", "__pycache__/press.pyc", "evidence/notes.txt"):
        (tmp_path / name).write_text("anything")
    assert report.unmatched(tmp_path, claims(), TYPE, ALL_PASSED) == []
    for name, content in (("press.py", "FORCE = 101\n"), ("meshes/press.stl", "Solid"), ("other.py", "")):
        path = tmp_path / name
        before = path.read_bytes() if path.exists() else None
        path.write_text(content)
        changed = ["the files of the driver have changed since the report was written"]
        assert report.unmatched(tmp_path, claims(), TYPE, ALL_PASSED) == changed
        path.unlink() if before is None else path.write_bytes(before)
    assert report.unmatched(tmp_path, claims(), TYPE, ALL_PASSED) == []


def test_a_recording_belongs_to_its_report(tmp_path: Path) -> None:
    recording = report.Recording("wire.jsonl.gz", hashlib.sha256(b"bytes").hexdigest())
    write_report(tmp_path, recording=recording)
    missing = report.unmatched(tmp_path, claims(), TYPE, ALL_PASSED)
    assert missing == ["the recording wire.jsonl.gz cannot be read: No such file or directory"]
    for content, problem in ((b"bytes", []), (b"Bytes", ["the recording wire.jsonl.gz is not the one of the report"])):
        (tmp_path / "evidence" / "wire.jsonl.gz").write_bytes(content)
        assert report.unmatched(tmp_path, claims(), TYPE, ALL_PASSED) == problem


def test_a_case_that_the_real_device_could_not_show_needs_a_reason(tmp_path: Path) -> None:
    cases = {case: CaseResult(Kind.PASSED) for case in ALL_PASSED}
    write_report(tmp_path, cases=cases | {"stop_passes": CaseResult(Kind.NOT_RUN, "declined")})
    reason = {"stop_passes": "the guard was not mounted yet"}
    assert report.unmatched(tmp_path, claims(), TYPE, ALL_PASSED) == ["stop_passes is not run there"]
    assert report.unmatched(tmp_path, claims(not_on_hardware=reason), TYPE, ALL_PASSED) == []
    write_report(tmp_path, cases=cases | {"stop_passes": CaseResult(Kind.FAILED, "went on")})
    assert report.unmatched(tmp_path, claims(not_on_hardware=reason), TYPE, ALL_PASSED) == [
        "stop_passes is failed there"
    ]
    write_report(tmp_path)
    recovery = claims(not_on_hardware={"half_a_frame": "the line cannot be interrupted"})
    assert report.unmatched(tmp_path, recovery, TYPE, ALL_PASSED) == ["half_a_frame has to pass on the real device"]
    with pytest.raises(ValueError, match="not_on_hardware: stop_passes needs a reason in words"):
        claims(not_on_hardware={"stop_passes": "no"})


def test_a_missing_or_invalid_report_is_named(tmp_path: Path) -> None:
    assert report.unmatched(tmp_path, claims(), TYPE, {}) == ["the report evidence/real.json does not exist"]
    (tmp_path / "evidence").mkdir()
    (tmp_path / "evidence" / "real.json").write_text("{}")
    assert "cannot be read" in report.unmatched(tmp_path, claims(), TYPE, {})[0]
    assert "names no report" in report.unmatched(tmp_path, claims(report=msgspec.UNSET), TYPE, {})[0]


# ------------------------------------------------------------------------------------------------ places
@pytest.mark.parametrize(
    ("settings", "here", "error_text"),
    [
        ({"host": "127.0.0.1", "port": 5020}, True, "5020"),
        ({"host": "192.0.2.7", "port": 502}, False, "502"),
        ({"host": "tester.example", "port": 502}, False, "502"),
        ({"host": "localhost", "port": 502, "serial_port": ""}, True, "502"),
        ({"port": "socket://127.0.0.1:4001"}, True, "4001"),
        ({"port": "/dev/ttyUSB0"}, False, "/dev/ttyUSB0"),
        ({"port": "/dev/pts/7"}, True, "/dev/pts/7"),
        ({"url": "opc.tcp://127.0.0.1:4840/plc"}, True, "4840"),
        ({"base_url": "http://192.0.2.9/erp"}, False, "80"),
        ({"ip": "127.0.0.1"}, True, "127.0.0.1"),
        ({"channel": "can0", "interface": "socketcan"}, False, "channel can0"),
    ],
)
def test_the_address_is_found_in_the_settings(settings: dict[str, Any], here: bool, error_text: str) -> None:
    found = places(settings)
    assert all(place.here for place in found) is here
    assert found[0].error_text == error_text


def test_settings_and_ports_may_be_named() -> None:
    settings = {"box": "127.0.0.1", "door": 7, "port": 8}
    assert places(settings) == []
    (place,) = places(settings, ["box", "door"])
    assert place.moved("127.0.0.1", 99, "") == {"box": "127.0.0.1", "door": 99}
    (place,) = places({"ip": "127.0.0.1"}, ["ip", 29999, 30004])
    assert place.ports == (29999, 30004)
    with pytest.raises(KeyError):
        places(settings, ["gate"])
