"""Recovery: every transport lost and whole again, all drivers at once in one process.

A thread per link loses it; another goes on asking the driver all the time, as a program would. A link is back when the
driver says that it is online, or back, and has given a fresh reading; the time counts from just before the link is made
whole. After each cycle everybody is silent, and what the process holds is counted.
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
"""s; the longer is noticed by every driver, the shorter by some."""
CASES: Final = tuple((kind, seconds) for kind in KINDS for seconds in OUTAGES)
CONNECTS_WITHIN: Final = 20.0
"""s; the camera's first picture needs Open3D loaded."""
GIVEN_UP: Final = 20.0
"""s after which a driver counts as not back; the metric then has this time."""
ASKED_EACH: Final = 0.02
STEADY: Final = 1.0
"""s, and up to another half by chance, between being back and being lost again."""
QUIET: Final = 3.0
"""s in which what only ends belatedly ends, and what is held is counted."""
QUIET_TRIES: Final = 5

ONLINE: Final = (Connection.ONLINE, Connection.BACK)


class Asking:
    """Asks the driver of a link all the time, except while it is held."""

    def __init__(self, link: Link) -> None:
        self._line = link
        self._turn = threading.Lock()
        self._ending = threading.Event()
        self._fresh: Fresh | None = None
        self._told = threading.Event()
        self.failed = 0
        """Readings refused by a typed error."""
        self.mistakes: list[str] = []
        """Errors that are none of a device's."""
        self._thread = threading.Thread(target=self._run, name=f"asking {link.name}", daemon=True)
        self._thread.start()

    def expect(self, fresh: Fresh) -> None:
        self._told.clear()
        self._fresh = fresh

    def back_by(self, deadline: float) -> bool:
        """Wait until what was expected was told and the driver says that it is online."""
        if not self._told.wait(max(0.0, deadline - time.monotonic())):
            return False
        while self._line.device.connection not in ONLINE:
            if time.monotonic() > deadline:
                return False
            time.sleep(0.001)
        return True

    @contextlib.contextmanager
    def held(self) -> Iterator[None]:
        with self._turn:
            yield

    def end(self) -> None:
        self._ending.set()
        self._thread.join()

    def _run(self) -> None:
        while not self._ending.wait(ASKED_EACH):
            with self._turn:
                try:
                    found = self._line.read()
                except DeviceError:
                    self.failed += 1
                    continue
                except Exception as error:  # noqa: BLE001 - reported with the driver's name
                    self.failed += 1
                    self.mistakes.append(f"{type(error).__name__}: {error}")
                    continue
                if (fresh := self._fresh) is not None and fresh(found):
                    self._fresh = None
                    self._told.set()


class Trial:
    """One link through all its cases, cycle by cycle."""

    def __init__(self, link: Link) -> None:
        self.link = link
        self.samples: dict[tuple[Kind, float], list[float]] = {case: [] for case in CASES}
        self.lost_for_good: list[str] = []
        self._marks = 0
        for each in link.objects:
            each.connect(CONNECTS_WITHIN)
        self.asking = Asking(link)
        if not self._seen_anew():
            raise RuntimeError(f"{link.name} gives no fresh reading before anything was lost")

    def _seen_anew(self) -> bool:
        """Give the device another state; tell whether the driver tells it in time."""
        self._marks += 1
        self.asking.expect(self.link.mark(self._marks))
        return self.asking.back_by(time.monotonic() + GIVEN_UP)

    def cycle(self) -> None:
        for kind, seconds in random.sample(CASES, len(CASES)):
            time.sleep(STEADY + 0.5 * random.random())
            self._lose(kind, seconds)

    def _lose(self, kind: Kind, seconds: float) -> None:
        link = self.link
        failed = self.asking.failed
        link.lose(kind)
        time.sleep(seconds)
        failed = self.asking.failed - failed
        began = time.monotonic()
        link.heal(kind)
        back = self._seen_anew()
        self.samples[kind, seconds].append(time.monotonic() - began if back else GIVEN_UP)
        if seconds == max(OUTAGES) and not failed:
            raise RuntimeError(f"{link.name} gave readings through {seconds:g} s of {kind}: the link was not lost")
        if not back:
            self.lost_for_good.append(f"{kind} of {seconds:g} s")
            self._anew()

    def _anew(self) -> None:
        with self.asking.held():
            for each in reversed(self.link.objects):
                each.disconnect()
            for each in self.link.objects:
                each.connect(CONNECTS_WITHIN)
        if not self._seen_anew():
            raise RuntimeError(f"{self.link.name} is not there when it is connected anew either")

    def end(self) -> None:
        self.asking.end()
        for each in reversed(self.link.objects):
            each.disconnect()

    def all_samples(self) -> list[float]:
        return [sample for samples in self.samples.values() for sample in samples]


Held = dict[str, Counter[str]]


def held() -> Held:
    """Count the threads (also those of libraries), descriptors and tasks of this process, each by what it is."""
    names = {thread.native_id: thread.name for thread in threading.enumerate()}
    threads = Counter(names.get(int(each.name), "of a library") for each in Path("/proc/self/task").iterdir())
    descriptors: Counter[str] = Counter()
    for each in Path("/proc/self/fd").iterdir():
        with contextlib.suppress(OSError):  # the one of this very look
            descriptors[str(each.readlink()).partition(":")[0]] += 1
    found = [each for each in gc.get_objects() if issubclass(type(each), asyncio.Task)]
    tasks = Counter(getattr(each.get_coro(), "__qualname__", "") for each in found if not each.done())
    return {"threads": threads, "descriptors": descriptors, "tasks": tasks}


def settled(trials: list[Trial]) -> Held:
    """Give what is held most of the time in a few seconds in which every driver is online.

    Not the least: a link that a busy machine lets be lost and opened anew just then holds less.
    """
    for _ in range(QUIET_TRIES):
        found: list[Held] = []
        online = True
        until = time.monotonic() + QUIET
        while time.monotonic() < until:
            gc.collect()
            found.append(held())
            online = online and all(trial.link.device.connection in ONLINE for trial in trials)
            time.sleep(0.1)
        if online:
            break
    usual = {kind: statistics.mode(each[kind].total() for each in found) for kind in found[0]}
    return {kind: next(each[kind] for each in found if each[kind].total() == usual[kind]) for kind in found[0]}


def through(trials: list[Trial], cycles: int) -> tuple[Held, Held, str]:
    """Run all cycles; give what was held after the first and after the last, and in words the memory then."""
    counted: list[Held] = []
    memory: list[float] = []
    with ThreadPoolExecutor(len(trials), thread_name_prefix="losing") as pool:
        for _ in range(cycles):
            for done in [pool.submit(trial.cycle) for trial in trials]:
                done.result()
            with contextlib.ExitStack() as quiet:
                for trial in trials:
                    quiet.enter_context(trial.asking.held())
                counted.append(settled(trials))
                memory.append(resident())
    return counted[0], counted[-1], f"{memory[0]:.0f} to {memory[-1]:.0f} MiB resident"


def resident() -> float:
    """Give the memory of this process, MiB."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * resource.getpagesize() / 2**20


def grown(first: Held, last: Held) -> tuple[int, str]:
    """Give how many more there are, each kind by itself, and which are new."""
    more = {kind: max(0, last[kind].total() - first[kind].total()) for kind in first}
    counts = ", ".join(f"{first[kind].total()} to {last[kind].total()} {kind}" for kind in first)
    new = [f"{n} {what}" for kind in first if more[kind] for what, n in (last[kind] - first[kind]).items()]
    return sum(more.values()), counts + (f"; more: {', '.join(new)}" if new else "")


def table(trials: list[Trial]) -> None:
    """Print on standard error how long each link took, worst first."""
    console = Console(stderr=True, width=None if sys.stderr.isatty() else 180)
    shown = Table("link", "p95", *(f"{kind} {seconds:g} s" for kind, seconds in CASES), title="back after, s: worst")
    for trial in sorted(trials, key=lambda each: -percentile(each.all_samples(), 95)):
        worst = (f"{max(trial.samples[case]):.2f}" for case in CASES)
        shown.add_row(trial.link.name, f"{percentile(trial.all_samples(), 95):.2f}", *worst)
    console.print(shown)


def measure(cycles: int) -> list[Metric]:
    """Measure on this thread."""
    with device_links.started() as links, contextlib.ExitStack() as stack:
        trials = []
        for link in links:
            trials.append(Trial(link))
            stack.callback(trials[-1].end)
        first, last, memory = through(trials, cycles)
    table(trials)
    mistakes = [f"{trial.link.name}: {text}" for trial in trials for text in trial.asking.mistakes]
    if mistakes:
        raise RuntimeError(f"errors that are none of a device's: {'; '.join(mistakes[:5])}")
    worst = max(trials, key=lambda trial: percentile(trial.all_samples(), 95))
    every = [sample for trial in trials for sample in trial.all_samples()]
    never = [f"{trial.link.name} never back from {case}" for trial in trials for case in trial.lost_for_good]
    parts = (f"worst of {len(trials)} links: {worst.link.name}", f"of all {percentile(every, 95):.2f} s", *never)
    growth, what = grown(first, last)
    return [
        Metric("recovery_p95_s", percentile(worst.all_samples(), 95), len(every), "; ".join(parts)),
        Metric("recovery_growth", growth, cycles, f"{what}; {memory}"),
    ]


async def run(report: Report, long: bool = False) -> None:
    """Measure everything in this group."""
    logging.getLogger("arcor2_hw").setLevel(logging.ERROR)  # each loss is told once, as it should; not here
    for metric in await asyncio.to_thread(measure, LONG_CYCLES if long else CYCLES):
        report.add(metric)
