"""The PDOs of the drive (CiA 301, 7.5.2.33 to 38): mapping, transmission, reception, and rejected configurations."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import ClassVar

from arcor2_fakes.conveyor.dictionary import BAD_VALUE, Abort, Dictionary, Entry

_INVALID = 1 << 31
_ID_BITS = 0x1FFFFFFF
_UNSUPPORTED, _CANNOT_MAP, _TOO_LONG = 0x06010000, 0x06040041, 0x06040042
_LONGEST = 64  # bits
_MOST = 8
_CONTROLWORD, _STATUSWORD = 0x6040, 0x6041
_DUMMIES = {0x0005: 8, 0x0006: 16, 0x0007: 32}


class Pdo:
    """A PDO: its COB-ID, and the objects mapped to it."""

    first_id: ClassVar[int]
    communication: ClassVar[int]
    highest: ClassVar[int]
    mapping: ClassVar[int]
    mappable: ClassVar[dict[int, int]]
    """COB-ID without node of the first PDO, its communication parameter with the highest subindex, its mapping
    parameter, and the sizes of the objects that can be mapped, bits."""

    def __init__(self, number: int, node: int, default: tuple[int, ...], dictionary: Dictionary) -> None:
        self._dictionary = dictionary
        self._cob_id = self.first_id + 0x100 * number + node
        self._type = 255
        self._mapping = [index << 16 | self.mappable[index] for index in default]
        self._count = len(default)
        communication, mapping = self.communication + number, self.mapping + number
        self._entries = entries = dictionary.entries
        entries[communication, 0] = Entry("B", lambda: self.highest)
        entries[communication, 1] = Entry("I", lambda: self._cob_id, self._set_cob_id)
        entries[communication, 2] = Entry("B", lambda: self._type, self._set_type)
        entries[mapping, 0] = Entry("B", lambda: self._count, self._set_count)
        for at in range(_MOST):
            entries[mapping, at + 1] = Entry(
                "I",
                lambda at=at: self._mapping[at] if at < len(self._mapping) else 0,  # type: ignore[misc]
                lambda value, at=at: self._set_mapping(at, value),  # type: ignore[misc]
            )

    @property
    def cob_id(self) -> int | None:
        """Return the identifier of its frames; None while it is invalid or empty."""
        return None if self._cob_id & _INVALID or not self._count else self._cob_id & _ID_BITS

    def objects(self) -> Iterator[tuple[int, int, int]]:
        """Return index, subindex and size in bytes of the mapped objects."""
        for each in self._mapping[: self._count]:
            yield each >> 16, each >> 8 & 0xFF, (each & 0xFF) // 8

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
        if value >> 8 & 0xFF or self.mappable.get(value >> 16) != value & 0xFF:
            raise Abort(_CANNOT_MAP)
        self._mapping.append(value)


class Tpdo(Pdo):
    """A transmit PDO. Call `tick` frequently while the node is Operational; it sends with `send(cob_id, data)`."""

    first_id, communication, highest, mapping = 0x180, 0x1800, 5, 0x1A00
    mappable: ClassVar[dict[int, int]] = {0x603F: 16, _STATUSWORD: 16, 0x6061: 8, 0x6064: 32, 0x606C: 32}

    def __init__(
        self,
        number: int,
        node: int,
        default: tuple[int, ...],
        dictionary: Dictionary,
        send: Callable[[int, bytes], None],
    ) -> None:
        super().__init__(number, node, default, dictionary)
        self.sent = 0
        self._send = send
        self._period_ms = 0
        self._due = 0.0
        self._last = b""
        self._entries[self.communication + number, 5] = Entry("H", lambda: self._period_ms, self._set_period)

    def tick(self, now: float) -> None:
        """Send if the event timer has expired or the status word has changed."""
        if (cob_id := self.cob_id) is None:
            return
        data = b"".join(self._dictionary.read(index, subindex) for index, subindex, _ in self.objects())
        has_status = self._mapping[0] >> 16 == _STATUSWORD
        changed = has_status and data[:2] != self._last[:2]
        if not changed and not (self._period_ms and now >= self._due):
            return
        period = self._period_ms / 1000.0
        # After a stall, missed transmissions are not sent later.
        self._due = self._due + period if now - self._due < period else now + period
        self._last = data
        self.sent += 1
        self._send(cob_id, data)

    def _set_period(self, value: int) -> None:
        self._period_ms = value


class Rpdo(Pdo):
    """A receive PDO. Call `received` with each frame while the node is Operational."""

    first_id, communication, highest, mapping = 0x200, 0x1400, 2, 0x1600
    mappable: ClassVar[dict[int, int]] = _DUMMIES | {
        **{_CONTROLWORD: 16, 0x6060: 8, 0x607A: 32, 0x6081: 32, 0x6083: 32, 0x6084: 32, 0x60FF: 32},
    }

    def received(self, data: bytes) -> list[tuple[int, int, bytes]] | None:
        """Return index, subindex and data of the values in a frame; None if it is too short.

        Further bytes are ignored. The control word comes last, so that it acts on the other values of the frame.
        """
        found, at = [], 0
        for index, subindex, size in self.objects():
            found.append((index, subindex, data[at : at + size]))
            at += size
        if at > len(data):
            return None
        return sorted((one for one in found if one[0] not in _DUMMIES), key=lambda one: one[0] == _CONTROLWORD)
