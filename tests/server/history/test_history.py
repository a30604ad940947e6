"""The history: recording of points, and moving of rows, which are read exactly once and never lost."""

import asyncio
import signal
import sqlite3
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import msgspec
import pytest
from hypothesis import HealthCheck, given, settings, strategies as st
from msgspec.structs import replace

from arcor2_hw.compute import history_functions
from arcor2_hw.compute.history_tasks import (
    POINTS,
    RUNS,
    VALID_MS,
    ReadPoint,
    ReadRuns,
    SummarizePoint,
    WriteColdFile,
)
from arcor2_hw.compute.worker_state import WorkerState
from arcor2_hw.data.cell import read_cell
from arcor2_hw.data.device import Connection
from arcor2_hw.data.editor import Run, RunEnd, RunStatistics
from arcor2_hw.data.events import Event
from arcor2_hw.data.history import HistoryPoint, HistoryQuery, HistoryRunQuery, PastRun, PointValues
from arcor2_hw.data.points import LivePoint, ObjectPointsData, PointQuality, PointUse
from arcor2_hw.exceptions import InvalidData, NotFound, StorageError
from arcor2_server.errors import RequestRefused
from arcor2_server.history.recorder import PointRecorder
from arcor2_server.history.service import DAY, HOUR, History, dead_bands, past_run
from arcor2_server.settings import DeadBand, ServerSettings
from arcor2_server.storage import history as storage_history
from arcor2_server.storage.history import HistoryFile, Sample

STATE = WorkerState(lambda _share, _text: None)
START = 20_000 * DAY
GOOD = 0


def point(name: str, value: Any, quality: PointQuality = PointQuality.GOOD, **more: Any) -> LivePoint:
    return LivePoint(name, PointUse.INPUT, value, "V", quality, **more)


def described(name: str) -> HistoryPoint:
    return HistoryPoint(0, "obj", "oven", name, PointUse.INPUT, "V", False, START)


def opened(directory: Path) -> HistoryFile:
    file = HistoryFile(directory)
    file.open()
    return file


def run(number: int, ended: int) -> PastRun:
    return PastRun(number, ended - 1000, ended, RunEnd.FINISHED, "pkg_1", "sorting", cycles=3, good=2, bad=1)


# ------------------------------------------------------------------------------------------ the recorder
def values_of(recorder: PointRecorder) -> list[tuple[str, int, Any, str]]:
    return [
        (one.name, time, value if text is None else text, list(PointQuality)[quality].value)
        for one, time, value, text, quality in recorder.take()
    ]


def test_changes_beyond_the_dead_band_are_recorded_with_the_time_of_their_source() -> None:
    recorder = PointRecorder(0.1, [DeadBand.parse("oven.temp*=0.5"), DeadBand.parse("*=0")])
    for at, temperature, door in ((1000, 20.0, False), (2000, 20.5, True), (3000, 20.6, True), (4000, 20.1, True)):
        recorder.device_reported("obj", "oven", [point("temperature", temperature, age=0.25), point("door", door)], at)
    assert values_of(recorder) == [
        ("temperature", 750, 20.0, "good"),
        ("door", 1000, 0.0, "good"),
        ("door", 2000, 1.0, "good"),
        ("temperature", 2750, 20.6, "good"),
    ]


def test_dead_bands_of_the_cell_file_precede_those_of_the_variable(tmp_path: Path) -> None:
    file = tmp_path / "cell.yaml"
    file.write_text(
        "devices: [{name: oven, type: Oven, dead_bands: {temperature: 0.5, 'zone*': 2}}, {name: lamp, type: L}]"
    )
    settings = ServerSettings(data_dir=tmp_path, cell=read_cell(file), point_history_dead_bands=("oven.*=9", "*=0.1"))
    assert dead_bands(settings) == [("oven.temperature", 0.5), ("oven.zone*", 2.0), ("oven.*", 9.0), ("*", 0.1)]
    assert dead_bands(ServerSettings(data_dir=tmp_path)) == []
    file.write_text("devices: [{name: oven, type: Oven, dead_bands: {temperature: -1}}]")
    with pytest.raises(InvalidData, match="dead_bands"):
        read_cell(file)


@pytest.mark.parametrize(
    ("name", "value"),
    [("DEAD_BANDS", "oven"), ("DEAD_BANDS", "oven=-1"), ("INTERVAL", "0.01"), ("DAYS", "0"), ("MEGABYTES", "x")],
)
def test_the_error_names_an_invalid_setting(name: str, value: str) -> None:
    with pytest.raises(InvalidData, match=f"ARCOR2_HW_POINT_HISTORY_{name}"):
        ServerSettings.from_environment({f"ARCOR2_HW_POINT_HISTORY_{name}": value})


def test_a_change_that_lasts_is_recorded_when_the_interval_is_over() -> None:
    recorder = PointRecorder(1.0)
    for at, value in ((0, 1.0), (500, 2.0), (600, 3.0), (1100, 3.0)):
        recorder.device_reported("obj", "oven", [point("p", value)], at)
    assert values_of(recorder) == [("p", 0, 1.0, "good"), ("p", 1100, 3.0, "good")]


def test_a_lost_value_is_recorded_at_once_and_an_unchanged_one_every_ten_minutes() -> None:
    recorder = PointRecorder(60.0)
    recorder.device_reported("obj", "oven", [point("p", 1.0), point("code", "=abc")], 0)
    recorder.device_reported("obj", "oven", [point("p", 1.0, PointQuality.BAD), point("code", "=abc")], 10)
    recorder.device_reported("obj", "oven", [point("code", "=abc")], 600_000)
    recorder.device_removed("obj", 600_001)
    recorder.device_removed("obj", 600_002)
    assert values_of(recorder) == [
        ("p", 0, 1.0, "good"),
        ("code", 0, "=abc", "good"),
        ("p", 10, None, "bad"),
        ("code", 600_000, "=abc", "good"),
        ("code", 600_001, None, "not_connected"),
    ]


def test_the_memory_of_the_recorder_is_bounded(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("arcor2_server.history.recorder.MAX_WAITING", 100)
    monkeypatch.setattr("arcor2_server.history.recorder.MAX_POINTS", 2)
    recorder = PointRecorder(0.1)
    for at in range(500):
        recorder.device_reported("obj", "oven", [point("a", float(at)), point("b", 1.0), point("c", 1.0)], at * 1000)
    values = recorder.take()
    assert len(values) <= 100
    assert recorder.dropped == 501 - len(values)
    recorder.device_reported("obj", "oven", [point("a", -1.0)], 500_000)
    recorder.put_back([*values, *values])
    assert len(recorder.take()) == 100


# ------------------------------------------------------------------------------------------ hot and cold together
def summary(samples: list[tuple[int, float | None]], since: int, until: int, buckets: int) -> list[tuple[Any, ...]]:
    """Compute the summary from a plain list, ms by ms."""
    width = max(1, -(-(until - since) // buckets))
    ordered = sorted(samples)
    found: dict[int, list[float]] = {}
    starts = {time for time, value in samples if value is not None}
    for at in range(since, until):
        before = [(time, value) for time, value in ordered if time <= at]
        if before and before[-1][1] is not None and at < before[-1][0] + VALID_MS:
            found.setdefault((at - since) // width, []).append(before[-1][1])
    return [
        (
            since + bucket * width,
            min(values),
            max(values),
            pytest.approx(sum(values) / len(values)),
            sum(since + bucket * width <= time < min(since + (bucket + 1) * width, until) for time in starts),
        )
        for bucket, values in sorted(found.items())
    ]


class Mover:
    """Moves rows to files as the service does, in single steps, so that a test can query between them."""

    def __init__(self, file: HistoryFile) -> None:
        self.file = file
        self.directory = str(file.directory)

    def move(self, before: int) -> None:
        self._write(before, [])

    def merge(self) -> None:
        while not self.file.clear():
            pass
        self._write(0, [each.name for each in self.file.files(POINTS)])

    def _write(self, before: int, merged: list[str]) -> None:
        while not self.file.clear():
            pass
        name = self.file.unused_name(POINTS, "20241004")
        task = WriteColdFile(self.directory, POINTS, name, before, merged)
        self.file.add(history_functions.write_cold_file(task, STATE), before, merged)


VALUE = st.one_of(st.none(), st.sampled_from([0.0, 1.0, -2.5, 1e9]))
STEP = st.one_of(
    st.lists(st.tuples(st.integers(0, 60), VALUE), max_size=6),  # store values, also older ones than before
    st.tuples(st.just("move"), st.integers(0, 70)),
    st.just("merge"),
    st.just("clear"),
    st.just("reopen"),
)


@settings(max_examples=12, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(steps=st.lists(STEP, max_size=6), since=st.integers(0, 40), length=st.integers(1, 40), buckets=st.integers(1, 7))
def test_queries_equal_a_plain_list_while_rows_are_moved_at_any_time(
    tmp_path_factory: pytest.TempPathFactory, steps: list[Any], since: int, length: int, buckets: int
) -> None:
    directory = tmp_path_factory.mktemp("history")
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(storage_history, "CLEARED_AT_ONCE", 2)
        file = opened(directory)
        file.number_points([described("a"), described("b")])
        expected: dict[int, float | None] = {}
        mover = Mover(file)
        for step in [*steps, "clear"]:
            match step:
                case ("move", int(before)):
                    mover.move(START + before)
                case "merge":
                    mover.merge()
                case "clear":
                    file.clear()
                case "reopen":
                    file.close()
                    file.open()
                case _:
                    new = {START + time: value for time, value in step if START + time not in expected}
                    expected |= new
                    rows: list[Sample] = [(1, time, value, None, GOOD) for time, value in new.items()]
                    file.put([*rows, (2, START, 7.0, None, GOOD)])
                    continue
            begin, end = START + since, START + since + length
            read = history_functions.read_point(ReadPoint(str(directory), 1, begin, end, 100), STATE)
            inside = sorted((time, value) for time, value in expected.items() if begin <= time < end)
            assert list(zip(read.times, read.values, strict=True)) == inside
            task = SummarizePoint(str(directory), 1, begin, end, buckets)
            found = history_functions.summarize_point(task, STATE)
            columns = (found.times, found.lowest, found.highest, found.mean, found.counts)
            assert list(zip(*columns, strict=True)) == summary(list(expected.items()), begin, end, buckets)
        file.close()


def test_texts_qualities_and_limits_survive_the_move(tmp_path: Path) -> None:
    file = opened(tmp_path / "h")
    (number,) = file.number_points([described("it's")])
    file.put([(number, START, None, "it's", 1), (number, START + 1, None, None, 4), (number, START + 2, 3.5, None, 0)])
    file.put([], [run(1, START), run(2, START + 5)])
    before = [replace(run(1, START)), run(2, START + 5)]
    for moved in (False, True):
        if moved:
            Mover(file).move(START + 2)
            name = file.unused_name(RUNS, "x")
            file.add(
                history_functions.write_cold_file(WriteColdFile(str(tmp_path / "h"), RUNS, name, START + 5), STATE),
                START + 5,
            )
        read = history_functions.read_point(ReadPoint(str(tmp_path / "h"), number, START, START + 9, 2), STATE)
        qualities = [PointQuality.UNCERTAIN, PointQuality.NOT_CONNECTED]
        assert read == PointValues([START, START + 1], ["it's", None], qualities, False)
        runs = history_functions.read_runs(ReadRuns(str(tmp_path / "h"), START, START + 9, 9, "pkg_1"), STATE)
        assert runs == before[::-1]
        other = ReadRuns(str(tmp_path / "h"), START, START + 9, 9, "it's' or '1'='1")
        assert history_functions.read_runs(other, STATE) == []
    file.close()


def test_files_that_are_not_listed_are_deleted_and_a_damaged_history_is_renamed(tmp_path: Path) -> None:
    directory = tmp_path / "h"
    file = opened(directory)
    file.number_points([described("a")])
    file.put([(1, START, 1.0, None, GOOD)])
    Mover(file).move(START + 1)
    (listed,) = file.files(POINTS)
    file.close()
    (directory / "points-lost.parquet").write_bytes(b"not listed")
    (directory / ".points-half.parquet.new").write_bytes(b"half")
    file.open()
    assert sorted(each.name for each in directory.iterdir() if "points" in each.name) == [listed.name]
    file.close()
    (directory / "recent.sqlite").write_bytes(b"damaged" * 1000)
    file.open()
    assert file.points() == []
    (stored,) = tmp_path.glob("h.damaged-*")
    assert (stored / listed.name).exists()
    file.close()


def test_a_killed_process_loses_nothing_that_was_stored(tmp_path: Path) -> None:
    script = (
        "import sys, os, signal\nfrom pathlib import Path\n"
        "from arcor2_server.storage.history import HistoryFile\n"
        "file = HistoryFile(Path(sys.argv[1]))\nfile.open()\n"
        "file.put([(1, 5, 2.0, None, 0)])\nos.kill(os.getpid(), signal.SIGKILL)\n"
    )
    ended = subprocess.run([sys.executable, "-c", script, tmp_path / "h"], check=False)
    assert ended.returncode == -signal.SIGKILL
    file = opened(tmp_path / "h")
    assert history_functions.read_point(ReadPoint(str(tmp_path / "h"), 1, 0, 9, 9), STATE).values == [2.0]
    file.close()


# ------------------------------------------------------------------------------------------ the service
class Worker:
    """Runs the tasks in this process."""

    async def run(self, task: Any, **_options: Any) -> Any:
        function: Callable[..., Any] = getattr(history_functions, task.function.partition(":")[2])
        return await asyncio.to_thread(function, task, STATE)


def host() -> Any:
    board = SimpleNamespace(on_report=[], on_clear=[], object=lambda _: SimpleNamespace(name="oven"))
    streams = SimpleNamespace(observed={})
    streams.observe = lambda key, *_, owner: streams.observed.update({key: _[-1]})
    return SimpleNamespace(board=board, streams=streams)


async def test_the_service_records_moves_merges_and_deletes(tmp_path: Path) -> None:
    at = [START / 1000 + 10.0]
    source = host()
    history = History(
        ServerSettings(data_dir=tmp_path, point_history=True, point_history_days=3),
        Worker(),  # type: ignore[arg-type]
        [source],
        lambda: at[0],
    )
    with pytest.raises(RequestRefused, match="--history"):
        await history.points(SimpleNamespace(object_id=None))  # type: ignore[arg-type]
    await history.open()
    source.board.on_report[0](SimpleNamespace(object_id="obj", connection=Connection.ONLINE))
    for hour in range(30):
        at[0] = (START + hour * HOUR) / 1000 + 10.0
        event = Event("ObjectPoints", data=ObjectPointsData("obj", 1.0, [point("p", hour)]))
        source.streams.observed["obj"](msgspec.json.encode(event))
        await history.maintain()
    history.run_ended(Run(7, "pkg_1", "sorting", "2024-10-05T00:00:00+00:00", RunEnd.FAILED, error="broken",
                          ended="2024-10-05T00:00:05+00:00", statistics=RunStatistics(4, good=3)))  # fmt: skip
    (found,) = await history.points(SimpleNamespace(object_id="obj"))  # type: ignore[arg-type]
    assert (found.object_name, found.name, found.use) == ("oven", "p", PointUse.INPUT)
    query = HistoryQuery(found.number, "2024-10-04T00:00:00Z", "2024-10-06T00:00:00Z", buckets=2)
    whole = await history.summary(query)
    assert (whole.counts, whole.lowest, whole.highest) == ([24, 6], [0.0, 24.0], [23.0, 29.0])
    assert len((await history.values(replace(query, limit=29))).times) == 29
    (past,) = await history.runs(HistoryRunQuery("2024-10-05T00:00:00Z"))
    assert (past.number, past.error, past.cycles, past.good) == (7, "broken", 4, 3)
    state = await history.state()
    assert state.recording
    assert (state.files, state.rows) == (5, 28)  # one for the first day, and one for each closed hour of the second
    with pytest.raises(NotFound):
        await history.summary(HistoryQuery(99))
    with pytest.raises(InvalidData, match="empty"):
        await history.summary(replace(query, until=query.since))
    with pytest.raises(InvalidData, match="not a time"):
        await history.summary(replace(query, since="yesterday"))
    source.board.on_clear[0](["obj"])
    at[0] += 10 * DAY / 1000
    await history.maintain()
    await history.maintain()
    assert (await history.state()).files == 0
    await history.close()


async def test_a_full_disk_is_reported_and_waiting_values_are_stored_later(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    history = History(ServerSettings(data_dir=tmp_path, point_history=True), Worker())  # type: ignore[arg-type]
    await history.open()
    history.run_ended(Run(7, "pkg_1", "sorting", "2024-10-05T00:00:00+00:00", RunEnd.FINISHED))
    with monkeypatch.context() as full:
        full.setattr(storage_history.shutil, "disk_usage", lambda _: SimpleNamespace(free=1000))
        await history.flush()
        assert "nearly full" in (await history.state()).problem
    await history.flush()
    assert (await history.state()).problem == ""
    (found,) = await history.runs(HistoryRunQuery("2024-10-01T00:00:00Z"))
    assert found == past_run(Run(7, "pkg_1", "sorting", "2024-10-05T00:00:00+00:00", RunEnd.FINISHED))
    await history.close()


async def test_the_oldest_files_are_deleted_when_the_history_is_too_large(tmp_path: Path) -> None:
    history = History(
        ServerSettings(data_dir=tmp_path, point_history=True, point_history_megabytes=0), Worker(),  # type: ignore[arg-type]
        clock=lambda: (START + DAY) / 1000,
    )  # fmt: skip
    await history.open()
    file = history._file
    file.number_points([described("a")])
    file.put([(1, START, 1.0, None, GOOD)])
    Mover(file).move(START + HOUR)
    assert len(file.files(POINTS)) == 1
    await history.maintain()
    assert file.files(POINTS) == []
    await history.close()


def test_files_cannot_be_read_outside_of_the_directory(tmp_path: Path) -> None:
    file = opened(tmp_path / "h")
    file.close()
    with sqlite3.connect(tmp_path / "h" / "recent.sqlite") as connection:
        connection.execute("insert into cold values (1, 'points', '../secret.parquet', 0, 9, 1, 1, 0, 0, 0)")
    (tmp_path / "secret.parquet").write_bytes(b"PAR1")
    with pytest.raises(StorageError, match="cannot be used"):
        history_functions.read_point(ReadPoint(str(tmp_path / "h"), 1, 0, 9, 9), STATE)
