"""The bench does not change the weight, so that it would not notice an old result."""

from collections.abc import Iterator
from typing import Any

from arcor2_hw.testing.bench import Check

from .toy_press import ToyBench, ToyPress


class BrokenPress(ToyPress):
    """A press."""


class BrokenBench(ToyBench):
    def results(self, device: Any) -> Iterator[Check]:
        for _ in range(2):
            yield Check("weigh", device.weigh(), self.press.weight, 0.001)
