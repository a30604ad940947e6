"""What a worker has at hand: robots' models that were read, and the collision world that it was told of."""

from collections import OrderedDict
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import msgspec

from arcor2_hw.collision.description import RobotSource, WorldItem

if TYPE_CHECKING:
    from arcor2_hw.compute.world_replica import WorldReplica
    from arcor2_hw.kinematics import model

MODELS: Final = 16
"""Models of robots that are kept, those that were used last."""


class Desk:
    """Kept from one computation to the next. progress(share, message): tells how far the present one is.

    place: the name of the world of the present computation.
    """

    def __init__(self, progress: Callable[[float, str], None]) -> None:
        self.progress = progress
        self._models: OrderedDict[bytes, model.RobotModel] = OrderedDict()
        self._changes: dict[str, list[tuple[Sequence[WorldItem], Sequence[str]]]] = {}
        self._worlds: dict[str, WorldReplica] = {}
        self.place = ""

    def change(self, place: str, put: Sequence[WorldItem], remove: Sequence[str]) -> None:
        """Change a world; nothing is read of it before a computation needs it."""
        self._changes.setdefault(place, []).append((put, remove))

    def forget(self, place: str) -> None:
        """Drop a world."""
        self._changes.pop(place, None)
        self._worlds.pop(place, None)

    def world(self) -> "WorldReplica":
        """Give the world of this place as it is now. Raises ModelError, BadMesh ... for what of it cannot be used."""
        from arcor2_hw.compute.world_replica import WorldReplica

        world = self._worlds.get(self.place)
        if world is None:
            world = self._worlds[self.place] = WorldReplica(self.robot)
        for put, remove in self._changes.pop(self.place, []):
            world.change(put, remove)
        world.settle()
        return world

    def robot(self, wanted: RobotSource) -> "model.RobotModel":
        """Give a robot's model as it stands in itself, read once. Raises ModelError and its kinds.

        With a calibration: also where that is one of another arm.
        """
        from arcor2_hw.kinematics.dh import of_very_arm
        from arcor2_hw.kinematics.model import RobotModel as Model

        key = msgspec.msgpack.encode((wanted.urdf.path, wanted.settings, wanted.calibration))
        found = self._models.pop(key, None)
        if found is None:
            settings: dict[str, Any] = wanted.settings
            found = Model.load(Path(wanted.urdf.path), settings, name=wanted.urdf.name)
            if wanted.calibration is not None:
                found = of_very_arm(found, wanted.calibration)
        self._models[key] = found
        while len(self._models) > MODELS:
            self._models.popitem(last=False)
        return found
