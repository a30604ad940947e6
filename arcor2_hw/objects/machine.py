"""Machine: a mixin for units that follow PackML (ISA-TR88.00.02)."""

import abc
import enum
from typing import ClassVar

from arcor2_hw.actions import StrEnum
from arcor2_hw.exceptions import Arcor2NotImplemented


class MachineState(enum.IntEnum):
    """States of PackML with their numbers."""

    CLEARING = 1
    STOPPED = 2
    STARTING = 3
    IDLE = 4
    SUSPENDED = 5
    EXECUTE = 6
    STOPPING = 7
    ABORTING = 8
    ABORTED = 9
    HOLDING = 10
    HELD = 11
    UNHOLDING = 12
    SUSPENDING = 13
    UNSUSPENDING = 14
    RESETTING = 15
    COMPLETING = 16
    COMPLETE = 17


class MachineStateName(StrEnum):
    """The states of a machine (PackML, ISA-TR88.00.02)."""

    CLEARING = "clearing"
    STOPPED = "stopped"
    STARTING = "starting"
    IDLE = "idle"
    SUSPENDED = "suspended"
    EXECUTE = "execute"
    STOPPING = "stopping"
    ABORTING = "aborting"
    ABORTED = "aborted"
    HOLDING = "holding"
    HELD = "held"
    UNHOLDING = "unholding"
    SUSPENDING = "suspending"
    UNSUSPENDING = "unsuspending"
    RESETTING = "resetting"
    COMPLETING = "completing"
    COMPLETE = "complete"


class MachineCommand(enum.IntEnum):
    """Commands of PackML with their numbers (CntrlCmd)."""

    RESET = 1
    START = 2
    STOP = 3
    HOLD = 4
    UNHOLD = 5
    SUSPEND = 6
    UNSUSPEND = 7
    ABORT = 8
    CLEAR = 9
    COMPLETE = 10


class UnitMode(enum.IntEnum):
    """Unit modes of PackML with their numbers."""

    PRODUCE = 1
    MAINTENANCE = 2
    MANUAL = 3


_S = MachineState
_ACTIVE = frozenset(_S) - {_S.STOPPED, _S.STOPPING, _S.ABORTED, _S.ABORTING, _S.CLEARING}

ALLOWED: dict[MachineCommand, frozenset[MachineState]] = {
    MachineCommand.RESET: frozenset({_S.STOPPED, _S.COMPLETE}),
    MachineCommand.START: frozenset({_S.IDLE}),
    MachineCommand.STOP: _ACTIVE,
    MachineCommand.HOLD: frozenset({_S.EXECUTE}),
    MachineCommand.UNHOLD: frozenset({_S.HELD}),
    MachineCommand.SUSPEND: frozenset({_S.EXECUTE}),
    MachineCommand.UNSUSPEND: frozenset({_S.SUSPENDED}),
    MachineCommand.ABORT: frozenset(_S) - {_S.ABORTED, _S.ABORTING},
    MachineCommand.CLEAR: frozenset({_S.ABORTED}),
    MachineCommand.COMPLETE: frozenset({_S.EXECUTE}),
}
"""States in which PackML allows each command."""


class Machine(abc.ABC):
    """A unit with the states of PackML. A mixin: `class Tester(Machine, CollisionObject)`.

    Class Attributes:
        states: States that the unit has, at least Stopped, Idle, Execute and Aborted.
    """

    category: ClassVar[str] = "Machines"
    icon: ClassVar[str] = "machine"
    states: ClassVar[frozenset[MachineState]]

    @abc.abstractmethod
    def machine_state(self) -> MachineState:
        """Return the present state."""

    @abc.abstractmethod
    def command(self, command: MachineCommand) -> None:
        """Execute a command.

        Raises:
            Refused: The present state does not allow it; the message names command and state.
        """

    def unit_mode(self) -> UnitMode:
        """Return the unit mode."""
        raise Arcor2NotImplemented("unit_mode")

    def wait_for(self, state: MachineState, timeout: float) -> None:
        """Wait until the unit is in `state`.

        Args:
            state: The state.
            timeout: Time limit, s.

        Raises:
            DeviceTimeout: The unit is not in that state in time.
            DeviceFault: The unit aborts.
        """
        raise Arcor2NotImplemented("wait_for")

    def counters(self) -> dict[str, int]:
        """Return the unit's counters by name."""
        raise Arcor2NotImplemented("counters")

    def stop_reason(self) -> str:
        """Return why the unit stopped or aborted, empty when it did not."""
        raise Arcor2NotImplemented("stop_reason")

    def permissives(self) -> list[tuple[str, bool]]:
        """Return the conditions for a start, each with whether it is met."""
        raise Arcor2NotImplemented("permissives")
