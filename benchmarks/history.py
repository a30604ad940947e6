"""The history: size of two million rows in Parquet files, time of queries, and processor time of recording.

The rows are those that the recorder would store of 7 points of a cell in 30 days: 4 digital ones that change twice in
each cycle of 24 s (standard deviation 0.9 s), and 3 inputs of a 12-bit converter that drift through 600 steps each
day, with noise of 1.2 steps (standard deviation) and a dead band of 2 steps. The driver polls every 100 ms, with a
jitter of 2 ms. All values are random but repeatable. Changes that are spread over the day without any pattern need 3.9
instead of 2.2 bytes for a row.
"""

import asyncio
import statistics
import time
from pathlib import Path
from typing import Any, Final

import msgspec
import numpy as np
import numpy.typing as npt

from arcor2_hw.compute.history_tasks import POINTS, WriteColdFile
from arcor2_hw.data.device import Connection, Health
from arcor2_hw.data.events import Event
from arcor2_hw.data.history import HistoryPoint, HistoryQuery
from arcor2_hw.data.points import LivePoint, ObjectPointsData, PointUse
from arcor2_hw.data.scene import SceneObject
from arcor2_hw.runtime.messages import DeviceChanged, StreamEvent
from arcor2_server.compute.workers import Compute
from arcor2_server.history.service import DAY, History
from arcor2_server.hosts.pool import CellHosts
from arcor2_server.hosts.session import HostSession
from arcor2_server.settings import ServerSettings
from arcor2_server.storage.history import HistoryFile, Sample
from arcor2_server.websocket.hub import Hub
from benchmarks.metrics import Metric, Report

DAYS: Final = 30
DIGITAL: Final = 4
ANALOG: Final = 3
CYCLE_MS: Final = 24_000
STEP: Final = 10.0 / 4095.0
"""A step of the converter, V."""
DEAD_BAND: Final = 2
"""Dead band, steps."""
START: Final = 20_400 * DAY
POLLED_MS: Final = 100
JITTER_MS: Final = 2.0
REPEATS: Final = 5
SECONDS: Final = 10.0
RATE: Final = 10.0
RECORDED: Final = 100
DEVICE: Final = "obj_1"


def digital(random: np.random.Generator, number: int) -> tuple[npt.NDArray[Any], npt.NDArray[Any]]:
    """Return times of a day, ms, and values of a point that is switched on and off in each cycle."""
    starts = np.cumsum(random.normal(CYCLE_MS, 900, DAY // CYCLE_MS))
    on = starts + 1100 * number
    off = on + random.normal(3000 + 400 * number, 120, len(on))
    times = np.sort(np.concatenate([on, off]))
    times = times[times < DAY]
    return np.floor(times / POLLED_MS) * POLLED_MS, np.arange(len(times)) % 2.0


def analog(random: np.random.Generator, number: int) -> tuple[npt.NDArray[Any], npt.NDArray[Any]]:
    """Return times of a day, ms, and values of a point that changes by more than its dead band, at most once per s."""
    seconds = np.arange(DAY // 1000)
    drift = 300 * np.sin(seconds / len(seconds) * 2 * np.pi + number)
    steps = np.rint(2048 + drift + random.normal(0, 1.2, len(seconds)))
    stored, last = [], -1e9
    for second, step in enumerate(steps.tolist()):
        if abs(step - last) > DEAD_BAND:
            stored.append(second)
            last = step
    chosen = np.array(stored)
    return chosen * 1000.0 + 37 * number, np.round(steps[chosen] * STEP, 6)


def samples(day: int) -> list[Sample]:
    """Return the rows of a day in the order of their times."""
    random = np.random.default_rng(day)
    rows: list[Sample] = []
    for number in range(DIGITAL + ANALOG):
        times, values = (digital if number < DIGITAL else analog)(random, number)
        stamps = START + day * DAY + np.rint(times + random.normal(0, JITTER_MS, len(times))).astype(np.int64)
        rows += [(number + 1, at, value, None, 0) for at, value in zip(stamps.tolist(), values.tolist(), strict=True)]
    rows.sort(key=lambda row: row[1])
    return rows


async def fill(file: HistoryFile, compute: Compute) -> int:
    """Fill a history; return the number of rows."""
    points = [
        HistoryPoint(0, DEVICE, "block", f"point_{number}", PointUse.INPUT, "V", number < DIGITAL, START)
        for number in range(DIGITAL + ANALOG)
    ]
    await asyncio.to_thread(file.number_points, points)
    total = 0
    for day in range(DAYS):
        rows = await asyncio.to_thread(samples, day)
        total += len(rows)
        await asyncio.to_thread(file.put, rows)
        before = START + (day + 1) * DAY + 1000
        name = file.unused_name(POINTS, f"{day:02}")
        written = await compute.run(WriteColdFile(str(file.directory), POINTS, name, before))
        file.add(written, before)
        while not file.clear():
            pass
    return total


async def queries(history: History) -> list[Metric]:
    """Measure the summary of a point over a day and over all days."""
    metrics = []
    for name, days in (("day", 1), ("month", DAYS)):
        query = HistoryQuery(DIGITAL + ANALOG, _time(START + (DAYS - days) * DAY), _time(START + DAYS * DAY))
        took, counts = [], 0
        for _ in range(REPEATS):
            began = time.perf_counter()
            counts = sum((await history.summary(query)).counts)
            took.append(1e3 * (time.perf_counter() - began))
        metrics.append(
            Metric(f"history_{name}_ms", statistics.median(took), REPEATS, f"summary of {counts} values of one point")
        )
    return metrics


async def recording(directory: Path, compute: Compute) -> Metric:
    """Measure the processor time of recording points that all change."""
    hub = Hub()
    host = HostSession(hub, CellHosts((), None), "scene")
    settings = ServerSettings(data_dir=directory, point_history=True, point_history_interval=1 / RATE)
    history = History(settings, compute, [host])
    await history.open()
    host.board.show([SceneObject("block", "RemoteIO", id=DEVICE)], {})
    host.board.changed(DeviceChanged(DEVICE, Connection.ONLINE, Health.NORMAL))
    random = np.random.default_rng(1)
    encoded = [
        msgspec.json.encode(
            Event(
                "ObjectPoints",
                data=ObjectPointsData(
                    DEVICE,
                    1.0,
                    [
                        LivePoint(f"AI{number}", PointUse.INPUT, float(random.random()), "V")
                        for number in range(RECORDED)
                    ],
                ),
            )
        )
        for _ in range(50)
    ]
    before, began, index = time.process_time(), time.monotonic(), 0
    while time.monotonic() - began < SECONDS:
        host.streams.publish(StreamEvent("ObjectPoints", DEVICE, encoded[index % 50], RATE))
        index += 1
        await asyncio.sleep(1 / RATE)
    used, elapsed = time.process_time() - before, time.monotonic() - began
    await history.close()
    note = f"{index * RECORDED} changed values; the time of the whole process"
    return Metric("history_core_percent", 100.0 * used / elapsed, index * RECORDED, note)


async def run(report: Report, folder: Path) -> None:
    """Measure everything in this group."""
    settings = ServerSettings(data_dir=folder / "history", point_history=True, point_history_days=100_000)
    settings.data_dir.mkdir()
    compute = Compute(60.0)
    try:
        file = HistoryFile(settings.point_history_dir)
        file.open()
        rows = await fill(file, compute)
        size = sum(each.size for each in file.files(POINTS))
        report.add(Metric("history_cold_mib", size / 2**20, rows, f"{DAYS} files, {size / rows:.2f} bytes for a row"))
        file.close()
        history = History(settings, compute, clock=lambda: (START + DAYS * DAY) / 1000)
        await history.open()
        for metric in await queries(history):
            report.add(metric)
        await history.close()
        recorded = folder / "history-recorded"
        recorded.mkdir()
        report.add(await recording(recorded, compute))
    finally:
        await compute.close()


def _time(milliseconds: int) -> str:
    return np.datetime_as_string(np.datetime64(milliseconds, "ms")) + "Z"
