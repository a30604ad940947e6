"""Recovery: every transport is interrupted and restored, with all drivers in one process.

One thread per link interrupts it; another reads from the driver continuously, as a program does. A link has recovered
when the driver reports that it is online, or back, and has returned a fresh reading; the time starts just before the
link is restored. After each cycle the reading pauses, and the resources of the process are counted.
"""

import asyncio
import contextlib
import gc
import logging
import random
import resource
import statistics
import sys
import threading
import time
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Final

from rich.console import Console
from rich.table import Table

from arcor2_hw.data.device import Connection
from arcor2_hw.exceptions import DeviceError
from benchmarks import device_links
from benchmarks.device_links import KINDS, Fresh, Kind, Link
from benchmarks.metrics import Metric, Report, percentile

CYCLES: Final = 3
LONG_CYCLES: Final = 50
OUTAGES: Final = (0.5, 5.0)
"""Durations of an interruption, s. Every driver notices the longer one, some the shorter one."""
CASES: Final = tuple((kind, seconds) for kind in KINDS for seconds in OUTAGES)
CONNECT_TIMEOUT: Final = 20.0
"""Time limit of connecting, s; the camera's first picture loads Open3D."""
GIVES_UP_AFTER: Final = 20.0
"""Time after which a driver counts as not recovered, s; used as its sample."""
READ_PERIOD: Final = 0.02
STEADY: Final = 1.0
"""Time between recovery and the next interruption, s; a random time of up to 0.5 s is added."""
QUIET: Final = 3.0
"""Time in which delayed ends complete and resources are counted, s."""
QUIET_TRIES: Final = 5

ONLINE: Final = (Connection.ONLINE, Connection.BACK)


class Reader:
    """Reads from the driver of a link continuously, except while paused."""

    def __init__(self, link: Link) -> None:
        self._link = link
        self._reading = threading.Lock()
        self._stop = threading.Event()
        self._fresh: Fresh | None = None
        self._arrived = threading.Event()
        self.failed = 0
        """Number of readings that raised a device error."""
        self.other_errors: list[str] = []
        """Errors other than device errors."""
        self._thread = threading.Thread(target=self._run, name=f"reading {link.name}", daemon=True)
        self._thread.start()

    def expect(self, fresh: Fresh) -> None:
        self._arrived.clear()
        self._fresh = fresh

    def recovered_by(self, deadline: float) -> bool:
        """Wait until the expected reading arrived and the driver reports that it is online; return False on timeout."""
        if not self._arrived.wait(max(0.0, deadline - time.monotonic())):
            return False
        while self._link.device.connection not in ONLINE:
            if time.monotonic() > deadline:
                return False
            time.sleep(0.001)
        return True

    @contextlib.contextmanager
    def paused(self) -> Iterator[None]:
        with self._reading:
            yield

    def end(self) -> None:
        self._stop.set()
        self._thread.join()

    def _run(self) -> None:
        while not self._stop.wait(READ_PERIOD):
            with self._reading:
                try:
                    found = self._link.read()
                except DeviceError:
                    self.failed += 1
                    continue
                except Exception as error:  # noqa: BLE001 - reported with the driver's name
                    self.failed += 1
                    self.other_errors.append(f"{type(error).__name__}: {error}")
                    continue
                if (fresh := self._fresh) is not None and fresh(found):
                    self._fresh = None
                    self._arrived.set()


class Trial:
    """Interrupts one link in all its cases, cycle by cycle."""

    def __init__(self, link: Link) -> None:
        self.link = link
        self.samples: dict[tuple[Kind, float], list[float]] = {case: [] for case in CASES}
        self.never_recovered: list[str] = []
        self._marks = 0
        for each in link.objects:
            each.connect(CONNECT_TIMEOUT)
        self.reader = Reader(link)
        if not self._recovers():
            raise RuntimeError(f"{link.name} returned no fresh reading before the first interruption.")

    def _recovers(self) -> bool:
        """Change the state of the device; return whether the driver reports it in time."""
        self._marks += 1
        self.reader.expect(self.link.mark(self._marks))
        return self.reader.recovered_by(time.monotonic() + GIVES_UP_AFTER)

    def cycle(self) -> None:
        for kind, seconds in random.sample(CASES, len(CASES)):
            time.sleep(STEADY + 0.5 * random.random())
            self._interrupt(kind, seconds)

    def _interrupt(self, kind: Kind, seconds: float) -> None:
        link = self.link
        failed = self.reader.failed
        link.interrupt(kind)
        time.sleep(seconds)
        failed = self.reader.failed - failed
        began = time.monotonic()
        link.restore(kind)
        back = self._recovers()
        self.samples[kind, seconds].append(time.monotonic() - began if back else GIVES_UP_AFTER)
        if seconds == max(OUTAGES) and not failed:
            raise RuntimeError(
                f"{link.name} returned readings during {seconds:g} s of {kind}: the link was not interrupted."
            )
        if not back:
            self.never_recovered.append(f"{kind} of {seconds:g} s")
            self._reconnect()

    def _reconnect(self) -> None:
        with self.reader.paused():
            for each in reversed(self.link.objects):
                each.disconnect()
            for each in self.link.objects:
                each.connect(CONNECT_TIMEOUT)
        if not self._recovers():
            raise RuntimeError(f"{self.link.name} did not recover after reconnecting.")

    def end(self) -> None:
        self.reader.end()
        for each in reversed(self.link.objects):
            each.disconnect()

    def all_samples(self) -> list[float]:
        return [sample for samples in self.samples.values() for sample in samples]


Resources = dict[str, Counter[str]]


def resources() -> Resources:
    """Count the threads (including those of libraries), descriptors and tasks of this process by name."""
    names = {thread.native_id: thread.name for thread in threading.enumerate()}
    threads = Counter(names.get(int(each.name), "of a library") for each in Path("/proc/self/task").iterdir())
    descriptors: Counter[str] = Counter()
    for each in Path("/proc/self/fd").iterdir():
        with contextlib.suppress(OSError):  # the descriptor of this directory listing
            descriptors[str(each.readlink()).partition(":")[0]] += 1
    found = [each for each in gc.get_objects() if issubclass(type(each), asyncio.Task)]
    tasks = Counter(getattr(each.get_coro(), "__qualname__", "") for each in found if not each.done())
    return {"threads": threads, "descriptors": descriptors, "tasks": tasks}


def settled(trials: list[Trial]) -> Resources:
    """Return the most frequent resource counts during a few seconds in which every driver is online.

    The minimum would be wrong: a link that reconnects at that moment on a busy machine uses less.
    """
    for _ in range(QUIET_TRIES):
        found: list[Resources] = []
        online = True
        until = time.monotonic() + QUIET
        while time.monotonic() < until:
            gc.collect()
            found.append(resources())
            online = online and all(trial.link.device.connection in ONLINE for trial in trials)
            time.sleep(0.1)
        if online:
            break
    usual = {kind: statistics.mode(each[kind].total() for each in found) for kind in found[0]}
    return {kind: next(each[kind] for each in found if each[kind].total() == usual[kind]) for kind in found[0]}


def run_cycles(trials: list[Trial], cycles: int) -> tuple[Resources, Resources, str]:
    """Run all cycles; return the resources after the first and the last cycle, and the memory as text."""
    counted: list[Resources] = []
    memory: list[float] = []
    with ThreadPoolExecutor(len(trials), thread_name_prefix="interrupting") as pool:
        for _ in range(cycles):
            for done in [pool.submit(trial.cycle) for trial in trials]:
                done.result()
            with contextlib.ExitStack() as quiet:
                for trial in trials:
                    quiet.enter_context(trial.reader.paused())
                counted.append(settled(trials))
                memory.append(resident())
    return counted[0], counted[-1], f"{memory[0]:.0f} to {memory[-1]:.0f} MiB resident"


def resident() -> float:
    """Return the resident memory of this process, MiB."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * resource.getpagesize() / 2**20


def grown(first: Resources, last: Resources) -> tuple[int, str]:
    """Return the growth summed over the kinds, and a text that names new resources."""
    more = {kind: max(0, last[kind].total() - first[kind].total()) for kind in first}
    counts = ", ".join(f"{first[kind].total()} to {last[kind].total()} {kind}" for kind in first)
    new = [f"{n} {name}" for kind in first if more[kind] for name, n in (last[kind] - first[kind]).items()]
    return sum(more.values()), counts + (f"; more: {', '.join(new)}" if new else "")


def table(trials: list[Trial]) -> None:
    """Print the recovery times of each link on standard error, worst first."""
    console = Console(stderr=True, width=None if sys.stderr.isatty() else 180)
    shown = Table("link", "p95", *(f"{kind} {seconds:g} s" for kind, seconds in CASES), title="worst recovery time, s")
    for trial in sorted(trials, key=lambda each: -percentile(each.all_samples(), 95)):
        worst = (f"{max(trial.samples[case]):.2f}" for case in CASES)
        shown.add_row(trial.link.name, f"{percentile(trial.all_samples(), 95):.2f}", *worst)
    console.print(shown)


def measure(cycles: int) -> list[Metric]:
    """Measure in this thread."""
    with device_links.started() as links, contextlib.ExitStack() as stack:
        trials = []
        for link in links:
            trials.append(Trial(link))
            stack.callback(trials[-1].end)
        first, last, memory = run_cycles(trials, cycles)
    table(trials)
    other_errors = [f"{trial.link.name}: {text}" for trial in trials for text in trial.reader.other_errors]
    if other_errors:
        raise RuntimeError(f"Errors other than device errors: {'; '.join(other_errors[:5])}")
    worst = max(trials, key=lambda trial: percentile(trial.all_samples(), 95))
    every = [sample for trial in trials for sample in trial.all_samples()]
    never = [f"{trial.link.name} never recovered from {case}" for trial in trials for case in trial.never_recovered]
    parts = (f"worst of {len(trials)} links: {worst.link.name}", f"of all {percentile(every, 95):.2f} s", *never)
    growth, counts = grown(first, last)
    return [
        Metric("recovery_p95_s", percentile(worst.all_samples(), 95), len(every), "; ".join(parts)),
        Metric("recovery_growth", growth, cycles, f"{counts}; {memory}"),
    ]


async def run(report: Report, long: bool = False) -> None:
    """Measure everything in this group."""
    logging.getLogger("arcor2_hw").setLevel(logging.ERROR)  # hide the log line of each connection loss
    for metric in await asyncio.to_thread(measure, LONG_CYCLES if long else CYCLES):
        report.add(metric)
