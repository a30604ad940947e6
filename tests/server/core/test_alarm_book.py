"""The book of alarms: merging, first-up, shelving, latching; and the checks of the system."""

import asyncio
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from arcor2_hw.data.alarms import AlarmCategory, AlarmFilter, AlarmKind, AlarmRecord, Priority
from arcor2_hw.data.role import Role
from arcor2_hw.data.rpc import ListAlarmsArgs
from arcor2_hw.exceptions import Refused
from arcor2_hw.messages import Message
from arcor2_server.alarms.book import MAX_RECORDS, SAME_CAUSE_PERIOD, AlarmBook, Occurrence
from arcor2_server.alarms.kinds import AlarmKinds
from arcor2_server.alarms.service import Alarms
from arcor2_server.alarms.system import SystemAlarms
from arcor2_server.websocket.hub import Hub

AT = "2026-01-01T00:00:00+00:00"
LATER = "2026-01-01T00:01:00+00:00"


def kind(code: str, **values: Any) -> AlarmKind:
    given = {"priority": Priority.HIGH, "category": AlarmCategory.DEVICE, "group": "test"}
    return AlarmKind(1, code, **given | values)


def occurrence(source: str, code: str, stamp: float = 100.0, **values: Any) -> Occurrence:
    of = {name: values.pop(name) for name in ("latching", "category") if name in values}
    return Occurrence(source, code, kind(code, **of), AT, stamp, Message.of(code), session="run 1", **values)


def first_ups(book: AlarmBook) -> dict[str, int]:
    return {f"{record.object_id}": record.first_up for record in book.records()}


def test_error_of_an_action_and_the_condition_behind_it_are_one_alarm() -> None:
    for order in ("error first", "condition first"):
        book = AlarmBook()
        error = occurrence("printer", "device_timeout", 100.0, momentary=True, action="print", run=3)
        condition = occurrence("printer", "paper_out", 100.8)
        for each in (error, condition) if order == "error first" else (condition, error):
            book.raised(each)
        [record] = book.records()
        assert (record.code, record.action, record.run, record.active) == ("paper_out", "print", 3, True), order


def test_unrelated_error_is_an_alarm_of_its_own() -> None:
    book = AlarmBook()
    book.raised(occurrence("reader", "dirty"))
    book.raised(occurrence("reader", "parts_touch", momentary=True))
    book.raised(occurrence("printer", "device_timeout", momentary=True))
    assert [record.code for record in book.records()] == ["device_timeout", "parts_touch", "dirty"]


def test_first_cause_is_on_top_when_ten_follow_in_any_order() -> None:
    book = AlarmBook()
    stamps = {f"d{number}": 100.0 + number for number in range(11)}
    for name in ("d5", "d3", "d7", "d0", "d10", "d1", "d2", "d9", "d4", "d6", "d8"):
        book.raised(occurrence(name, "connection_lost", stamps[name]))
    cause = next(record.number for record in book.records() if record.object_id == "d0")
    assert set(first_ups(book).values()) == {cause}


def test_alarm_after_a_quiet_time_or_of_another_run_is_a_first_up_itself() -> None:
    book = AlarmBook()
    book.raised(occurrence("a", "x", 100.0))
    book.raised(occurrence("b", "x", 100.1 + SAME_CAUSE_PERIOD))
    book.raised(Occurrence("c", "x", kind("x"), AT, 100.2, session="run 2"))
    assert first_ups(book) == {"a": 1, "b": 2, "c": 3}


@pytest.mark.parametrize(("latching", "retained"), [(True, 1), (False, 0)])
def test_latching_alarm_stays_until_it_is_acknowledged(latching: bool, retained: int) -> None:
    book = AlarmBook()
    book.raised(occurrence("a", "x", latching=latching))
    book.ended("a", "x", LATER)
    assert len([*book.records(AlarmFilter.RETAINED)]) == retained
    book.acknowledged(1, "Olga", "seen", LATER)
    [record] = book.records()
    assert (record.retain, record.acknowledged_by, record.note, record.cleared) == (False, "Olga", "seen", LATER)
    with pytest.raises(Refused, match="already acknowledged by Olga"):
        book.acknowledged(1, "Wendy", "", LATER)


def test_returning_condition_continues_the_open_record_and_needs_a_new_acknowledgement() -> None:
    book = AlarmBook()
    book.raised(occurrence("a", "x", latching=True))
    book.acknowledged(1, "Olga", "", AT)
    book.shelved(1, LATER, "Theo", "")
    for _ in range(3):
        book.ended("a", "x", LATER)
        book.raised(occurrence("a", "x", latching=True))
    [record] = book.records()
    assert (record.count, record.active, record.acknowledged) == (4, True, False)


def test_safety_stop_is_never_shelved() -> None:
    book = AlarmBook()
    [record] = book.raised(occurrence("robot", "protective_stop", category=AlarmCategory.SAFETY))
    assert not record.can_be_shelved
    assert record.latching
    with pytest.raises(Refused, match="protective_stop is a safety stop"):
        book.shelved(record.number, LATER, "Theo", "")


def test_shelved_alarm_is_hidden_and_returns() -> None:
    book = AlarmBook()
    book.raised(occurrence("a", "x"))
    book.shelved(1, LATER, "Theo", "sensor ordered")
    assert not [*book.records(AlarmFilter.RETAINED)]
    assert [record.shelved_by for record in book.records(AlarmFilter.SHELVED)] == ["Theo"]
    book.shelved(1, None, "", "")
    assert [record.number for record in book.records(AlarmFilter.RETAINED)] == [1]


def test_restart_ends_conditions_but_keeps_unacknowledged_alarms() -> None:
    before = AlarmBook()
    before.raised(occurrence("a", "x", latching=True))
    before.raised(occurrence("b", "y"))
    book = AlarmBook(reversed([*before.records()]), LATER)
    assert [record.cleared for record in book.restored] == [LATER, LATER]
    assert [record.code for record in book.records(AlarmFilter.RETAINED)] == ["x"]
    [record] = book.raised(occurrence("b", "y"))
    assert record.number == 3


def test_history_is_bounded_and_keeps_alarms_that_need_attention() -> None:
    book = AlarmBook()
    book.raised(occurrence("keep", "x"))
    for number in range(MAX_RECORDS + 5):
        book.raised(occurrence("a", f"c{number}"))
        book.ended("a", f"c{number}", AT)
    numbers = [record.number for record in book.records()]
    assert len(numbers) == MAX_RECORDS
    assert numbers[-1] == 1
    assert min(book.deleted) == 2


def test_statistics_count_and_measure_within_the_period() -> None:
    book = AlarmBook()
    seconds: Callable[[str], float] = {AT: 0.0, LATER: 60.0}.__getitem__
    book.raised(occurrence("a", "x"))
    book.ended("a", "x", LATER)
    book.raised(occurrence("a", "x"))
    book.raised(occurrence("b", "y"))
    book.ended("b", "y", AT)
    found = {each.code: each for each in book.frequencies(AT, 90.0, seconds)}
    assert (found["x"].count, found["x"].duration) == (2, 150.0)
    assert (found["y"].count, found["y"].duration) == (1, 0.0)
    assert [each.code for each in book.frequencies(LATER, 90.0, seconds)] == ["x"]


class NoStore:
    """A store that forgets."""

    async def all(self) -> list[AlarmRecord]:
        return []

    async def put(self, records: object, deleted: object) -> None:
        pass


async def test_roles_shelving_that_ends_by_itself_and_clock() -> None:
    store: Any = NoStore()
    hub: Any = Hub()
    alarms = Alarms(hub, store, AlarmKinds(lambda _: None), lambda: 0)
    system = SystemAlarms(alarms, hub, Path(), None, lambda: "")
    system.check_disk(1_000_000)
    system.check_nodes({"press": ["arm", "belt"]})
    [lost] = await alarms.find(ListAlarmsArgs(AlarmFilter.ALL, limit=1))
    assert (lost.code, lost.active, lost.text) == (
        "node_lost:press",
        True,
        "The node press is not connected. Needed for: arm, belt.",
    )
    system.check_nodes({})
    system.check_clock(time.time() - time.monotonic() - 60.0)
    system.check_clock(time.time() - time.monotonic() - 60.0)
    clock, back, disk = await alarms.find(ListAlarmsArgs(AlarmFilter.ALL))
    assert (back.code, back.active) == ("node_lost:press", False)
    assert (disk.code, disk.text, disk.active) == (
        "disk_nearly_full",
        "The disk of the server has only 1 MB left.",
        True,
    )
    assert (clock.code, clock.count, clock.first_up) == ("clock_jumped", 1, clock.number)
    with pytest.raises(Refused, match="needs the role technician"):
        await alarms.acknowledge(disk.number, "Olga", Role.OPERATOR, "")
    await alarms.shelve(disk.number, 0.05, "Theo", "")
    assert [each.number for each in await alarms.find(ListAlarmsArgs(AlarmFilter.SHELVED))] == [disk.number]
    async with asyncio.timeout(10.0):
        while await alarms.find(ListAlarmsArgs(AlarmFilter.SHELVED)):
            await asyncio.sleep(0.01)
    await alarms.acknowledge(disk.number, "Theo", Role.TECHNICIAN, "")
    system.check_disk(10**12)
    assert [each.code for each in await alarms.find(ListAlarmsArgs())] == ["clock_jumped"]
    await alarms.close()
