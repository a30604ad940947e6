"""stop() returns before the press has stopped."""

import threading

from .toy_press import ToyPress


class BrokenPress(ToyPress):
    """A press."""

    def stop(self) -> None:
        """Stop."""
        threading.Timer(0.5, super().stop).start()
