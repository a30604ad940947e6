"""Stop latency: from the call of a driver's stop to its frame at the device, with all drivers moving in one process.

Fakes and calls use the machine's monotonic clock. Measured in an otherwise idle process, and next to an action that
computes and one that holds the interpreter lock for 0.4 s.
"""

import asyncio
import contextlib
import logging
import random
import sys
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import Any, Final

from arcor2_hw.exceptions import Cancelled
from arcor2_hw.objects import Generic
from arcor2_hw.testing.bench import Bench
from benchmarks.metrics import Metric, Report, median, percentile
from tests.drivers.benches.abb_yumi_bench import YuMiBench
from tests.drivers.benches.conveyor_bench import ConveyorBench
from tests.drivers.benches.dobot_magician_bench import DobotMagicianBench
from tests.drivers.benches.robotiq_2f_bench import Robotiq2FBench
from tests.drivers.benches.two_axis_robot_bench import TwoAxisRobotBench
from tests.drivers.benches.universal_robots_bench import UR5eBench
from tests.drivers.stall import stall

STOPS: Final = 100
"""Number of stops of each driver."""
LONG_STOPS: Final = 500
"""Number of stops of each driver in a busy process, with `--long`."""
LOCK_TIME: Final = 0.4
"""Time for which an action holds the interpreter lock, s."""
LOCK_PAUSE: Final = 0.6
"""Time until it holds the lock again, s."""
PHASES: Final = 0.3
"""Maximum time from the start of a motion to its stop, s."""
START_TIMEOUT: Final = 10.0
END_TIMEOUT: Final = 5.0
ARRIVAL_TIMEOUT: Final = 2.0

MOVING_ARM: Final = "left"
"""Arm of the YuMi that `run_long` moves; the stationary arm reads a stop earlier."""
CONTROL_WORD: Final = "2b406000"
"""First bytes of an SDO that writes the control word (6040h); the word follows, low byte first."""
HALT: Final = 0x0100


def _halts(truth: dict[str, Any]) -> Iterable[float]:
    for frame in truth["frames"]:
        data = str(frame["data"])
        if frame["from_host"] and data.startswith(CONTROL_WORD):
            word = int.from_bytes(bytes.fromhex(data[8:12]), "little")
            if word & HALT:
                yield float(frame["time"])


def _stamps(bench: Bench) -> Callable[[], Iterable[float]]:
    """Return a function that returns the arrival times of stopping frames at the fake of a bench."""
    if isinstance(bench, UR5eBench):
        ur = bench.fake
        return lambda: [stop["t"] for stop in ur.do("stops")]
    if isinstance(bench, YuMiBench):
        yumi = bench.fake
        return lambda: yumi.do("stops")[MOVING_ARM]
    if isinstance(bench, ConveyorBench):
        belt = bench.fake
        return lambda: _halts(belt.truth())
    assert isinstance(bench, DobotMagicianBench | TwoAxisRobotBench | Robotiq2FBench)
    fake = bench.fake
    # A stop writes the nearest goals at which the servos can stop; nothing else is written during motion.
    command = "sync_writes" if isinstance(bench, TwoAxisRobotBench) else "stops"
    return lambda: fake.control.do(command)


BENCHES: Final[tuple[type[Bench], ...]] = (
    UR5eBench,
    YuMiBench,
    DobotMagicianBench,
    TwoAxisRobotBench,
    ConveyorBench,
    Robotiq2FBench,
)


class Motion:
    """A motion in a separate thread, stopped before it ends."""

    def __init__(self, bench: Bench, device: Generic) -> None:
        self._bench, self._device = bench, device
        self._error: BaseException | None = None
        self._thread = threading.Thread(target=self._run, name=f"moving {bench.name()}", daemon=True)
        self._thread.start()

    def _run(self) -> None:
        try:
            self._bench.run_long(self._device)
        except BaseException as error:  # noqa: BLE001 - checked by wait_until_stopped
            self._error = error

    def wait_until_moving(self) -> None:
        until = time.monotonic() + START_TIMEOUT
        while not self._bench.running():
            if not self._thread.is_alive() or time.monotonic() > until:
                raise RuntimeError(f"{self._bench.name()} does not move: {self._error!r}")
            time.sleep(0.005)

    def wait_until_stopped(self) -> None:
        self._thread.join(END_TIMEOUT)
        if self._thread.is_alive() or not isinstance(self._error, Cancelled):
            raise RuntimeError(f"A stopped motion of {self._bench.name()} did not raise Cancelled: {self._error!r}")


def one_stop(bench: Bench, device: Any, stamps: Callable[[], Iterable[float]]) -> float:
    """Start a motion and stop it at a random moment; return the latency of the frame at the device, s."""
    motion = Motion(bench, device)
    motion.wait_until_moving()
    time.sleep(PHASES * random.random())
    called = time.monotonic()
    device.stop()
    until = time.monotonic() + ARRIVAL_TIMEOUT
    while not (arrived := [stamp for stamp in stamps() if stamp >= called]):
        if time.monotonic() > until:
            raise RuntimeError(f"A stop of {bench.name()} did not arrive.")
    motion.wait_until_stopped()
    return min(arrived) - called


def stops_of(kind: type[Bench], count: int) -> tuple[list[float], list[str]]:
    """Return the latencies of the stops of a driver, s, and the errors of failed stops."""
    bench = kind()
    bench.start()
    latencies, failures = [], []
    try:
        bench.reset()
        device, stamps = bench.controlled(), _stamps(bench)
        for _ in range(count):
            try:
                latencies.append(one_stop(bench, device, stamps))
            except RuntimeError as error:
                failures.append(str(error))
                bench.release()
                bench.reset()
                device = bench.controlled()
    finally:
        bench.release()
        bench.end()
    return latencies, failures


@contextlib.contextmanager
def busy() -> Iterator[None]:
    """Run one action that computes in Python, and one that repeatedly holds the interpreter lock in a C call."""
    ending = threading.Event()

    def compute() -> None:
        while not ending.is_set():
            sum(i * i for i in range(10_000))

    def hold_lock() -> None:
        while not ending.wait(LOCK_PAUSE):
            stall(LOCK_TIME)

    threads = [threading.Thread(target=each) for each in (compute, hold_lock)]
    interval = sys.getswitchinterval()
    sys.setswitchinterval(0.0005)  # as in the cell host
    for thread in threads:
        thread.start()
    try:
        yield
    finally:
        ending.set()
        for thread in threads:
            thread.join()
        sys.setswitchinterval(interval)


def _stop_all(count: int) -> tuple[dict[type[Bench], list[float]], list[str]]:
    with ThreadPoolExecutor(len(BENCHES), thread_name_prefix="stopping") as pool:
        results = list(pool.map(lambda kind: stops_of(kind, count), BENCHES))
    failures = [text for _, texts in results for text in texts]
    return {kind: latencies for kind, (latencies, _) in zip(BENCHES, results, strict=True)}, failures


def measure_busy(count: int) -> list[Metric]:
    """Measure in a busy process, in this thread."""
    with busy():
        found, failures = _stop_all(count)
    latencies = [each for samples in found.values() for each in samples]
    notes = ", ".join(f"{kind.type_name()} {percentile(found[kind], 99) * 1e3:.0f}" for kind in found if found[kind])
    done = count * len(BENCHES)
    return [
        Metric("busy_stops_lost", len(failures), done, "; ".join(failures[:5])),
        Metric("busy_stop_p99_ms", percentile(latencies, 99) * 1e3, len(latencies), f"p99 of each: {notes}"),
    ]


def measure() -> Metric:
    """Measure in this thread."""
    found, failures = _stop_all(STOPS)
    if failures:
        raise RuntimeError("; ".join(failures))
    p99 = {kind.type_name(): percentile(samples, 99) * 1e3 for kind, samples in found.items()}
    notes = [f"{kind.type_name()} {p99[kind.type_name()]:.1f} ({median(found[kind]) * 1e3:.1f})" for kind in found]
    note = f"p99 (median) of each: {', '.join(notes)}; {STOPS} stops each"
    return Metric("driver_stop_p99_ms", max(p99.values()), STOPS * len(BENCHES), note)


async def run(report: Report, long: bool) -> None:
    """Measure everything in this group."""
    logging.getLogger("arcor2_hw").setLevel(logging.ERROR)
    report.add(await asyncio.to_thread(measure))
    for metric in await asyncio.to_thread(measure_busy, LONG_STOPS if long else STOPS):
        report.add(metric)
