"""The gate, through which each action of a program passes: pause, resume, step, breakpoints, stop."""

import enum
import sys
import threading
import time
from collections.abc import Callable, Iterable, Set

from arcor2_hw.data.position import ProgramStep
from arcor2_hw.exceptions import ProgramStopped
from arcor2_hw.runtime.branches import Branch


class _Mode(enum.Enum):
    RUN = enum.auto()
    STEP = enum.auto()
    PAUSE = enum.auto()


class BranchHeld(ProgramStopped):
    """The branch was ended at its next action, because another branch of the same parallel work has failed."""


class Gate:
    """Hold the threads of a script before and after each action while the program is paused.

    Args:
        notify: Called with "paused" when no action runs any more, and with "running" when the program continues.
        settle: Called before a pause to wait until no device moves. No lock is held.
        start_paused: Whether to pause before the first action.
        breakpoints: Ids of actions and action points before which the program pauses.
    """

    def __init__(
        self,
        notify: Callable[[str], None],
        settle: Callable[[], object] = lambda: None,
        *,
        start_paused: bool = False,
        breakpoints: Set[str] = frozenset(),
    ) -> None:
        self._notify = notify
        self._settle = settle
        self._breakpoints = breakpoints
        self._mode = _Mode.RUN
        self._steps = 0
        self._step = ProgramStep.OVER
        self._stepping: Branch | None = None
        """The branch that makes the step; None for the first one that arrives."""
        self._waiting: dict[Branch, None] = {}
        """The branches that wait because of a pause, the one that waits longest first."""
        self._parallel: set[Branch] = set()
        """The branches of the present parallel work."""
        self._deepest = sys.maxsize
        """After a step: maximum call depth of an action before which the program pauses."""
        if start_paused:  # the same state as after a single step
            self._mode = _Mode.STEP
        self._reported = False
        self._running = 0
        self._stopped = False
        self._hold: object = None
        """Identity of the present hold, None if the program is not held."""
        self._changed = threading.Condition()

    # -------------------------------------------------------------------------------- commands
    def pause(self) -> None:
        """Pause before the next action. Report "paused" at once if no action is running."""
        with self._changed:
            self._mode = _Mode.PAUSE
            self._report_paused()

    def resume(self) -> None:
        """Continue the program."""
        self._continue(_Mode.RUN)

    def step(self, mode: ProgramStep = ProgramStep.OVER, branch: str = "") -> None:
        """Continue one branch for one action. The other branches of the same parallel work remain paused.

        Args:
            mode: whether the actions inside a function that it calls count.
            branch: id of the branch; empty or unknown for the one that waits longest.
        """
        with self._changed:
            self._step = mode
            longest = next(iter(self._waiting), None)
            # The branch may be about to enter the gate.
            self._stepping = next((one for one in self._parallel if one.id == branch), longest)
            self._continue(_Mode.STEP)

    def stop(self) -> None:
        """Raise ProgramStopped in all threads that wait at the gate or arrive later."""
        with self._changed:
            self._stopped = True
            self._changed.notify_all()

    def _continue(self, mode: _Mode) -> None:
        with self._changed:
            self._mode = mode
            self._steps = 1
            if self._hold is None:
                self._report_running()

    # -------------------------------------------------------------------------------- actions
    def set_breakpoints(self, breakpoints: Set[str]) -> None:
        """Replace the breakpoints, from the next action on."""
        with self._changed:
            self._breakpoints = breakpoints

    def before(self, branch: Branch, ids: Set[str] = frozenset(), depth: int = 0, *, is_call: bool = False) -> None:
        """Wait until an action may start. Raises ProgramStopped.

        Args:
            branch: the branch of the action.
            ids: of the action and its action points, compared with the breakpoints.
            depth: number of calls of functions around the action.
            is_call: whether it calls a function, so that other actions pass the gate before it ends.
        """
        with self._changed:
            stepped = self._mode is _Mode.STEP and not self._steps and depth <= self._deepest
            if (stepped and not self._is_blocked(branch)) or not self._breakpoints.isdisjoint(ids):
                self._mode = _Mode.PAUSE
            self._wait(branch)
            if self._mode is _Mode.STEP and self._steps:
                self._steps = 0
                self._stepping = branch
                limits = {ProgramStep.OVER: depth, ProgramStep.INTO: sys.maxsize, ProgramStep.OUT: depth - 1}
                self._deepest = limits[self._step]
            if not is_call:
                self._running += 1

    def after(self, branch: Branch, *, counted: bool = True) -> None:
        """Record the end of an action, then wait while the program is paused. Raises ProgramStopped.

        counted: whether the action still counts as running, which it does not after `hold_program`.
        """
        if self._mode is _Mode.PAUSE:
            self._settle()
        with self._changed:
            self._running -= counted
            self._wait(branch)

    # -------------------------------------------------------------------------------- holds
    def hold_program(self, branch: Branch, begin: Callable[[], None]) -> None:
        """Hold the program until `release`, in the thread of an action, which does not count as running any more.

        Other branches wait before their next action. Only one branch holds the program at a time.

        Args:
            branch: the branch of the action.
            begin: called when the hold begins, before "paused" is reported. The gate is locked.

        Raises:
            ProgramStopped: the program, or this branch, was stopped.
        """
        with self._changed:
            self._running -= 1
            self._wait_not_held(branch)
            own = self._hold = object()
            begin()
            self._report_paused()
            while self._hold is own and not self._stopped and not branch.held:
                self._changed.wait()
            if self._hold is own and not self._stopped:  # another branch has failed, which ends this one
                self._hold = None
                self._report_running()
            self._check(branch)

    def release(self) -> None:
        """End the hold."""
        with self._changed:
            self._hold = None
            self._report_running()

    def before_decided(self, branch: Branch) -> None:
        """Let an action start that a person has decided on, also while the program is paused. Raises ProgramStopped."""
        with self._changed:
            self._wait_not_held(branch)
            self._running += 1

    def _wait_not_held(self, branch: Branch) -> None:
        while self._hold is not None and not self._stopped and not branch.held:
            self._report_paused()  # this may have been the last action that ran
            self._changed.wait()
        self._check(branch)

    def sleep(self, branch: Branch, seconds: float) -> None:
        """Wait for a time between two actions. Raises ProgramStopped as soon as the program is stopped."""
        with self._changed:
            self._changed.wait_for(lambda: self._stopped or branch.held, seconds)
            self._check(branch)

    def wait_to_start(self, branch: Branch, seconds: float) -> float:
        """Wait in an action that has not started yet, as long as the program is paused or held, else for a time.

        Return for how long the program was paused, s. Raises ProgramStopped.
        """
        with self._changed:
            if not self._is_blocked(branch) and self._hold is None:
                self._changed.wait_for(lambda: self._stopped or branch.held, seconds)
                self._check(branch)
                return 0.0
            began = time.monotonic()
            self._running -= 1
            try:
                self._wait(branch)
            finally:
                self._running += 1
            return time.monotonic() - began

    def _is_blocked(self, branch: Branch) -> bool:
        """Return whether a branch has to wait. A step of one branch leaves the others of its parallel work paused."""
        if self._mode is _Mode.STEP:
            return branch.parent is not None and self._stepping not in (None, branch, branch.parent)
        return self._mode is _Mode.PAUSE

    def _wait(self, branch: Branch) -> None:
        while (self._is_blocked(branch) or self._hold is not None) and not self._stopped and not branch.held:
            self._waiting.setdefault(branch)
            self._report_paused()
            self._changed.wait()
        self._waiting.pop(branch, None)
        self._check(branch)

    def _check(self, branch: Branch) -> None:
        if self._stopped:
            raise ProgramStopped
        if branch.held:
            raise BranchHeld("It was stopped, because another branch has failed.")

    # -------------------------------------------------------------------------------- parallel work
    def started(self, branches: Iterable[Branch]) -> None:
        """Record the start of branches of parallel work."""
        with self._changed:
            self._parallel.update(branches)

    def hold(self, branches: Iterable[Branch]) -> None:
        """Raise BranchHeld in branches that wait at the gate or arrive later."""
        with self._changed:
            for branch in branches:
                branch.held = True
            self._changed.notify_all()

    def ended(self, branch: Branch) -> None:
        """Record the end of a branch of parallel work, and end its single step unless all branches have ended."""
        with self._changed:
            self._parallel.discard(branch)
            if self._mode is _Mode.STEP and self._stepping is branch:
                if self._parallel:
                    self._mode = _Mode.PAUSE
                    self._report_paused()
                else:
                    self._stepping = branch.parent
            self._changed.notify_all()

    def wait_for(self, condition: Callable[[], bool], timeout: float | None = None, *, stop: bool = True) -> None:
        """Wait until a condition holds, which `hold` and `ended` let check again.

        Args:
            condition: the condition.
            timeout: longest time, s.
            stop: whether the wait ends when the program is stopped.
        """
        with self._changed:
            self._changed.wait_for(lambda: condition() or (stop and self._stopped), timeout)

    def _report_running(self) -> None:
        self._reported = False
        self._notify("running")
        self._changed.notify_all()

    def _report_paused(self) -> None:
        paused = self._mode is _Mode.PAUSE or self._hold is not None
        if paused and not self._running and not self._reported:
            self._reported = True
            self._notify("paused")
