"""permissives() raises an error that is not a typed error."""

from .toy_press import ToyPress


class BrokenPress(ToyPress):
    """A press."""

    def permissives(self) -> list[tuple[str, bool]]:
        raise ValueError("invalid literal for int() with base 10: ''")
