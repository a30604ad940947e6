"""The record of a run: the part inventory, and checkpoints before and after each action."""

import enum
import hashlib
import logging
import threading
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Final

from msgspec.structs import replace

from arcor2_hw.actions.decorator import ends_with_program
from arcor2_hw.data.base import Unset, now
from arcor2_hw.data.geometry import Orientation, Pose, Position
from arcor2_hw.data.parts import ConfirmedPart, DoneAction, PartInventory, RunCheckpoint, RunningAction
from arcor2_hw.data.project import START, Project
from arcor2_hw.exceptions import Arcor2Error, Conflict, PartUnconfirmed, StorageError
from arcor2_hw.runtime import messages as m
from arcor2_hw.runtime.branches import Action, Branch
from arcor2_hw.runtime.cell import Cell
from arcor2_hw.runtime.checkpoints import CheckpointFile, Checkpoints
from arcor2_hw.runtime.continuing import Continuation, kind_of
from arcor2_hw.runtime.device import Device
from arcor2_hw.runtime.part_tracking import PartTracking, Step
from arcor2_hw.runtime.values import results

MAX_RESULT: Final = 10_000
"""Maximum length of results that are stored in checkpoints, characters."""
MAX_STORED_ACTIONS: Final = 300
"""Maximum number of stored actions of a cycle. A program with a longer cycle cannot continue."""
_STORED: Final = (bool, int, float, str, enum.Enum, Pose, Position, Orientation)
"""Types of results that are stored in checkpoints."""

log = logging.getLogger(__name__)


class RunRecord:
    """Tracks the places of parts and stores checkpoints. The threads of the script and the reader thread call it.

    Args:
        checkpoints: returns the checkpoints of a scene.
        run: number of the run.
        package_id: the package.
        changed: called with the inventory after each change of a part.
        concerned: called before the end of each action that concerned a part, with the values of PartStep.
        each_action: whether a checkpoint is stored before and after each action, or only of the start and the end.
        continues: whether the program continues where it was interrupted.
        continue_at: number of actions of the interrupted cycle that are not repeated; None for all.
    """

    def __init__(
        self,
        checkpoints: Callable[[str], Checkpoints],
        run: int,
        package_id: str,
        changed: Callable[[PartInventory], None],
        concerned: Callable[[int, int, str, str, bool | None], None] = lambda *_: None,
        *,
        each_action: bool = True,
        continues: bool = False,
        continue_at: int | None = None,
    ) -> None:
        self._checkpoints, self._changed, self._each_action = checkpoints, changed, each_action
        self._concerned = concerned
        self._run = RunCheckpoint(run, package_id, "", now())
        self._lock = threading.Lock()
        self._file: Checkpoints | None = None
        self._parts: PartTracking | None = None
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
        """Completed actions of the present cycle; at most MAX_STORED_ACTIONS."""
        self._cycle_call = 0
        """Number of the call with which the present cycle has started; 0 if it started with an action."""
        self.continues, self._continue_at = continues, continue_at
        """Whether the program continues where it was interrupted."""
        self.continuation: Continuation | None = None
        """Completed actions of the interrupted cycle; None if the program starts from its beginning."""

    @classmethod
    def of(cls, run: m.RunPackage, post: Callable[[m.ToServer], None], at_server: Checkpoints) -> "RunRecord | None":
        """Return the record of a run, None if nothing is stored.

        Args:
            run: the request to run a package.
            post: sends a message to the server.
            at_server: the checkpoints if the server stores them.
        """
        if not (run.records or run.records_at_server):
            return None
        return cls(
            lambda scene: at_server if run.records_at_server else CheckpointFile(Path(run.records), scene),
            run.run,
            run.package_id,
            lambda inventory: post(m.PartsChanged(inventory)),
            lambda *concerned: post(m.PartStep(*concerned)),
            each_action=run.checkpoints,
            continues=run.continues,
            continue_at=run.continue_at,
        )

    def open(self, project: Project, cell: Cell, package: Path) -> None:
        """Read the inventory of the scene, and store that the run has started. All devices are connected.

        Raises:
            StorageError: the checkpoint cannot be stored.
            PartUnconfirmed: a person has to confirm the place of a part first.
            Conflict: the program cannot continue, because it was not interrupted, or was changed since.
        """
        file = self._checkpoints(project.scene_id)
        former = file.read() or PartInventory(project.scene_id)
        if former.unconfirmed:
            raise PartUnconfirmed("Confirm where the parts are before the program starts: {parts}.",
                                  parts=", ".join(part.shown for part in former.unconfirmed))  # fmt: skip
        self._first = next((item.end for item in project.logic if item.start == START), "")
        self._named = {action.id for action in project.all_actions() if action.outputs()}
        self._variables = {one.name: one.value for one in project.parameters if one.variable}
        stores = ((action.id, action.outputs()) for action in project.all_actions())
        self._outputs = {key: names for key, names in stores if not self._variables.keys().isdisjoint(names)}
        self._run = replace(self._run, package_hash=package_hash(package), variables=dict(self._variables))
        if self.continues:
            self._continue(former.run)
        self._parts, self._file = PartTracking(former, project, cell, self._changed, self._concerned), file
        self._store(always=True)
        self._parts.publish()

    def _continue(self, former: RunCheckpoint | Unset) -> None:
        """Use the completed actions of the last cycle of an interrupted run. Raises Conflict."""
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
            PartError: the action does not agree with the inventory. Nothing is recorded.
            InvalidData: the place of the part is unknown, because the pose is at no action point.
            StorageError: the checkpoint cannot be stored.
        """
        action_id = action.id or ""
        with self._lock:
            step = Step(action.number, _done(action, name, branch, device, bound))
            step = self._tracking.begin(step, device, bound, arguments, keywords)
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
        """Return whether an action is the first one of a cycle: after START, or the first one inside a call there."""
        outer = branch.calls[0] if branch.calls else action
        if not outer.id or outer.id != self._first:
            return False
        if outer is action:
            return action.attempt == 1 or self.continuation is not None
        former, self._cycle_call = self._cycle_call, outer.number
        return outer.number != former

    def outcome(self, branch: Branch, action_id: str, name: str) -> DoneAction | None:
        """Return the stored outcome of the next action of a branch, None if the action has to be executed.

        Raises:
            Conflict: the interrupted program has done another action here.
        """
        done = None if self.continuation is None else self.continuation.take(branch, action_id, name)
        if done is not None and branch.calls:
            self._cycle_call = branch.calls[0].number  # the enclosing call belongs to the interrupted cycle
        return done

    def end(self, step: Step, value: Any) -> None:
        """Record that an action has succeeded, or counts as done. It is on disk when this returns.

        Raises:
            WrongPart: another part was identified than expected.
        """
        with self._lock:
            self._tracking.end(step, value)
            self._running.pop(step.number, None)
            self._add_done(step.done, value)
            self._store_later()
            if step.part is not None or step.place:
                self._tracking.publish()
            self._tracking.report(step, value if step.judges and isinstance(value, bool) else None)

    def fail(self, step: Step) -> None:
        """Record that an action has failed or was stopped: the part may be at its source or its target."""
        with self._lock:
            if not self._interrupted and (running := self._running.pop(step.number, None)) is not None:
                self._held[running.branch, running.action_id] = running
            self._tracking.fail(step)
            self._store_later()
            if step.part is not None:
                self._tracking.publish(sense=True)
            self._tracking.report(step)

    def require_arrived(self, step: Step | None) -> None:
        """Check that a movement may count as done by hand. Raises WrongPart if a person has confirmed otherwise."""
        if step is not None:
            with self._lock:
                self._tracking.require_arrived(step)

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
        if len(self._done) < MAX_STORED_ACTIONS:
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
        former = self._checkpoints(scene_id).read()
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
            if self._parts is None:  # the program is still starting
                raise Conflict("The program has no part inventory.")
            if self._running:
                names = ", ".join(action.action_name for action in self._running.values())
                raise Conflict("Parts cannot be confirmed while an action runs: {names}.", names=names)
            self._tracking.confirm(found)
            self._store(always=True)
            self._tracking.publish(sense=True)

    # -------------------------------------------------------------------------------- helpers
    @property
    def _tracking(self) -> PartTracking:
        assert self._parts is not None, "open has succeeded"
        return self._parts

    def _store(self, *, always: bool = False) -> None:
        if self._file is not None and (always or self._each_action):
            unfinished = [] if self.continuation is None else self.continuation.unfinished
            actions = [*self._running.values(), *self._held.values(), *unfinished]
            run = replace(self._run, actions=actions, results=self._results, done=self._done)
            self._file.write(replace(self._tracking.inventory, run=run))

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
    return found if sum(map(len, found)) <= MAX_RESULT else []
