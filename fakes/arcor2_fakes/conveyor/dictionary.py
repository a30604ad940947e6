"""The object dictionary of the drive, and the SDO aborts for invalid accesses."""

from __future__ import annotations

import struct
from collections.abc import Callable
from dataclasses import dataclass

from arcor2_fakes.conveyor.drive import Drive, Mode

NO_OBJECT, NO_SUBINDEX, NO_DATA = 0x06020000, 0x06090011, 0x08000024
NOT_STORED = 0x08000020
READ_ONLY, TOO_LONG, TOO_SHORT, BAD_VALUE = 0x06010002, 0x06070012, 0x06070013, 0x06090030


class Abort(Exception):
    """An SDO abort with its code."""

    def __init__(self, code: int) -> None:
        super().__init__(f"{code:08X}")
        self.code = code


@dataclass(frozen=True)
class Entry:
    """A subindex: struct format ("s": text), and functions that read and write it (None: read only)."""

    form: str
    read: Callable[[], int | str]
    write: Callable[[int], None] | None = None


class Dictionary:
    """The entries by (index, subindex)."""

    def __init__(self) -> None:
        self.entries: dict[tuple[int, int], Entry] = {}

    def read(self, index: int, subindex: int) -> bytes:
        """Return the bytes of a value. Raises Abort."""
        entry = self._entry(index, subindex)
        value = entry.read()
        return value.encode() if isinstance(value, str) else struct.pack("<" + entry.form, value)

    def write(self, index: int, subindex: int, data: bytes) -> None:
        """Write a value. Raises Abort."""
        size = self.writable_size(index, subindex)
        if len(data) != size:
            raise Abort(TOO_LONG if len(data) > size else TOO_SHORT)
        entry = self._entry(index, subindex)
        assert entry.write is not None
        try:
            entry.write(struct.unpack("<" + entry.form, data)[0])
        except ValueError:
            raise Abort(BAD_VALUE) from None

    def writable_size(self, index: int, subindex: int) -> int:
        """Return the number of bytes of a value that can be written. Raises Abort."""
        entry = self._entry(index, subindex)
        if entry.write is None:
            raise Abort(READ_ONLY)
        return struct.calcsize("<" + entry.form)

    def _entry(self, index: int, subindex: int) -> Entry:
        entry = self.entries.get((index, subindex))
        if entry is None:
            raise Abort(NO_SUBINDEX if any(known == index for known, _ in self.entries) else NO_OBJECT)
        return entry


_PARAMETERS = {
    0x6007: ("h", "abort_option", -32768),
    0x605A: ("h", "quick_stop_option", -32768),
    0x607A: ("i", "target_position", -(1 << 31)),
    0x607C: ("i", "home_offset", -(1 << 31)),
    0x6081: ("I", "profile_velocity", 1),
    0x6083: ("I", "acceleration", 1),
    0x6084: ("I", "deceleration", 1),
    0x6085: ("I", "quick_stop_deceleration", 1),
    0x6098: ("b", "homing_method", -128),
    0x609A: ("I", "homing_acceleration", 1),
    0x60FF: ("i", "target_velocity", -(1 << 31)),
}
_SETUP = {
    (0x605B, 0): ("h", 0, 0, 1),
    (0x605C, 0): ("h", 1, 0, 1),
    (0x605D, 0): ("h", 1, 1, 4),
    (0x605E, 0): ("h", 2, 0, 2),
    (0x6065, 0): ("I", 2000, 0, (1 << 32) - 1),
    (0x6066, 0): ("H", 100, 0, 0xFFFF),
    (0x6072, 0): ("H", 1200, 0, 3000),
    (0x6073, 0): ("H", 1500, 0, 2000),
    (0x607E, 0): ("B", 0, 0, 0xFF),
    (0x607F, 0): ("I", 20000, 1, (1 << 32) - 1),
    (0x6080, 0): ("I", 3000, 1, 6000),
    (0x608F, 1): ("I", 10000, 1, (1 << 32) - 1),
    (0x608F, 2): ("I", 1, 1, (1 << 32) - 1),
    (0x6091, 1): ("I", 5, 1, (1 << 32) - 1),
    (0x6091, 2): ("I", 1, 1, (1 << 32) - 1),
}
"""Format, default, minimum and maximum of each setup value. The motion does not use them."""
_SAVE = int.from_bytes(b"save", "little")


class Setup:
    """Setup of the drive: present values and stored values."""

    def __init__(self) -> None:
        self.present = {key: value for key, (_, value, _, _) in _SETUP.items()}
        self._stored = dict(self.present)

    def add_to(self, dictionary: Dictionary) -> None:
        """Add its entries."""
        entries = dictionary.entries
        for key, (form, _, lowest, highest) in _SETUP.items():

            def write(value: int, key: tuple[int, int] = key, lowest: int = lowest, highest: int = highest) -> None:
                if not lowest <= value <= highest:
                    raise ValueError
                self.present[key] = value

            entries[key] = Entry(form, lambda key=key: self.present[key], write)  # type: ignore[misc]
        for index in {index for index, subindex in _SETUP if subindex}:
            entries[index, 0] = Entry("B", lambda: 2)
        entries[0x1010, 0] = Entry("B", lambda: 1)
        entries[0x1010, 1] = Entry("I", lambda: 1, self._save)

    def _save(self, value: int) -> None:
        if value != _SAVE:
            raise Abort(NOT_STORED)
        self._stored = dict(self.present)

    def power_cycle(self) -> None:
        """Load the stored values."""
        self.present = dict(self._stored)


_MODES_HAD = 1 << 0 | 1 << 2 | 1 << 5  # 6502h: bits of pp, pv, hm


def add_drive(dictionary: Dictionary, drive: Drive) -> None:
    """Add the entries of CiA 402."""
    entries = dictionary.entries
    for index, (form, name, lowest) in _PARAMETERS.items():

        def write(value: int, name: str = name, lowest: int = lowest) -> None:
            if value < lowest:
                raise ValueError
            setattr(drive.parameters, name, value)

        entries[index, 0] = Entry(form, lambda name=name: getattr(drive.parameters, name), write)  # type: ignore[misc]

    def homing_speed(value: int) -> None:
        if value < 1:
            raise ValueError
        drive.parameters.homing_speed = value

    entries[0x603F, 0] = Entry("H", lambda: drive.error_code)
    entries[0x6040, 0] = Entry("H", lambda: drive.controlword, drive.control)
    entries[0x6041, 0] = Entry("H", lambda: drive.statusword)
    entries[0x6060, 0] = Entry("b", lambda: drive.mode, drive.set_mode)
    entries[0x6061, 0] = Entry("b", lambda: drive.mode)
    entries[0x6064, 0] = Entry("i", lambda: drive.position)
    entries[0x606C, 0] = Entry("i", lambda: round(drive.velocity))
    entries[0x6099, 0] = Entry("B", lambda: 2)
    for subindex in (1, 2):
        entries[0x6099, subindex] = Entry("I", lambda: drive.parameters.homing_speed, homing_speed)
    entries[0x6502, 0] = Entry("I", lambda: _MODES_HAD)
    assert all(mode in (0, 1, 3, 6) for mode in Mode)
