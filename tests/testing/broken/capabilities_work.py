"""An optional method only looks implemented."""

from arcor2_hw.objects import Machine, MachineState

from .toy_press import ToyPress


class BrokenPress(ToyPress):
    """A press."""

    def wait_for(self, state: MachineState, timeout: float) -> None:
        Machine.wait_for(self, state, timeout)
