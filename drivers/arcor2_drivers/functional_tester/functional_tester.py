"""The object type of a functional tester: a Machine on Modbus TCP that tests one board at a time."""

import contextlib
from typing import ClassVar, Final

from arcor2_hw.actions import action
from arcor2_hw.data.device import Alarm, Health, LossReaction, Observation, Quality
from arcor2_hw.data.geometry import Pose
from arcor2_hw.data.object_type import Models
from arcor2_hw.data.parts import PlaceKind
from arcor2_hw.exceptions import Cancelled, DeviceError, DeviceFault, DeviceTimeout, NotFound, Refused
from arcor2_hw.messages import Phrase, translatable
from arcor2_hw.objects import CollisionObject, Machine, MachineCommand, MachineState, UnitMode

from .registers import ABORT_STATES, DOOR_CLOSE, DOOR_OPEN, STATES, TRANSIENT_STATES, Holding, Inputs, fault_of, title
from .settings import MAX_TEST_TIME, MAX_WATCHDOG_TIMEOUT, FunctionalTesterSettings
from .tester import TRANSITION, Tester

MARGIN: Final = 20.0
"""Time beyond the longest test, s: the reset before it, handshakes, repeated requests, the stop."""
ABORT_TIMEOUT: Final = 0.2
"""Time from the decision to abort to the state Aborted, s."""

S = MachineState


class FunctionalTester(Tester, Machine, CollisionObject):
    """A station that contacts a printed circuit board, runs a test program and reports pass or fail."""

    _ABSTRACT = False
    display_name = "Functional tester"
    place_kind = PlaceKind.HOLDER
    states: ClassVar[frozenset[MachineState]] = STATES
    loss_reaction: ClassVar[LossReaction] = LossReaction.stops_within(MAX_WATCHDOG_TIMEOUT / 1000.0 + ABORT_TIMEOUT)
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
            raise NotFound("{name} has no settings. Set host to the address of the tester.", name=name)
        self.use_tester(settings)

    # -------------------------------------------------------------------------------- condition
    def condition(self) -> Health:
        """Return the condition that the tester last reported."""
        inputs = self.newest()
        if inputs is None:
            return Health.NORMAL
        if inputs.fault_code:
            return fault_of(inputs.fault_code).health
        return Health.NORMAL if inputs.mode is UnitMode.PRODUCE else Health.CHECK_FUNCTION

    def alarms(self) -> list[Alarm]:
        """Return the present fault as an alarm, if there is one."""
        inputs = self.current()
        if not inputs.fault_code:
            return []
        fault = fault_of(inputs.fault_code)
        return [Alarm(str(inputs.fault_code), fault.severity, fault.text, fault.remedy, self.fault_since)]

    def acknowledge(self, code: str) -> None:
        """Clear the fault `code`. Raises NotFound when there is no such fault, Refused while its cause is present."""
        if code == "0" or str(self.fresh().fault_code) != code:
            raise NotFound("{device} has no alarm {code}", device=self.who, code=code)
        self.clear()

    @property
    def shown_values(self) -> dict[str, float]:
        """Return whether the door is open."""
        inputs = self.newest()
        return {} if inputs is None else {"door": (1.0 + inputs.door_open - inputs.door_closed) / 2.0}

    # -------------------------------------------------------------------------------- machine
    def machine_state(self) -> MachineState:
        """Return the present state. Raises NotConnected, ConnectionLost, or Stale if the newest state is too old."""
        return self.current().state

    def unit_mode(self) -> UnitMode:
        """Return the position of the key switch at the station."""
        return self.current().mode

    def counters(self) -> dict[str, int]:
        """Return the boards tested, passed and failed since power-on."""
        inputs = self.current()
        return {
            translatable("tested"): inputs.tested,
            translatable("passed"): inputs.passed,
            translatable("failed"): inputs.failed,
        }

    def observations(self) -> list[Observation]:
        """Return the measurements of the last tested board and the counters since power-on."""
        inputs = self.current()
        measured = (
            (translatable("Supply voltage"), inputs.supply_voltage, "V"),
            (translatable("Supply current"), inputs.supply_current, "A"),
            (translatable("Contact resistance"), inputs.contact_resistance, "Ω"),
        )
        counted = (
            (translatable("Boards tested"), inputs.tested),
            (translatable("Boards passed"), inputs.passed),
            (translatable("Boards failed"), inputs.failed),
        )
        tested = inputs.result != 0  # otherwise nothing has been measured yet
        quality = Quality.GOOD if tested else Quality.BAD
        return [
            *(Observation(name, value if tested else None, unit, quality) for name, value, unit in measured),
            *(Observation(name, value) for name, value in counted),
        ]

    def permissives(self) -> list[tuple[str, bool]]:
        """Return the conditions of a test, and for each whether it is met."""
        inputs = self.current()
        return [
            ("door closed", inputs.door_closed),
            ("board present", inputs.board_present),
            ("emergency stop released", not inputs.emergency_stop),
            ("no fault", inputs.fault_code == 0),
            ("key switch at produce", inputs.mode is UnitMode.PRODUCE),
        ]

    def stop_reason(self) -> str:
        """Return why the tester stopped or aborted; empty if it did neither."""
        inputs = self.current()
        if inputs.fault_code:
            return f"fault {inputs.fault_code}: {fault_of(inputs.fault_code).text}"
        if inputs.state in ABORT_STATES:
            return "aborted by command"
        return "stopped" if inputs.state in (S.STOPPED, S.STOPPING) else ""

    def wait_for(self, state: MachineState, timeout: float) -> None:
        """Wait until the tester is in `state`. Raises DeviceTimeout after `timeout` s, DeviceFault if it aborts."""
        what = f"reaching {title(state)}"
        self.reach({state}, timeout, what, self.begin(what))

    def command(self, command: MachineCommand, then: MachineState | None = None) -> None:
        """Send a command. Return when it is accepted; with `then`, when the tester is in that state.

        Raises:
            Refused: The tester does not accept the command.
        """
        name = command.name.lower()
        go_on = self.begin(name)
        self.require_command(name)
        self.send_command(command, go_on)
        if then is not None:
            self.reach({then}, TRANSITION, name, go_on)

    def stop(self) -> None:
        """Stop (PackML) and return at standstill. An unfinished test returns no result.

        Calls that wait end with Cancelled. Without control nothing is sent, because another client started the test.
        """
        self.stop_waiting()
        if not self.in_control:
            return
        go_on = self.begin("stop")
        if self.fresh().state in ABORT_STATES | {S.STOPPED, S.CLEARING}:
            return
        self.send_command(MachineCommand.STOP, go_on)
        self.reach({S.STOPPED, *ABORT_STATES}, TRANSITION, "stop", go_on)

    # -------------------------------------------------------------------------------- actions
    @action
    def open_door(self, *, an: str | None = None) -> None:
        """Open the door and wait until it is open."""
        self.move_door(DOOR_OPEN, "open_door", lambda now: now.door_open)

    @action
    def close_door(self, *, an: str | None = None) -> None:
        """Close the door and wait until it is closed."""
        self.move_door(DOOR_CLOSE, "close_door", lambda now: now.door_closed)

    @action(deadline=MAX_TEST_TIME + MARGIN, verdict=True)
    def test(self, program: int = 1, *, an: str | None = None) -> bool:
        """Test the board in the fixture; return whether it passes.

        :param program: number of the test program
        """
        assert 1 <= program <= 9

        what = Phrase.of("test with program {program}", program=program)
        go_on = self.begin(what)
        before = self.require_command("test")
        if before.state in TRANSIENT_STATES:
            before = self.wait(
                lambda now: now.state not in TRANSIENT_STATES, TRANSITION, "leaving the short state", go_on
            )
        if before.state in ABORT_STATES:
            raise self.fault(before, f"test is refused in state {title(before.state)}: what ran before")
        if before.state in (S.COMPLETE, S.STOPPED):
            self.send_command(MachineCommand.RESET, go_on)
            before = self.reach({S.IDLE}, TRANSITION, "the reset before the test", go_on)
        expected = (before.result_number + 1) & 0xFFFF
        go_on()
        self.link.write_registers(Holding.TEST_PROGRAM, program)

        def finished(inputs: Inputs) -> bool:
            if inputs.state in ABORT_STATES:
                raise self.fault(inputs, what)
            if inputs.state in (S.STOPPING, S.STOPPED):
                raise Cancelled("{device}: {what} was stopped at the station", device=self.who, what=what)
            return inputs.state in (S.COMPLETE, S.RESETTING, S.IDLE) and inputs.result_number == expected

        try:
            self.send_command(MachineCommand.START, go_on)
            after = self.wait(finished, self._s.test_timeout, what, go_on)
        except DeviceTimeout:
            with contextlib.suppress(DeviceError):  # the watchdog of the tester ends it
                self.stop()  # the test must not continue without us
            raise
        if after.result not in (1, 2):
            raise DeviceFault(
                "{device}: {what} ended with result {result}, neither pass nor fail",
                device=self.who,
                what=what,
                result=after.result,
            )
        return after.result == 1

    @action(again="safe")
    def supply_voltage(self, *, an: str | None = None) -> float:
        """Return the supply voltage of the last tested board, V."""
        return self._measured("supply_voltage").supply_voltage

    @action(again="safe")
    def supply_current(self, *, an: str | None = None) -> float:
        """Return the supply current of the last tested board, A."""
        return self._measured("supply_current").supply_current

    @action(again="safe")
    def contact_resistance(self, *, an: str | None = None) -> float:
        """Return the contact resistance of the last tested board, Ω."""
        return self._measured("contact_resistance").contact_resistance

    def _measured(self, operation: str) -> Inputs:
        inputs = self.fresh()
        if inputs.result == 0:
            raise Refused(
                "{device}: {what} is refused in state {state}: nothing was tested",
                device=self.who,
                what=operation,
                state=title(inputs.state),
            )
        return inputs

    @action(again="safe")
    def board_present(self, *, an: str | None = None) -> bool:
        """Return whether a board is in the fixture."""
        return self.fresh().board_present

    @action
    def reset(self, *, an: str | None = None) -> None:
        """Reset the tester for a test, and wait until it is idle."""
        self.command(MachineCommand.RESET, S.IDLE)

    @action
    def clear(self, *, an: str | None = None) -> None:
        """Clear a fault after its cause was removed; return when the tester is stopped."""
        self.command(MachineCommand.CLEAR, S.STOPPED)

    @action
    def abort(self, *, an: str | None = None) -> None:
        """Abort, and return when the tester is aborted. It has to be cleared afterwards."""
        self.command(MachineCommand.ABORT, S.ABORTED)
