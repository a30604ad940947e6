"""State of a compute worker between tasks: robot models and collision worlds."""

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
"""Maximum number of cached robot models; the least recently used is dropped."""


class WorkerState:
    """State that a worker keeps between tasks.

    Attributes:
        progress: Function (share, message) that reports the progress of the present task.
        place: Name of the world of the present task.
    """

    def __init__(self, progress: Callable[[float, str], None]) -> None:
        self.progress = progress
        self._models: OrderedDict[bytes, model.RobotModel] = OrderedDict()
        self._changes: dict[str, list[tuple[Sequence[WorldItem], Sequence[str]]]] = {}
        self._worlds: dict[str, WorldReplica] = {}
        self.place = ""

    def change(self, place: str, put: Sequence[WorldItem], remove: Sequence[str]) -> None:
        """Record a change of a world. The change is applied when a task needs the world."""
        self._changes.setdefault(place, []).append((put, remove))

    def forget(self, place: str) -> None:
        """Drop a world."""
        self._changes.pop(place, None)
        self._worlds.pop(place, None)

    def world(self) -> "WorldReplica":
        """Return the world of the present task.

        Raises:
            Arcor2Error: An item of the world cannot be used, such as a broken mesh (BadMesh) or robot model
                (ModelError).
        """
        from arcor2_hw.compute.world_replica import WorldReplica

        world = self._worlds.get(self.place)
        if world is None:
            world = self._worlds[self.place] = WorldReplica(self.robot)
        for put, remove in self._changes.pop(self.place, []):
            world.change(put, remove)
        world.apply_changes()
        return world

    def robot(self, wanted: RobotSource) -> "model.RobotModel":
        """Return a robot model with its root link at the origin. It is loaded once.

        Raises:
            ModelError: The model cannot be used, or the calibration belongs to another kind of robot.
        """
        from arcor2_hw.kinematics.dh import calibrated_model
        from arcor2_hw.kinematics.model import RobotModel as Model

        key = msgspec.msgpack.encode((wanted.urdf.path, wanted.settings, wanted.calibration))
        found = self._models.pop(key, None)
        if found is None:
            settings: dict[str, Any] = wanted.settings
            found = Model.load(Path(wanted.urdf.path), settings, name=wanted.urdf.name)
            if wanted.calibration is not None:
                found = calibrated_model(found, wanted.calibration)
        self._models[key] = found
        while len(self._models) > MODELS:
            self._models.popitem(last=False)
        return found
