"""The press with the declaration of an alarm in its own folder."""

from ..toy_press import ToyPress  # noqa: TID252 - the analysis follows it as part of the driver


class BrokenPress(ToyPress):
    """A press."""
