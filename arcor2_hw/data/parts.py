"""Parts in the cell: their places, the counts, and the interrupted program."""

import enum

from msgspec import field
from msgspec.structs import replace

from arcor2_hw.data.base import UNSET, Data, Timestamp, TranslatableData, Unset
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
    """A place of parts: id and name of its object, or of an action point that belongs to no object with a place.

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
    """Counts since the scene was created: fed = good + bad + rejected + in_cell."""

    fed: int = 0
    good: int = 0
    bad: int = 0
    rejected: int = 0
    in_cell: int = 0


class RunningAction(Data, frozen=True):
    """An action that has started but not ended.

    number: in the run. branch, frames: its position, as in ProgramPosition.
    """

    number: int
    action_id: str
    action_name: str
    branch: str
    frames: list[Frame] = field(default_factory=list)


class DoneAction(Data, frozen=True, omit_defaults=True):
    """An action of the present cycle that has ended. Clients do not receive it.

    branch: of the program. action_id, name, device: the action and its object. results: in JSON. stored: whether the
    results are stored. error, code, text: kind, code and message of an error that the program has handled. lasts:
    whether its effect ends with the program. moved: whether it has moved a part; source, target: its places before and
    after.
    """

    branch: str
    action_id: str
    name: str
    device: str
    results: list[str] = field(default_factory=list)
    stored: bool = True
    error: str = ""
    code: str = ""
    text: str = ""
    lasts: bool = False
    moved: bool = False
    source: str = ""
    target: str = ""


class Restart(TranslatableData, frozen=True):
    """An action of the interrupted cycle at which the program can continue instead, so that it is repeated.

    at: its position in the cycle. text: reason why it cannot continue there; empty if it can.
    """

    at: int
    action_id: str
    name: str
    text: str = ""


class RunCheckpoint(Data, frozen=True):
    """State of a run before or after an action.

    package_hash: SHA-256 of script and project. cycle: number of the present cycle, from 1. actions: those that have
    started and not ended; empty between two actions. last: the action that ended last. results: the newest results of
    each action by its id, in JSON. ended: whether the program has ended in an orderly way. done: the completed
    actions of the present cycle. variables: the values of the program's variables at its start, by name, in JSON.
    complete: whether `done` is complete. interrupted: whether the server has noticed that the run was interrupted.
    confirmed: whether a person has since confirmed the places of all parts.
    restarts: the actions before the interruption at which it can continue instead.
    continues, continues_at: whether the program can continue, and at which actions (empty: after `last`). missing: name
    of the action because of which it cannot.
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
    done: list[DoneAction] = field(default_factory=list)
    variables: dict[str, str] = field(default_factory=dict)
    complete: bool = False
    interrupted: bool = False
    confirmed: bool = False
    continues: bool = False
    continues_at: list[str] = field(default_factory=list)
    missing: str = ""
    restarts: list[Restart] = field(default_factory=list)

    def until(self, at: int) -> "RunCheckpoint":
        """Return the run as if it had been interrupted before one of its completed actions."""
        return replace(self, done=self.done[:at], actions=[])

    def split_done(self) -> tuple[list[DoneAction], list[DoneAction]]:
        """Return the actions whose results are used when the program continues, and those that are repeated.

        An action is repeated if its effect has ended with the program. The later actions of its branch are repeated
        too.
        """
        newest = {each.device: index for index, each in enumerate(self.done)}
        first: dict[str, int] = {}
        for index, each in enumerate(self.done):
            if each.lasts and newest[each.device] == index:
                first.setdefault(each.branch, index)
        kept: list[DoneAction] = []
        repeated: list[DoneAction] = []
        for index, each in enumerate(self.done):
            (kept if index < first.get(each.branch, len(self.done)) else repeated).append(each)
        return kept, repeated

    def why_not(self) -> str:
        """Return the name of the action because of which the program cannot continue; empty if it can."""
        kept, repeated = self.split_done()
        return next(
            (each.name for each in (*kept, *repeated) if not each.stored or (each in repeated and each.moved)), ""
        )

    def published(self) -> "RunCheckpoint":
        """Return the run as it is sent to clients: with the possible decisions, without the completed actions."""
        _, repeated = self.split_done()
        branches = {each.branch for each in repeated}
        at = [action.action_name for action in self.actions if action.branch not in branches]
        first = {each.branch: each.name for each in reversed(repeated)}
        missing = self.why_not()
        can = self.complete and self.cycle > 0 and not missing
        return replace(
            self,
            done=[],
            variables={},
            continues=can,
            continues_at=[*first.values(), *at] if can else [],
            missing=missing,
        )


class PartInventory(Data, frozen=True):
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

    number: of the part; 0: a part that is not in the inventory, which counts as fed. place: id of the place; empty: the
    part was taken out of the cell, which counts as rejected. serial: corrects the serial number. exists: false if there
    has never been such a part, for example because a sensor was wrong: it does not count as fed. A part that was read
    has existed.
    """

    number: int
    place: str
    serial: str | Unset = UNSET
    exists: bool = True


# Names before version 0.2.
PartBooks = PartInventory
