"""What a worker has at hand: robots' models that were read, and the collision world that it was told of."""

from collections import OrderedDict
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import msgspec

from arcor2_hw.compute.world import RobotModel, Thing

if TYPE_CHECKING:
    from arcor2_hw.compute.standing_world import StandingWorld
    from arcor2_hw.kinematics import model

MODELS: Final = 16
"""Models of robots that are kept, those that were used last."""


class Desk:
    """Kept from one computation to the next. progress(share, message): tells how far the present one is."""

    def __init__(self, progress: Callable[[float, str], None]) -> None:
        self.progress = progress
        self._models: OrderedDict[bytes, model.RobotModel] = OrderedDict()
        self._changes: list[tuple[Sequence[Thing], Sequence[str]]] = []
        self._world: StandingWorld | None = None

    def change(self, put: Sequence[Thing], remove: Sequence[str]) -> None:
        """Change the world; nothing is read of it before a computation needs it."""
        self._changes.append((put, remove))

    def world(self) -> "StandingWorld":
        """Give the world as it is now. Raises ModelError, BadMesh ... for what of it cannot be used."""
        from arcor2_hw.compute.standing_world import StandingWorld

        if self._world is None:
            self._world = StandingWorld(self.robot)
        changes, self._changes = self._changes, []
        for put, remove in changes:
            self._world.change(put, remove)
        self._world.settle()
        return self._world

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
