"""Identification of a device. A device that differs from the confirmed one is observed, but not commanded."""

import logging
import threading
from collections.abc import Callable
from typing import Final, NamedTuple

from arcor2_hw.data.base import now
from arcor2_hw.data.device import Alarm, Identity, Severity
from arcor2_hw.exceptions import Arcor2Error, Arcor2NotImplemented, DifferentDevice, Refused, message_of
from arcor2_hw.messages import Message, translatable
from arcor2_hw.objects import Generic

log = logging.getLogger(__name__)

ALARM: Final = DifferentDevice.code
"""Code of the alarm of a device that is not the confirmed one."""

_TEXTS: Final = translatable(
    {
        "serial": "{name} is a different {model}: serial number {found} instead of {known}.",
        "firmware": "{name} has another firmware: {found} instead of {known}.",
        "model": "{name} is a different device: {found} instead of {known}.",
        "vendor": "{name} is a device of another manufacturer: {found} instead of {known}.",
    }
)
_ORDER: Final = ("vendor", "model", "serial", "firmware")
"""The fields in the order in which a difference is reported; a wrong model explains a wrong serial number."""
_REMEDY: Final = "Call a technician, who confirms the device."


class ReadIdentity(NamedTuple):
    """The read identity, or the reason why it cannot be read; and the counters of the device, None without counters."""

    identity: Identity | None
    problem: Message | None = None
    counters: dict[str, int] | None = None


class Identification:
    """Reads the identity of one device after each connection, and compares it with the confirmed one.

    Methods that read run on the lane of the device, so that no command precedes the comparison.

    Args:
        name: Name of the device.
        known: The confirmed identity, None for a device that was not seen before.
        report: Called, on any thread, with the result of reading.
        changed: Called, on any thread, when the alarm begins or ends.
    """

    def __init__(
        self,
        name: str,
        known: Identity | None,
        report: Callable[[ReadIdentity], None],
        changed: Callable[[], None] = lambda: None,
    ) -> None:
        self._name = name
        self._known = known
        self._report = report
        self._changed = changed
        self._lock = threading.Lock()
        self._found: Identity | None = None
        self._losses = 0
        self.alarm: Alarm | None = None
        """The alarm of a device that is not the confirmed one."""

    def forget(self) -> None:
        """Read the identity again before the next command, because the connection was lost."""
        self._losses += 1
        self._found = None

    def read(self, instance: Generic) -> None:
        """Read and report the identity, unless it is known for this connection.

        Raises:
            Refused: The identity of a confirmed device cannot be read.
        """
        if self._found is not None:
            return
        losses = self._losses
        try:
            found = instance.identify()
        except Arcor2NotImplemented:  # the type declares an identity, but the device has none
            found = Identity()
        except Exception as error:
            message = message_of(error)
            self._report(ReadIdentity(None, message))
            if self._known is None:
                return
            raise Refused(
                "{name}: the identity cannot be read, so it may be another device: {reason}",
                error.detail if isinstance(error, Arcor2Error) else "",
                name=self._name,
                reason=message,
            ) from error
        if losses != self._losses:
            return  # the identity may be that of the device before the connection loss; the next command reads it again
        self._found = found
        self._compare()
        self._report(ReadIdentity(found, counters=_counters(instance)))

    def require_confirmed(self, instance: Generic) -> None:
        """Read the identity if necessary.

        Raises:
            DifferentDevice: The device is not the confirmed one.
            Refused: The identity of a confirmed device cannot be read.
        """
        self.read(instance)
        if (difference := self.difference) is not None:
            text = Message.of("{difference} A technician has to confirm it.", difference=difference)
            raise DifferentDevice(text)

    def confirm(self, identity: Identity) -> None:
        """Accept an identity from now on."""
        self._known = identity
        self._compare()

    @property
    def confirmed(self) -> bool:
        """Return whether the identity was read since the connection and does not differ."""
        return self._found is not None and self.difference is None

    @property
    def difference(self) -> Message | None:
        """Return the difference from the confirmed device, None if there is none or the identity is unknown."""
        known, found = self._known, self._found
        if known is None or found is None:
            return None
        differing = known.differences(found)
        for field in _ORDER:
            if field in differing:
                return Message.of(
                    _TEXTS[field],
                    name=self._name,
                    model=found.model or known.model,
                    found=getattr(found, field),
                    known=getattr(known, field),
                )
        return None

    def _compare(self) -> None:
        with self._lock:
            difference, before = self.difference, self.alarm
            self.alarm = None
            if difference is not None:
                since = now() if before is None else before.since
                self.alarm = Alarm.of(ALARM, Severity.ERROR, difference, _REMEDY, since)
            changed = (before is None) != (self.alarm is None)
        if changed:
            self._changed()


def _counters(instance: Generic) -> dict[str, int] | None:
    try:
        return instance.counters()
    except Arcor2NotImplemented:
        return None
    except Exception as error:  # noqa: BLE001 - a device that cannot count can be used
        log.warning("counters of %s cannot be read: %s", instance.name, error)
        return None
