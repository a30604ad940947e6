"""Who it is cannot be told: an error that is nobody's type."""

from arcor2_hw.data.device import Identity

from .toy_press import ToyPress


class BrokenPress(ToyPress):
    """A press."""

    def identify(self) -> Identity:
        raise ValueError("invalid literal for int() with base 10: ''")
