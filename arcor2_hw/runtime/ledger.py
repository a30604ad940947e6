"""The inventory of parts in a cell: the place of each part, and the numbers of parts that entered and left."""

from collections import deque
from collections.abc import Iterable, Sequence
from typing import Final

from msgspec import UNSET
from msgspec.structs import replace

from arcor2_hw.data.base import Unset
from arcor2_hw.data.parts import ConfirmedPart, Part, PartCounts, PartInventory, Place, PlaceKind
from arcor2_hw.exceptions import Conflict, NotFound, PartUnconfirmed, PlaceEmpty, PlaceOccupied, WrongPart

SERIALS: Final = 100
"""Number of serial numbers that are stored of each box; the newest."""


class PartGone(WrongPart):
    """A part has left the cell, so it cannot be brought to a place."""


class Ledger:
    """The part inventory of a scene. Every operation leaves fed = good + bad + rejected + in the cell.

    Args:
        inventory: the inventory so far.
    """

    def __init__(self, inventory: PartInventory) -> None:
        self._scene_id = inventory.scene_id
        self._parts = {part.number: part for part in inventory.parts}
        self._places = {place.id: place for place in inventory.places}
        self._serials = {place.id: deque(place.parts, SERIALS) for place in inventory.places if place.kind.is_box}
        counts = inventory.counts
        self._left = {PlaceKind.GOOD: counts.good, PlaceKind.BAD: counts.bad, PlaceKind.REJECTED: counts.rejected}
        self._fed = counts.fed
        self._gone: dict[int, str] = {}
        """Ids of the boxes in which parts have left the cell, by number of the part; empty: taken out by hand."""
        self.tests = False
        """Whether the program tests parts, so that only those that have passed may go into a good box."""

    @property
    def inventory(self) -> PartInventory:
        """The present inventory, without the run."""
        places = [
            replace(place, parts=list(self._serials[key])) if key in self._serials else place
            for key, place in self._places.items()
        ]
        left = self._left
        counts = PartCounts(
            self._fed, left[PlaceKind.GOOD], left[PlaceKind.BAD], left[PlaceKind.REJECTED], len(self._parts)
        )
        return PartInventory(self._scene_id, list(self._parts.values()), places, counts)

    def set_places(self, places: Iterable[Place]) -> None:
        """Replace the places. Those that still contain a part remain."""
        occupied = {part.place for part in self._parts.values()} | {
            part.moving_to for part in self._parts.values() if not isinstance(part.moving_to, Unset)
        }
        former = {key: place for key, place in self._places.items() if key in occupied}
        self._places = former | {place.id: place for place in places}
        for key, place in self._places.items():
            if place.kind.is_box:
                self._serials.setdefault(key, deque(maxlen=SERIALS))

    def add_place(self, place: Place) -> None:
        """Add a place unless it exists."""
        self._places.setdefault(place.id, place)

    # -------------------------------------------------------------------------------- actions
    def move(self, source: str, target: str) -> int:
        """Start to move a part from one place to another, and return its number.

        A part at a feeder that is not in the inventory is new. The move ends by `complete` or `fail`. A part whose
        place is not confirmed may only repeat its last movement, by the decision of a person.

        Raises:
            PlaceOccupied: the target is occupied.
            PlaceEmpty: there is no part at the source.
            WrongPart: the result of the test does not agree with the box.
            PartUnconfirmed: the place of the part is unknown.
        """
        start, end = self._places[source], self._places[target]
        if start.kind.is_box:
            raise PlaceEmpty("{place} is a box. Parts that have left the cell cannot be taken back.", place=start.name)
        part = next((one for one in self._parts.values() if one.place == source), None)
        for one in self._parts.values():
            if not one.confirmed and {one.place, one.moving_to} & {source, target} and one.moving_to != target:
                raise self._unconfirmed(one)
        if part is None and start.kind is not PlaceKind.FEEDER:
            raise PlaceEmpty(
                "The inventory has no part at {place}. Check the place, then confirm where the parts are.",
                place=start.name,
            )
        self._require_room(end, None if part is None else part.number)
        if part is None:
            part = self._new(source)
        if end.kind is PlaceKind.GOOD and (part.good is False or (self.tests and part.good is not True)):
            raise WrongPart(
                "Part {part} does not belong in {place}: it has not passed its test.", part=part.shown, place=end.name
            )
        if end.kind is PlaceKind.BAD and part.good is True:
            raise WrongPart(
                "Part {part} does not belong in {place}: it has passed its test.", part=part.shown, place=end.name
            )
        self._parts[part.number] = replace(part, moving_to=target, confirmed=True)
        return part.number

    def complete(self, number: int) -> None:
        """Record that a part has arrived at its target."""
        part = self._parts.get(number)
        if part is not None and not isinstance(part.moving_to, Unset):  # unless a person has confirmed its place
            self._put(part, part.moving_to)

    def fail(self, number: int) -> None:
        """Record that the movement of a part has not completed: it is at its source or its target."""
        part = self._parts.get(number)
        if part is not None and not isinstance(part.moving_to, Unset):
            self._parts[number] = replace(part, confirmed=False)

    def identify(self, place_id: str, serial: str) -> None:
        """Record the serial number of the part at a place. At a feeder, the part may be new.

        Raises:
            WrongPart: another part is expected here, or this part is expected elsewhere.
        """
        place = self._places[place_id]
        known = next((part for part in self._parts.values() if part.serial == serial), None)
        if known is not None and known.place != place_id:
            raise WrongPart(
                "Part {part} was read at {place}, but it is expected at {expected}. Confirm where the parts are.",
                part=serial,
                place=place.name,
                expected=self.name_of(known.place),
            )
        part = next((one for one in self._parts.values() if one.place == place_id), None)
        if part is None:
            if place.kind is not PlaceKind.FEEDER:
                return
            part = self._new(place_id)
        elif part.serial not in ("", serial):
            raise WrongPart(
                "Part {part} was read at {place}, where part {expected} is expected. Confirm where the parts are.",
                part=serial,
                place=place.name,
                expected=part.serial,
            )
        self._parts[part.number] = replace(part, serial=serial)

    def judge(self, place_id: str, good: bool) -> None:
        """Record the result of the test of the part at a place."""
        for part in self._parts.values():
            if part.place == place_id:
                self._parts[part.number] = replace(part, good=good)
                return

    def require_arrived(self, number: int, target: str) -> None:
        """Raise WrongPart if a person has confirmed a part at a place other than the target of its movement."""
        part = self._parts.get(number)
        if part is not None and isinstance(part.moving_to, Unset) and part.place != target:
            raise WrongPart(
                "Part {part} is at {place}, not at {target}. Bring it there and confirm that, or decide otherwise.",
                part=part.shown,
                place=self.name_of(part.place),
                target=self.name_of(target),
            )
        if part is None and self._gone.get(number, target) != target:
            raise PartGone("The part is not at {target}: it has left the cell.", target=self.name_of(target))

    def has_part(self, place_id: str) -> bool:
        """Return whether a part is at a place, or may be there."""
        return any(place_id in (part.place, part.moving_to) for part in self._parts.values())

    def part_at(self, place_id: str) -> int:
        """Return the number of the part at a place, 0 if there is none."""
        return next((part.number for part in self._parts.values() if place_id and part.place == place_id), 0)

    def name_of(self, place_id: str) -> str:
        """Return the name of a place."""
        place = self._places.get(place_id)
        return place_id if place is None else place.name

    # -------------------------------------------------------------------------------- people
    def interrupt(self) -> None:
        """Record that the program was interrupted: a person has to confirm the place of each part."""
        self._parts = {number: replace(part, confirmed=False) for number, part in self._parts.items()}

    def confirm(self, found: Sequence[ConfirmedPart]) -> None:
        """Record where a person has found parts. Either all of them are recorded or none.

        Raises:
            NotFound: there is no such part or place.
            PlaceOccupied: too many parts would be at a place.
            Conflict: a serial number is given to two parts, or a part with a serial number is reported as missing.
        """
        parts = dict(self._parts)
        fed = self._fed
        leaving: list[tuple[Part, Place | None]] = []
        for one in found:
            if one.number:
                part = parts.get(one.number)
                if part is None:
                    raise NotFound("There is no part {number} in the cell.", number=one.number)
                if not one.exists:
                    if part.serial:
                        raise Conflict("Part {part} was read, so it exists. Say where it is.", part=part.serial)
                    del parts[part.number]
                    fed -= 1
                    continue
            else:
                fed += 1
                part = Part(_next_number(fed, parts), "")
            place = self._places.get(one.place)
            if place is None and (one.place or not one.number):
                raise NotFound("The cell has no place {place}.", place=one.place)
            serial = part.serial if isinstance(one.serial, Unset) else one.serial
            part = replace(part, place=one.place, serial=serial, moving_to=UNSET, confirmed=True)
            if place is None or place.kind.is_box:
                parts.pop(part.number, None)
                leaving.append((part, place))
            else:
                parts[part.number] = part
        self._check(parts.values())
        self._parts, self._fed = parts, fed
        for part, place in leaving:
            self._leave(part, place)

    def _check(self, parts: Iterable[Part]) -> None:
        serials: set[str] = set()
        used: dict[str, list[Part]] = {}
        for part in parts:
            if part.serial and part.serial in serials:
                raise Conflict("Two parts cannot have the serial number {serial}.", serial=part.serial)
            serials.add(part.serial)
            used.setdefault(part.place, []).append(part)
        for key, there in used.items():
            place = self._places.get(key)
            if place is not None and place.capacity and len(there) > place.capacity:
                raise self._occupied(place, there[0])

    # -------------------------------------------------------------------------------- helpers
    def _new(self, place_id: str) -> Part:
        self._fed += 1
        part = Part(_next_number(self._fed, self._parts), place_id)
        self._parts[part.number] = part
        return part

    def _put(self, part: Part, place_id: str) -> None:
        place = self._places[place_id]
        part = replace(part, place=place_id, moving_to=UNSET, confirmed=True)
        if place.kind.is_box:
            del self._parts[part.number]
            self._leave(part, place)
        else:
            self._parts[part.number] = part

    def _leave(self, part: Part, place: Place | None) -> None:
        """Count a part that has left the cell, in a box or by hand."""
        self._gone[part.number] = "" if place is None else place.id
        self._left[PlaceKind.REJECTED if place is None else place.kind] += 1
        if place is not None:
            self._serials[place.id].append(part.shown)

    def _require_room(self, place: Place, moved: int | None) -> None:
        if not place.capacity:
            return
        there = [
            part for part in self._parts.values() if part.number != moved and place.id in (part.place, part.moving_to)
        ]
        if len(there) >= place.capacity:
            raise self._occupied(place, there[0])

    def _occupied(self, place: Place, part: Part) -> PlaceOccupied:
        return PlaceOccupied(
            "{place} is occupied: part {part} is there. Remove it, then confirm where it is.",
            place=place.name,
            part=part.shown,
        )

    def _unconfirmed(self, part: Part) -> PartUnconfirmed:
        to = part.place if isinstance(part.moving_to, Unset) else part.moving_to
        return PartUnconfirmed(
            "Part {part} is at {place} or at {other}. Confirm where it is.",
            part=part.shown,
            place=self.name_of(part.place),
            other=self.name_of(to),
        )


def _next_number(fed: int, parts: Iterable[int]) -> int:
    """Return the number of a new part: usually the number of fed parts, but unique if some of them did not exist."""
    return max(fed, 1 + max(parts, default=0))
