"""PolledControl: connection, control, actions and stop of a device whose state is read periodically. A mixin."""

import contextlib
import threading
import time
import typing
from collections.abc import Callable, Iterator
from typing import Final, Protocol, TypeVar

from arcor2_hw.data.device import Health
from arcor2_hw.exceptions import DeviceError, DeviceFault, NotInControl, Refused
from arcor2_hw.messages import Message, Phrase
from arcor2_hw.objects.connected import Connected
from arcor2_hw.objects.generic import DEFAULT_CONNECT_TIMEOUT
from arcor2_hw.objects.observing import GoOn
from arcor2_hw.objects.state_observer import Snapshot, StateObserver

T = TypeVar("T")

OWNED_BY_US: Final = "us"
NOBODY: Final = Phrase.of("nobody has control")
STANDSTILL_TIMEOUT: Final = 1.0
"""Time limit from a stop to standstill, s."""


class Link(Protocol):
    """Interface of a connection, such as ModbusLink, Line, or a class of the driver."""

    who: str | Message
    """Name and address, for errors."""

    def open(self, timeout: float) -> None:
        """Open the connection within `timeout` s. Raises DeviceError."""

    def close(self) -> None:
        """Close the connection. It does nothing when closed. A request that waits for its answer fails at once."""


class PolledControl(Connected, typing.Generic[T]):
    """A device that is read periodically and commanded after `take_control`.

    For example `class Press(Machine, PolledControl[list[int]], Generic)`. A driver calls `use_link` in `__init__` and
    overrides `read_state`. If the device has these features, it overrides `arm` and `disarm` (write what takes and
    releases control), `send_stop`, and `is_busy`, `owner_of` and `fault_of` (decode a state). All may raise
    DeviceError. Control ends when the connection is lost, or when the device reports another owner.
    """

    period: float = 0.1
    busy_period: float = 0.02
    fresh_for: float = 0.5
    answers_within: float = 3.0
    """See StateObserver."""
    stands_within: float = STANDSTILL_TIMEOUT
    """Time limit from a stop to standstill, s."""
    in_control: bool = False
    why_not: str = NOBODY
    """Reason why control was not taken or has ended."""
    _link: Link

    def use_link(self, link: Link, observer: StateObserver[T] | None = None) -> None:
        """Read the state over `link`, or by a custom observer."""
        self._link = link
        self._polled = observer or _Observer(self, link.who)
        self.keep_connection(link.who, self._polled.observing)
        self._control_since = 0.0
        self._taking_control, self._sending = threading.Lock(), threading.RLock()
        self._acting = threading.Lock()
        self._doing = ""

    def observe_by(self, link: Link, read: Callable[[], T], *, period: float = 0.1, fresh: float = 0.5) -> None:
        """Read the state with a function, for drivers written before `read_state` existed."""
        self.period, self.busy_period, self.fresh_for = period, min(period, 0.02), fresh
        self._read = read
        self.use_link(link)

    # -------------------------------------------------------------------------------- hooks: connection and state
    def open_link(self, timeout: float) -> Snapshot[T]:
        """Open the connection within `timeout` s and return the first state."""
        self._link.open(timeout)
        return self.snapshot()

    def read_state(self) -> T:
        """Read the state of the device. Raise DeviceError, or ValueError for values that are invalid."""
        return self._read()

    def snapshot(self) -> Snapshot[T]:
        """Read the state now. Raises DeviceFault for invalid values, and as `read_state`."""
        try:
            return Snapshot.by(self.read_state)
        except ValueError as error:
            raise DeviceFault("{device} sent invalid values: {reason}", device=self.who, reason=error) from error

    def close_link(self) -> None:
        """Close the connection."""
        self._link.close()

    def on_state(self, snapshot: Snapshot[T]) -> None:
        """Process a new state before other threads get it."""

    def after_reading(self) -> None:
        """Do what is necessary after each reading, such as feeding a watchdog."""

    # -------------------------------------------------------------------------------- hooks: control
    def arm(self) -> None:
        """Take control at the device, for example set its watchdog time and write the owner."""

    def disarm(self) -> None:
        """Release control at the device."""

    def send_stop(self) -> None:
        """Send the stop command."""

    def is_busy(self, state: T) -> bool:
        """Return whether the device is executing a command."""
        return False

    def owner_of(self, state: T) -> str | None:
        """Return the owner of control in a state: "us", the name of another client, or None."""
        return OWNED_BY_US if self.in_control else None

    def why_control_ended(self, state: T) -> str:
        """Return why our control has ended according to a state; empty if it has not."""
        owner = self.owner_of(state)
        return "" if owner == OWNED_BY_US else Phrase.of("{owner} has control", owner=owner) if owner else NOBODY

    def fault_of(self, state: T) -> int:
        """Return the number of the fault in a state; 0 for none."""
        return 0

    # -------------------------------------------------------------------------------- states and commands
    def newest(self) -> T | None:
        """Return the newest state of any age; None before the first."""
        return self._polled.newest()

    def current(self) -> T:
        """Return the newest state. Raises NotConnected, ConnectionLost, or Stale if it is too old."""
        return self._polled.current().value

    def fresh(self) -> T:
        """Return a state requested after this call. Raises DeviceTimeout, NotConnected, ConnectionLost."""
        return self._polled.fresh().value

    def wait(self, holds: Callable[[T], bool], timeout: float, what: str, go_on: GoOn | None = None) -> T:
        """Return the first state requested from now on for which `holds` is true. Raises Cancelled, DeviceTimeout."""
        return self._polled.wait(holds, timeout, what, go_on).value

    def require_control(self, what: str) -> None:
        """Check that the device may be commanded. Raises NotConnected, ConnectionLost, NotInControl.

        what: name of the command, for errors.
        """
        self.observing.check()
        if not self.in_control:
            owner = self.control_owner()
            other = bool(owner) and self.why_not == NOBODY
            why = Phrase.of("{owner} has control", owner=owner) if other else self.why_not
            raise NotInControl("{device}: {what} is refused: {reason}", device=self.who, what=what, reason=why)

    def send(self, what: str, write: Callable[[], object], go_on: GoOn | None = None) -> None:
        """Send a command unless a stop or a connection loss came first. Raises NotInControl.

        Args:
            what: Name of the command, for errors.
            write: Sends the command.
            go_on: Check of the work that the command belongs to, from `act`.
        """
        with self._sending:
            if go_on is not None:
                go_on()
            self.require_control(what)
            write()

    @contextlib.contextmanager
    def act(self, what: str) -> Iterator[GoOn]:
        """Do longer work in this context. The value is the check for `send` and `wait`. Raises Refused while busy."""
        if not self._acting.acquire(blocking=False):
            raise Refused(
                "{device} is busy ({doing}): {what} has to wait", device=self.who, doing=self._doing, what=what
            )
        try:
            self._doing = what
            yield self.begin(what)
        finally:
            self._acting.release()

    def finish(self, what: str, timeout: float, go_on: GoOn) -> T:
        """Wait until the device is no longer busy and return its state. Raises DeviceFault if it reports a fault."""
        end = self.wait(lambda state: not self.is_busy(state), timeout, what, go_on)
        if fault := self.fault_of(end):
            raise DeviceFault("{device}: {what} failed", fault_code=fault, device=self.who, what=what)
        return end

    def stop_waiting(self) -> None:
        """Cancel the work in progress."""
        self._polled.stop_waiting()

    # -------------------------------------------------------------------------------- connection
    def connect(self, timeout: float = DEFAULT_CONNECT_TIMEOUT) -> None:
        """Start observing within `timeout` s. Raises NotConnected, DeviceTimeout, DeviceFault."""
        self._polled.connect(timeout)

    def disconnect(self) -> None:
        """Release control if we have it, and close the connection. Work in progress ends with an error."""
        if self.in_control and self.observing.online:
            with contextlib.suppress(DeviceError):  # the watchdog of the device releases control instead
                self.leave()
        self.drop_control()
        self._polled.disconnect()

    def leave(self) -> None:
        """Release control during disconnecting, within 0.5 s."""
        PolledControl.release_control(self)

    def condition(self) -> Health:
        """Return failure while the device reports a fault."""
        newest = self.newest()
        return Health.FAILURE if newest is not None and self.fault_of(newest) else super().condition()

    # -------------------------------------------------------------------------------- control
    def take_control(self) -> None:
        """Take control. It does nothing when we have control. Raises NotInControl if another client has it."""
        with self._taking_control:
            owner = self.owner_of(self.fresh())
            if owner not in (None, OWNED_BY_US):
                raise NotInControl("{device}: control is refused: {owner} has it", device=self.who, owner=owner)
            if self.in_control:
                return
            losses = self.observing.losses
            with self._sending:
                self.arm()
                with self._polled.taking:
                    self._control_since, self.in_control = time.monotonic(), True
            try:
                self.observing.check_unbroken(losses)
            except DeviceError:
                self.drop_control(Phrase.of("the connection was lost"))
                raise
            self.observing.settled()

    def release_control(self) -> None:
        """Stop the device and release control. It does nothing without control."""
        with self._sending:
            if not self.in_control:
                return
            self.drop_control()
            newest = self.newest()
            if newest is not None and self.is_busy(newest):
                self.stop_waiting()
                self.send_stop()
            self.disarm()

    def control_owner(self) -> str | None:
        """Return the owner of control: "us", the name of another client, or None."""
        if self.in_control:
            return OWNED_BY_US
        newest = self.newest()
        owner = None if newest is None else self.owner_of(newest)
        return None if owner == OWNED_BY_US else owner  # the device still reports an earlier session of this driver

    def drop_control(self, why: str = NOBODY) -> None:
        """Record that we no longer have control. Nothing is sent."""
        self.in_control, self.why_not = False, why

    def on_lost(self, error: DeviceError) -> None:
        """End control, because the connection is lost."""
        self.drop_control(Phrase.of("control ended when the connection was lost"))

    def check_control(self, snapshot: Snapshot[T]) -> None:
        """End control if a state requested after taking control shows that the device has another owner."""
        if self.in_control and snapshot.asked > self._control_since and (why := self.why_control_ended(snapshot.value)):
            self.drop_control(why)

    # -------------------------------------------------------------------------------- stop
    def stop(self) -> None:
        """Stop the device and return at standstill. Raises DeviceTimeout if the device does not stop."""
        with self._sending:
            self.stop_waiting()
            self.observing.check()
            if not self.in_control:
                return
            self.send_stop()
        self._polled.wait(lambda state: not self.is_busy(state), self.stands_within, "stopping")


class _Observer(StateObserver[T]):
    """Observe the state with the hooks of a device."""

    def __init__(self, device: PolledControl[T], who: str | Message) -> None:
        self._device = device
        self.period, self.busy_period = device.period, device.busy_period
        self.fresh_for, self.answers_within = device.fresh_for, device.answers_within
        super().__init__(who)

    def open(self, timeout: float) -> Snapshot[T]:
        return self._device.open_link(timeout)

    def read(self) -> T | None:
        return self._device.snapshot().value

    def close(self) -> None:
        self._device.close_link()

    def interrupt(self) -> None:
        self._device.close_link()

    def on_state(self, snapshot: Snapshot[T]) -> None:
        self._device.check_control(snapshot)
        self._device.on_state(snapshot)

    def after_reading(self) -> None:
        self._device.after_reading()

    def on_lost(self, error: DeviceError) -> None:
        self._device.on_lost(error)


# Names before version 0.2.
STANDS_WITHIN, US = STANDSTILL_TIMEOUT, OWNED_BY_US
