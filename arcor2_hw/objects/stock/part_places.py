"""Places of parts: feeders, holders and boxes. Scenes with them record where each part is.

An action that takes a part from an action point, or puts it there, uses the place that is the parent of the point.
"""

import dataclasses
from collections.abc import Callable

from arcor2_hw.actions import StrEnum
from arcor2_hw.data.geometry import Pose
from arcor2_hw.data.parts import PlaceKind
from arcor2_hw.exceptions import InvalidData
from arcor2_hw.objects import Generic, GenericWithPose, Settings
from arcor2_hw.objects.small import HasPoints


class Outcome(StrEnum):
    """Category in which the parts in a box are counted."""

    GOOD = "good"
    BAD = "bad"
    REJECTED = "rejected"


@dataclasses.dataclass
class PlaceSettings(Settings):
    """Settings of a place.

    :param sensor: digital input that is on while a part is at the place: object and input, such as io/board_at_stop
    """

    sensor: str = ""


@dataclasses.dataclass
class BoxSettings(Settings):
    """Settings of a box.

    :param counts_as: as what parts in the box are counted
    """

    counts_as: Outcome


class PartHolder(GenericWithPose):
    """A nest or fixture that holds one part."""

    category = "Parts"
    icon = "box"
    _ABSTRACT = False
    display_name = "Part holder"
    place_kind = PlaceKind.HOLDER

    def __init__(self, obj_id: str, name: str, pose: Pose, settings: PlaceSettings | None = None) -> None:
        super().__init__(obj_id, name, pose, settings)
        self._sensor = "" if settings is None else settings.sensor
        self._find: Callable[[str], Generic] | None = None
        if self._sensor and not all(self._sensor.partition("/")):
            raise InvalidData(
                "{name}: the sensor {sensor} is not written as object/input.", name=name, sensor=self._sensor
            )

    def attach(self, find: Callable[[str], Generic]) -> None:
        """Receive the function that finds the object with the sensor."""
        self._find = find

    def part_present(self) -> bool | None:
        """Return whether the sensor detects a part; None without a sensor."""
        if not self._sensor or self._find is None:
            return None
        owner, _, point = self._sensor.partition("/")
        found = self._find(owner)
        if not isinstance(found, HasPoints):
            raise InvalidData("{name}: {owner} has no inputs.", name=self.name, owner=owner)
        return bool(found.read(point).value)


class PartFeeder(PartHolder):
    """A place where parts enter the cell, such as the stop of a conveyor."""

    _ABSTRACT = False
    display_name = "Part feeder"
    place_kind = PlaceKind.FEEDER


class PartBox(GenericWithPose):
    """A box in which parts leave the cell."""

    category = "Parts"
    icon = "box"
    _ABSTRACT = False
    display_name = "Part box"
    place_capacity = 0

    def __init__(self, obj_id: str, name: str, pose: Pose, settings: BoxSettings) -> None:
        super().__init__(obj_id, name, pose, settings)
        self.place_kind = PlaceKind(settings.counts_as.value)
