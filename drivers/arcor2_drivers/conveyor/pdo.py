"""The drive's state by PDO: two TPDOs that it sends by its own timer, how they are set up and read (CiA 301, 7.5.2)."""

import struct
import time
from typing import Final, NamedTuple

from arcor2_hw.exceptions import DeviceFault, Refused

from . import cia402
from .cia402 import Entry, State
from .link import CanLink

INVALID: Final = 1 << 31
"""Bit of the COB-ID: the PDO does not exist. A mapping may be changed only then."""
BY_EVENT: Final = 255
"""Transmission type: on events of the profile, and by the event timer."""


class Tpdo(NamedTuple):
    """A PDO of the drive: its number from 0, the base of its COB-ID, and what is in it."""

    number: int
    base: int
    entries: tuple[Entry, ...]

    def unpack(self, data: bytes) -> tuple[int, ...] | None:
        """Return the values, None for a frame of another length."""
        form = "<" + "".join(entry.form[1:] for entry in self.entries)
        return struct.unpack(form, data) if len(data) == struct.calcsize(form) else None


STATUS: Final = Tpdo(0, 0x180, (cia402.STATUSWORD, cia402.MODE_DISPLAY, cia402.ERROR_CODE))
MOTION: Final = Tpdo(1, 0x280, (cia402.POSITION, cia402.VELOCITY))


def set_up(link: CanLink, node: int, period_ms: int) -> None:
    """Configure the drive to send STATUS and MOTION every `period_ms`. Raises Refused when it cannot."""
    try:
        for pdo in (STATUS, MOTION):
            _set_up(link, pdo, node, period_ms)
    except DeviceFault as error:
        raise Refused(
            "{device} does not send its state by PDO; set pdo_period_ms to 0 to ask for it", str(error), device=link.who
        ) from error


def _set_up(link: CanLink, pdo: Tpdo, node: int, period_ms: int) -> None:
    communication, mapping = 0x1800 + pdo.number, 0x1A00 + pdo.number
    title = f"TPDO{pdo.number + 1}"
    cob_id, count = Entry(communication, 1, "<I", f"{title} COB-ID"), Entry(mapping, 0, "<B", f"{title} mapping count")
    link.write(cob_id, INVALID | pdo.base + node)
    link.write(count, 0)
    for subindex, entry in enumerate(pdo.entries, 1):
        mapped = entry.at << 16 | entry.subindex << 8 | 8 * struct.calcsize(entry.form)
        link.write(Entry(mapping, subindex, "<I", f"{title} mapping {subindex}"), mapped)
    link.write(count, len(pdo.entries))
    link.write(Entry(communication, 2, "<B", f"{title} transmission type"), BY_EVENT)
    link.write(Entry(communication, 5, "<H", f"{title} event timer"), period_ms)
    link.write(cob_id, pdo.base + node)


class PdoState:
    """Combines the two PDOs to a state. Called on the receiving thread."""

    def __init__(self, node: int) -> None:
        self._node = node
        self._status: tuple[tuple[int, ...], float] | None = None
        self.received = 0
        """Number of PDOs received."""
        self.newest = 0.0
        """Time of the last complete state (monotonic, s)."""

    def take(self, identifier: int, data: bytes) -> tuple[State, float] | None:
        """Receive a frame. Return the completed state, if any, and its time (monotonic, s)."""
        if identifier == STATUS.base + self._node:
            values = STATUS.unpack(data)
            if values is not None:
                self._status = values, time.monotonic()
                self.received += 1
        elif identifier == MOTION.base + self._node and (values := MOTION.unpack(data)) is not None:
            self.received += 1
            if self._status is not None:
                (statusword, mode, error_code), since = self._status
                position, velocity = values
                self._status, self.newest = None, time.monotonic()
                return State.of(statusword, mode, position, velocity, error_code), since
        return None
