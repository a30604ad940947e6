"""Two points have the same name."""

from arcor2_hw.data.points import LivePoint, PointUse

from .toy_press import ToyPress


class BrokenPress(ToyPress):
    """A press."""

    def live_points(self) -> list[LivePoint]:
        return [LivePoint("guard", PointUse.INPUT, value, age=0.0) for value in (True, False)]
