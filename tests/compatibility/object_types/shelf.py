"""A shelf, as an integrator writes an object type: uploaded to a server, no driver behind it."""

from dataclasses import dataclass
from typing import Annotated

from arcor2_hw.actions import IntEnum, StrEnum, action, deadline_of, metadata_of
from arcor2_hw.data.base import UNSET
from arcor2_hw.data.device import Alarm, Connection, Health, Identity, LossReaction
from arcor2_hw.data.geometry import Orientation, Pose, Position
from arcor2_hw.data.object_type import Box, Models
from arcor2_hw.data.robot import Joint
from arcor2_hw.exceptions import Arcor2Error, DeviceFault, InvalidData, NotInControl, OutOfRange, Refused
from arcor2_hw.objects import CollisionObject, Generic, Settings

IMPORTED = (UNSET, Alarm, Annotated, Box, Connection, DeviceFault, Generic, Health, IntEnum, Joint, LossReaction)
ERRORS = (Arcor2Error, InvalidData, NotInControl, OutOfRange, Refused)
assert IMPORTED
assert ERRORS
assert callable(deadline_of)
assert callable(metadata_of)


class Side(StrEnum):
    """Where on a row a part is put."""

    LEFT = "left"
    RIGHT = "right"


@dataclass
class ShelfSettings(Settings):
    """The settings that a person enters for the shelf."""

    rows: int
    distance: float = 0.3
    owner: str = "nobody"
    side: Side = Side.LEFT


class Shelf(CollisionObject):
    """A shelf with rows."""

    _ABSTRACT = False

    def __init__(
        self, obj_id: str, name: str, pose: Pose, collision_model: Models | None, settings: ShelfSettings
    ) -> None:
        super().__init__(obj_id, name, pose, collision_model, settings)
        self._filled = 0
        self._place = Pose(Position(), Orientation())

    @property
    def settings(self) -> ShelfSettings:
        """What a person said."""
        settings = super().settings
        assert isinstance(settings, ShelfSettings)
        return settings

    def identify(self) -> Identity:
        """Name the shelf."""
        return Identity("ACME", "shelf", self.settings.owner, "1")

    @action
    def put(self, where: Pose, row: int, side: Side, force: float = 0.25, *, an: str | None = None) -> int:
        """Put a part on a row.

        :param where: on which place
        :param row: number of the row
        :param side: of the row
        :param force: as a part of the largest
        """
        assert 1 <= row <= 9
        assert 0.0 <= force <= 1.0
        if row > self.settings.rows:
            raise OutOfRange(f"{self.name} has {self.settings.rows} rows, not {row}")
        self._place = where
        self._filled += 1
        return self._filled

    @action
    def is_full(self, slots: int, label: str, filled: int, *, an: str | None = None) -> bool:
        """Say whether all places are taken."""
        return filled >= slots and bool(label)
