"""Connected: the connection, the health and the alarms of a device. A mixin of object types."""

import threading
from collections.abc import Mapping
from typing import ClassVar, Final, NamedTuple

from arcor2_hw.data.base import now
from arcor2_hw.data.device import Alarm, Connection, Health, Severity
from arcor2_hw.exceptions import DeviceError
from arcor2_hw.objects.generic import DEFAULT_CONNECT_TIMEOUT
from arcor2_hw.objects.observing import GoOn, Observing

NOT_OBSERVED: Final = (Connection.LOST, Connection.FAILED)


class AlarmText(NamedTuple):
    """What an alarm says, and what to do about it."""

    text: str
    remedy: str
    severity: Severity = Severity.ERROR


class Connected:
    """A device whose connection a thread of its own keeps: it opens it, watches it, and opens it again after a loss.

    Call `keep_connection` in `__init__`. A driver overrides `open_link`, `watch` and `close_link`, and where it has
    something to do or to say `on_lost`, `condition` and ALARMS. Only observation comes back after a loss.
    """

    ALARMS: ClassVar[Mapping[str, AlarmText]] = {}
    """The alarms that `set_alarm` raises, by code."""
    name: str
    who: str
    """Name and address, for errors."""
    observing: Observing
    _active_alarms: dict[str, Alarm]

    def keep_connection(self, who: str, observing: Observing | None = None) -> None:
        """Prepare the connection; nothing is opened yet."""
        self.who = who
        self.observing = observing or Observing(who, self.open_link, self.watch, self.close_link, self.on_lost)
        self._active_alarms = {}

    # -------------------------------------------------------------------------------- hooks
    def open_link(self, timeout: float) -> object:
        """Open the connection within `timeout` s and see that the device answers. Raises DeviceError."""

    def watch(self, stopping: threading.Event) -> None:
        """Watch the connection until `stopping` is set. Raises DeviceError when it is lost."""
        stopping.wait()

    def close_link(self) -> None:
        """Close the connection; does nothing when it is closed."""

    def on_lost(self, error: DeviceError) -> None:
        """Do what a loss of the connection requires; called once per loss, before the connection is closed."""

    def condition(self) -> Health:
        """Return the condition of a device that is observed. The default: failure with an alarm of severity error."""
        worst = any(alarm.severity is not Severity.WARNING for alarm in self._active_alarms.values())
        return Health.FAILURE if worst else Health.CHECK_FUNCTION if self._active_alarms else Health.NORMAL

    # -------------------------------------------------------------------------------- connection
    def connect(self, timeout: float = DEFAULT_CONNECT_TIMEOUT) -> None:
        """Start to observe within `timeout` s; nothing is written. Raises NotConnected, DeviceTimeout, DeviceFault."""
        self.observing.start(timeout)

    def disconnect(self) -> None:
        """Stop observing and close; does nothing when closed."""
        self.observing.stop()

    @property
    def connection(self) -> Connection:
        """Return the state of the connection."""
        return self.observing.state

    @property
    def health(self) -> Health:
        """Return the condition that the device last reported; failure while the connection is lost."""
        return Health.FAILURE if self.connection in NOT_OBSERVED else self.condition()

    def alarms(self) -> list[Alarm]:
        """Return what a person should deal with."""
        return list(self._active_alarms.values())

    def set_alarm(self, code: str, active: bool) -> None:
        """Raise an alarm of ALARMS, or end it."""
        if not active:
            self._active_alarms.pop(code, None)
        elif code not in self._active_alarms:
            text, remedy, severity = self.ALARMS[code]
            self._active_alarms[code] = Alarm(code, severity, text, remedy, now())

    # -------------------------------------------------------------------------------- stopping
    def begin(self, what: str) -> GoOn:
        """Return the check for work that starts now: it raises Cancelled after a stop, ConnectionLost after a loss."""
        return self.observing.begin(what)

    def stop_waiting(self) -> None:
        """End with Cancelled the work that has started."""
        self.observing.cancel()
