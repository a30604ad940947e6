"""The gate that every action of a program passes: pause, resume, step, breakpoints, stop."""

import enum
import sys
import threading
from collections.abc import Callable, Set

from arcor2_hw.data.position import ProgramStep
from arcor2_hw.exceptions import ProgramStopped


class _Mode(enum.Enum):
    RUN = enum.auto()
    STEP = enum.auto()
    PAUSE = enum.auto()


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
        self._deepest = sys.maxsize
        """After a step: the largest number of calls around an action before which the program pauses."""
        if start_paused:  # the same state as after a single step
            self._mode = _Mode.STEP
        self._reported = False
        self._running = 0
        self._stopped = False
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

    def step(self, mode: ProgramStep = ProgramStep.OVER) -> None:
        """Continue for one action. `mode`: whether the actions inside a function that it calls count."""
        with self._changed:
            self._step = mode
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
            self._reported = False
            self._notify("running")
            self._changed.notify_all()

    # -------------------------------------------------------------------------------- actions
    def set_breakpoints(self, breakpoints: Set[str]) -> None:
        """Replace the breakpoints, from the next action on."""
        with self._changed:
            self._breakpoints = breakpoints

    def before(self, ids: Set[str] = frozenset(), depth: int = 0, *, is_call: bool = False) -> None:
        """Wait until an action may start. Raises ProgramStopped.

        Args:
            ids: of the action and its action points, compared with the breakpoints.
            depth: number of calls of functions around the action.
            is_call: whether it calls a function, so that other actions pass the gate before it ends.
        """
        with self._changed:
            stepped = self._mode is _Mode.STEP and not self._steps and depth <= self._deepest
            if stepped or not self._breakpoints.isdisjoint(ids):
                self._mode = _Mode.PAUSE
            self._wait()
            if self._mode is _Mode.STEP and self._steps:
                self._steps = 0
                limits = {ProgramStep.OVER: depth, ProgramStep.INTO: sys.maxsize, ProgramStep.OUT: depth - 1}
                self._deepest = limits[self._step]
            if not is_call:
                self._running += 1

    def after(self) -> None:
        """Record the end of an action, then wait while the program is paused. Raises ProgramStopped."""
        if self._mode is _Mode.PAUSE:
            self._settle()
        with self._changed:
            self._running -= 1
            self._wait()

    def sleep(self, seconds: float) -> None:
        """Wait for a time between two actions. Raises ProgramStopped as soon as the program is stopped."""
        with self._changed:
            if self._changed.wait_for(lambda: self._stopped, seconds):
                raise ProgramStopped

    def _wait(self) -> None:
        while self._mode is _Mode.PAUSE and not self._stopped:
            self._report_paused()
            self._changed.wait()
        if self._stopped:
            raise ProgramStopped

    def _report_paused(self) -> None:
        if not self._running and not self._reported:
            self._reported = True
            self._notify("paused")
