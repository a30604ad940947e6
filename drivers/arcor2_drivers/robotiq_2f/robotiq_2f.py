"""Robotiq2F: the object type of Robotiq 2F grippers."""

import contextlib
from typing import ClassVar, Final

from arcor2_hw.actions import action, observation
from arcor2_hw.data.base import Timestamp, now
from arcor2_hw.data.device import Alarm, Health, LossReaction
from arcor2_hw.data.geometry import Pose, Position
from arcor2_hw.exceptions import DeviceError, DeviceFault, DeviceTimeout, NotFound, OutOfRange, Refused
from arcor2_hw.messages import Message, Phrase
from arcor2_hw.objects import Gripper, GripResult, PartSize
from arcor2_hw.objects.observing import GoOn
from arcor2_hw.objects.polled_control import NOBODY, OWNED_BY_US, PolledControl
from arcor2_hw.objects.small import GripperState
from arcor2_hw.objects.state_observer import Snapshot

from . import scaling
from .ascii_link import AsciiLink
from .rtu_link import RtuLink
from .settings import Robotiq2FSettings, Wire
from .status import FIRST_MAJOR_FAULT, HELD, Activation, Command, Link, Object, Status, fault_of

MARGIN: Final = 2.0
"""Time a motion may take beyond stroke / speed, s: for acceleration, the force to build up, and a slow wire."""
ACCEPT_TIMEOUT: Final = 1.0
"""Time limit from a command to its echo in the status, s."""
STANDSTILL_TIMEOUT: Final = 2.0
"""Time limit from a stop to standstill, s."""
ACTION_DEADLINE: Final = 300.0
"""Deadline of an action, s: the whole stroke at the lowest speed takes less."""
PAD_HEIGHT: Final = 0.022
"""Height of the pads of the fingers, m; the assumed height of a part of unknown size."""


def link_of(name: str, settings: Robotiq2FSettings) -> Link:
    """Return the connection that the settings select; it is not open yet."""
    if settings.wire is Wire.MODBUS_RTU:
        return RtuLink(name, settings.serial_port, settings.baud_rate, settings.unit_id, settings.request_timeout)
    return AsciiLink(name, settings.host, settings.port, settings.request_timeout)


class Robotiq2F(PolledControl[Status], Gripper):
    """A Robotiq 2F-85 or 2F-140 adaptive gripper, on a robot's URCap or on Modbus RTU."""

    _ABSTRACT = False
    display_name = "Robotiq 2F gripper"
    # The gripper finishes its motion, then holds: spindle and spring are self-locking.
    loss_reaction: ClassVar[LossReaction] = LossReaction.holds()
    CANCEL_MAPPING: ClassVar[dict[str, str]] = {"activate": "stop", "grip": "stop", "release": "stop"}
    busy_period = 0.01
    fresh_for = 1.0

    def __init__(self, obj_id: str, name: str, settings: Robotiq2FSettings) -> None:
        super().__init__(obj_id, name, settings)
        self._s = settings
        self.tcp = Pose(Position(0.0, 0.0, settings.tcp_z))
        self.mass = settings.mass
        self._gripper = link_of(name, settings)
        self.answers_within = 16.0 * settings.request_timeout
        self.use_link(self._gripper)
        self._activating = False
        self._other_client = ""
        self._commanded: int | None = None
        """Latest position that we commanded; None while the gripper may be elsewhere."""
        self._echoed = False
        self._held = self._lost = False
        self._fault_since: Timestamp = now()

    # -------------------------------------------------------------------------------- state
    def read_state(self) -> Status:
        """Read the status."""
        return self._gripper.read()

    def on_state(self, snapshot: Snapshot[Status]) -> None:
        """Detect faults, a lost part, and commands of other clients."""
        status, before = snapshot.value, self.newest()
        if status.fault and (before is None or before.fault != status.fault):
            self._fault_since = now()
        if not status.active:
            self._held = self._lost = False
            self._commanded = None
            self.detach_part()
        elif self._held and status.go_to and status.object not in HELD:
            self._held, self._lost = False, True
            self.detach_part()
        commanded = self._commanded
        if commanded is None:
            return
        if status.echo == commanded:
            self._echoed = True
        elif self._echoed:
            other = "another client of the gripper, which requested position {position},"
            self._other_client = Phrase.of(other, position=status.echo)
            self.drop_control(Phrase.of("{owner} has control", owner=self._other_client))

    def condition(self) -> Health:
        """Return the condition that the gripper last reported."""
        status = self.newest()
        return Health.NORMAL if status is None or not status.fault else fault_of(status.fault).health

    def alarms(self) -> list[Alarm]:
        """Return the active fault."""
        code = self.current().fault
        if not code:
            return []
        fault = fault_of(code)
        return [Alarm(str(code), fault.severity, fault.text, fault.remedy, self._fault_since)]

    def acknowledge(self, code: str) -> None:
        """Reset the gripper after a fault from code 10 on, without motion; activate it afterwards.

        Raises:
            NotFound: The fault is not active.
            Refused: The fault is cleared by removing its cause.
        """
        status = self.fresh()
        if not status.fault or str(status.fault) != code:
            raise NotFound("{device} has no alarm {code}", device=self.who, code=code)
        if status.fault < FIRST_MAJOR_FAULT:
            fault = fault_of(status.fault)
            raise Refused(
                "{device}: fault {code} ({text}) is cleared by removing its cause: {remedy}.",
                device=self.who,
                code=code,
                text=Message.of(fault.text),
                remedy=Message.of(fault.remedy),
            )
        with self.act("acknowledge") as go_on:
            self._reset(go_on)

    # -------------------------------------------------------------------------------- control
    def disconnect(self) -> None:
        """Stop observing. The gripper keeps a gripped part."""
        super().disconnect()
        self._held = self._lost = False

    def leave(self) -> None:
        """Send nothing when disconnecting: the gripper finishes its motion, then holds."""

    def is_busy(self, state: Status) -> bool:
        """Return whether the fingers move."""
        return state.moving

    def owner_of(self, state: Status) -> str | None:
        """Return the owner; another client is detected only while it moves the gripper."""
        if self.in_control:
            return OWNED_BY_US
        return Phrase.of("another client, which moves the gripper,") if state.moving else None

    def arm(self) -> None:
        """Take control without writing anything; the gripper is not activated."""
        self._other_client, self._commanded = "", None

    def release_control(self) -> None:
        """Release control. Raise Refused while the gripper moves."""
        if self.in_control and self.fresh().moving:
            raise Refused(
                "{device}: release_control is refused in state {state}: stop the gripper first",
                device=self.who,
                state=self.state(),
            )
        super().release_control()

    def control_owner(self) -> str | None:
        """Return who has control."""
        return super().control_owner() or self._other_client or None

    def drop_control(self, reason: str = NOBODY) -> None:
        """Record that control has ended."""
        super().drop_control(reason)
        self._commanded = None

    def _check(self, status: Status, operation: str) -> None:
        """Check that we have control and that no major fault is active. Raise NotInControl or DeviceFault."""
        self.require_control(operation)
        if status.fault >= FIRST_MAJOR_FAULT:
            fault = fault_of(status.fault)
            raise DeviceFault(
                "{device}: {what} ended by fault {code}: {text}",
                fault.remedy,
                status.fault,
                device=self.who,
                what=operation,
                code=status.fault,
                text=Message.of(fault.text),
            )

    # -------------------------------------------------------------------------------- observing
    def state(self) -> GripperState:
        """Return the state of the gripper. Raise Stale, NotConnected or ConnectionLost."""
        status = self.current()
        if status.moving and not self._lost:
            return GripperState.MOVING
        if not status.active:
            return GripperState.INACTIVE
        if self._lost:
            return GripperState.LOST
        return GripperState.HOLDING if status.object in HELD else GripperState.AT_POSITION

    @observation
    def holding(self) -> bool:
        """Return whether a part is held. Raise Stale, NotConnected or ConnectionLost."""
        return self.state() is GripperState.HOLDING

    def width(self) -> float:
        """Return the width between the fingers, m. Raise Stale, NotConnected or ConnectionLost."""
        return scaling.width(self._s, self.current().position)

    @property
    def shown_values(self) -> dict[str, float]:
        """Return the width between the fingers, m."""
        status = self.newest()
        return {} if status is None else {"width": round(scaling.width(self._s, status.position), 3)}

    # -------------------------------------------------------------------------------- motion
    def stop(self) -> None:
        """Stop moving fingers and wait for standstill. A gripped part stays gripped."""
        self.stop_waiting()
        if not self.in_control:
            return
        with self._sending:
            moving = self._acting.locked() or self.fresh().moving
            if moving:
                self._gripper.write(
                    Command(act=not self._activating, go_to=False)
                )  # only a reset can stop an activation
        if moving:
            self._await_standstill()

    def _await_standstill(self) -> None:
        before: list[int] = []

        def at_standstill(status: Status) -> bool:
            before.append(status.position)
            return not status.go_to and len(before) > 1 and before[-2] == status.position

        self.wait(at_standstill, STANDSTILL_TIMEOUT, "coming to a standstill")

    def _write(self, command: Command, operation: str, go_on: GoOn) -> None:
        def write() -> None:
            self._commanded, self._echoed = None, False
            self._held = self._lost = False
            self._gripper.write(command)
            self._commanded = command.position

        self.send(operation, write, go_on)  # if a stop was requested, the motion is not sent or the stop follows it

    def _reset(self, go_on: GoOn) -> None:
        self._write(Command(act=False, go_to=False), "the reset", go_on)

        def done(status: Status) -> bool:
            return not status.act and status.activation is Activation.RESET and not status.fault

        self.wait(done, ACCEPT_TIMEOUT + self._s.request_timeout, "the reset")

    def _move(self, width: float, force: float, speed: float, operation: str) -> Status:
        """Move the fingers to a width; return the status at standstill."""
        try:
            command = Command(
                position=scaling.position(self._s, width),
                force=scaling.force(self._s, force),
                speed=scaling.speed(self._s, speed),
            )
        except OutOfRange as e:
            raise OutOfRange("{device}: {reason}", device=self.who, reason=e) from e
        with self.act(operation) as go_on:
            self.require_control(operation)
            status = self.fresh()
            self._check(status, operation)
            if not status.active:
                raise Refused(
                    "{device}: {what} is refused in state {inactive}: activate it first",
                    device=self.who,
                    what=operation,
                    inactive=GripperState.INACTIVE,
                )
            self._write(command, operation, go_on)

            def at_standstill(status: Status) -> bool:
                self._check(status, operation)
                if not status.active:
                    raise DeviceFault(
                        "{device}: {what} ended early: the gripper was reset or switched off",
                        device=self.who,
                        what=operation,
                    )
                accepted = status.go_to and status.echo == command.position
                return accepted and status.object is not Object.MOVING

            try:
                return self.wait(at_standstill, self._s.stroke / speed + ACCEPT_TIMEOUT + MARGIN, operation, go_on)
            except DeviceTimeout:
                with contextlib.suppress(DeviceError):  # without control the gripper finishes the motion, then holds
                    self._write(Command(go_to=False), operation, go_on)  # no caller waits for the motion any more
                raise

    # -------------------------------------------------------------------------------- actions
    @action(deadline=ACTION_DEADLINE)
    def activate(self, *, an: str | None = None) -> None:
        """Activate the gripper: it opens and closes once unless it is active. It may drop a part that it holds."""
        what = "activate"
        with self.act(what) as go_on:
            self.require_control(what)
            status = self.fresh()
            self._check(status, what)
            if status.active:
                return
            self._reset(go_on)
            self._activating = True
            try:
                self._write(Command(act=True, go_to=False), what, go_on)

                def ready(status: Status) -> bool:
                    self._check(status, what)
                    return status.active

                self.wait(ready, self._s.activation_timeout, what, go_on)
            finally:
                self._activating = False

    @action(deadline=ACTION_DEADLINE)
    def grip(
        self, width: float = 0.0, force: float = 40.0, speed: float = 0.1, *, an: str | None = None
    ) -> tuple[bool, float]:
        """Move the fingers to a width. Return whether a part is held, and the width between the fingers, m.

        :param width: width to move to if no part is between the fingers, m
        :param force: gripping force, N
        :param speed: speed of the fingers, m/s
        """
        status = self._move(width, force, speed, f"grip to {width:g} m")
        held = status.object in HELD
        gripped = scaling.width(self._s, status.position)
        if held:
            self._held = True
            self.attach_part(PartSize(gripped, gripped, PAD_HEIGHT, -PAD_HEIGHT / 2.0))
        else:
            self.detach_part()
        return GripResult(held, gripped)

    @action(deadline=ACTION_DEADLINE)
    def release(self, *, an: str | None = None) -> None:
        """Open completely; fail if the fingers are blocked."""
        try:
            status = self._move(self._s.stroke, self._s.min_force, self._s.max_speed, "release")
        finally:
            if not self._held:
                self.detach_part()
        if status.object is not Object.ARRIVED:
            opened = scaling.width(self._s, status.position)
            raise DeviceFault(
                "{device}: release ended at {opened:.4f} m: the fingers are blocked", device=self.who, opened=opened
            )

    @action(again="safe")
    def part_held(self, *, an: str | None = None) -> bool:
        """Return whether a part is held; false after a gripped part was lost."""
        self.fresh()
        return self.state() is GripperState.HOLDING
