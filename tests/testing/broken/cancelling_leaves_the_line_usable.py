"""The answer to a stop is returned as the next reading."""

from .toy_press import ToyPress


class BrokenPress(ToyPress):
    """A press."""

    def stop(self) -> None:
        """Stop."""
        super().stop()
        self._unread = "HALTED"

    def reading(self) -> float:
        answer, self._unread = self._unread, ""
        return answer or super().reading()  # type: ignore

    _unread = ""
