"""Parallel work of a script: several calls run concurrently, each on its own thread, and the script waits for all."""

import logging
import threading
from collections.abc import Callable, Sequence
from typing import Any, Final

from arcor2_hw.data.project import MAX_BRANCHES, MIN_BRANCHES
from arcor2_hw.exceptions import Arcor2Error, InvalidData, ProgramStopped
from arcor2_hw.runtime.branches import Action, Branch
from arcor2_hw.runtime.functions import announced
from arcor2_hw.runtime.lane import Job
from arcor2_hw.runtime.program import Program
from arcor2_hw.runtime.stopping import send_stop, wait_stopped

STOP_PERIOD: Final = 0.05
"""Period at which running actions are stopped after a branch has failed, s: one may have started just before."""
BRANCH_END_TIMEOUT: Final = 1.0
"""Time that branches have to end after the program was stopped, s."""

_log = logging.getLogger(__name__)


def run_parallel(program: Program, calls: Sequence[Callable[[], Any]], an: str | None) -> tuple[Any, ...]:
    """Run calls at once and return their results. `Resources.parallel` states what happens when one fails."""
    if not MIN_BRANCHES <= len(calls) <= MAX_BRANCHES:
        raise InvalidData(
            "parallel work has {least} to {most} calls, not {count}",
            least=MIN_BRANCHES,
            most=MAX_BRANCHES,
            count=len(calls),
        )
    if program.branches.current.parent is not None:
        raise InvalidData("parallel work cannot contain other parallel work")
    return announced(program, "parallel", an, [], lambda entered: _Group(program, entered, calls).run(), own=True)


class _Group:
    """Calls that run at once."""

    def __init__(self, program: Program, entered: Action, calls: Sequence[Callable[[], Any]]) -> None:
        self._program = program
        self._parent = program.branches.current
        self._calls = calls
        self._branches = [Branch(f"branch {number}", self._parent) for number in range(1, len(calls) + 1)]
        for branch in self._branches:
            branch.calls = [*self._parent.calls[:-1], Action(entered.number, entered.id, entered.call, None)]
        self._values: list[Any] = [None] * len(calls)
        self._running = set(self._branches)
        self._first: tuple[BaseException, Branch] | None = None
        """The error that came first, and its branch."""
        self._failing = threading.Lock()
        self._stopped: list[Job] = []
        """The actions that were stopped because another branch has failed."""

    def run(self) -> tuple[Any, ...]:
        """Run the calls and wait for them."""
        self._program.gate.started(self._branches)
        for number, branch in enumerate(self._branches):
            name = f"branch {number + 1}"
            threading.Thread(target=self._run_branch, args=(number, branch), name=name, daemon=True).start()
        try:
            self._join()
        except BaseException:  # such as KeyboardInterrupt in a script run by hand
            self._program.gate.hold(self._branches)
            raise
        if self._first is not None:
            error, branch = self._first
            self._parent.failure.action, self._parent.failure.device = branch.failure.action, branch.failure.device
            raise error
        return tuple(self._values)

    def _join(self) -> None:
        program, gate = self._program, self._program.gate
        gate.wait_for(lambda: not self._running or self._first is not None)
        while self._running and not program.stop_requested:
            self._stop_running()
            gate.wait_for(lambda: not self._running, STOP_PERIOD)
        if program.stop_requested:
            gate.wait_for(lambda: not self._running, BRANCH_END_TIMEOUT, stop=False)
            raise ProgramStopped

    def _stop_running(self) -> None:
        """Stop the devices whose actions still run."""
        sent = []
        for branch in list(self._running):
            if not (key := branch.device):
                continue
            device = self._program.cell[key]
            job = device.lane.current
            if job is not None and job not in self._stopped:
                self._stopped.append(job)
                sent.append(send_stop(device))
        if (problem := wait_stopped(sent)) is not None:
            _log.warning("%s", problem)

    # -------------------------------------------------------------------------------- threads of the branches
    def _run_branch(self, number: int, branch: Branch) -> None:
        self._program.branches.enter(branch)
        try:
            self._values[number] = self._calls[number]()
        except ProgramStopped:  # the program, or this branch because of another one
            pass
        except BaseException as error:  # noqa: BLE001 - the thread that waits raises it
            self._fail(error, branch)
        finally:
            self._running.discard(branch)
            self._program.gate.ended(branch)

    def _fail(self, error: BaseException, branch: Branch) -> None:
        with self._failing:
            if self._first is not None:
                return
            self._first = error, branch
        if isinstance(error, Arcor2Error):
            _log.info("a branch has failed, the others are stopped: %s", error)
        self._program.gate.hold([other for other in self._branches if other is not branch])
