"""PolledMachine: a machine with PackML states that is read periodically. A mixin of object types."""

import abc
from typing import TypeVar

from arcor2_hw.exceptions import DeviceFault, Refused
from arcor2_hw.objects.machine import ALLOWED, Machine, MachineCommand, MachineState
from arcor2_hw.objects.observing import GoOn
from arcor2_hw.objects.polled_control import PolledControl

T = TypeVar("T")


class PolledMachine(PolledControl[T], Machine):
    """A machine such as `class Press(PolledMachine[list[int]], Generic)`.

    A driver overrides `state_of` and `write_command`.
    """

    @abc.abstractmethod
    def state_of(self, state: T) -> MachineState:
        """Return the PackML state in a state of the device."""

    @abc.abstractmethod
    def write_command(self, command: MachineCommand, *arguments: int) -> None:
        """Write a command. Raises DeviceError."""

    def machine_state(self) -> MachineState:
        """Return the present state. Raises NotConnected, ConnectionLost, Stale."""
        return self.state_of(self.current())

    def command(self, command: MachineCommand) -> None:
        """Send a command. Raises Refused, NotInControl."""
        self._command(command)

    def run(self, timeout: float, go_on: GoOn, *arguments: int) -> T:
        """Reset if necessary, start, and return the state of the device at the end. Call it within `act`.

        Raises:
            DeviceFault: The unit did not end in Complete or Idle.
            DeviceTimeout: Resetting or running took longer than `timeout` s.
        """
        if self.state_of(self.fresh()) in ALLOWED[MachineCommand.RESET]:
            self._command(MachineCommand.RESET, go_on=go_on)
            self.wait(lambda read: self.state_of(read) is MachineState.IDLE, timeout, "resetting", go_on)
        self._command(MachineCommand.START, *arguments, go_on=go_on)
        end = self.wait(lambda read: not self.is_busy(read), timeout, "running", go_on)
        if (state := self.state_of(end)) not in (MachineState.COMPLETE, MachineState.IDLE):
            raise DeviceFault(
                "{device} did not complete; its state is {name}",
                fault_code=self.fault_of(end),
                device=self.who,
                name=state.name,
            )
        return end

    # -------------------------------------------------------------------------------- hooks of PolledControl
    def is_busy(self, state: T) -> bool:
        """Return whether the unit is in a state that it leaves by itself."""
        return self.state_of(state) not in _STAYS

    def send_stop(self) -> None:
        """Send the command STOP."""
        self.write_command(MachineCommand.STOP)

    def _command(self, command: MachineCommand, *arguments: int, go_on: GoOn | None = None) -> None:
        if (state := self.state_of(self.fresh())) not in ALLOWED[command]:
            raise Refused(
                "{device}: {name} is not allowed in the state {state_name}",
                device=self.who,
                name=command.name,
                state_name=state.name,
            )
        self.send(command.name, lambda: self.write_command(command, *arguments), go_on)


_S = MachineState
_STAYS = frozenset({_S.STOPPED, _S.IDLE, _S.SUSPENDED, _S.ABORTED, _S.HELD, _S.COMPLETE})
