"""Presses that hold, or continue, when their driver is killed, and their benches."""

import math
import time
from typing import ClassVar

from arcor2_hw.data.device import LossReaction

from .toy_device import STROKE
from .toy_press import ToyBench, ToyPress


class HoldingPress(ToyPress):
    """A press that holds its part."""

    loss_reaction: ClassVar[LossReaction] = LossReaction.holds()


class HoldingBench(ToyBench):
    """The process to be killed clamps a part; this is the last request that reaches the press."""

    object_type = HoldingPress
    lets_go_after: ClassVar[float] = math.inf

    def running(self) -> bool:
        return self.press.running()

    def holding(self) -> str:
        return "a part" if time.time() - self.heard_last() < self.lets_go_after else ""


class ContinuingPress(ToyPress):
    """A press that finishes its stroke."""

    loss_reaction: ClassVar[LossReaction] = LossReaction.continues()


class ContinuingBench(ToyBench):
    """The process to be killed starts a stroke."""

    object_type = ContinuingPress
    watchdog = math.inf
    stops_after: ClassVar[float] = math.inf

    def orphan(self) -> list[str]:
        self.began = time.time()
        return super().orphan()

    def progress(self) -> float:
        return (min(time.time(), self.heard_last() + self.stops_after) - self.began) / STROKE
