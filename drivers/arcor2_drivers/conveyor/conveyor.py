"""The object type of a conveyor: an Axis and a Machine with a CiA 402 drive; positions in m, speeds in m/s."""

from typing import ClassVar, Final

from arcor2_hw.actions import action, observation
from arcor2_hw.data.device import Alarm, Health, Identity, LossReaction, Reading
from arcor2_hw.data.maintenance import DeviceParameter, ParameterFailure
from arcor2_hw.exceptions import ConnectionLost, NotFound, OutOfRange, Refused
from arcor2_hw.messages import Phrase
from arcor2_hw.objects import Axis, Machine, MachineCommand, MachineState
from arcor2_hw.objects.observing import GoOn
from arcor2_hw.objects.polled_control import NOBODY, OWNED_BY_US, PolledControl

from . import cia402
from .cia402 import FAULTY, SWITCHED_OFF, Power, State
from .emergencies import fault_of
from .motion import Motion
from .observer import Observer
from .packml import STATES, Unit
from .parameters import dump, restore
from .settings import MAX_HEARTBEAT_TIME, MAX_MOVE_TIME, MAX_RAMP_TIME, ConveyorSettings

MARGIN: Final = 30.0
"""Time a move may take beyond MAX_MOVE_TIME, s: enabling, handshake and stop, including timeouts."""
DECELERATION_DELAY: Final = 0.1
"""Time from the heartbeat timeout until the drive decelerates, s."""


class Conveyor(PolledControl[State], Machine, Axis):
    """A belt conveyor with a servo drive (CANopen, CiA 402)."""

    _ABSTRACT = False
    display_name = "Conveyor"
    states: ClassVar[frozenset[MachineState]] = STATES
    loss_reaction: ClassVar[LossReaction] = LossReaction.stops_within(
        MAX_HEARTBEAT_TIME / 1000.0 + DECELERATION_DELAY + MAX_RAMP_TIME
    )
    CANCEL_MAPPING: ClassVar[dict[str, str]] = {
        "home": "halt",
        "move_to": "halt",
        "move_by": "halt",
        "run": "halt",
        "start": "halt",
    }

    def __init__(self, obj_id: str, name: str, settings: ConveyorSettings) -> None:
        super().__init__(obj_id, name, settings)
        self._units = settings
        self._observer = Observer(name, settings, self.drop_control)
        self._motion = Motion(self._observer, settings)
        self._unit = Unit(self._observer.who, self._motion, settings.counts(settings.belt_speed))
        self._homed = False
        self.use_link(self._observer.link, self._observer)

    # -------------------------------------------------------------------------------- connection
    def disconnect(self) -> None:
        """Release control and stop observing. A moving belt is stopped, by us or by the drive."""
        self.stop_waiting()
        super().disconnect()

    def leave(self) -> None:
        """Release control because we disconnect."""
        newest = self.newest()
        if newest is not None and self._motion.is_stopped(newest):
            self.disarm()
        else:
            self._observer.link.write(cia402.CONTROLWORD, cia402.CW_QUICK_STOP)

    def condition(self) -> Health:
        """Return the condition that the drive last reported."""
        newest = self.newest()
        return Health.FAILURE if newest is not None and newest.power in FAULTY else Health.NORMAL

    def identify(self) -> Identity:
        """Read the identity object of the drive (1018h)."""
        self.observing.check()
        entries = (cia402.VENDOR, cia402.PRODUCT, cia402.SERIAL, cia402.REVISION)
        vendor, product, serial, revision = (self._observer.link.read(entry) for entry in entries)
        return Identity(f"CANopen vendor {vendor:X}h", f"product {product:X}h", str(serial), f"{revision:X}h")

    def parameters_dump(self) -> list[DeviceParameter]:
        """Read the setup of the drive; objects that the model does not have are left out."""
        self.observing.check()
        return dump(self._observer.link)

    def parameters_restore(self, parameters: list[DeviceParameter]) -> list[ParameterFailure]:
        """Write the setup of the drive, which stores it. Raise Refused while the drive is enabled."""
        if (power := self.fresh().power) not in SWITCHED_OFF:
            raise Refused(
                "{device}: parameters can be written only while the drive is switched off; its state is {state}",
                device=self.who,
                state=power,
            )
        return restore(self._observer.link, parameters)

    def alarms(self) -> list[Alarm]:
        """Return the present fault, or the emergency that was not cancelled."""
        now = self.current()
        code = now.error_code if now.power in FAULTY else self._observer.emergency
        if not code:
            return []
        fault = fault_of(code)
        return [Alarm(f"{code:04X}h", fault.severity, fault.text, fault.remedy, self._observer.emergency_since)]

    def acknowledge(self, code: str) -> None:
        """Reset the fault `code`. Raises NotFound when there is no such fault, Refused while its cause is present."""
        now = self.fresh()
        if now.power not in FAULTY or f"{now.error_code:04X}h" != code:
            raise NotFound("{device} has no alarm {code} to acknowledge", device=self.who, code=code)
        self.fault_reset()

    # -------------------------------------------------------------------------------- control
    def arm(self) -> None:
        """Configure the reaction of the drive to the loss of our heartbeat, and start the node."""
        link, s = self._observer.link, self._units
        armed = (
            (cia402.CONSUMER_HEARTBEAT, s.master_id << 16 | s.heartbeat_ms),
            (cia402.ABORT_OPTION, cia402.QUICK_STOP_ON_LOSS),
        )
        link.write(cia402.CONSUMER_HEARTBEAT, 0)  # earlier heartbeats do not count
        for entry, value in armed:
            link.write(entry, value)
        link.write(cia402.QUICK_STOP_OPTION, cia402.SLOW_DOWN_AND_DISABLE)
        link.write(cia402.QUICK_STOP_DECELERATION, s.rate(s.quick_stop_deceleration))
        link.write(cia402.ACCELERATION, s.rate(s.acceleration))
        link.write(cia402.DECELERATION, s.rate(s.acceleration))
        for entry, value in armed:
            if (stored := link.read(entry)) != value:
                raise Refused(
                    "{device}: {title} is {stored} after {value} was written",
                    device=self.who,
                    title=entry.title,
                    stored=stored,
                    value=value,
                )
        self._observer.listen()
        link.start_node()
        link.heartbeat()
        self._unit.forget()
        self._observer.guarded = True

    def disarm(self) -> None:
        """Switch off the torque and the monitoring of our heartbeat."""
        self._observer.link.write(cia402.CONTROLWORD, cia402.CW_DISABLE_VOLTAGE)
        self._observer.link.write(cia402.CONSUMER_HEARTBEAT, 0)

    def release_control(self) -> None:
        """Switch off the torque and the monitoring of our heartbeat. Raises Refused while the belt moves."""
        if self.in_control and not self._motion.is_stopped(self.fresh()):
            raise Refused("{device}: release_control is refused while the belt moves: halt it", device=self.who)
        super().release_control()

    def owner_of(self, state: State) -> str | None:
        """Return who has control: us, the node whose heartbeat is monitored, or the client that enabled the drive."""
        if self.in_control:
            return OWNED_BY_US
        master, limit = self._observer.consumer >> 16 & 0x7F, self._observer.consumer & 0xFFFF
        if limit and self._observer.received_heartbeat(master, limit / 1000.0):
            return Phrase.of("node {node}, whose heartbeat the drive monitors,", node=master)
        if self._observer.received_heartbeat(self._units.master_id, MAX_HEARTBEAT_TIME / 1000.0):
            return Phrase.of("another host, which sends heartbeats as node {node} too,", node=self._units.master_id)
        other = Phrase.of("another client, which enabled the drive,")
        return other if state.power is Power.ENABLED else None

    def drop_control(self, reason: str = NOBODY) -> None:
        """End control. After a loss, also forget the zero: the drive may have been off."""
        super().drop_control(reason)
        self._observer.guarded = False
        self._unit.forget()
        self._homed = self._homed and self.observing.online

    def _begin(self, operation: str, resting: bool = True) -> tuple[State, GoOn]:
        go_on = self.begin(operation)
        now = self.fresh()
        self.require_control(operation)
        if resting and not self._motion.is_stopped(now):
            raise Refused(
                "{device}: {what} is refused while the belt moves: halt it first", device=self.who, what=operation
            )
        return now, go_on

    # -------------------------------------------------------------------------------- values
    @observation
    def position(self) -> Reading[float]:
        """Return the position of the belt, m.

        Raises NotConnected, ConnectionLost, or Stale if the position is too old.
        """
        now, asked, stamp = self._observer.current()
        return Reading(self._units.metres(now.position), stamp, asked)

    @observation
    def velocity(self) -> Reading[float]:
        """Return the velocity of the belt, m/s. Raises like `position`."""
        now, asked, stamp = self._observer.current()
        return Reading(self._units.metres(now.velocity), stamp, asked)

    @property
    def shown_values(self) -> dict[str, float]:
        """Return the velocity of the belt, m/s."""
        now = self.newest()
        return {} if now is None else {"velocity": round(self._units.metres(now.velocity), 2)}

    @property
    def homed(self) -> bool:
        """Return whether the drive was homed since the last connection loss."""
        return self._homed

    # -------------------------------------------------------------------------------- methods of the bases
    def move_absolute(self, position: float, velocity: float) -> None:
        """Move to `position`, m, with `velocity`, m/s; return at the position. Refused before homing."""
        what = Phrase.of("move_to {position:g} m", position=position)
        self._check(position, velocity, what)
        now, go_on = self._begin(what)
        if not self._homed:
            raise Refused(
                "{device}: {what} is refused in state {power}: it is not homed",
                device=self.who,
                what=what,
                power=now.power,
            )
        target = self._units.counts(position)
        with self._unit.act(what):
            self._motion.move(target, False, self._units.rate(velocity), target, what, go_on)

    def move_relative(self, distance: float, velocity: float) -> None:
        """Move by `distance`, m, with `velocity`, m/s; return at the position."""
        what = Phrase.of("move_by {distance:g} m", distance=distance)
        now, go_on = self._begin(what)
        end = self._units.metres(now.position) + distance
        self._check(end, velocity, what)
        by = self._units.counts(distance)
        with self._unit.act(what):
            self._motion.move(by, True, self._units.rate(velocity), now.position + by, what, go_on)

    def move_velocity(self, velocity: float) -> None:
        """Run with `velocity`, m/s, until halted; return when it is reached."""
        what = Phrase.of("run with {velocity:g} m/s", velocity=velocity)
        if not abs(velocity) <= self._units.max_speed:
            raise OutOfRange(
                "{device}: {what}: velocity must be at most {max_speed:g} m/s",
                device=self.who,
                what=what,
                max_speed=self._units.max_speed,
            )
        _, go_on = self._begin(what, resting=False)
        with self._unit.act(what):
            self._motion.run(self._units.counts(velocity), what, go_on)

    def _check(self, position: float, speed: float, operation: str) -> None:
        s = self._units
        if not s.min_position <= position <= s.max_position:
            limits = f"{s.min_position:g} to {s.max_position:g} m"
            raise OutOfRange(
                "{device}: {what}: position must be {limits}, not {position:g} m",
                device=self.who,
                what=operation,
                limits=limits,
                position=position,
            )
        if not 0.0 < speed <= s.max_speed:
            raise OutOfRange(
                "{device}: {what}: speed must be above 0 and at most {max_speed:g} m/s",
                device=self.who,
                what=operation,
                max_speed=s.max_speed,
            )
        longest = MAX_MOVE_TIME * speed
        if abs(position - s.metres(self.current().position)) > longest:
            raise OutOfRange(
                "{device}: {what} would take longer than {longest_move:g} s at {speed:g} m/s",
                device=self.who,
                what=operation,
                longest_move=MAX_MOVE_TIME,
                speed=speed,
            )

    # -------------------------------------------------------------------------------- machine
    def machine_state(self) -> MachineState:
        """Return the present state. Raises NotConnected, ConnectionLost, or Stale if the newest state is too old."""
        return self._unit.state(self.current())

    def command(self, command: MachineCommand) -> None:
        """Execute a command, and wait for the state that it leads to. Raises Refused, NotInControl."""
        now, go_on = self._begin(command.name.lower(), resting=False)
        if command in (MachineCommand.STOP, MachineCommand.ABORT):
            self.stop_waiting()
        self._unit.command(command, now, go_on)

    def wait_for(self, state: MachineState, timeout: float) -> None:
        """Return when the belt is in `state`. Raises DeviceTimeout after `timeout` s, DeviceFault when it aborts."""
        what = f"becoming {state.name.lower()}"

        def arrived(now: State) -> bool:
            if now.power in FAULTY and state not in (MachineState.ABORTED, MachineState.ABORTING):
                raise self._motion.fault(now, f"{what} ended")
            return self._unit.state(now) is state

        self.wait(arrived, timeout, what, self.begin(what))

    def stop_reason(self) -> str:
        """Return why the belt is aborted; empty when it is not."""
        return self._unit.reason(self.current())

    def permissives(self) -> list[tuple[str, bool]]:
        """Return the conditions of a start, and for each whether it is met."""
        now = self.current()
        return [
            ("control is taken", self.in_control),
            ("no fault is active", now.power not in FAULTY and not self._unit.aborted),
            ("the drive is enabled", now.power is Power.ENABLED),
            ("the belt is stopped", self._motion.is_stopped(now)),
        ]

    # -------------------------------------------------------------------------------- actions
    @action
    def reset(self, *, an: str | None = None) -> None:
        """Enable the drive, so that the belt can be started; return when it is idle."""
        self.command(MachineCommand.RESET)

    @action
    def start(self, *, an: str | None = None) -> None:
        """Run the idle belt with the speed of its settings; return when it is reached."""
        self.command(MachineCommand.START)

    @action
    def hold(self, *, an: str | None = None) -> None:
        """Stop the running belt, with the torque on; return at standstill."""
        self.command(MachineCommand.HOLD)

    @action
    def unhold(self, *, an: str | None = None) -> None:
        """Continue to run the belt after a hold."""
        self.command(MachineCommand.UNHOLD)

    @action
    def abort(self, *, an: str | None = None) -> None:
        """Stop the belt quickly; it has to be cleared afterwards."""
        self.command(MachineCommand.ABORT)

    @action
    def clear(self, *, an: str | None = None) -> None:
        """Clear a fault or an abort after its cause was removed; the belt is stopped then."""
        self.command(MachineCommand.CLEAR)

    @action(deadline=MAX_MOVE_TIME + MARGIN)
    def home(self, *, an: str | None = None) -> None:
        """Home the belt: find its zero."""
        _, go_on = self._begin("home")
        losses = self._observer.losses
        with self._unit.act("home"):
            self._homed = False
            self._motion.home("home", go_on)
        self._homed = True
        if self._observer.losses != losses:
            self._homed = False
            raise ConnectionLost("{device}: the connection was lost while homing ended", device=self.who)

    @action(deadline=MAX_MOVE_TIME + MARGIN)
    def move_to(self, position: float, speed: float = 0.1, *, an: str | None = None) -> None:
        """Move the belt to a position; it has to be homed.

        :param position: target position, m
        :param speed: speed, m/s
        """
        assert 0.001 <= speed <= 10.0

        self.move_absolute(position, speed)

    @action(deadline=MAX_MOVE_TIME + MARGIN)
    def move_by(self, distance: float, speed: float = 0.1, *, an: str | None = None) -> None:
        """Move the belt by a distance.

        :param distance: distance, m; negative for backwards
        :param speed: speed, m/s
        """
        assert 0.001 <= speed <= 10.0

        self.move_relative(distance, speed)

    @action(ends_with_program=True)
    def run(self, velocity: float = 0.1, *, an: str | None = None) -> None:
        """Run the belt until it is halted; return when it has reached its velocity.

        :param velocity: velocity, m/s; negative for backwards
        """
        assert -10.0 <= velocity <= 10.0

        self.move_velocity(velocity)

    @action
    def halt(self, *, an: str | None = None) -> None:
        """Stop the belt; return at standstill. A running move ends with Cancelled."""
        self.stop_waiting()
        if self.in_control:
            self._motion.halt()

    def stop(self) -> None:
        """Halt the belt."""
        self.halt()

    @action
    def quick_stop(self, *, an: str | None = None) -> None:
        """Stop the belt as quickly as its settings allow; return at standstill, without torque."""
        self.stop_waiting()
        if self.in_control:
            self._motion.quick_stop()

    @action
    def fault_reset(self, *, an: str | None = None) -> None:
        """Reset a fault after its cause was removed; the belt does not move."""
        _, go_on = self._begin("fault_reset", resting=False)
        self._motion.fault_reset(go_on)
        self._unit.forget()

    @action(again="safe")
    def belt_position(self, *, an: str | None = None) -> float:
        """Return the position of the belt, m."""
        return self._units.metres(self.fresh().position)
