"""The record of a run: the books of parts, and checkpoints before and after each action."""

import enum
import hashlib
import inspect
import logging
import threading
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Final, NamedTuple

from msgspec.structs import replace

from arcor2_hw.actions import metadata_of
from arcor2_hw.actions.decorator import PartFlow, ends_with_program, part_flow_of
from arcor2_hw.data.base import UNSET, Unset, now
from arcor2_hw.data.geometry import Orientation, Pose, Position
from arcor2_hw.data.parts import ConfirmedPart, DoneAction, PartBooks, Place, PlaceKind, RunCheckpoint, RunningAction
from arcor2_hw.data.project import START, Project
from arcor2_hw.exceptions import (
    Arcor2Error,
    Conflict,
    InvalidData,
    PartUnconfirmed,
    PlaceEmpty,
    PlaceOccupied,
    StorageError,
)
from arcor2_hw.runtime.branches import Action, Branch
from arcor2_hw.runtime.cell import Cell
from arcor2_hw.runtime.checkpoints import CheckpointFile
from arcor2_hw.runtime.continuing import Continuation, kind_of
from arcor2_hw.runtime.device import Device
from arcor2_hw.runtime.ledger import Ledger
from arcor2_hw.runtime.values import results

LONGEST_RESULT: Final = 10_000
"""Length of results that are stored in checkpoints, characters. Longer ones are not stored."""
MOST_DONE: Final = 300
"""Number of actions of a cycle that are stored. A program whose cycle has more cannot continue."""
_STORED: Final = (bool, int, float, str, enum.Enum, Pose, Position, Orientation)
"""Types of results that are stored in checkpoints."""

log = logging.getLogger(__name__)


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


class RunRecord:
    """Keeps the books of parts and stores checkpoints. The threads of the script and the reader thread call it.

    The books are kept in scenes with a feeder or a box. In other scenes there are only checkpoints.

    Args:
        directory: the directory of the checkpoints.
        run: number of the run.
        package_id: the package.
        changed: called with the books after each change of a part.
        concerned: called before the end of each action that concerned a part, with the values of PartStep.
        each_action: whether a checkpoint is stored before and after each action, or only of the start and the end.
        continues: whether the program continues where it was interrupted.
        continue_at: number of actions of the interrupted cycle that are not repeated; None for all.
    """

    def __init__(
        self,
        directory: Path,
        run: int,
        package_id: str,
        changed: Callable[[PartBooks], None],
        concerned: Callable[[int, int, str, str, bool | None], None] = lambda *_: None,
        *,
        each_action: bool = True,
        continues: bool = False,
        continue_at: int | None = None,
    ) -> None:
        self._directory, self._changed, self._each_action = directory, changed, each_action
        self._concerned = concerned
        self._run = RunCheckpoint(run, package_id, "", now())
        self._lock = threading.Lock()
        self._file: CheckpointFile | None = None
        self._ledger = Ledger(PartBooks(""))
        self._cell: Cell | None = None
        self._keeps_books = False
        self._points: dict[str, str] = {}
        """The place of each action point by its id."""
        self._free: dict[str, Place] = {}
        """Places that are action points at no object, by their ids; they count when a part is first moved there."""
        self._own: dict[str, str] = {}
        """The place of each action at an action point, by the id of the action."""
        self._only_feeder = ""
        """The place of actions of functions, which are at no action point: the feeder, if there is only one."""
        self._first = ""
        self._named: set[str] = set()
        """The actions whose results have names, so that other actions can use them."""
        self._outputs: dict[str, list[str]] = {}
        """The names of the results of the actions that store one in a variable."""
        self._variables: dict[str, str] = {}
        """The present values of the variables, by name, in JSON."""
        self._running: dict[int, RunningAction] = {}
        self._results: dict[str, list[str]] = {}
        self._held: dict[tuple[str, str], RunningAction] = {}
        """Actions that have failed, about which a person has to decide, by branch and id."""
        self._interrupted = False
        self._done: list[DoneAction] = []
        """What the present cycle has done; at most MOST_DONE actions."""
        self._cycle_call = 0
        """Number of the call with which the present cycle has started; 0 if it started with an action."""
        self.continues, self._continue_at = continues, continue_at
        """Whether the program continues where it was interrupted."""
        self.continuation: Continuation | None = None
        """What the interrupted cycle has done already; None if the program starts from its beginning."""

    def open(self, project: Project, cell: Cell, package: Path) -> None:
        """Read the books of the scene, and store that the run has started. All devices are connected.

        Raises:
            StorageError: the checkpoint cannot be stored.
            PartUnconfirmed: a person has to confirm the place of a part first.
            Conflict: the program cannot continue, because it was not interrupted, or was changed since.
        """
        self._cell = cell
        self._file = CheckpointFile(self._directory, project.scene_id)
        former = self._file.read() or PartBooks(project.scene_id)
        if former.unconfirmed:
            raise PartUnconfirmed("Confirm where the parts are before the program starts: {parts}.",
                                  parts=", ".join(part.shown for part in former.unconfirmed))  # fmt: skip
        self._ledger = Ledger(former)
        kinds = {device.require().place_kind for device in cell}
        self._keeps_books = not kinds <= {None, PlaceKind.HOLDER}
        self._first = next((item.end for item in project.logic if item.start == START), "")
        self._named = {action.id for action in project.all_actions() if action.outputs()}
        self._variables = {one.name: one.value for one in project.parameters if one.variable}
        stores = ((action.id, action.outputs()) for action in project.all_actions())
        self._outputs = {key: names for key, names in stores if not self._variables.keys().isdisjoint(names)}
        self._run = replace(self._run, package_hash=package_hash(package), variables=dict(self._variables))
        if self.continues:
            self._continue(former.run)
        if self._keeps_books:
            self._ledger.set_places(self._find_places(project, cell))
        self._store(always=True)
        self._publish()

    def _continue(self, former: RunCheckpoint | Unset) -> None:
        """Use what an interrupted run has done in its last cycle. Raises Conflict."""
        if self._continue_at is not None and not isinstance(former, Unset):
            former = former.until(self._continue_at)
        if isinstance(former, Unset) or former.ended or not former.published().continues:
            raise Conflict("The program cannot continue: it was not interrupted. Start it from its beginning.")
        if former.package_hash != self._run.package_hash:
            raise Conflict("The program cannot continue: it was changed. Start it from its beginning.")
        self.continuation = Continuation(former)
        self._results = dict(former.results)
        self._done = former.split_done()[0]
        self._variables |= former.variables
        self._run = replace(
            self._run, cycle=former.cycle, last=former.last, complete=True, variables=dict(self._variables)
        )

    def _find_places(self, project: Project, cell: Cell) -> list[Place]:
        """Return the places of the scene and of the project, and assign action points and actions to them."""
        places: dict[str, Place] = {}
        for device in cell:
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
            if owner not in (device.id for device in cell):
                continue
            bound = getattr(cell[owner].require(), method, None)
            flow, found = part_flow_of(bound), metadata_of(bound)
            self._ledger.tests = self._ledger.tests or (found is not None and found.verdict is True)
            if (flow.takes_from or flow.puts_to) and owner not in places:  # a robot or gripper
                places[owner] = Place(owner, cell[owner].name, PlaceKind.HOLDER)
        return list(places.values())

    # -------------------------------------------------------------------------------- actions
    def begin(
        self, action: Action, name: str, branch: Branch, device: Device, bound: Any, arguments: Sequence[Any],
        keywords: Mapping[str, Any],
    ) -> Step:  # fmt: skip
        """Record that an action is about to start. It is on disk when this returns.

        Args:
            action: the announced action.
            name: its name.
            branch: the branch of the program.
            device: the device.
            bound: its method.
            arguments: positional arguments.
            keywords: named arguments.

        Raises:
            PartError: the action does not agree with the books. Nothing is recorded.
            InvalidData: the place of the part is unknown, because the pose is at no action point.
            StorageError: the checkpoint cannot be stored.
        """
        action_id = action.id or ""
        with self._lock:
            step = Step(action.number, _done(action, name, branch, device, bound))
            if self._keeps_books:
                step = self._begin_part(step, device, bound, arguments, keywords)
            if self._starts_cycle(action, branch):
                variables = dict(self._variables)
                self._run = replace(self._run, cycle=self._run.cycle + 1, complete=True, variables=variables)
                self._done.clear()
                self.continuation = None
            self._held.pop((branch.id, action_id), None)
            frames = [each.frame for each in (*branch.calls, action) if each.frame is not None]
            self._running[action.number] = RunningAction(action.number, action_id, name, branch.id, frames)
            self._store()
        return step

    def _starts_cycle(self, action: Action, branch: Branch) -> bool:
        """Return whether an action is the first one of a cycle: that after START, or the first inside a call there."""
        outer = branch.calls[0] if branch.calls else action
        if not outer.id or outer.id != self._first:
            return False
        if outer is action:
            return action.attempt == 1 or self.continuation is not None
        former, self._cycle_call = self._cycle_call, outer.number
        return outer.number != former

    def outcome(self, branch: Branch, action_id: str, name: str) -> DoneAction | None:
        """Return what the interrupted program has done as the next action of a branch, None if it has to be executed.

        Raises:
            Conflict: the interrupted program has done another action here.
        """
        done = None if self.continuation is None else self.continuation.take(branch, action_id, name)
        if done is not None and branch.calls:
            self._cycle_call = branch.calls[0].number  # the call around it belongs to the interrupted cycle
        return done

    def _begin_part(
        self, step: Step, device: Device, bound: Any, arguments: Sequence[Any], keywords: Mapping[str, Any]
    ) -> Step:
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
            self._publish()
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

    def _place_of(self, bound: Any, parameter: str, arguments: Sequence[Any], keywords: Mapping[str, Any]) -> str:
        """Return the place that an argument names; empty if it is a pose at no action point."""
        given = inspect.signature(bound).bind(*arguments, **keywords).arguments.get(parameter)
        point = vars(given).get("action_point_id", "") if isinstance(given, Pose) else ""
        return self._points.get(point, "")

    def _compare(self, source: str, target: str) -> None:
        """Compare what the books expect with what sensors detect. Raises PlaceEmpty, PlaceOccupied."""
        if self._sensed(source) is False:
            raise PlaceEmpty(
                "The sensor detects no part at {place}. Check the place, then confirm where the parts are.",
                place=self._ledger.name_of(source),
            )
        if not self._ledger.has_part(target) and self._sensed(target) is True:
            raise PlaceOccupied(
                "{place} is occupied: its sensor detects a part that is not in the books. Remove it.",
                place=self._ledger.name_of(target),
            )

    def _sensed(self, place_id: str) -> bool | None:
        """Return whether the sensor of a place detects a part; None without a sensor that can be read."""
        if self._cell is None:
            return None
        for device in self._cell:
            if device.id == place_id and device.instance is not None:
                try:
                    return device.instance.part_present()
                except Arcor2Error:
                    return None
        return None

    def end(self, step: Step, value: Any) -> None:
        """Record that an action has succeeded, or counts as done. It is on disk when this returns.

        Raises:
            WrongPart: another part was identified than expected.
        """
        with self._lock:
            if step.part is not None:
                self._ledger.complete(step.part)
            if step.place and step.identifies and isinstance(value, str):
                self._ledger.identify(step.place, value)
            if step.place and step.judges and isinstance(value, bool):
                self._ledger.judge(step.place, value)
            self._running.pop(step.number, None)
            self._add_done(step.done, value)
            self._store_later()
            if step.part is not None or step.place:
                self._publish()
            self._report(step, value if step.judges and isinstance(value, bool) else None)

    def _report(self, step: Step, verdict: bool | None = None) -> None:
        """Report that an action has concerned a part."""
        part = step.part or self._ledger.part_at(step.place) or step.concerns
        if self._keeps_books and (part or step.serial):
            self._concerned(step.number, 0 if step.serial else part, step.serial, step.order, verdict)

    def fail(self, step: Step) -> None:
        """Record that an action has failed or was stopped: the part may be at its source or its target."""
        with self._lock:
            if not self._interrupted and (running := self._running.pop(step.number, None)) is not None:
                self._held[running.branch, running.action_id] = running
            if step.part is not None:
                self._ledger.fail(step.part)
            self._store_later()
            if step.part is not None:
                self._publish(sense=True)
            self._report(step)

    def require_arrived(self, step: Step | None) -> None:
        """Check that a movement may count as done by hand. Raises WrongPart if a person has confirmed otherwise."""
        if step is not None and step.part is not None:
            with self._lock:
                self._ledger.require_arrived(step.part, step.target)

    def decided(self, action: Action, name: str, branch: Branch, device: Device, bound: Any, value: Any) -> None:
        """Record that an action that has not started counts as done, by the decision of a person."""
        with self._lock:
            self._add_done(_done(action, name, branch, device, bound), value)
            self._store_later()

    def handled(
        self, action: Action, name: str, branch: Branch, device: Device, bound: Any, error: BaseException
    ) -> None:
        """Record that an action has failed with an error that the program may handle."""
        with self._lock:
            if isinstance(error, Arcor2Error) and not self._interrupted:
                done = replace(
                    _done(action, name, branch, device, bound),
                    error=kind_of(error), code=error.code, text=str(error), lasts=False,
                )  # fmt: skip
                self._append(done)
                self._store_later()

    def _add_done(self, done: DoneAction, value: Any) -> None:
        if not done.action_id:
            return
        if done.action_id in self._named:
            stored = self._results[done.action_id] = _stored(value)
            done = replace(done, results=stored, stored=bool(stored) or value is None)
        self._run = replace(self._run, last=done.action_id)
        self._append(done)

    def _append(self, done: DoneAction) -> None:
        self._held.pop((done.branch, done.action_id), None)
        if len(self._done) < MOST_DONE:
            self._done.append(done)
        else:
            self._run = replace(self._run, complete=False)

    def store_variables(self, action_id: str, results: Sequence[str]) -> None:
        """Record the results, in JSON, that an action or a call stores in variables."""
        if (names := self._outputs.get(action_id)) is not None:
            with self._lock:
                found = dict(zip(names, results, strict=False))
                self._variables |= {name: value for name, value in found.items() if name in self._variables}

    def former_variables(self, scene_id: str) -> Mapping[str, str]:
        """Return the values of the variables with which an interrupted program continues, by name, in JSON."""
        former = CheckpointFile(self._directory, scene_id).read()
        return {} if former is None or isinstance(former.run, Unset) else former.run.variables

    def interrupt(self) -> None:
        """Record that the program is stopped because the server has ended. The actions that ran remain recorded."""
        self._interrupted = True

    def close(self) -> None:
        """Record that the program has ended."""
        with self._lock:
            if self._file is not None:
                if not self._interrupted:
                    self._run = replace(self._run, ended=True)
                    self._running.clear()
                    self._held.clear()
                self._store_later(always=True)
                self._file.close()
                self._file = None

    # -------------------------------------------------------------------------------- people
    def confirm(self, found: Sequence[ConfirmedPart]) -> None:
        """Record where a person has found parts, while the program is held or paused.

        Raises:
            Conflict: an action is running, or the parts contradict each other.
            NotFound: there is no such part or place.
        """
        with self._lock:
            if self._running:
                names = ", ".join(action.action_name for action in self._running.values())
                raise Conflict("Parts cannot be confirmed while an action runs: {names}.", names=names)
            self._ledger.confirm(found)
            self._store(always=True)
            self._publish(sense=True)

    # -------------------------------------------------------------------------------- helpers
    def _publish(self, *, sense: bool = False) -> None:
        """Publish the books. sense: whether sensors are read, which may take some milliseconds."""
        if not self._keeps_books:
            return
        books = self._ledger.books
        if sense:
            sensed = ((place, self._sensed(place.id)) for place in books.places)
            books = replace(
                books, places=[replace(place, sensed=UNSET if found is None else found) for place, found in sensed]
            )
        self._changed(books)

    def _store(self, *, always: bool = False) -> None:
        if self._file is not None and (always or self._each_action):
            unfinished = [] if self.continuation is None else self.continuation.unfinished
            actions = [*self._running.values(), *self._held.values(), *unfinished]
            run = replace(self._run, actions=actions, results=self._results, done=self._done)
            self._file.write(replace(self._ledger.books, run=run))

    def _store_later(self, *, always: bool = False) -> None:
        """Store a checkpoint. If the disk fails, the next action does not start, but this one does not fail."""
        try:
            self._store(always=always)
        except StorageError as error:
            log.error("%s", error)


def _done(action: Action, name: str, branch: Branch, device: Device, bound: Any) -> DoneAction:
    return DoneAction(branch.id, action.id or "", name, device.id, lasts=ends_with_program(bound))


def package_hash(directory: Path) -> str:
    """Return the SHA-256 of the script and the project of a package."""
    digest = hashlib.sha256()
    for name in ("script.py", "data/project.json", "data/scene.json"):
        content = (directory / name).read_bytes()
        digest.update(len(content).to_bytes(8, "little") + content)
    return digest.hexdigest()


def _stored(value: Any) -> list[str]:
    """Return results as they are stored; none if they are long or of another type, such as an image."""
    members = value if isinstance(value, tuple) else () if value is None else (value,)
    if not all(isinstance(member, _STORED) for member in members):
        return []
    found = results(value)
    return found if sum(map(len, found)) <= LONGEST_RESULT else []
