"""Half an answer is read as far as it goes."""

from .toy_press import ToyPress


class BrokenPress(ToyPress):
    """A press."""

    def _decoded(self, answer: bytes) -> int:
        return answer[-1]
