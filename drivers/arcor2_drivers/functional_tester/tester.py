"""Tester: state, control and commands of a functional tester on Modbus TCP. A mixin of the object type."""

import threading
import time
from collections.abc import Callable
from typing import Any, Final

from arcor2_hw.actions import observation
from arcor2_hw.data.base import Timestamp, now
from arcor2_hw.exceptions import (
    DeviceError,
    DeviceFault,
    DeviceTimeout,
    NotConnected,
    NotInControl,
    Refused,
    SafetyStop,
    Stale,
)
from arcor2_hw.messages import Message, Phrase
from arcor2_hw.objects import MachineCommand, MachineState, UnitMode
from arcor2_hw.objects.generic import DEFAULT_CONNECT_TIMEOUT
from arcor2_hw.objects.modbus_device import ModbusDevice
from arcor2_hw.objects.modbus_link import ModbusLink
from arcor2_hw.objects.observing import GoOn
from arcor2_hw.objects.polled_control import OWNED_BY_US
from arcor2_hw.objects.state_observer import Snapshot

from . import registers
from .registers import ABORT_STATES, RUNNING, Holding, Inputs, fault_of, title
from .settings import FunctionalTesterSettings

TRANSITION: Final = 3.0
"""Time for a short state, s: Resetting, Clearing, Stopping, Aborting take about 0.2 s."""
LIFE_TIMEOUT: Final = 1.0
"""Time without a change of the life counter after which the values are old, s."""
WATCHDOG_MARGIN: Final = 0.2
"""Time beyond the watchdog timeout until the tester has detected our absence, s."""


class Tester(ModbusDevice[Inputs]):
    """A tester whose state is read every 0.1 s; the requests also reset its host watchdog."""

    def use_tester(self, settings: FunctionalTesterSettings) -> None:
        """Prepare the connection; called in `__init__`."""
        self._s = settings
        self.link = ModbusLink(self.name, settings.host, settings.port, settings.unit_id, settings.request_timeout)
        # Two readings, each repeated once on a new connection.
        self.answers_within = 6.0 * settings.request_timeout
        self.use_link(self.link)
        self.fault_since: Timestamp = now()
        self._one_command = threading.Lock()
        self._leave_alone_until = 0.0
        self._life = (-1, 0.0)

    # -------------------------------------------------------------------------------- state
    def connect(self, timeout: float = DEFAULT_CONNECT_TIMEOUT) -> None:
        """Start to observe within `timeout` s; nothing is written. Raises NotConnected, DeviceTimeout, DeviceFault."""
        self._leave_alone_until = 0.0
        super().connect(timeout)

    def open_link(self, timeout: float) -> Snapshot[Inputs]:
        """Open the connection, unless the watchdog of the tester has to expire first."""
        left = self._leave_alone_until - time.monotonic()
        if left > 0.0:
            raise NotConnected(
                "{device} is not contacted for {left:.1f} s, so that its watchdog expires", device=self.who, left=left
            )
        self._life = (-1, 0.0)
        return super().open_link(timeout)

    def read_state(self) -> Inputs:
        """Read the input registers and the discrete inputs."""
        words = self.link.read_input_registers(0, registers.INPUT_COUNT)
        bits = self.link.read_discrete_inputs(0, registers.DISCRETE_COUNT)
        return registers.decode(words, bits)

    def on_state(self, snapshot: Snapshot[Inputs]) -> None:
        """Record changes of the life counter and of the fault."""
        inputs, before = snapshot.value, self.newest()
        if inputs.life != self._life[0]:
            self._life = (inputs.life, time.monotonic())
        if inputs.fault_code and (before is None or before.fault_code != inputs.fault_code):
            self.fault_since = now()

    def on_lost(self, error: DeviceError) -> None:
        """End control. Send no requests for a while, so that the watchdog of the tester ends a running test."""
        newest = self.newest()
        if self.in_control and newest is not None and newest.state in RUNNING:
            self._leave_alone_until = self.link.sent + self._s.watchdog_ms / 1000.0 + WATCHDOG_MARGIN
        super().on_lost(error)

    def current(self) -> Inputs:
        """Return the newest state. Raises NotConnected, ConnectionLost, or Stale when it is too old."""
        newest = super().current()
        value, since = self._life
        if (age := time.monotonic() - since) > LIFE_TIMEOUT:
            raise Stale(
                "{device} answers, but its life counter has been {value} for {age:.1f} s",
                device=self.who,
                value=value,
                age=age,
            )
        return newest

    @observation
    def door_open(self) -> bool:
        """Return whether the door is completely open."""
        return bool(self.current().door_open)

    @observation
    def door_closed(self) -> bool:
        """Return whether the door is closed."""
        return bool(self.current().door_closed)

    @observation
    def board_in_fixture(self) -> bool:
        """Return whether a board is in the fixture."""
        return bool(self.current().board_present)

    # -------------------------------------------------------------------------------- control
    def arm(self) -> None:
        """Set the host watchdog."""
        self.link.write_verified(Holding.HOST_WATCHDOG, self._s.watchdog_ms)

    def disarm(self) -> None:
        """Switch the host watchdog off."""
        self.link.write_registers(Holding.HOST_WATCHDOG, 0)

    def leave(self) -> None:
        """Release control because we disconnect; the watchdog ends a running test."""
        newest = self.newest()
        if newest is not None and newest.state not in RUNNING:
            super().leave()

    def release_control(self) -> None:
        """Switch the host watchdog off. Raises Refused while a test runs."""
        if self.in_control and (state := self.fresh().state) in RUNNING:
            raise Refused(
                "{device}: release_control is refused in state {state}: stop the test",
                device=self.who,
                state=title(state),
            )
        super().release_control()

    def owner_of(self, state: Inputs) -> str | None:
        """Return who has control: us, the user of the key switch, or the client whose test runs."""
        if state.mode is not UnitMode.PRODUCE:
            return Phrase.of("the key switch at the station ({mode})", mode=state.mode.name.lower())
        if self.in_control:
            return OWNED_BY_US
        other = Phrase.of("another client, which started a test (state {state}),", state=title(state.state))
        return other if state.state in RUNNING else None

    def why_control_ended(self, state: Inputs) -> str:
        """Return an empty text: the key switch only interrupts our control."""
        return ""

    def control_owner(self) -> str | None:
        """Return who has control."""
        newest = self.newest()
        return None if newest is None else self.owner_of(newest)

    def require_command(self, operation: str) -> Inputs:
        """Return a fresh state if we have control. Raises NotInControl, which names the owner."""
        inputs = self.fresh()
        owner = self.owner_of(inputs)
        if owner != OWNED_BY_US:
            raise NotInControl(
                "{device}: {what} is refused in state {state}: {owner} has control"
                if owner
                else "{device}: {what} is refused in state {state}: nobody has control",
                device=self.who,
                what=operation,
                state=title(inputs.state),
                owner=owner,
            )
        return inputs

    # -------------------------------------------------------------------------------- commands
    def send_command(self, command: MachineCommand, go_on: GoOn) -> None:
        """Send a command and wait until command_acknowledged contains its number. Raises Refused with the reason."""
        name = command.name.lower()
        if command not in registers.COMMANDS:
            state = title(self.fresh().state)
            raise Refused(
                "{device}: {name} is refused in state {state}: it has no such command",
                device=self.who,
                name=name,
                state=state,
            )
        with self._one_command:
            before = self.fresh()
            sequence = self._write_numbered(Holding.COMMAND, command, go_on)
            after = self.wait(
                lambda inputs: inputs.command_acknowledged == sequence,
                4.0 * self._s.request_timeout,
                f"taking the command {name}",
            )
        if after.command_result != registers.ACCEPTED:
            result = after.command_result
            known = registers.REFUSALS.get(result)
            why = Message.of("result {result}", result=result) if known is None else Message.of(known)
            if before.emergency_stop:
                why = Message.of("the emergency stop is pressed")
            raise Refused(
                "{device}: {name} is refused in state {state}: {reason}",
                device=self.who,
                name=name,
                state=title(before.state),
                reason=why,
            )

    def reach(self, wanted: set[MachineState], timeout: float, operation: str, go_on: GoOn) -> Inputs:
        """Wait for one of the states. Raises DeviceTimeout, and DeviceFault or SafetyStop when it aborts instead."""

        def arrived(inputs: Inputs) -> bool:
            if inputs.state in wanted:
                return True
            if inputs.state in ABORT_STATES and not wanted & ABORT_STATES:
                raise self.fault(inputs, operation)
            return False

        return self.wait(arrived, timeout, operation, go_on)

    def fault(self, inputs: Inputs, operation: str) -> DeviceError:
        """Return the error for a tester that has aborted."""
        code = inputs.fault_code
        if not code:
            return DeviceFault(
                "{device}: {what} ended: aborted by command; clear it", fault_code=0, device=self.who, what=operation
            )
        fault = fault_of(code)
        message = Message.of(
            "{device}: {what} ended: fault {code}, {text}; {remedy}",
            device=self.who,
            what=operation,
            code=code,
            text=Message.of(fault.text),
            remedy=Message.of(fault.remedy),
        )
        if code == registers.EMERGENCY_STOP:
            return SafetyStop(message, kind="emergency_stop")
        return DeviceFault(message, fault_code=code)

    def move_door(self, command: int, operation: str, arrived: Callable[[Inputs], bool]) -> None:
        """Move the door and wait for its end position. The tester reports no refusal, so the state is checked."""
        self.require_command(operation)
        go_on = self.begin(operation)
        began = time.monotonic()

        def done(inputs: Inputs) -> bool:
            values: dict[str, Any] = {"device": self.who, "what": operation, "state": title(inputs.state)}
            if inputs.emergency_stop:
                raise SafetyStop(
                    "{device}: {what} is refused in state {state}: the emergency stop is pressed",
                    kind="emergency_stop",
                    **values,
                )
            if inputs.state not in registers.DOOR_MAY_MOVE | registers.TRANSIENT_STATES:
                text = "{device}: {what} is refused in state {state}: the door moves only when no test runs"
                raise Refused(text, **values)
            return arrived(inputs)

        def movable(inputs: Inputs) -> bool:
            done(inputs)
            return inputs.state in registers.DOOR_MAY_MOVE

        self.wait(movable, TRANSITION, f"{operation}: reaching a state that lets the door move", go_on)
        with self._one_command:
            self._write_numbered(Holding.DOOR_COMMAND, command, go_on)
        left = max(0.1, began + self._s.door_timeout - time.monotonic())
        try:
            self.wait(done, left, operation, go_on)
        except DeviceTimeout as error:
            raise DeviceTimeout("{reason}: the door does not reach its end position", reason=error) from error

    def _write_numbered(self, register: int, command: int, go_on: GoOn) -> int:
        """Write a command with its number, which is in the next register; return the number."""
        # Read the number, because the tester may have restarted or another host may have sent commands.
        holding = self.link.read_holding_registers(0, registers.HOLDING_COUNT)
        sequence = (holding[register + 1] + 1) & 0xFFFF
        go_on()
        self.link.write_registers(register, command, sequence)
        return sequence
