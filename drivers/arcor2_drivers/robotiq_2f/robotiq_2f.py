"""The Robotiq 2F as an object type: activates on command, grips with force and speed, notices a part that is lost."""

import contextlib
import threading
from collections.abc import Callable
from typing import ClassVar, Final

from arcor2_hw.actions import action
from arcor2_hw.data.device import Alarm, Connection, Health, LossReaction
from arcor2_hw.data.geometry import Pose, Position
from arcor2_hw.exceptions import (
    Cancelled,
    DeviceError,
    DeviceFault,
    DeviceTimeout,
    NotFound,
    NotInControl,
    OutOfRange,
    Refused,
)
from arcor2_hw.objects import Gripper, GripResult, PartSize
from arcor2_hw.objects.generic import DEFAULT_CONNECT_TIMEOUT
from arcor2_hw.objects.small import GripperState

from . import scaling
from .ascii_link import AsciiLink
from .observer import Observer
from .rtu_link import RtuLink
from .settings import Robotiq2FSettings, Wire
from .status import FIRST_MAJOR, HELD, Activation, Command, Link, Object, Status, fault_of

MARGIN: Final = 2.0
"""s a motion may take beyond stroke / speed: acceleration, closing the last of the force, a slow wire."""
TAKEN_WITHIN: Final = 1.0
"""s from a command to its echo in the status."""
STANDS_WITHIN: Final = 2.0
"""s from a stop to fingers at rest."""
LONGEST_ACTION: Final = 300.0
PAD_HEIGHT: Final = 0.022
"""Height of the fingers' pads, m: a part of unknown size is at least between them, above the tool centre point."""


def link_of(name: str, settings: Robotiq2FSettings) -> Link:
    """Give the wire that the settings choose, closed."""
    if settings.wire is Wire.MODBUS_RTU:
        return RtuLink(name, settings.serial_port, settings.baud_rate, settings.unit_id, settings.request_timeout)
    return AsciiLink(name, settings.host, settings.port, settings.request_timeout)


class Robotiq2F(Gripper):
    """A Robotiq 2F-85 or 2F-140 adaptive gripper, on a robot's URCap or on Modbus RTU."""

    _ABSTRACT = False
    # A closing under way is finished, then it holds; spindle and spring are self-locking.
    loss_reaction: ClassVar[LossReaction] = LossReaction.holds()
    CANCEL_MAPPING: ClassVar[dict[str, str]] = {"activate": "stop", "grip": "stop", "release": "stop"}

    def __init__(self, obj_id: str, name: str, settings: Robotiq2FSettings) -> None:
        super().__init__(obj_id, name, settings)
        self._s = settings
        self.tcp = Pose(Position(0.0, 0.0, settings.tcp_z))
        self.mass = settings.mass
        self._observer = Observer(link_of(name, settings), self._seen, self._drop_control)
        self._who = self._observer.who
        self._one_motion = threading.Lock()
        self._one_command = threading.Lock()
        self._stops = 0
        self._activating = False
        self._in_control = False
        self._foreign = ""
        self._commanded: int | None = None
        """The position we asked for last; None when the gripper need not have it."""
        self._echoed = False
        self._held = self._lost = False

    # -------------------------------------------------------------------------------- connection
    def connect(self, timeout: float = DEFAULT_CONNECT_TIMEOUT) -> None:
        """Begin to observe within `timeout` s; nothing is written. Raises NotConnected, DeviceTimeout, DeviceFault."""
        self._observer.connect(timeout)

    def disconnect(self) -> None:
        """Stop observing; harmless when not connected. The gripper keeps what it holds."""
        self._drop_control()
        self._observer.disconnect()
        self._held = self._lost = False

    @property
    def connection(self) -> Connection:
        """Tell how the connection is."""
        return self._observer.observing.state

    @property
    def health(self) -> Health:
        """Give the condition the gripper told last; failure when it does not tell any more."""
        if self.connection in (Connection.LOST, Connection.FAILED):
            return Health.FAILURE
        status = self._observer.newest()
        return Health.NORMAL if status is None or not status.fault else fault_of(status.fault).health

    def alarms(self) -> list[Alarm]:
        """Give the fault that stands."""
        code = self._observer.current().fault
        if not code:
            return []
        fault = fault_of(code)
        return [Alarm(str(code), fault.severity, fault.text, fault.remedy, self._observer.fault_since)]

    def acknowledge(self, code: str) -> None:
        """Reset the gripper after a fault from 10 on; it is not activated then, and nothing moves.

        Raises NotFound when the fault does not stand, Refused for one that ends with its cause.
        """
        status = self._fresh()
        if not status.fault or str(status.fault) != code:
            raise NotFound(f"{self._who} has no alarm {code}")
        if status.fault < FIRST_MAJOR:
            fault = fault_of(status.fault)
            raise Refused(f"{self._who}: fault {code} ends with its cause: {fault.text}; {fault.remedy}")
        self._require_control("acknowledge")
        with self._one_motion:
            self._reset(lambda: None)

    # -------------------------------------------------------------------------------- control
    def take_control(self) -> None:
        """Take control; nothing is written, and the gripper is not activated. Raises NotInControl while it moves."""
        if self._in_control:
            return
        status = self._fresh()
        if status.moving:
            raise NotInControl(f"{self._who}: control is refused: somebody else moves the gripper")
        self._foreign, self._commanded = "", None
        self._in_control = True
        self._observer.observing.settled()

    def release_control(self) -> None:
        """Give control back. Raises Refused while the gripper moves."""
        if self._in_control and self._fresh().moving:
            raise Refused(f"{self._who}: release_control is refused in state {self.state()}: stop it first")
        self._drop_control()

    def control_owner(self) -> str | None:
        """Tell who has control; another client of the gripper is known when it moves it."""
        if self._in_control:
            return "us"
        return self._foreign or None

    def _drop_control(self) -> None:
        self._in_control, self._commanded = False, None

    def _require_control(self, what: str) -> None:
        if not self._in_control:
            raise NotInControl(f"{self._who}: {what} is refused: {self._foreign or 'nobody'} has control")

    def _require_ready(self, what: str) -> Status:
        self._require_control(what)
        status = self._fresh()
        if status.fault >= FIRST_MAJOR:
            raise self._fault(status, what)
        if not status.active:
            raise Refused(f"{self._who}: {what} is refused in state {GripperState.INACTIVE}: activate it first")
        return status

    def _fresh(self) -> Status:
        return self._observer.wait(lambda _: True, 16.0 * self._s.request_timeout, "telling its status")

    def _fault(self, status: Status, what: str) -> DeviceFault:
        fault = fault_of(status.fault)
        text = f"{self._who}: {what} ended by fault {status.fault}: {fault.text}"
        return DeviceFault(text, fault.remedy, fault_code=status.fault)

    # -------------------------------------------------------------------------------- each reading
    def _seen(self, status: Status) -> None:
        """Notice a part that is lost, and commands that are not ours. On the observing thread."""
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
            self._foreign = f"another client of the gripper, which asks for position {status.echo},"
            self._drop_control()

    def state(self) -> GripperState:
        """Tell what it is doing. Raises Stale, NotConnected, ConnectionLost."""
        status = self._observer.current()
        if status.moving and not self._lost:
            return GripperState.MOVING
        if not status.active:
            return GripperState.INACTIVE
        if self._lost:
            return GripperState.LOST
        return GripperState.HOLDING if status.object in HELD else GripperState.AT_POSITION

    def width(self) -> float:
        """Give the width between the fingers, m. Raises Stale, NotConnected, ConnectionLost."""
        return scaling.width(self._s, self._observer.current().position)

    # -------------------------------------------------------------------------------- motion
    def stop(self) -> None:
        """Stop the fingers and return when they stand. What is held stays held; a standing gripper is left alone."""
        self._stops += 1
        if not self._in_control:
            self._observer.wake()
            return
        with self._one_command:
            moving = self._one_motion.locked() or self._fresh().moving
            if moving:
                self._observer.link.write(Command(act=not self._activating, go_to=False))  # only a reset ends that
        self._observer.wake()
        if moving:
            self._await_rest()

    def _await_rest(self) -> None:
        before: list[int] = []

        def stands(status: Status) -> bool:
            before.append(status.position)
            return not status.go_to and len(before) > 1 and before[-2] == status.position

        self._observer.wait(stands, STANDS_WITHIN, "coming to rest")

    def _begin(self, what: str) -> Callable[[], None]:
        """Give what raises as soon as `what` was stopped, or control was lost, since now."""
        stops = self._stops

        def go_on() -> None:
            if self._stops != stops:
                raise Cancelled(f"{self._who}: {what} was stopped")
            self._require_control(what)

        return go_on

    def _write(self, command: Command, go_on: Callable[[], None]) -> None:
        with self._one_command:  # a stop comes before, and this is not sent, or after it
            go_on()
            self._commanded, self._echoed = None, False
            self._held = self._lost = False
            self._observer.link.write(command)
            self._commanded = command.position

    def _reset(self, go_on: Callable[[], None]) -> None:
        self._write(Command(act=False, go_to=False), go_on)

        def done(status: Status) -> bool:
            return not status.act and status.activation is Activation.RESET and not status.fault

        self._observer.wait(done, TAKEN_WITHIN + self._s.request_timeout, "the reset")

    def _move(self, width: float, force: float, speed: float, what: str) -> Status:
        """Send the fingers to a width; give the status when they stand."""
        go_on = self._begin(what)
        try:
            command = Command(
                position=scaling.position(self._s, width),
                force=scaling.force(self._s, force),
                speed=scaling.speed(self._s, speed),
            )
        except OutOfRange as e:
            raise OutOfRange(f"{self._who}: {e}") from e
        if not self._one_motion.acquire(blocking=False):
            raise Refused(f"{self._who}: {what} is refused in state {GripperState.MOVING}")
        try:
            self._require_ready(what)
            self._write(command, go_on)

            def stands(status: Status) -> bool:
                go_on()
                if status.fault >= FIRST_MAJOR:
                    raise self._fault(status, what)
                if not status.active:
                    raise DeviceFault(f"{self._who}: {what} was ended: the gripper was reset or switched off")
                taken = status.go_to and status.echo == command.position
                return taken and status.object is not Object.MOVING

            try:
                return self._observer.wait(stands, self._s.stroke / speed + TAKEN_WITHIN + MARGIN, what)
            except DeviceTimeout:
                with contextlib.suppress(DeviceError):  # it finishes then, and holds
                    self._write(Command(go_to=False), go_on)  # nothing may go on that nobody waits for any more
                raise
        finally:
            self._one_motion.release()

    # -------------------------------------------------------------------------------- actions
    @action(deadline=LONGEST_ACTION)
    def activate(self, *, an: str | None = None) -> None:
        """Make the gripper ready; it opens and closes once, unless it is ready. A part it holds may be dropped."""
        what = "activate"
        go_on = self._begin(what)
        if not self._one_motion.acquire(blocking=False):
            raise Refused(f"{self._who}: {what} is refused in state {GripperState.MOVING}")
        try:
            self._require_control(what)
            status = self._fresh()
            if status.fault >= FIRST_MAJOR:
                raise self._fault(status, what)
            if status.active:
                return
            self._reset(go_on)
            self._activating = True
            self._write(Command(act=True, go_to=False), go_on)

            def ready(status: Status) -> bool:
                go_on()
                if status.fault >= FIRST_MAJOR:
                    raise self._fault(status, what)
                return status.active

            self._observer.wait(ready, self._s.activation_timeout, what)
        finally:
            self._activating = False
            self._one_motion.release()

    @action(deadline=LONGEST_ACTION)
    def grip(
        self, width: float = 0.0, force: float = 40.0, speed: float = 0.1, *, an: str | None = None
    ) -> tuple[bool, float]:
        """Move the fingers to a width; true when something is held, and the width between the fingers, m.

        :param width: width to go to when nothing is in between, m
        :param force: force to hold with, N
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

    @action(deadline=LONGEST_ACTION)
    def release(self, *, an: str | None = None) -> None:
        """Open fully; fails when the fingers are blocked."""
        try:
            status = self._move(self._s.stroke, self._s.min_force, self._s.max_speed, "release")
        finally:
            if not self._held:  # it was told to open
                self.detach_part()
        if status.object is not Object.ARRIVED:
            opened = scaling.width(self._s, status.position)
            raise DeviceFault(f"{self._who}: release ended at {opened:.4f} m: the fingers are blocked")

    @action
    def part_held(self, *, an: str | None = None) -> bool:
        """Tell whether a part is held; false when it was lost since it was gripped."""
        self._fresh()
        return self.state() is GripperState.HOLDING
