"""How a command is handed to the tester, and how one that waits for its end learns that it is to give up."""

import threading
import time
from collections.abc import Callable
from typing import Final

from arcor2_hw.exceptions import DeviceError, DeviceFault, DeviceTimeout, Refused, SafetyStop
from arcor2_hw.objects import MachineCommand, MachineState
from arcor2_hw.objects.polled import GoOn

from .observer import Observer
from .registers import (
    ACCEPTED,
    COMMANDS,
    DOOR_MAY_MOVE,
    EMERGENCY_STOP,
    FALLEN,
    PASSING,
    REFUSALS,
    Holding,
    Inputs,
    fault_of,
    title,
)
from .settings import FunctionalTesterSettings

TRANSITION: Final = 3.0
"""s the tester has to pass through a short state: Resetting, Clearing, Stopping, Aborting take some 0.2 s."""


class Handshake:
    """Hands commands over, one at a time."""

    def __init__(self, observer: Observer, settings: FunctionalTesterSettings) -> None:
        self._observer = observer
        self._settings = settings
        self._who = observer.who
        self._one_command = threading.Lock()

    # -------------------------------------------------------------------------------- commands
    def give(self, command: MachineCommand, go_on: GoOn) -> None:
        """Give a command: it is taken when command_acknowledged shows its number. Raises Refused with the reason."""
        name = command.name.lower()
        if command not in COMMANDS:
            raise Refused(f"{self._who}: {name} is refused in state {self._state()}: it has no such command")
        with self._one_command:
            before = self._observer.fresh().value
            link = self._observer.link
            # Not counted here: the tester may have been switched off and on, or another host may have been at it.
            sequence = (self._observer.read_holding()[Holding.COMMAND_SEQUENCE] + 1) & 0xFFFF
            go_on()
            link.write_registers(Holding.COMMAND, command, sequence)
            after = self._observer.wait(
                lambda now: now.command_acknowledged == sequence,
                4.0 * self._settings.request_timeout,
                f"taking the command {name}",
            ).value
        if after.command_result != ACCEPTED:
            why = REFUSALS.get(after.command_result, f"result {after.command_result}")
            if before.emergency_stop:
                why = "the emergency stop is pressed"
            raise Refused(f"{self._who}: {name} is refused in state {title(before.state)}: {why}")

    def _state(self) -> str:
        return title(self._observer.fresh().value.state)

    def reach(self, wanted: set[MachineState], timeout: float, what: str, go_on: GoOn) -> Inputs:
        """Wait for one of the states. Raises DeviceTimeout, and DeviceFault or SafetyStop when it aborts instead."""

        def arrived(inputs: Inputs) -> bool:
            go_on()
            if inputs.state in wanted:
                return True
            if inputs.state in FALLEN and not wanted & FALLEN:
                raise self.fault(inputs, what)
            return False

        return self._observer.wait(arrived, timeout, what).value

    def fault(self, inputs: Inputs, what: str) -> DeviceError:
        """Give the error for a tester that has aborted."""
        code = inputs.fault_code
        if not code:
            return DeviceFault(f"{self._who}: {what} ended: aborted by command; clear it", fault_code=0)
        fault = fault_of(code)
        text = f"{self._who}: {what} ended: fault {code}, {fault.text}; {fault.remedy}"
        return SafetyStop(text, kind="emergency_stop") if code == EMERGENCY_STOP else DeviceFault(text, fault_code=code)

    # -------------------------------------------------------------------------------- door
    def move_door(self, command: int, what: str, arrived: Callable[[Inputs], bool]) -> None:
        """Move the door and wait for its end position. The tester tells no refusal, so the state is looked at."""
        go_on = self._observer.begin(what)
        began = time.monotonic()

        def done(inputs: Inputs) -> bool:
            go_on()
            where = f"{self._who}: {what} is refused in state {title(inputs.state)}"
            if inputs.emergency_stop:
                raise SafetyStop(f"{where}: the emergency stop is pressed", kind="emergency_stop")
            if inputs.state not in DOOR_MAY_MOVE | PASSING:
                raise Refused(f"{where}: the door moves only when no test runs")
            return arrived(inputs)

        def movable(inputs: Inputs) -> bool:
            done(inputs)
            return inputs.state in DOOR_MAY_MOVE

        self._observer.wait(movable, TRANSITION, f"{what}: reaching a state that lets the door move")
        with self._one_command:
            link = self._observer.link
            sequence = (self._observer.read_holding()[Holding.DOOR_SEQUENCE] + 1) & 0xFFFF
            go_on()
            link.write_registers(Holding.DOOR_COMMAND, command, sequence)
        left = max(0.1, began + self._settings.door_timeout - time.monotonic())
        try:
            self._observer.wait(done, left, what)
        except DeviceTimeout as error:
            raise DeviceTimeout(f"{error}: the door does not reach its end position") from error
