"""A thread keeps observing a controlled press after disconnect."""

import threading

from .toy_press import ToyPress


class BrokenPress(ToyPress):
    """A press."""

    def _end(self, thread: threading.Thread | None) -> None:
        if not self._was_controlled:
            super()._end(thread)

    def take_control(self) -> None:
        super().take_control()
        self._was_controlled = True

    _was_controlled = False
