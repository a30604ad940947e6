"""What a worker has at hand: robots' models that were read, and the collision world that it was told of."""

from collections import OrderedDict
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import msgspec

from arcor2_hw.compute.world import Body, RobotModel

if TYPE_CHECKING:
    from arcor2_hw.kinematics import model

MODELS: Final = 16
"""Models of robots that are kept, those that were used last."""


class Desk:
    """Kept from one computation to the next. progress(share, message): tells how far the present one is."""

    def __init__(self, progress: Callable[[float, str], None]) -> None:
        self.progress = progress
        self.bodies: dict[str, Body] = {}
        self._models: OrderedDict[bytes, model.RobotModel] = OrderedDict()

    def change(self, put: Sequence[Body], remove: Sequence[str]) -> None:
        """Change the world; nothing is read of it before a computation needs it."""
        for key in remove:
            self.bodies.pop(key, None)
        for body in put:
            self.bodies[body.id] = body

    def robot(self, wanted: RobotModel) -> "model.RobotModel":
        """Give a robot's model as it stands in itself, read once. Raises ModelError and its kinds."""
        from arcor2_hw.kinematics.model import RobotModel as Model

        key = msgspec.msgpack.encode((wanted.urdf.path, wanted.settings))
        found = self._models.pop(key, None)
        if found is None:
            settings: dict[str, Any] = wanted.settings
            found = Model.load(Path(wanted.urdf.path), settings, name=wanted.urdf.name)
        self._models[key] = found
        while len(self._models) > MODELS:
            self._models.popitem(last=False)
        return found
