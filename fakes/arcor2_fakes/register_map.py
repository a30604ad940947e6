"""Register maps: the places of a device's values in the four tables of Modbus, with their number formats."""

from __future__ import annotations

import struct
from collections.abc import Mapping, Sequence
from types import SimpleNamespace
from typing import Any, Final, NamedTuple, Protocol

from arcor2_fakes.modbus import ExceptionCode, ModbusRefusal, ModbusTables

COILS, DISCRETE_INPUTS, HOLDING_REGISTERS, INPUT_REGISTERS = TABLES = (
    "coils",
    "discrete_inputs",
    "holding_registers",
    "input_registers",
)
FORMATS: Final = {
    "uint16": ">H",
    "int16": ">h",
    "uint32": ">I",
    "int32": ">i",
    "float32": ">f",
    "uint64": ">Q",
    "int64": ">q",
    "float64": ">d",
}
"""Formats of `struct` by type of a number."""
SIZE: Final = 1 << 16
"""Number of addresses in a table."""


class Refusal(Exception):
    """The device refuses a write in its present state."""


class Place(NamedTuple):
    """The place of a value. With `bit` it is one bit of a register; with `low_first` the low word comes first."""

    table: str
    address: int
    type: str = "uint16"
    low_first: bool = False
    bit: int | None = None

    @property
    def size(self) -> int:
        """Return the number of coils, discrete inputs or registers that it takes."""
        return struct.calcsize(FORMATS[self.type]) // 2

    def words(self, value: Any) -> list[int]:
        """Return the registers of a value, in the order of their addresses."""
        if self.table in (COILS, DISCRETE_INPUTS):
            return [int(bool(value))]
        if self.bit is not None:
            return [bool(value) << self.bit]
        packed = struct.pack(FORMATS[self.type], value if "float" in self.type else round(value))
        words = [int.from_bytes(packed[at : at + 2]) for at in range(0, len(packed), 2)]
        return words[::-1] if self.low_first else words

    def value(self, words: Sequence[int]) -> Any:
        """Return the value in registers."""
        if self.table in (COILS, DISCRETE_INPUTS):
            return bool(words[0])
        if self.bit is not None:
            return bool(words[0] >> self.bit & 1)
        packed = b"".join(word.to_bytes(2) for word in (words[::-1] if self.low_first else words))
        return struct.unpack(FORMATS[self.type], packed)[0]


def coil(address: int) -> Place:
    """Return the place of a coil."""
    return Place(COILS, address)


def discrete_input(address: int) -> Place:
    """Return the place of a discrete input."""
    return Place(DISCRETE_INPUTS, address)


def holding_register(address: int, type_: str = "uint16", *, low_first: bool = False, bit: int | None = None) -> Place:
    """Return the place of a number of a type of FORMATS, or of a bit, in holding registers."""
    return Place(HOLDING_REGISTERS, address, type_, low_first, bit)


def input_register(address: int, type_: str = "uint16", *, low_first: bool = False, bit: int | None = None) -> Place:
    """Return the place of a number of a type of FORMATS, or of a bit, in input registers."""
    return Place(INPUT_REGISTERS, address, type_, low_first, bit)


class RegisterMap:
    """The places of values by name. Raises ValueError if an address is beyond its table or used twice."""

    def __init__(self, places: Mapping[str, Place]) -> None:
        self._places = places
        self._names: dict[str, dict[int, list[str]]] = {table: {} for table in TABLES}
        for name, place in places.items():
            if not 0 <= place.address <= SIZE - place.size:
                raise ValueError(f"{name}: address {place.address} is not in the table")
            for address in range(place.address, place.address + place.size):
                others = self._names[place.table].setdefault(address, [])
                bits = [places[other].bit for other in others]
                if bits and (None in (place.bit, *bits) or place.bit in bits):
                    raise ValueError(f"{name}: address {address} belongs to {others[0]}")
                others.append(name)

    def has(self, table: str) -> bool:
        """Return whether the device has a table."""
        return bool(self._names[table])

    def read(self, values: Mapping[str, Any], table: str, address: int, count: int) -> list[int]:
        """Return registers, or coils and discrete inputs as 0 and 1. Raises LookupError for a gap in the map."""
        words = []
        for each in range(address, address + count):
            word = 0
            for name in self._names[table][each]:
                place = self._places[name]
                word |= place.words(values[name])[each - place.address]
            words.append(word)
        return words

    def write(self, values: Mapping[str, Any], table: str, address: int, words: Sequence[int]) -> dict[str, Any]:
        """Return the values that a write changes, by name. Raises LookupError for a gap in the map."""
        new = dict(enumerate(words, address))
        names = dict.fromkeys(name for each in new for name in self._names[table][each])
        written = {}
        for name in names:
            place = self._places[name]
            present = enumerate(place.words(values[name]), place.address)
            written[name] = place.value([new.get(each, word) for each, word in present])
        return written


class MappedFake(Protocol):
    """A device whose values are in a map."""

    map: RegisterMap
    registers: SimpleNamespace

    def heard(self) -> None:
        """Note a request of the host."""
        ...

    def write_map(self, table: str, address: int, words: Sequence[int]) -> None:
        """Execute a write of the host. Raises Refusal, LookupError."""
        ...


class MapTables(ModbusTables):
    """The tables of a device with a map. Addresses that are not in the map are answered with "illegal address"."""

    def __init__(self, device: MappedFake) -> None:
        self._device = device
        for table in TABLES:
            setattr(self, table, SIZE if device.map.has(table) else 0)

    def request_arrived(self) -> None:
        """Advance the simulation."""
        self._device.heard()

    def read_coils(self) -> Any:
        """Return the coils."""
        return _Cells(self._device, COILS)

    def read_discrete_inputs(self) -> Any:
        """Return the discrete inputs."""
        return _Cells(self._device, DISCRETE_INPUTS)

    def read_input_registers(self) -> Any:
        """Return the input registers."""
        return _Cells(self._device, INPUT_REGISTERS)

    def read_holding_register(self, address: int) -> int:
        """Return a holding register."""
        return _Cells(self._device, HOLDING_REGISTERS)[address : address + 1][0]

    def write_coils(self, address: int, values: list[bool]) -> None:
        """Switch coils."""
        self._write(COILS, address, values)

    def write_holding_registers(self, address: int, values: list[int]) -> None:
        """Write holding registers, all or none."""
        self._write(HOLDING_REGISTERS, address, values)

    def _write(self, table: str, address: int, values: Sequence[int]) -> None:
        try:
            self._device.write_map(table, address, values)
        except LookupError:
            raise ModbusRefusal(ExceptionCode.ILLEGAL_ADDRESS) from None
        except Refusal:
            raise ModbusRefusal(ExceptionCode.DEVICE_BUSY) from None


class _Cells:
    """A table whose values are read on request."""

    def __init__(self, device: MappedFake, table: str) -> None:
        self._device, self._table = device, table

    def __getitem__(self, part: slice) -> list[int]:
        try:
            return self._device.map.read(vars(self._device.registers), self._table, part.start, part.stop - part.start)
        except LookupError:
            raise ModbusRefusal(ExceptionCode.ILLEGAL_ADDRESS) from None
