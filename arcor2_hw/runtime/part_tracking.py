"""The parts of a running program: which actions move, identify and judge them, and where its places are."""

import inspect
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

from msgspec.structs import replace

from arcor2_hw.actions import metadata_of
from arcor2_hw.actions.decorator import PartFlow, part_flow_of
from arcor2_hw.data.base import UNSET, Unset
from arcor2_hw.data.geometry import Pose
from arcor2_hw.data.parts import ConfirmedPart, DoneAction, PartInventory, Place, PlaceKind
from arcor2_hw.data.project import Project
from arcor2_hw.exceptions import Arcor2Error, InvalidData, PlaceEmpty, PlaceOccupied
from arcor2_hw.runtime.cell import Cell
from arcor2_hw.runtime.device import Device
from arcor2_hw.runtime.ledger import Ledger


class Step(NamedTuple):
    """A started action.

    part, target: number of the part that it moves, and where to. place: where it identifies or judges one.
    concerns: number of the part that it concerns otherwise. serial, order: of the part, as arguments state them.
    """

    number: int
    done: DoneAction
    part: int | None = None
    target: str = ""
    place: str = ""
    identifies: bool = False
    judges: bool = False
    concerns: int = 0
    serial: str = ""
    order: str = ""


class PartTracking:
    """Tracks the places of parts while a program runs, in scenes with a feeder or a box. Calls must not overlap.

    Args:
        former: The inventory so far.
        project: The project of the program.
        cell: Its devices, all connected.
        changed: Called with the inventory after each change of a part.
        concerned: Called before the end of each action that concerned a part, with the values of PartStep.
    """

    def __init__(
        self,
        former: PartInventory,
        project: Project,
        cell: Cell,
        changed: Callable[[PartInventory], None],
        concerned: Callable[[int, int, str, str, bool | None], None],
    ) -> None:
        self._cell, self._changed, self._concerned = cell, changed, concerned
        self._ledger = Ledger(former)
        self._points: dict[str, str] = {}
        """The place of each action point by its id."""
        self._free: dict[str, Place] = {}
        """Places that are action points at no object, by their ids; they count when a part is first moved there."""
        self._own: dict[str, str] = {}
        """The place of each action at an action point, by the id of the action."""
        self._only_feeder = ""
        """The place of actions of functions, which are at no action point: the feeder, if there is only one."""
        kinds = {device.require().place_kind for device in cell}
        self._active = not kinds <= {None, PlaceKind.HOLDER}
        if self._active:
            self._ledger.set_places(self._find_places(project))

    @property
    def inventory(self) -> PartInventory:
        """The present inventory, without the run."""
        return self._ledger.inventory

    def _find_places(self, project: Project) -> list[Place]:
        """Return the places of the scene and of the project, and assign action points and actions to them."""
        places: dict[str, Place] = {}
        for device in self._cell:
            instance = device.require()
            if instance.place_kind is not None:
                kind, capacity = PlaceKind(instance.place_kind), instance.place_capacity
                places[device.id] = Place(device.id, device.name, kind, capacity)
        feeders = [key for key, place in places.items() if place.kind is PlaceKind.FEEDER]
        self._only_feeder = feeders[0] if len(feeders) == 1 else ""
        points = {point.id: point for point in project.action_points}
        for point in project.action_points:
            parent, seen = point.parent, {point.id}
            while not isinstance(parent, Unset) and parent in points and parent not in seen:
                seen.add(parent)
                parent = points[parent].parent
            if not isinstance(parent, Unset) and parent in places:
                self._points[point.id] = parent
            else:
                self._points[point.id] = point.id
                self._free[point.id] = Place(point.id, point.name, PlaceKind.FEEDER, 0)
            self._own |= {action.id: self._points[point.id] for action in point.actions}
        for action in project.all_actions():
            owner, _, method = action.type.partition("/")
            if owner not in (device.id for device in self._cell):
                continue
            bound = getattr(self._cell[owner].require(), method, None)
            flow, found = part_flow_of(bound), metadata_of(bound)
            self._ledger.tests = self._ledger.tests or (found is not None and found.verdict is True)
            if (flow.takes_from or flow.puts_to) and owner not in places:  # a robot or gripper
                places[owner] = Place(owner, self._cell[owner].name, PlaceKind.HOLDER)
        return list(places.values())

    def begin(
        self, step: Step, device: Device, bound: Any, arguments: Sequence[Any], keywords: Mapping[str, Any]
    ) -> Step:
        """Return the step with its effect on a part; `RunRecord.begin` states the arguments and errors."""
        if not self._active:
            return step
        flow, found = part_flow_of(bound), metadata_of(bound)
        judges = found is not None and found.verdict is True
        own = self._own.get(step.done.action_id, "")
        if flow.serial or flow.order:
            given = inspect.signature(bound).bind(*arguments, **keywords).arguments
            serial, order = (str(given.get(name, "")) if name else "" for name in (flow.serial, flow.order))
            step = step._replace(serial=serial, order=order)
        if not step.serial:  # the part in this device, or at the place of the action
            step = step._replace(concerns=self._ledger.part_at(device.id) or self._ledger.part_at(own))
        if flow._replace(serial="", order="") == PartFlow() and not judges:
            return step
        if flow.takes_from or flow.puts_to:
            there = self._place_of(bound, flow.takes_from or flow.puts_to, arguments, keywords) or own
            if not there:
                raise InvalidData(
                    "{device}: the place of the part is unknown, because its pose is at no action point.",
                    device=device.name,
                )
            if there in self._free:
                self._ledger.add_place(self._free[there])
            source, target = (there, device.id) if flow.takes_from else (device.id, there)
            self._compare(source, target)
            part = self._ledger.move(source, target)
            self.publish()
            return step._replace(
                part=part, target=target, done=replace(step.done, moved=True, source=source, target=target)
            )
        if judges and self._ledger.has_part(device.id):
            own = device.id
        elif flow.identifies:
            own = own or self._only_feeder
        if own in self._free:
            own = ""
        return step._replace(place=own, identifies=flow.identifies, judges=judges)

    def end(self, step: Step, value: Any) -> None:
        """Record that an action has succeeded, or counts as done. Raises WrongPart."""
        if step.part is not None:
            self._ledger.complete(step.part)
        if step.place and step.identifies and isinstance(value, str):
            self._ledger.identify(step.place, value)
        if step.place and step.judges and isinstance(value, bool):
            self._ledger.judge(step.place, value)

    def fail(self, step: Step) -> None:
        """Record that an action has failed or was stopped: the part may be at its source or its target."""
        if step.part is not None:
            self._ledger.fail(step.part)

    def require_arrived(self, step: Step) -> None:
        """Check that a movement may count as done by hand. Raises WrongPart if a person has confirmed otherwise."""
        if step.part is not None:
            self._ledger.require_arrived(step.part, step.target)

    def confirm(self, found: Sequence[ConfirmedPart]) -> None:
        """Record where a person has found parts. Raises Conflict, NotFound, PlaceOccupied."""
        self._ledger.confirm(found)

    def publish(self, *, sense: bool = False) -> None:
        """Publish the inventory. sense: whether sensors are read, which may take some milliseconds."""
        if not self._active:
            return
        inventory = self._ledger.inventory
        if sense:
            sensed = ((place, self._sensed(place.id)) for place in inventory.places)
            inventory = replace(
                inventory, places=[replace(place, sensed=UNSET if found is None else found) for place, found in sensed]
            )
        self._changed(inventory)

    def report(self, step: Step, verdict: bool | None = None) -> None:
        """Report that an action has concerned a part."""
        part = step.part or self._ledger.part_at(step.place) or step.concerns
        if self._active and (part or step.serial):
            self._concerned(step.number, 0 if step.serial else part, step.serial, step.order, verdict)

    def _place_of(self, bound: Any, parameter: str, arguments: Sequence[Any], keywords: Mapping[str, Any]) -> str:
        """Return the place that an argument names; empty if it is a pose at no action point."""
        given = inspect.signature(bound).bind(*arguments, **keywords).arguments.get(parameter)
        point = vars(given).get("action_point_id", "") if isinstance(given, Pose) else ""
        return self._points.get(point, "")

    def _compare(self, source: str, target: str) -> None:
        """Compare the expected parts with those that sensors detect. Raises PlaceEmpty, PlaceOccupied."""
        if self._sensed(source) is False:
            raise PlaceEmpty(
                "The sensor detects no part at {place}. Check the place, then confirm where the parts are.",
                place=self._ledger.name_of(source),
            )
        if not self._ledger.has_part(target) and self._sensed(target) is True:
            raise PlaceOccupied(
                "{place} is occupied: its sensor detects a part that is not in the inventory. Remove it.",
                place=self._ledger.name_of(target),
            )

    def _sensed(self, place_id: str) -> bool | None:
        """Return whether the sensor of a place detects a part; None without a sensor that can be read."""
        for device in self._cell:
            if device.id == place_id and device.instance is not None:
                try:
                    return device.instance.part_present()
                except Arcor2Error:
                    return None
        return None
