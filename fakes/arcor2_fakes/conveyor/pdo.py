"""The transmit PDOs of the drive (CiA 301, 7.5.2): mapping, transmission, and rejected configurations."""

from __future__ import annotations

from collections.abc import Callable

from arcor2_fakes.conveyor.dictionary import BAD_VALUE, Abort, Dictionary, Entry

_INVALID = 1 << 31
_ID_BITS = 0x1FFFFFFF
_UNSUPPORTED, _CANNOT_MAP, _TOO_LONG = 0x06010000, 0x06040041, 0x06040042
_LONGEST = 64  # bits
_MOST = 8
_MAPPABLE = {0x603F: 16, 0x6041: 16, 0x6061: 8, 0x6064: 32, 0x606C: 32}


class Tpdo:
    """A PDO. Call `tick` frequently while the node is Operational; it sends with `send(cob_id, data)`."""

    def __init__(self, number: int, node: int, default: tuple[int, ...], send: Callable[[int, bytes], None]) -> None:
        self.sent = 0
        self._number = number
        self._send = send
        self._cob_id = 0x180 + 0x100 * number + node
        self._type = 255
        self._period_ms = 0
        self._mapping = [index << 16 | _MAPPABLE[index] for index in default]
        self._count = len(default)
        self._due = 0.0
        self._last = b""

    def enter(self, dictionary: Dictionary) -> None:
        """Add the communication and mapping parameters to the dictionary."""
        self._dictionary = dictionary
        communication, mapping = 0x1800 + self._number, 0x1A00 + self._number
        entries = dictionary.entries
        entries[communication, 0] = Entry("B", lambda: 5)
        entries[communication, 1] = Entry("I", lambda: self._cob_id, self._set_cob_id)
        entries[communication, 2] = Entry("B", lambda: self._type, self._set_type)
        entries[communication, 5] = Entry("H", lambda: self._period_ms, self._set_period)
        entries[mapping, 0] = Entry("B", lambda: self._count, self._set_count)
        for at in range(_MOST):
            entries[mapping, at + 1] = Entry(
                "I",
                lambda at=at: self._mapping[at] if at < len(self._mapping) else 0,  # type: ignore[misc]
                lambda value, at=at: self._set_mapping(at, value),  # type: ignore[misc]
            )

    def tick(self, now: float) -> None:
        """Send if the event timer has expired or the status word has changed."""
        if self._cob_id & _INVALID or not self._count:
            return
        data = b"".join(self._dictionary.read(each >> 16, each >> 8 & 0xFF) for each in self._mapping[: self._count])
        has_status = self._mapping[0] >> 16 == 0x6041
        changed = has_status and data[:2] != self._last[:2]
        if not changed and not (self._period_ms and now >= self._due):
            return
        period = self._period_ms / 1000.0
        # After a stall, missed transmissions are not made up for.
        self._due = self._due + period if now - self._due < period else now + period
        self._last = data
        self.sent += 1
        self._send(self._cob_id & _ID_BITS, data)

    def _set_cob_id(self, value: int) -> None:
        if not self._cob_id & _INVALID and not value & _INVALID and value != self._cob_id:
            raise Abort(BAD_VALUE)
        if not value & _INVALID and not 0x180 <= value & _ID_BITS <= 0x57F:
            raise Abort(BAD_VALUE)
        self._cob_id = value

    def _set_type(self, value: int) -> None:
        if value not in (254, 255):  # SYNC is not modelled
            raise Abort(BAD_VALUE)
        self._type = value

    def _set_period(self, value: int) -> None:
        self._period_ms = value

    def _changeable(self) -> None:
        if not self._cob_id & _INVALID:
            raise Abort(_UNSUPPORTED)

    def _set_count(self, value: int) -> None:
        self._changeable()
        if value > len(self._mapping):
            raise Abort(_TOO_LONG)
        if sum(each & 0xFF for each in self._mapping[:value]) > _LONGEST:
            raise Abort(_TOO_LONG)
        self._count = value
        if value == 0:
            self._mapping = []

    def _set_mapping(self, at: int, value: int) -> None:
        self._changeable()
        if self._count or at != len(self._mapping):
            raise Abort(_UNSUPPORTED)
        if value >> 8 & 0xFF or _MAPPABLE.get(value >> 16) != value & 0xFF:
            raise Abort(_CANNOT_MAP)
        self._mapping.append(value)
