"""The gate between the actions of a program: pause, resume, step, breakpoints, stop."""

import enum
import threading
from collections.abc import Callable, Set

from arcor2_hw.exceptions import ProgramStopped


class _Mode(enum.Enum):
    RUN = enum.auto()
    STEP = enum.auto()
    PAUSE = enum.auto()


class Gate:
    """Every outermost action passes it before it starts and after it has ended.

    `tell` is called with "paused" once nothing runs any more, and with "running" when it goes on.
    `settle` waits until nothing moves; it is called without any lock.
    """

    def __init__(
        self,
        tell: Callable[[str], None],
        settle: Callable[[], object] = lambda: None,
        *,
        start_paused: bool = False,
        breakpoints: Set[str] = frozenset(),
    ) -> None:
        self._tell = tell
        self._settle = settle
        self._breakpoints = breakpoints
        self._mode = _Mode.RUN
        self._steps = 0
        if start_paused:  # as if a step had just been used up: pause before the next action
            self._mode = _Mode.STEP
        self._reported = False
        self._under_way = 0
        self._stopped = False
        self._changed = threading.Condition()

    # -------------------------------------------------------------------------------- commands
    def pause(self) -> None:
        """Let no further action start. "paused" is reported at once when none is running."""
        with self._changed:
            self._mode = _Mode.PAUSE
            self._tell_paused()

    def resume(self) -> None:
        """Go on."""
        self._go(_Mode.RUN)

    def step(self) -> None:
        """Go on for one action."""
        self._go(_Mode.STEP)

    def stop(self) -> None:
        """Let no action pass any more: present and later callers get ProgramStopped."""
        with self._changed:
            self._stopped = True
            self._changed.notify_all()

    def _go(self, mode: _Mode) -> None:
        with self._changed:
            self._mode = mode
            self._steps = 1
            self._reported = False
            self._tell("running")
            self._changed.notify_all()

    # -------------------------------------------------------------------------------- actions
    def set_breakpoints(self, breakpoints: Set[str]) -> None:
        """Pause at other ids from the next action on."""
        with self._changed:
            self._breakpoints = breakpoints

    def before(self, ids: Set[str] = frozenset()) -> None:
        """Wait until an action may start; `ids`: its own, and of its action points. Raises ProgramStopped."""
        with self._changed:
            if (self._mode is _Mode.STEP and not self._steps) or not self._breakpoints.isdisjoint(ids):
                self._mode = _Mode.PAUSE
            self._wait()
            if self._mode is _Mode.STEP:
                self._steps = 0
            self._under_way += 1

    def after(self) -> None:
        """Say that the action has ended, and wait for leave to go on. Raises ProgramStopped."""
        if self._mode is _Mode.PAUSE:
            self._settle()
        with self._changed:
            self._under_way -= 1
            self._wait()

    def _wait(self) -> None:
        while self._mode is _Mode.PAUSE and not self._stopped:
            self._tell_paused()
            self._changed.wait()
        if self._stopped:
            raise ProgramStopped

    def _tell_paused(self) -> None:
        if not self._under_way and not self._reported:
            self._reported = True
            self._tell("paused")
