"""Machine: a mixin for units that follow PackML (ISA-TR88.00.02)."""

import abc
from typing import ClassVar

from arcor2_hw.actions import StrEnum
from arcor2_hw.data.packml import ALLOWED, MachineCommand, MachineState, UnitMode
from arcor2_hw.exceptions import Arcor2NotImplemented

__all__ = ["ALLOWED", "Machine", "MachineCommand", "MachineState", "MachineStateName", "UnitMode"]


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

    def stop_reason(self) -> str:
        """Return why the unit stopped or aborted, empty when it did not."""
        raise Arcor2NotImplemented("stop_reason")

    def permissives(self) -> list[tuple[str, bool]]:
        """Return the conditions for a start, and for each whether it is met."""
        raise Arcor2NotImplemented("permissives")
