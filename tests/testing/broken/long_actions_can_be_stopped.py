"""Only the objects have stop(), so neither the analysis nor a reader of the class can find it."""

from typing import Any

from .toy_press import ToyPress


class BrokenPress(ToyPress):
    """A press."""

    stop: Any = None

    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        self.stop = super().stop
