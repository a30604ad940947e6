"""A second connect opens a second connection."""

from .toy_press import ToyPress


class BrokenPress(ToyPress):
    """A press."""

    def connect(self, timeout: float = 5.0) -> None:
        if self._thread is not None:
            self._end(None)
            former, self._thread = self._thread, None
            super().connect(timeout)
            former.join()
            return
        super().connect(timeout)
