"""An optional method exists only at run time, so that the analysis cannot find it."""

from .toy_press import NOWHERE, ToyPress


class BrokenPress(ToyPress):
    """A press."""

    def __init__(self, obj_id: str, name: str, address: str = NOWHERE) -> None:
        super().__init__(obj_id, name, address)
        self.permissives = lambda: [("guard closed", True)]
