"""Connected: connection, health and alarms of a device. A mixin of object types."""

import threading
from collections.abc import Mapping
from typing import ClassVar, Final, NamedTuple

from arcor2_hw.data.device import Alarm, Connection, Health, Severity
from arcor2_hw.exceptions import DeviceError
from arcor2_hw.messages import Message
from arcor2_hw.objects.conditions import conditions_of
from arcor2_hw.objects.generic import DEFAULT_CONNECT_TIMEOUT
from arcor2_hw.objects.observing import GoOn, Observing

NOT_OBSERVED: Final = (Connection.LOST, Connection.FAILED)


class AlarmText(NamedTuple):
    """Text and remedy of an alarm."""

    text: str
    remedy: str
    severity: Severity = Severity.ERROR


class Connected:
    """A device with an `Observing` connection, which is opened again after a loss.

    A driver calls `keep_connection` in `__init__` and overrides `open_link`, `watch` and `close_link`. It may override
    `on_lost`, `condition` and ALARMS. After a loss only observation resumes, not control.
    """

    ALARMS: ClassVar[Mapping[str, AlarmText]] = {}
    """Texts of the alarms by code, for `set_alarm`."""
    name: str
    who: str | Message
    """Name and address, for errors."""
    observing: Observing

    def keep_connection(self, who: str | Message, observing: Observing | None = None) -> None:
        """Create the connection without opening it."""
        self.who = who
        self.observing = observing or Observing(who, self.open_link, self.watch, self.close_link, self.on_lost)

    # -------------------------------------------------------------------------------- hooks
    def open_link(self, timeout: float) -> object:
        """Open the connection within `timeout` s and check that the device answers. Raises DeviceError."""

    def watch(self, stopping: threading.Event) -> None:
        """Watch the connection until `stopping` is set. Raises DeviceError after a loss."""
        stopping.wait()

    def close_link(self) -> None:
        """Close the connection. It does nothing when the connection is closed."""

    def on_lost(self, error: DeviceError) -> None:
        """Handle a connection loss. It is called once per loss, before the connection is closed."""

    def condition(self) -> Health:
        """Return the health of an observed device. By default it depends on the active alarms."""
        active = conditions_of(self).alarms()
        worst = any(alarm.severity is not Severity.WARNING for alarm in active)
        return Health.FAILURE if worst else Health.CHECK_FUNCTION if active else Health.NORMAL

    # -------------------------------------------------------------------------------- connection
    def connect(self, timeout: float = DEFAULT_CONNECT_TIMEOUT) -> None:
        """Start observing within `timeout` s. Raises NotConnected, DeviceTimeout, DeviceFault."""
        self.observing.start(timeout)

    def disconnect(self) -> None:
        """Stop observing and close the connection. It does nothing when the connection is closed."""
        self.observing.stop()

    @property
    def connection(self) -> Connection:
        """Return the state of the connection."""
        return self.observing.state

    @property
    def health(self) -> Health:
        """Return `condition`, or failure while the connection is lost or failed."""
        return Health.FAILURE if self.connection in NOT_OBSERVED else self.condition()

    def alarms(self) -> list[Alarm]:
        """Return the active alarms."""
        return conditions_of(self).alarms()

    def set_alarm(self, code: str, active: bool) -> None:
        """Raise an alarm of ALARMS, or end it."""
        text, remedy, severity = self.ALARMS[code]
        conditions_of(self).set(code, active, text, remedy, severity)

    # -------------------------------------------------------------------------------- stopping
    def begin(self, what: str) -> GoOn:
        """Return a check for new work: it raises Cancelled after a stop and ConnectionLost after a loss."""
        return self.observing.begin(what)

    def stop_waiting(self) -> None:
        """Cancel the work in progress."""
        self.observing.cancel()
