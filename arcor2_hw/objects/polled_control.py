"""PolledControl: connection, control, acts and stop of a device whose state is read over and over. A mixin."""

import contextlib
import threading
import time
import typing
from collections.abc import Callable, Iterator
from typing import Final, Protocol, TypeVar

from arcor2_hw.data.device import Connection, Health
from arcor2_hw.exceptions import DeviceError, NotInControl, Refused
from arcor2_hw.objects.generic import DEFAULT_CONNECT_TIMEOUT
from arcor2_hw.objects.polled import GoOn, Polled, Snapshot

T = TypeVar("T")

US: Final = "us"
STANDS_WITHIN: Final = 1.0
"""s from a stop until the device has to stand; a driver may set another by its class data `stands_within`."""


class Link(Protocol):
    """What a connection to a device has at least: ModbusLink, or a driver's own."""

    who: str
    """Name and address, for errors."""

    def open(self, timeout: float) -> None:
        """Open within `timeout` s. Raises DeviceError."""

    def close(self) -> None:
        """Close, harmless when closed; what waits for an answer fails at once."""


class PolledControl(typing.Generic[T]):
    """`class Press(Machine, PolledControl[list[int]], Generic)`: call `observe_by` at the end of `__init__`.

    A driver overrides `arm` and `disarm` (what taking and giving back control writes), `send_stop` (the command that
    stops), `is_busy`, `owner_of` and `fault_of` (read from a state). All may raise DeviceError. Control goes with the
    connection, and when the device says that it has another owner.
    """

    name: str
    stands_within: float = STANDS_WITHIN
    _link: Link

    def observe_by(self, link: Link, read: Callable[[], T], *, period: float = 0.1, fresh: float = 0.5) -> None:
        """Say how the state is read: every `period` s, and how old (s) one may be that is given out."""
        self._link = link
        self._polled: Polled[T] = Polled(
            link.who,
            lambda timeout: self._first(read, timeout),
            read,
            link.close,
            quiet=period,
            busy=min(period, 0.02),
            fresh=fresh,
            taken=lambda snapshot: self._look(snapshot.value, snapshot.asked),
            lost=self._lost,
            interrupt=link.close,
        )
        self._ours_since: float | None = None
        self._sending = threading.Lock()
        self._acting = threading.Lock()
        self._doing = ""

    # -------------------------------------------------------------------------------- for drivers: hooks
    def arm(self) -> None:
        """Take control at the device: say how long it may go on without us, say who we are."""

    def disarm(self) -> None:
        """Give control back at the device."""

    def send_stop(self) -> None:
        """Send the command that stops."""

    def is_busy(self, state: T) -> bool:
        """Tell whether an act is under way."""
        return False

    def owner_of(self, state: T) -> str | None:
        """Tell who has control by the device's own word: "us", another's name, None: nobody, or it does not say."""
        return US if self._ours_since is not None else None

    def fault_of(self, state: T) -> int:
        """Give the number of the fault that the device tells; 0: none."""
        return 0

    # -------------------------------------------------------------------------------- for drivers: use
    def current(self) -> T:
        """Give the newest state. Raises NotConnected, ConnectionLost, or Stale when it is too old."""
        return self._polled.current().value

    def fresh(self) -> T:
        """Give a state that was asked for after this call. Raises DeviceTimeout, NotConnected, ConnectionLost."""
        return self._polled.fresh().value

    def send(self, what: str, write: Callable[[], None], go_on: GoOn | None = None) -> None:
        """Send a command, unless a stop, or a loss, came first. Raises NotInControl naming `what`."""
        with self._sending:
            if go_on is not None:
                go_on()
            self._polled.observing.check()
            if self._ours_since is None:
                owner = self.control_owner()
                raise NotInControl(f"{self._polled.who}: {what} needs control" + (f": {owner} has it" if owner else ""))
            write()

    @contextlib.contextmanager
    def act(self, what: str) -> Iterator[GoOn]:
        """Do something that takes its time, alone; gives what has to be handed to `send` and `wait`.

        Raises Refused while another act is under way. A failure stops the device.
        """
        if not self._acting.acquire(blocking=False):
            raise Refused(f"{self._polled.who} is busy ({self._doing}): {what} has to wait")
        try:
            self._doing = what
            yield self._polled.begin(what)
        finally:
            self._acting.release()

    def wait(self, holds: Callable[[T], bool], timeout: float, what: str, go_on: GoOn) -> T:
        """Give the first state asked for from now on of which `holds` is true. Raises Cancelled, DeviceTimeout."""
        return self._polled.wait(holds, timeout, what, go_on).value

    # -------------------------------------------------------------------------------- connection
    def connect(self, timeout: float = DEFAULT_CONNECT_TIMEOUT) -> None:
        """Begin to observe within `timeout` s; nothing is written. Raises NotConnected, DeviceTimeout, DeviceFault."""
        self._polled.connect(timeout)

    def disconnect(self) -> None:
        """Give control back when it is ours, and close; harmless when closed. An act ends with an error."""
        if self._ours_since is not None and self._polled.observing.online:
            with contextlib.suppress(DeviceError):  # the device's own supervision does it then
                self.release_control()
        self._ours_since = None
        self._polled.disconnect()

    @property
    def connection(self) -> Connection:
        """Tell how the connection is."""
        return self._polled.observing.state

    @property
    def health(self) -> Health:
        """Give the condition: failure while the device tells a fault."""
        newest = self._polled.newest()
        return Health.FAILURE if newest is not None and self.fault_of(newest) else Health.NORMAL

    def _first(self, read: Callable[[], T], timeout: float) -> Snapshot[T]:
        self._link.open(timeout)
        return Snapshot.by(read)

    def _lost(self, _: DeviceError) -> None:
        self._ours_since = None

    # -------------------------------------------------------------------------------- control
    def take_control(self) -> None:
        """Take control; harmless when it is ours. Raises NotInControl naming who has it."""
        if self._ours_since is not None:
            return
        owner = self.owner_of(self.fresh())
        if owner not in (None, US):
            raise NotInControl(f"{self._polled.who}: {owner} has control")
        with self._sending:
            self._polled.observing.settled()
            self.arm()
            self._ours_since = time.monotonic()

    def release_control(self) -> None:
        """Stop what is under way and give control back; harmless when it is not ours."""
        with self._sending:
            ours, self._ours_since = self._ours_since, None
            if ours is None:
                return
            self._polled.stop_waiting()
            newest = self._polled.newest()
            if newest is not None and self.is_busy(newest):
                self.send_stop()
            self.disarm()

    def control_owner(self) -> str | None:
        """Tell who has control: "us", another's name, or None."""
        if self._ours_since is not None:
            return US
        newest = self._polled.newest()
        owner = None if newest is None else self.owner_of(newest)
        return None if owner == US else owner  # an earlier session of ours, which the device has not forgotten yet

    def _look(self, state: T, asked: float) -> None:
        since = self._ours_since
        if since is not None and asked > since and self.owner_of(state) != US:
            self._ours_since = None

    # -------------------------------------------------------------------------------- stop
    def stop(self) -> None:
        """Stop what is under way, and return when the device stands. Raises DeviceTimeout when it does not."""
        with self._sending:
            self._polled.stop_waiting()
            self._polled.observing.check()
            if self._ours_since is None:
                return
            self.send_stop()
        self._polled.wait(lambda state: not self.is_busy(state), self.stands_within, "stopping")
