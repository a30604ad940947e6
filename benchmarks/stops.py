"""Stops: from the call of a driver's stop to its frame at the device, all that move moving at once in one process.

Each fake stamps what comes on the machine's monotonic clock, which is the one that the call is stamped by. Once in a
process that does nothing else, once next to an action that computes and one that keeps the interpreter for 0.4 s.
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
from tests.drivers.busy import stall

STOPS: Final = 100
"""For each driver."""
LONG_STOPS: Final = 500
"""For each driver in a busy process, with `--long`."""
KEEPS: Final = 0.4
"""Seconds for which an action keeps the interpreter."""
PAUSES: Final = 0.6
"""Seconds until it does so again."""
PHASES: Final = 0.3
"""s from the begin of a motion to its stop, at most."""
BEGINS_WITHIN: Final = 10.0
ENDS_WITHIN: Final = 5.0
ARRIVES_WITHIN: Final = 2.0

MOVING_ARM: Final = "left"
"""Of the YuMi, in `run_long`; the other, which stands, hears of a stop sooner."""
CONTROL_WORD: Final = "2b406000"
"""How the data of an SDO that writes the control word (6040h) begins; the word follows, low byte first."""
HALT: Final = 0x0100


def _halts(truth: dict[str, Any]) -> Iterable[float]:
    for frame in truth["frames"]:
        data = str(frame["data"])
        if frame["from_host"] and data.startswith(CONTROL_WORD):
            word = int.from_bytes(bytes.fromhex(data[8:12]), "little")
            if word & HALT:
                yield float(frame["time"])


def _stamps(bench: Bench) -> Callable[[], Iterable[float]]:
    """Give what tells when stopping frames came to the fake of a bench."""
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
    # The servos are given goals at which they can stand soonest; nothing else is written while they move.
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
    """A motion on a thread of its own, which is stopped before it ends."""

    def __init__(self, bench: Bench, device: Generic) -> None:
        self._bench, self._device = bench, device
        self._error: BaseException | None = None
        self._thread = threading.Thread(target=self._run, name=f"moving {bench.name()}", daemon=True)
        self._thread.start()

    def _run(self) -> None:
        try:
            self._bench.run_long(self._device)
        except BaseException as error:  # noqa: BLE001 - judged by who waits
            self._error = error

    def under_way(self) -> None:
        until = time.monotonic() + BEGINS_WITHIN
        while not self._bench.running():
            if not self._thread.is_alive() or time.monotonic() > until:
                raise RuntimeError(f"{self._bench.name()} does not move: {self._error!r}")
            time.sleep(0.005)

    def stopped(self) -> None:
        self._thread.join(ENDS_WITHIN)
        if self._thread.is_alive() or not isinstance(self._error, Cancelled):
            raise RuntimeError(f"a stopped motion of {self._bench.name()} did not end as one: {self._error!r}")


def one_stop(bench: Bench, device: Any, stamps: Callable[[], Iterable[float]]) -> float:
    """Begin a motion, stop it at some moment; give how late the frame was at the device, s."""
    motion = Motion(bench, device)
    motion.under_way()
    time.sleep(PHASES * random.random())
    called = time.monotonic()
    device.stop()
    until = time.monotonic() + ARRIVES_WITHIN
    while not (arrived := [stamp for stamp in stamps() if stamp >= called]):
        if time.monotonic() > until:
            raise RuntimeError(f"a stop of {bench.name()} did not arrive")
    motion.stopped()
    return min(arrived) - called


def stops_of(kind: type[Bench], count: int) -> tuple[list[float], list[str]]:
    """Return how late each stop of a driver was, s, and what went wrong with the others."""
    bench = kind()
    bench.start()
    late, wrong = [], []
    try:
        bench.reset()
        device, stamps = bench.controlled(), _stamps(bench)
        for _ in range(count):
            try:
                late.append(one_stop(bench, device, stamps))
            except RuntimeError as error:
                wrong.append(str(error))
                bench.release()
                bench.reset()
                device = bench.controlled()
    finally:
        bench.release()
        bench.end()
    return late, wrong


@contextlib.contextmanager
def busy() -> Iterator[None]:
    """Have one action compute in Python and one keep the interpreter in a C call, again and again."""
    ending = threading.Event()

    def compute() -> None:
        while not ending.is_set():
            sum(i * i for i in range(10_000))

    def keep() -> None:
        while not ending.wait(PAUSES):
            stall(KEEPS)

    threads = [threading.Thread(target=each) for each in (compute, keep)]
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
    wrong = [text for _, texts in results for text in texts]
    return {kind: late for kind, (late, _) in zip(BENCHES, results, strict=True)}, wrong


def measure_busy(count: int) -> list[Metric]:
    """Measure in a busy process, on this thread."""
    with busy():
        found, wrong = _stop_all(count)
    late = [each for samples in found.values() for each in samples]
    notes = ", ".join(f"{kind.type_name()} {percentile(found[kind], 99) * 1e3:.0f}" for kind in found if found[kind])
    done = count * len(BENCHES)
    return [
        Metric("busy_stops_lost", len(wrong), done, "; ".join(wrong[:5])),
        Metric("busy_stop_p99_ms", percentile(late, 99) * 1e3, len(late), f"p99 of each: {notes}"),
    ]


def measure() -> Metric:
    """Measure on this thread."""
    found, wrong = _stop_all(STOPS)
    if wrong:
        raise RuntimeError("; ".join(wrong))
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
