"""Histograms of durations, for the metrics."""

from collections.abc import Iterator
from contextlib import contextmanager
from time import perf_counter
from typing import Final

BOUNDS: Final = (0.001, 0.005, 0.025, 0.1, 0.5, 2.5, 10.0)
"""Upper bounds of the classes of durations, s. There is one more class without an upper bound."""


class Durations:
    """Histograms of durations by name. The names come from a fixed set.

    Attributes:
        counts: Number of durations in each class of BOUNDS, and above.
        sums: Sum of the durations, s.
        failures: Number of failed or refused requests.
    """

    def __init__(self) -> None:
        self.counts: dict[str, list[int]] = {}
        self.sums: dict[str, float] = {}
        self.failures: dict[str, int] = {}

    def add(self, name: str, seconds: float, *, failed: bool = False) -> None:
        """Count a duration, s."""
        counts = self.counts.setdefault(name, [0] * (len(BOUNDS) + 1))
        counts[sum(bound < seconds for bound in BOUNDS)] += 1
        self.sums[name] = self.sums.get(name, 0.0) + seconds
        self.failures[name] = self.failures.get(name, 0) + failed

    @contextmanager
    def measure(self, name: str) -> Iterator[None]:
        """Count the duration of the body of the `with` statement; an exception counts as a failure."""
        started, failed = perf_counter(), True
        try:
            yield
            failed = False
        finally:
            self.add(name, perf_counter() - started, failed=failed)
