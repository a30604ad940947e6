"""The functional tester as an object type: a Machine on Modbus TCP that tests one board at a time."""

import contextlib
from typing import ClassVar, Final

from arcor2_hw.actions import action
from arcor2_hw.data.device import Alarm, Connection, Health, Identity, LossReaction
from arcor2_hw.data.geometry import Pose
from arcor2_hw.data.object_type import Models
from arcor2_hw.exceptions import Cancelled, DeviceError, DeviceFault, DeviceTimeout, NotFound, NotInControl, Refused
from arcor2_hw.objects import CollisionObject, Machine, MachineCommand, MachineState, UnitMode
from arcor2_hw.objects.generic import DEFAULT_CONNECT_TIMEOUT

from .handshake import TRANSITION, Handshake
from .observer import Observer
from .registers import (
    DOOR_CLOSE,
    DOOR_OPEN,
    FALLEN,
    PASSING,
    RUNNING,
    STATES,
    Holding,
    Inputs,
    fault_of,
    title,
)
from .settings import LONGEST_TEST, LONGEST_WATCHDOG, FunctionalTesterSettings

MARGIN: Final = 20.0
"""s beyond the longest test: coming to rest and the reset before it, the handshakes, requests asked twice, the stop."""
ABORTS_WITHIN: Final = 0.2
"""s from the decision to abort to Aborted."""

S = MachineState


class FunctionalTester(Machine, CollisionObject):
    """A station that contacts a printed circuit board, runs a test program and tells pass or fail."""

    _ABSTRACT = False
    states: ClassVar[frozenset[MachineState]] = STATES
    loss_reaction: ClassVar[LossReaction] = LossReaction.stops_within(LONGEST_WATCHDOG / 1000.0 + ABORTS_WITHIN)
    CANCEL_MAPPING: ClassVar[dict[str, str]] = {"test": "stop", "open_door": "stop", "close_door": "stop"}

    def __init__(
        self,
        obj_id: str,
        name: str,
        pose: Pose,
        collision_model: Models | None = None,
        settings: FunctionalTesterSettings | None = None,
    ) -> None:
        super().__init__(obj_id, name, pose, collision_model, settings)
        if settings is None:
            raise NotFound(f"{name} has no settings: host must be the address of the tester")
        self._observer = Observer(name, settings, self._drop_control)  # only observation comes back by itself
        self._handshake = Handshake(self._observer, settings)
        self._watchdog_ms = settings.watchdog_ms
        self._test_timeout = settings.test_timeout
        self._in_control = False

    # -------------------------------------------------------------------------------- connection
    def connect(self, timeout: float = DEFAULT_CONNECT_TIMEOUT) -> None:
        """Begin to observe within `timeout` s; nothing is written. Raises NotConnected, DeviceTimeout, DeviceFault."""
        self._observer.connect(timeout)

    def disconnect(self) -> None:
        """Give control back and stop observing. A test that runs is left to the tester's watchdog, which ends it."""
        newest = self._observer.newest()
        if self._in_control and newest is not None and newest.state not in RUNNING:
            with contextlib.suppress(DeviceError):  # it is gone; its watchdog deals with that
                self._observer.link.write_registers(Holding.HOST_WATCHDOG, 0, timeout=0.3)
        self._drop_control()
        self._observer.disconnect()

    @property
    def connection(self) -> Connection:
        """Tell how the connection is."""
        return self._observer.observing.state

    @property
    def health(self) -> Health:
        """Give the condition as the tester last told it; failure when it does not tell any more."""
        inputs = self._observer.newest()
        if self.connection in (Connection.LOST, Connection.FAILED):
            return Health.FAILURE
        if inputs is None:
            return Health.NORMAL
        if inputs.fault_code:
            return fault_of(inputs.fault_code).health
        return Health.NORMAL if inputs.mode is UnitMode.PRODUCE else Health.CHECK_FUNCTION

    def identify(self) -> Identity:
        """Ask the tester who it is (function 43/14)."""
        self._observer.observing.check()
        return self._observer.link.identify()

    def alarms(self) -> list[Alarm]:
        """Give the fault that stands."""
        inputs = self._observer.current().value
        if not inputs.fault_code:
            return []
        fault = fault_of(inputs.fault_code)
        return [Alarm(str(inputs.fault_code), fault.severity, fault.text, fault.remedy, self._observer.fault_since)]

    def acknowledge(self, code: str) -> None:
        """Clear the fault `code`. Raises NotFound when it does not stand, Refused while its cause stands."""
        if code == "0" or str(self._observer.fresh().value.fault_code) != code:
            raise NotFound(f"{self._observer.who} has no alarm {code}")
        self.clear()

    # -------------------------------------------------------------------------------- control
    def take_control(self) -> None:
        """Arm the tester's host watchdog; from then on commands are sent. Raises NotInControl naming who has it."""
        inputs = self._observer.fresh().value
        if (owner := self._other_owner(inputs)) is not None:
            raise NotInControl(f"{self._observer.who}: control is refused: {owner} has it")
        if self._in_control:
            return
        losses, link = self._observer.losses, self._observer.link
        link.write_registers(Holding.HOST_WATCHDOG, self._watchdog_ms)
        if (kept := self._observer.read_holding()[Holding.HOST_WATCHDOG]) != self._watchdog_ms:
            raise Refused(f"{self._observer.who}: host_watchdog is {kept} ms after {self._watchdog_ms} was written")
        self._in_control = self._observer.guarded = True
        try:
            self._observer.check_unbroken(losses)
        except DeviceError:
            self._drop_control()
            raise
        self._observer.observing.settled()

    def release_control(self) -> None:
        """Switch the host watchdog off. Raises Refused while a test runs."""
        if not self._in_control:
            return
        state = self._observer.fresh().value.state
        if state in RUNNING:
            raise Refused(f"{self._observer.who}: release_control is refused in state {title(state)}: stop the test")
        self._observer.link.write_registers(Holding.HOST_WATCHDOG, 0)
        self._drop_control()

    def control_owner(self) -> str | None:
        """Tell who has control: us, the person with the key, or whoever started the test that runs."""
        inputs = self._observer.newest()
        other = None if inputs is None else self._other_owner(inputs)
        return other or ("us" if self._in_control else None)

    def _other_owner(self, inputs: Inputs) -> str | None:
        if inputs.mode is not UnitMode.PRODUCE:
            return f"the key switch at the station ({inputs.mode.name.lower()})"
        if inputs.state in RUNNING and not self._in_control:
            return f"somebody who started a test (state {title(inputs.state)})"
        return None

    def _drop_control(self) -> None:
        self._in_control = self._observer.guarded = False

    def _require_control(self, what: str) -> Inputs:
        inputs = self._observer.fresh().value
        owner = self._other_owner(inputs)
        if owner is not None or not self._in_control:
            refused = f"{self._observer.who}: {what} is refused in state {title(inputs.state)}"
            raise NotInControl(f"{refused}: {owner or 'nobody'} has control")
        return inputs

    # -------------------------------------------------------------------------------- machine
    def machine_state(self) -> MachineState:
        """Give the present state. Raises Stale when the newest is too old, NotConnected, ConnectionLost."""
        return self._observer.current().value.state

    def unit_mode(self) -> UnitMode:
        """Give what the key switch at the station says."""
        return self._observer.current().value.mode

    def counters(self) -> dict[str, int]:
        """Give the boards tested, passed and failed since the tester was switched on."""
        inputs = self._observer.current().value
        return {"tested": inputs.tested, "passed": inputs.passed, "failed": inputs.failed}

    def permissives(self) -> list[tuple[str, bool]]:
        """Give what a test needs, each with whether it is met."""
        inputs = self._observer.current().value
        return [
            ("door closed", inputs.door_closed),
            ("board present", inputs.board_present),
            ("emergency stop released", not inputs.emergency_stop),
            ("no fault", inputs.fault_code == 0),
            ("key switch at produce", inputs.mode is UnitMode.PRODUCE),
        ]

    def stop_reason(self) -> str:
        """Tell why it stopped or aborted; empty when it did neither."""
        inputs = self._observer.current().value
        if inputs.fault_code:
            return f"fault {inputs.fault_code}: {fault_of(inputs.fault_code).text}"
        if inputs.state in FALLEN:
            return "aborted by command"
        return "stopped" if inputs.state in (S.STOPPED, S.STOPPING) else ""

    def wait_for(self, state: MachineState, timeout: float) -> None:
        """Return when it is in `state`. Raises DeviceTimeout after `timeout` s, DeviceFault when it aborts instead."""
        what = f"reaching {title(state)}"
        self._handshake.reach({state}, timeout, what, self._observer.begin(what))

    def command(self, command: MachineCommand) -> None:
        """Give a command; return when the tester has taken it. Raises Refused, naming command and state."""
        self._command(command)

    def _command(self, command: MachineCommand, then: MachineState | None = None) -> None:
        """Give a command and see the tester arrive in the state `then`."""
        name = command.name.lower()
        go_on = self._observer.begin(name)
        self._require_control(name)
        self._handshake.give(command, go_on)
        if then is not None:
            self._handshake.reach({then}, TRANSITION, name, go_on)

    def stop(self) -> None:
        """Stop (PackML): an unfinished test gives no result; return when it stands.

        What waits here ends with Cancelled at once. Nothing is sent when control is not ours: what runs then was
        started by somebody else.
        """
        self._observer.stop_waiting()
        if not self._in_control:
            return
        go_on = self._observer.begin("stop")
        if self._observer.fresh().value.state in FALLEN | {S.STOPPED, S.CLEARING}:
            return
        self._handshake.give(MachineCommand.STOP, go_on)
        self._handshake.reach({S.STOPPED, *FALLEN}, TRANSITION, "stop", go_on)

    # -------------------------------------------------------------------------------- actions
    @action
    def open_door(self, *, an: str | None = None) -> None:
        """Open the door and wait until it is open."""
        self._require_control("open_door")
        self._handshake.move_door(DOOR_OPEN, "open_door", lambda now: now.door_open)

    @action
    def close_door(self, *, an: str | None = None) -> None:
        """Close the door and wait until it is closed."""
        self._require_control("close_door")
        self._handshake.move_door(DOOR_CLOSE, "close_door", lambda now: now.door_closed)

    @action(deadline=LONGEST_TEST + MARGIN)
    def test(self, program: int = 1, *, an: str | None = None) -> bool:
        """Test the board in the fixture; true when it passes.

        :param program: number of the test program
        """
        assert 1 <= program <= 9

        what = f"test with program {program}"
        go_on = self._observer.begin(what)
        before = self._require_control("test")
        if before.state in PASSING:
            before = self._observer.wait(lambda now: now.state not in PASSING, TRANSITION, "coming to rest").value
        if before.state in FALLEN:
            raise self._handshake.fault(before, f"test is refused in state {title(before.state)}: what ran before")
        if before.state in (S.COMPLETE, S.STOPPED):
            self._handshake.give(MachineCommand.RESET, go_on)
            before = self._handshake.reach({S.IDLE}, TRANSITION, "the reset before the test", go_on)
        expected = (before.result_number + 1) & 0xFFFF
        go_on()
        self._observer.link.write_registers(Holding.TEST_PROGRAM, program)

        def finished(inputs: Inputs) -> bool:
            go_on()
            if inputs.state in FALLEN:
                raise self._handshake.fault(inputs, what)
            if inputs.state in (S.STOPPING, S.STOPPED):
                raise Cancelled(f"{self._observer.who}: {what} was stopped at the station")
            return inputs.state in (S.COMPLETE, S.RESETTING, S.IDLE) and inputs.result_number == expected

        try:
            self._handshake.give(MachineCommand.START, go_on)
            after = self._observer.wait(finished, self._test_timeout, what).value
        except DeviceTimeout:
            with contextlib.suppress(DeviceError):  # the tester's watchdog is left then
                self.stop()  # nothing may go on that nobody waits for any more
            raise
        if after.result not in (1, 2):
            raise DeviceFault(f"{self._observer.who}: {what} ended with result {after.result}, neither pass nor fail")
        return after.result == 1

    @action
    def supply_voltage(self, *, an: str | None = None) -> float:
        """Give the supply voltage of the last board that was tested, V."""
        return self._measured("supply_voltage").supply_voltage

    @action
    def supply_current(self, *, an: str | None = None) -> float:
        """Give the supply current of the last board that was tested, A."""
        return self._measured("supply_current").supply_current

    @action
    def contact_resistance(self, *, an: str | None = None) -> float:
        """Give the contact resistance of the last board that was tested, Ω."""
        return self._measured("contact_resistance").contact_resistance

    def _measured(self, what: str) -> Inputs:
        inputs = self._observer.fresh().value
        if inputs.result == 0:
            raise Refused(f"{self._observer.who}: {what} is refused in state {title(inputs.state)}: nothing was tested")
        return inputs

    @action
    def board_present(self, *, an: str | None = None) -> bool:
        """Tell whether a board lies in the fixture."""
        return self._observer.fresh().value.board_present

    @action
    def reset(self, *, an: str | None = None) -> None:
        """Make the tester ready for a test; return when it is."""
        self._command(MachineCommand.RESET, S.IDLE)

    @action
    def clear(self, *, an: str | None = None) -> None:
        """Clear a fault after its cause was dealt with; return when the tester is stopped."""
        self._command(MachineCommand.CLEAR, S.STOPPED)

    @action
    def abort(self, *, an: str | None = None) -> None:
        """Abort what runs; return when the tester is aborted. It has to be cleared afterwards."""
        self._command(MachineCommand.ABORT, S.ABORTED)
