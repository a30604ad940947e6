"""The serial number is a different one with each connection."""

import itertools
from typing import ClassVar

from arcor2_hw.data.device import Identity

from .toy_press import ToyPress


class BrokenPress(ToyPress):
    """A press."""

    _numbers: ClassVar = itertools.count()

    def identify(self) -> Identity:
        return Identity("Toys", "Press", f"{next(self._numbers)}")
