"""identify() raises an error that is not a typed error."""

from arcor2_hw.data.device import Identity

from .toy_press import ToyPress


class BrokenPress(ToyPress):
    """A press."""

    def identify(self) -> Identity:
        raise ValueError("invalid literal for int() with base 10: ''")
