"""The PackML state of the cell, derived from the state of its program."""

from typing import Final

from arcor2_hw.data.editor import RunEnd
from arcor2_hw.data.package import PackageStateEnum
from arcor2_hw.data.packml import ALLOWED, MachineCommand, MachineState
from arcor2_server.errors import RequestRefused

P, S = PackageStateEnum, MachineState

_OF_PROGRAM: Final = {
    P.STARTED: S.STARTING,
    P.RUNNING: S.EXECUTE,
    P.PAUSING: S.HOLDING,
    P.PAUSED: S.HELD,
    P.RESUMING: S.UNHOLDING,
    P.STOPPING: S.STOPPING,
}
_AFTER: Final = {RunEnd.FINISHED: S.COMPLETE, RunEnd.STOPPED: S.STOPPED}
"""States after a run; after all other ends, the cell is aborted."""
COMMANDS: Final = frozenset(MachineCommand) - {
    MachineCommand.SUSPEND,
    MachineCommand.UNSUSPEND,
    MachineCommand.COMPLETE,
}
"""Commands that the cell has."""
STATES: Final = frozenset({*_OF_PROGRAM.values(), *_AFTER.values(), S.IDLE, S.ABORTING, S.ABORTED})
"""States that the cell has."""


class CellStates:
    """The state of the cell. After the start of the server it is Stopped."""

    def __init__(self) -> None:
        self.present = S.STOPPED
        self._aborting = False

    def program_changed(self, state: PackageStateEnum, outcome: RunEnd) -> None:
        """Handle a new state of the program.

        Args:
            state: its state.
            outcome: outcome of the program, if it is stopped.
        """
        following = _OF_PROGRAM.get(state)
        if following is None:
            following = S.ABORTED if self._aborting else _AFTER.get(outcome, S.ABORTED)
            self._aborting = False
        elif self._aborting:
            following = S.ABORTING
        self.present = following

    def require(self, command: MachineCommand) -> None:
        """Raise RequestRefused unless PackML allows a command in the present state."""
        if self.present not in ALLOWED[command]:
            raise RequestRefused(
                "The cell is {state} and cannot execute the command {command}.",
                state=self.present.name.lower(),
                command=command.name.lower(),
            )

    def command(self, command: MachineCommand, *, active: bool) -> None:
        """Handle a command that needs no program, or that ends it.

        Args:
            command: Reset, Clear, Stop or Abort.
            active: whether a program is active; its end then completes the command.

        Raises:
            RequestRefused: PackML does not allow the command in the present state.
        """
        self.require(command)
        match command:
            case MachineCommand.RESET:
                self.present = S.IDLE
            case MachineCommand.CLEAR:
                self.present = S.STOPPED
            case MachineCommand.STOP if not active:
                self.present = S.STOPPED
            case MachineCommand.ABORT:
                self._aborting = active
                self.present = S.ABORTING if active else S.ABORTED
