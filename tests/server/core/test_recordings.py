"""Recordings of alarms and failed runs: their files, content, times of storing, and deletion."""

import asyncio
import csv
import io
import shutil
import time
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import msgspec
import pytest

from arcor2_hw.data.alarms import AlarmCategory, AlarmRecord, Priority
from arcor2_hw.data.base import UNSET, now
from arcor2_hw.data.device import Observation
from arcor2_hw.data.recordings import RecordedAlarm, RecordedValues, RecordingInfo, RecordingQuery, Signal, SignalKind
from arcor2_hw.exceptions import NotFound, StorageError
from arcor2_hw.messages import Message
from arcor2_hw.runtime.recorder import Recorder
from arcor2_hw.runtime.ring import Ring
from arcor2_server.execution.run_message import RunMessages
from arcor2_server.execution.runs import RunStart
from arcor2_server.recordings.export import as_csv
from arcor2_server.recordings.service import MAX_PER_ALARM, Recordings
from arcor2_server.settings import ServerSettings
from arcor2_server.storage import recordings as storage
from arcor2_server.storage.recordings import RecordingFiles

VALUES = RecordedValues([Signal(SignalKind.POINT, "obj_io", "io", "part", "", [-1000, 0], [False, True])])


def info(number: int, **values: Any) -> RecordingInfo:
    return RecordingInfo(number, now(), 5.0, -60_000, 5000, **values)


def alarm(number: int, count: int = 1, run: int | Any = UNSET) -> AlarmRecord:
    return AlarmRecord(
        number,
        "io-1",
        "code",
        Priority.HIGH,
        AlarmCategory.DEVICE,
        f"Alarm {number}.",
        now(),
        number,
        object_id="obj_io",
        object_name="io",
        count=count,
        run=run,
    )


class Bench:
    """The service with a ring that contains one value."""

    def __init__(self, folder: Path) -> None:
        self.events: list[Any] = []
        self.folder = folder
        self.ring: list[Ring] | None = [Ring()]
        self.recorder = Recorder(self.ring[0])
        source: Any = SimpleNamespace(id="obj_io", name="io")
        self.recorder.observed(source, [Observation("part", True)], time.monotonic())
        self.recordings = self.server()

    def server(self) -> Recordings:
        """Return the service of a new server."""
        hub: Any = SimpleNamespace(broadcast=lambda event: self.events.append(event.data))
        return Recordings(hub, RecordingFiles(self.folder), lambda: self.ring)

    async def settled(self) -> None:
        """Store the recording in progress; the server continues."""
        await self.recordings.close()
        self.recordings._closed = False


@pytest.fixture
def bench(tmp_path: Path) -> Bench:
    return Bench(tmp_path / "recordings")


# ------------------------------------------------------------------------------------------------ files
def test_a_recording_is_read_as_it_was_stored(tmp_path: Path) -> None:
    files = RecordingFiles(tmp_path / "recordings")
    assert files.all() == []
    assert files.next_number() == 1
    stored = files.put(info(1, run=7, run_failed=True), VALUES)
    assert files.all() == [stored]
    assert stored.size == next(tmp_path.rglob("*.rec")).stat().st_size
    assert files.values(1) == VALUES
    assert files.next_number() == 2
    with pytest.raises(NotFound):
        files.values(2)


@pytest.mark.parametrize("change", ["cut", "empty", "flip", "garbage"])
def test_a_damaged_file_hides_no_other_and_is_named(tmp_path: Path, change: str) -> None:
    files = RecordingFiles(tmp_path)
    for number in (1, 2, 3):
        files.put(info(number), VALUES)
    path = tmp_path / "000002.rec"
    content = path.read_bytes()
    changed = {"cut": content[:-3], "empty": b"", "flip": content[:-1] + bytes([content[-1] ^ 1]), "garbage": b"x" * 99}
    path.write_bytes(changed[change])
    assert {1, 3} <= {each.number for each in files.all()}
    with pytest.raises(StorageError, match="recording 2"):
        files.values(2)
    assert files.next_number() == 4
    assert files.delete_oldest(most=1) == [2, 1]


def test_the_oldest_files_are_deleted_by_number_and_by_size(tmp_path: Path) -> None:
    files = RecordingFiles(tmp_path)
    sizes = [files.put(info(number), VALUES).size for number in range(1, 7)]
    assert files.delete_oldest() == []
    assert files.delete_oldest(most=4) == [2, 1]
    assert files.delete_oldest(most_bytes=2 * max(sizes)) == [4, 3]
    assert files.delete_oldest(most_bytes=1) == [5]
    assert [each.number for each in files.all()] == [6]


def test_nothing_is_stored_on_a_disk_that_is_nearly_full(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    free = SimpleNamespace(free=storage.MIN_FREE_SPACE - 1)
    monkeypatch.setattr(shutil, "disk_usage", lambda _: free)
    with pytest.raises(StorageError, match="nearly full"):
        RecordingFiles(tmp_path).put(info(1), VALUES)
    assert not list(tmp_path.glob("*"))


# ------------------------------------------------------------------------------------------------ what is stored
async def test_an_alarm_is_stored_at_once_and_again_when_it_is_complete(bench: Bench) -> None:
    await bench.recordings.open(lambda _: None)
    bench.recordings.alarm(alarm(5, run=3), time.monotonic())
    bench.recordings.alarm(alarm(6, run=3), time.monotonic())
    while not bench.events:
        await asyncio.sleep(0.001)
    (first,) = RecordingFiles(bench.folder).all()
    assert not first.complete
    assert [each.number for each in first.alarms] == [5, 6]
    assert first.run == 3
    bench.recordings.alarm(alarm(7, run=3), time.monotonic())  # within the same recording
    bench.recordings.run_failed(3, Message.of("{what} broke", what="it"), bench.ring)
    await bench.settled()
    (found,) = bench.recordings.find(RecordingQuery(alarm=7))
    assert found.complete
    assert found.run_failed
    assert found.error == "it broke"
    assert len(found.alarms) == 3
    assert bench.recordings.find(RecordingQuery(run=3)) == [found]
    assert bench.recordings.find(RecordingQuery(run=4)) == bench.recordings.find(RecordingQuery(alarm=8)) == []
    recording = await bench.recordings.get(1)
    assert [(each.name, each.values) for each in recording.signals] == [("part", [True])]
    assert [event.recording.complete for event in bench.events] == [False, True]


async def test_a_failed_run_without_an_alarm_is_stored(bench: Bench) -> None:
    await bench.recordings.open(lambda _: None)
    bench.recordings.run_failed(4, None, bench.ring)
    await bench.settled()
    (found,) = bench.recordings.find(RecordingQuery())
    assert found.run == 4
    assert found.run_failed
    assert found.alarms == []


async def test_without_a_host_and_for_old_or_known_occurrences_nothing_is_stored(bench: Bench) -> None:
    await bench.recordings.open(lambda _: None)
    bench.recordings.alarm(alarm(1), time.monotonic() - 100.0)
    shelved = msgspec.structs.replace(alarm(2), shelved_until=now())
    bench.recordings.alarm(shelved, time.monotonic())
    bench.ring = None
    bench.recordings.alarm(alarm(3), time.monotonic())
    bench.recordings.run_failed(1, None, None)
    await bench.settled()
    assert bench.recordings.find(RecordingQuery()) == []


async def test_an_alarm_that_keeps_returning_deletes_only_its_own_recordings(bench: Bench) -> None:
    await bench.recordings.open(lambda _: None)
    bench.recordings.alarm(alarm(1), time.monotonic())
    await bench.settled()
    for count in range(1, 9):
        bench.recordings.alarm(alarm(2, count), time.monotonic())
        bench.recordings.alarm(alarm(2, count), time.monotonic())  # nothing new
        await bench.settled()
    numbers = [each.number for each in bench.recordings.find(RecordingQuery())]
    assert numbers == [9, 8, 7, 6, 2, 1]
    assert len(numbers) == MAX_PER_ALARM + 1
    assert [number for event in bench.events for number in event.deleted] == [3, 4, 5]


async def test_a_full_disk_stops_no_alarm(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    await bench.recordings.open(lambda _: None)
    monkeypatch.setattr(storage, "MIN_FREE_SPACE", 1 << 60)
    bench.recordings.alarm(alarm(1), time.monotonic())
    await bench.settled()
    assert bench.recordings.find(RecordingQuery()) == []
    monkeypatch.undo()
    bench.recordings.alarm(alarm(2), time.monotonic())
    await bench.settled()
    assert len(bench.recordings.find(RecordingQuery())) == 1


async def test_the_ring_of_an_interrupted_run_becomes_a_recording_once(bench: Bench) -> None:
    other = Recorder(Ring())
    other.observed(SimpleNamespace(id="obj_far", name="far"), [Observation("part", False)], time.monotonic())  # type: ignore[arg-type]
    other.save(bench.folder, 12, main=False)
    other.save(bench.folder, 15, main=False)  # its program has ended, so the main host stores nothing
    bench.recorder.save(bench.folder, 12)
    bench.recorder.save(bench.folder, 13)
    (bench.folder / "run-14.ring").write_bytes(b"\xff")
    RecordingFiles(bench.folder).put(info(1, run=13, run_failed=True), VALUES)  # that server has stored it itself
    lost = Message.of("The server ended during the run.")
    server = bench.server()
    await server.open(lambda run: lost if run == 12 else None)
    await server.close()
    found = {each.run: each for each in server.find(RecordingQuery())}
    assert found[12].run_failed
    assert found[12].error == lost.text
    assert found[12].end == 0
    assert set(found) == {12, 13}
    assert not list(bench.folder.glob("*.ring"))
    recording = await server.get(found[12].number)
    assert [(each.object_name, each.values) for each in recording.signals] == [("io", [True]), ("far", [False])]
    again = bench.server()
    await again.open(lambda _: None)
    assert len(again.find(RecordingQuery())) == 2


async def test_limits_of_number_are_met_while_storing(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(RecordingFiles.delete_oldest, "__defaults__", (3, 10**9))
    await bench.recordings.open(lambda _: None)
    for number in range(1, 6):
        bench.recordings.alarm(alarm(number), time.monotonic())
        await bench.settled()
    assert [each.number for each in bench.recordings.find(RecordingQuery())] == [5, 4, 3]
    with pytest.raises(NotFound, match="Recording 1"):
        await bench.recordings.get(1)


async def test_csv_repeats_values_and_lists_events(bench: Bench) -> None:
    await bench.recordings.open(lambda _: None)
    stored = info(1, alarms=[RecordedAlarm(5, 0, "=It jams.", object_name="io")])
    RecordingFiles(bench.folder).put(stored, VALUES)
    server = bench.server()
    await server.open(lambda _: None)
    rows = list(csv.reader(io.StringIO(as_csv(await server.get(1)).decode())))
    assert rows == [
        ["time_s", "what", "io: part"],
        ["-1.000", "", "0"],
        ["0.000", "alarm 5: io: =It jams.", "1"],
    ]


def test_a_program_gets_absolute_paths_because_it_changes_its_directory(tmp_path: Path) -> None:
    world: Any = SimpleNamespace(shape_files=dict)
    unused: Any = None
    messages = RunMessages(ServerSettings(data_dir=Path("data")), unused, unused, world, dict)
    message = messages.prepare("pkg_1", tmp_path, RunStart())
    assert message.recordings == str(Path.cwd() / "data" / "recordings")
    assert message.records == str(Path.cwd() / "data" / "checkpoints")
