"""Half an answer is decoded as a value."""

from .toy_press import ToyPress


class BrokenPress(ToyPress):
    """A press."""

    def _decoded(self, answer: bytes) -> int:
        return answer[-1]
