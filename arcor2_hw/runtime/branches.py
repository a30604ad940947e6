"""The branches of a program: the program itself, calls that run in parallel, and threads that a script starts."""

import threading
from typing import TYPE_CHECKING

from arcor2_hw.data.position import MAIN_BRANCH, Frame

if TYPE_CHECKING:
    from arcor2_hw.runtime.device import Device


class Action:
    """One call of an action. `id` is None in a project that declares no actions.

    number: Counts the calls of a run from 1. call: The number of the call around it, 0 for none. frame: Its place in
    the position of the program; None for parallel work, which is not part of the stacks of its branches. attempt:
    Counts the attempts of an action that is retried. failed_after: Duration of an action at whose failure the program
    was held, s.
    """

    __slots__ = ("attempt", "began", "call", "failed_after", "frame", "id", "number", "waited")

    def __init__(self, number: int, action_id: str | None, call: int, frame: Frame | None, attempt: int = 1) -> None:
        self.number = number
        self.id = action_id
        self.call = call
        self.frame = frame
        self.attempt = attempt
        self.failed_after: float | None = None
        self.began = 0.0
        self.waited = 0.0


class Failure:
    """The last failure of a branch: its error with the action and the device that raised it."""

    __slots__ = ("action", "device")

    def __init__(self) -> None:
        self.action: tuple[BaseException, Action] | None = None
        self.device: tuple[BaseException, Device] | None = None


class Branch:
    """One thread of the script.

    Args:
        id: id of the branch: MAIN_BRANCH, the id of the call that the branch runs, or a name of the thread.
        parent: the branch that started it and waits for it; None for all but the branches of parallel work.
        failure: where failures are stored.
    """

    __slots__ = ("calls", "device", "failure", "held", "id", "parent")

    def __init__(self, id: str = MAIN_BRANCH, parent: "Branch | None" = None, failure: Failure | None = None) -> None:  # noqa: A002
        self.id = id
        self.parent = parent
        self.failure = failure or Failure()
        self.calls: list[Action] = []
        """The calls around the present action, outermost first."""
        self.device = ""
        """Id of the device of the running action; empty if none runs."""
        self.held = False
        """Whether no further action may start, because another branch has failed."""


class Branches:
    """The branch of each thread of a script."""

    def __init__(self) -> None:
        self.main = Branch()
        self._main_thread = threading.main_thread()
        self._local = threading.local()

    @property
    def in_main_thread(self) -> bool:
        """Return whether the current thread is the main thread of the script."""
        return threading.current_thread() is self._main_thread

    @property
    def current(self) -> Branch:
        """Return the branch of the current thread."""
        found: Branch | None = getattr(self._local, "branch", None)
        if found is None:
            main = self.main
            found = main if self.in_main_thread else Branch(f"thread {threading.get_ident()}", failure=main.failure)
            self._local.branch = found
        return found

    def enter(self, branch: Branch) -> None:
        """Set the branch of the current thread."""
        self._local.branch = branch
