"""A type without stop(): only its objects have one, which neither analysis nor a reader of the class can know."""

from typing import Any

from .toy_press import ToyPress


class BrokenPress(ToyPress):
    """A press."""

    stop: Any = None

    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        self.stop = super().stop
