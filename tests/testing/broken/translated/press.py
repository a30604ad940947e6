"""The press with a translation in its own folder."""

from arcor2_hw.exceptions import Refused

from ..toy_press import ToyPress  # noqa: TID252 - the analysis follows it as part of the driver


class BrokenPress(ToyPress):
    """A press."""

    def _require_open(self) -> None:

        if self.force() > 0.0:
            raise Refused("{name} is closed.", name=self.name)
