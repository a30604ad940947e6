"""Parts in the cell: where each of them is, what was counted, and which program was interrupted."""

import enum

from msgspec import field

from arcor2_hw.data.base import UNSET, Data, Timestamp, Unset
from arcor2_hw.data.position import Frame


class PlaceKind(enum.StrEnum):
    """Kinds of places.

    A part comes into the cell by a FEEDER. A HOLDER is a fixture, a nest, a gripper or a machine. A part leaves the
    cell in a box: GOOD, BAD or REJECTED, by which it is counted.
    """

    FEEDER = "feeder"
    HOLDER = "holder"
    GOOD = "good"
    BAD = "bad"
    REJECTED = "rejected"

    @property
    def is_box(self) -> bool:
        """Whether parts leave the cell here."""
        return self in (PlaceKind.GOOD, PlaceKind.BAD, PlaceKind.REJECTED)


class Place(Data, frozen=True):
    """A place: id and name of the object, or of an action point at no object that is a place.

    capacity: how many parts fit; 0: any number. parts: serial numbers of the newest parts in a box. sensed: whether the
    sensor detects a part; omitted if there is no sensor, or if it was not read.
    """

    id: str
    name: str
    kind: PlaceKind
    capacity: int = 1
    parts: list[str] = field(default_factory=list)
    sensed: bool | Unset = UNSET


class Part(Data, frozen=True):
    """A part in the cell.

    number: unique in the scene. serial: its code; empty before it is scanned. place: id of the place. moving_to: id of
    the place where it may also be, because an action has not completed. good: result of its test. confirmed: whether
    the place is known; if not, a person has to confirm it.
    """

    number: int
    place: str
    serial: str = ""
    moving_to: str | Unset = UNSET
    good: bool | Unset = UNSET
    confirmed: bool = True

    @property
    def shown(self) -> str:
        """The name of the part in messages."""
        return self.serial or f"#{self.number}"


class PartCounts(Data, frozen=True):
    """What was counted since the scene exists: fed = good + bad + rejected + in_cell."""

    fed: int = 0
    good: int = 0
    bad: int = 0
    rejected: int = 0
    in_cell: int = 0


class RunningAction(Data, frozen=True):
    """An action that has started and not ended.

    number: in the run. branch, frames: its position, as in ProgramPosition.
    """

    number: int
    action_id: str
    action_name: str
    branch: str
    frames: list[Frame] = field(default_factory=list)


class RunCheckpoint(Data, frozen=True):
    """State of a run before or after an action.

    package_hash: SHA-256 of script and project. cycle: number of the present cycle, from 1. actions: those that have
    started and not ended; empty between two actions. last: the action that ended last. results: the newest results of
    each action by its id, in JSON. ended: whether the program has ended in an orderly way.
    """

    run: int
    package_id: str
    package_hash: str
    since: Timestamp
    cycle: int = 0
    actions: list[RunningAction] = field(default_factory=list)
    last: str = ""
    results: dict[str, list[str]] = field(default_factory=dict)
    ended: bool = False


class PartBooks(Data, frozen=True):
    """The parts of a scene, its places, the counts, and the last run."""

    scene_id: str
    parts: list[Part] = field(default_factory=list)
    places: list[Place] = field(default_factory=list)
    counts: PartCounts = PartCounts()
    run: RunCheckpoint | Unset = UNSET

    @property
    def unconfirmed(self) -> list[Part]:
        """The parts whose places a person has to confirm."""
        return [part for part in self.parts if not part.confirmed]

    def name_of(self, place_id: str) -> str:
        """Return the name of a place."""
        return next((place.name for place in self.places if place.id == place_id), place_id)


class ConfirmedPart(Data, frozen=True):
    """The place of a part as a person has found it.

    number: of the part; 0: a part that is not in the books, which counts as fed. place: id of the place; empty: the
    part was taken out of the cell, which counts as rejected. serial: corrects the serial number.
    """

    number: int
    place: str
    serial: str | Unset = UNSET
