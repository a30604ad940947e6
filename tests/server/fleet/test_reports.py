"""Counts, lists and files of stored results, without a broker."""

import csv
import io
import sqlite3
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import msgspec
import pytest
from msgspec import UNSET
from msgspec.structs import replace

from arcor2_hw.data.alarms import AlarmCategory, AlarmRecord, Priority
from arcor2_hw.data.recipes import RecipeState, UsedRecipe
from arcor2_hw.data.units import UnitRecord, UnitState
from arcor2_hw.messages import Message
from arcor2_server.fleet import file as fleet_file
from arcor2_server.fleet.columns import SLOT, columns_of
from arcor2_server.fleet.driver_texts import DriverTexts, texts_of
from arcor2_server.fleet.file import FILE, FleetFile, ReceivedResult
from arcor2_server.fleet.reports import FleetReports, Period
from arcor2_server.fleet.summaries import UnitSummary, alarm_columns, unit_columns
from tests.ports import free_port
from tests.server.fleet.cells import unit
from tests.server.fleet.test_results import FleetProcess

NOON = 1_767_355_200
"""2026-01-02T12:00:00Z."""
DAY = Period(NOON - 12 * 3600, NOON + 12 * 3600)


def time_at(minutes: float) -> str:
    """Return a time some minutes after noon."""
    seconds = int(minutes * 60)
    return f"2026-01-02T{12 + seconds // 3600:02}:{seconds % 3600 // 60:02}:{seconds % 60:02}.000000+00:00"


def finished(number: int, minutes: float, state: UnitState = UnitState.GOOD, product: str = "") -> UnitRecord:
    recipe = UsedRecipe("rcp", product, 1, RecipeState.RELEASED, "") if product else UNSET
    return replace(unit(number, state=state), entered=time_at(0), left=time_at(minutes), recipe=recipe)


def alarm(number: int, minutes: float, code: str = "no_part", **values: Any) -> AlarmRecord:
    return AlarmRecord(
        number, "gripper-1", code, Priority.HIGH, AlarmCategory.DEVICE, "No part.", time_at(minutes), number, **values
    )


def received(record: UnitRecord | AlarmRecord, cell: str = "press-3", stamp: int = NOON * 1_000_000) -> ReceivedResult:
    kind, since = ("unit", record.entered) if isinstance(record, UnitRecord) else ("alarm", record.raised)
    document = msgspec.json.encode(record)
    columns = columns_of(kind, stamp, document)
    return ReceivedResult(cell, f"{cell:a<32}", kind, record.number, since, stamp, document, columns)


@pytest.fixture
def file(tmp_path: Path) -> Iterator[FleetFile]:
    opened = FleetFile(tmp_path / FILE)
    yield opened
    opened.close()


@pytest.fixture
def reports(file: FleetFile) -> Iterator[FleetReports]:
    opened = FleetReports(file.path)
    yield opened
    opened.close()


def counts(reports: FleetReports, period: Period = DAY) -> list[tuple[object, ...]]:
    return [msgspec.structs.astuple(each) for each in reports.production(period).counts]


# ---------------------------------------------------------------------------------------------------- counts
def test_units_are_counted_by_cell_and_product(
    file: FleetFile, reports: FleetReports, monkeypatch: pytest.MonkeyPatch
) -> None:
    file.put_results(
        [
            received(finished(1, 1, product="A")),
            received(finished(2, 50, UnitState.BAD, "A")),
            received(finished(3, 61, UnitState.REJECTED)),
            received(finished(1, 70, product="A"), "oven"),
        ]
    )
    assert counts(reports) == [
        ("oven", "A", "sorting", 1, 0, 0),
        ("press-3", "", "sorting", 0, 0, 1),
        ("press-3", "A", "sorting", 1, 1, 0),
    ]
    assert counts(reports, replace(DAY, cell="oven")) == [("oven", "A", "sorting", 1, 0, 0)]
    # A period is extended to whole quarters of an hour.
    hour = reports.production(Period(NOON + 60, NOON + 3540))
    assert (hour.since, hour.until, hour.step) == (NOON, NOON + 3600, 3600)
    assert [(each.at, each.good, each.bad) for each in hour.times] == [(NOON, 1, 1)]
    assert reports.production(Period(NOON - 7 * 86400, NOON)).step == 6 * 3600
    # A newer version of a record replaces it, an older one does not; the oldest results are deleted.
    file.put_results([received(finished(2, 50, UnitState.GOOD, "A"), stamp=NOON * 1_000_000 + 1)])
    file.put_results([received(finished(2, 50, UnitState.REJECTED, "A"))])
    assert counts(reports)[2] == ("press-3", "A", "sorting", 2, 0, 0)
    monkeypatch.setattr(fleet_file, "MAX_RESULTS", 2)
    file.put_results([received(finished(9, 80, product="A"))])
    assert counts(reports)[-1] == ("press-3", "A", "sorting", 1, 0, 0)
    assert sum(int(str(each[3])) for each in counts(reports)) == file.count()


def test_opening_a_file_of_the_first_version_computes_the_counts(tmp_path: Path) -> None:
    records = [
        received(finished(number, number, UnitState.BAD if number == 3 else UnitState.GOOD)) for number in range(5)
    ]
    with sqlite3.connect(tmp_path / FILE) as old:
        old.executescript(fleet_file._SCHEMA)
        old.executemany(
            "insert into result (cell, identity, kind, number, since, stamp, document) values (?, ?, ?, ?, ?, ?, ?)",
            [each[:-1] for each in [*records, received(alarm(1, 2))]],
        )
        old.execute("pragma user_version=1")
    old.close()
    FleetFile(tmp_path / FILE).close()
    FleetFile(tmp_path / FILE).close()
    reports = FleetReports(tmp_path / FILE)
    assert counts(reports) == [("press-3", "", "sorting", 4, 1, 0)]
    assert [each.unit.number for each in reports.bad_units(DAY, None, 10)] == [3]
    assert len(reports.alarms(DAY, None, 10)) == 1
    assert [each.unit.number for each in reports.find_units("0003", "press-3", None, 10)] == [3]
    reports.close()


# ---------------------------------------------------------------------------------------------------- lists
def test_bad_units_are_listed_with_their_reason(file: FleetFile, reports: FleetReports) -> None:
    failed = finished(1, 1, UnitState.BAD)
    error = replace(failed.steps[1], name="weld", error="no arc")
    tested = replace(failed.steps[2], name="measure", results=["false"])
    file.put_results(
        [
            received(replace(failed, steps=[tested, error, failed.steps[0]])),
            received(replace(finished(2, 2, UnitState.REJECTED), steps=[failed.steps[0], tested])),
            received(finished(3, 3, UnitState.BAD)),
            received(finished(4, 4)),
            received(finished(5, 4, UnitState.BAD), "oven"),
        ]
    )
    found = [(each.cell, each.unit.number, each.unit.step, each.unit.error) for each in reports.bad_units(DAY, None, 9)]
    assert found == [
        ("oven", 5, "", ""), ("press-3", 3, "", ""), ("press-3", 2, "measure", ""), ("press-3", 1, "weld", "no arc")
    ]  # fmt: skip
    assert [each.unit.number for each in reports.bad_units(replace(DAY, cell="press-3", since=NOON + 90), None, 9)] == [
        3,
        2,
    ]
    whole = reports.unit(reports.bad_units(DAY, None, 9)[-1].id)
    assert [step.name for step in whole.steps] == ["measure", "weld", "test"]


def test_units_are_found_by_a_part_of_their_serial_number(
    file: FleetFile, reports: FleetReports, monkeypatch: pytest.MonkeyPatch
) -> None:
    serials = ("Ab_12", "ab-12", 'x%"*)', "řř-Ř9")
    file.put_results([received(replace(finished(n, n), serial=serial)) for n, serial in enumerate(serials)])
    file.put_results([received(replace(finished(7, 0), serial="AB_12"), "oven"), received(alarm(1, 1))])

    def found(text: str, cell: str = "", before: tuple[int, int] | None = None) -> list[str]:
        return [each.unit.serial for each in reports.find_units(text, cell, before, 10)]

    # A text of less than three characters is searched without the index.
    for text, last in (("B_12", 5), ("B_", 5)):
        assert found(text) == ["AB_12", "Ab_12"]
        assert found(text, "press-3") == ["Ab_12"]
        assert found(text, before=(0, last)) == ["Ab_12"]
        assert found(text, "press-33") == []
        assert found(text, "PRESS-3") == []
    assert found("b", "press-3") == ["ab-12", "Ab_12"]
    assert found("%") == found('%"*') == ['x%"*)']
    assert found("ŘŘ-") == ["řř-Ř9"]
    for unmatched in ("\\", "\\\\\\", "___", "gripper", "press-3", "AB_\0", "serial : 12"):
        assert found(unmatched) == [], unmatched
    # A newer version may have another serial number. The oldest results are deleted.
    file.put_results([received(replace(finished(0, 0), serial="ZZ_99"), stamp=NOON * 1_000_000 + 1)])
    assert found("b_12") == ["AB_12"]
    assert found("zz_") == ["ZZ_99"]
    monkeypatch.setattr(fleet_file, "MAX_RESULTS", 4)
    file.put_results([received(finished(9, 80))])
    assert found("ab-") == found("zz_") == []
    assert found("ab_") == ["AB_12"]


def test_pages_contain_each_result_once(file: FleetFile, reports: FleetReports) -> None:
    file.put_results([received(finished(number, number // 3, UnitState.BAD)) for number in range(20)])
    numbers: list[int] = []
    before = None
    while page := reports.bad_units(DAY, before, 3):
        numbers += [each.unit.number for each in page]
        before = (page[-1].at, page[-1].id)
    assert numbers == list(range(19, -1, -1))


def test_the_most_frequent_causes_come_first(file: FleetFile, reports: FleetReports) -> None:
    ended = {"active": False, "object_id": "obj_1"}
    file.put_results(
        [
            received(alarm(1, 1, cleared=time_at(2), count=3, **ended)),
            received(alarm(2, 5, cleared=time_at(5.5), **ended)),
            received(alarm(3, 6, "door", cleared=time_at(26), count=2, **ended)),
            received(alarm(4, 7, object_id="obj_1"), "oven"),
        ]
    )
    causes = [(each.cell, each.newest.record.code, each.count, each.duration) for each in reports.causes(DAY)]
    assert causes[:2] == [("press-3", "no_part", 4, 90), ("press-3", "door", 2, 1200)]
    assert causes[2][:3] == ("oven", "no_part", 1)
    assert causes[2][3] > 86400, "it is still active"
    assert [each.alarm.record.number for each in reports.alarms(replace(DAY, cell="press-3"), None, 2)] == [3, 2]
    assert reports.causes(replace(DAY, cell="press-4")) == []


def test_a_damaged_time_is_replaced_by_the_time_of_arrival(file: FleetFile, reports: FleetReports) -> None:
    file.put_results([received(replace(finished(1, 1, UnitState.BAD), left="2026-13-32T12:00:00Z"))])
    assert reports.bad_units(DAY, None, 1)[0].at == NOON
    assert NOON % SLOT == 0


# ---------------------------------------------------------------------------------------------------- translations
def test_an_alarm_contains_the_translations_of_its_driver(tmp_path: Path) -> None:
    folder = tmp_path / "translations"
    folder.mkdir()
    texts = DriverTexts(lambda: [tmp_path])
    record = alarm(1, 1, remedy="Clean the jaws.")
    assert texts.of(texts_of(record)) == {}
    (folder / "cs.json").write_text('{"No part.": "Chybí díl.", "Other": "Jiný"}')
    (folder / "de.json").write_text("[]")
    (folder / "notes.json").write_text("{}")
    found = texts.of(texts_of(record))
    assert found == {"cs": {"No part.": "Chybí díl."}}
    stored = msgspec.json.decode(alarm_columns(record, found, 0).summary)
    assert stored["translations"] == found
    (folder / "cs.json").write_text('{"No part.": "Žádný díl.", "Clean the jaws.": "Očistěte čelisti."}')
    assert texts.of(texts_of(record))["cs"] == {"No part.": "Žádný díl.", "Clean the jaws.": "Očistěte čelisti."}


def test_a_bad_unit_contains_the_translations_of_its_errors(
    tmp_path: Path, file: FleetFile, reports: FleetReports
) -> None:
    (tmp_path / "translations").mkdir()
    (tmp_path / "translations" / "cs.json").write_text('{"No arc at {amps} A.": "Žádný oblouk při {amps} A."}')
    record = finished(1, 1, UnitState.BAD)
    error = Message.of("No arc at {amps} A.", amps=40)
    failed = replace(record.steps[0], name="weld", error=error.text, **error.translation())
    record = replace(record, steps=[failed, *record.steps[1:]])
    texts = DriverTexts(lambda: [tmp_path])
    translations = texts.of_unit(record)
    assert translations == {"cs": {error.key: "Žádný oblouk při {amps} A."}}
    assert texts.of_unit(finished(1, 1)) == {}
    file.put_results([received(record)._replace(columns=unit_columns(record, translations, NOON))])
    unit = reports.bad_units(DAY, None, 1)[0].unit
    assert (unit.error, unit.message, unit.translations) == ("No arc at 40 A.", error, translations)
    # A long error is shortened, and is not translated.
    long = replace(failed, error="x" * 5000)
    shown = msgspec.json.decode(unit_columns(replace(record, steps=[long]), {}, NOON).summary, type=UnitSummary)
    assert (len(shown.error), shown.message) == (1000, UNSET)


# ---------------------------------------------------------------------------------------------------- routes
def test_reports_are_served_as_json_and_csv(tmp_path: Path) -> None:
    file = FleetFile(tmp_path / FILE)
    file.put_results([received(replace(finished(1, 1, UnitState.BAD), serial="=SUM(1)")), received(alarm(1, 1))])
    file.close()
    fleet = FleetProcess(f"nats://127.0.0.1:{free_port()}", tmp_path)
    period = {"since": str(DAY.since), "until": str(DAY.until)}
    try:
        with httpx.Client(base_url=f"{fleet.url}/api/fleet", params=period) as client:
            assert client.get("/production").json()["counts"][0]["bad"] == 1
            bad = client.get("/units").json()
            assert client.get(f"/units/{bad[0]['id']}").json()["steps"]
            assert client.get("/units", params={"before": f"{bad[0]['at']}-{bad[0]['id']}"}).json() == []
            assert [each["cell"] for each in client.get("/alarms", params={"cell": "press-3"}).json()] == ["press-3"]
            assert client.get("/causes").json()[0]["count"] == 1
            units = list(csv.DictReader(io.StringIO(client.get("/units/export").text)))
            assert [(each["cell"], each["serial"], each["state"]) for each in units] == [("press-3", "'=SUM(1)", "bad")]
            alarms = list(csv.DictReader(io.StringIO(client.get("/alarms/export").text)))
            assert [(each["code"], each["text"], each["cleared"]) for each in alarms] == [("no_part", "No part.", "")]
            assert client.get("/units/99").status_code == 404
            for wrong in ({"since": "-1"}, {"before": "1"}, {"limit": "0"}):
                assert client.get("/units", params=wrong).status_code == 400, wrong
    finally:
        fleet.kill()
