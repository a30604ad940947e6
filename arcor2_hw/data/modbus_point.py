"""Points of a device on Modbus: their addresses, and the conversion between registers and values."""

import math
import struct
import sys
from collections.abc import Sequence
from typing import Final, Literal, TypeAlias

from msgspec import field

from arcor2_hw.data.base import UNSET, Data, Unset

Value: TypeAlias = bool | int | float | str
Table: TypeAlias = Literal["coil", "discrete_input", "holding_register", "input_register"]
NumberType: TypeAlias = Literal["uint16", "int16", "uint32", "int32", "uint64", "int64", "float32", "float64"]
WordOrder: TypeAlias = Literal["high_first", "low_first"]
Access: TypeAlias = Literal["read", "write", "read_write"]

Kind: TypeAlias = type[bool] | type[int] | type[float] | type[str]

FORMATS: Final = {
    "uint16": ">H",
    "int16": ">h",
    "uint32": ">I",
    "int32": ">i",
    "uint64": ">Q",
    "int64": ">q",
    "float32": ">f",
    "float64": ">d",
}
"""Formats of `struct` by type of a number."""
LARGEST: Final = {"float32": 3.4028234663852886e38, "float64": sys.float_info.max}
"""Maximum number by type."""
LAST_ADDRESS: Final = 0xFFFF
WORD_BITS: Final = 16
MAX_DEBOUNCE_TIME: Final = 10.0
"""Longest debounce time, s."""


class Point(Data, frozen=True, forbid_unknown_fields=True):
    """A value of a device: a coil, a discrete input, a number in one to four registers, or a bit of a register.

    Attributes:
        address: Zero-based address of the first register, coil or discrete input.
        type: Type of a number; coils, discrete inputs and bits are bool.
        word_order: Whether the register with the high or the low word comes first.
        bit: Number of the bit in the register, 0 to 15.
        scale: The value is the number in the registers times `scale`, in `unit`.
        values: Texts by number, for an enumeration.
        minimum: Least value that is written; default: that of the type.
        maximum: Greatest value that is written.
        debounce: Time for which a change of a bool must last to count, s.
        access: Default: `write` for coils and holding registers, `read` for the others.
        internal: Whether only commands use it, so that it has no actions.
        text: Description for users.

    Raises:
        ValueError: The fields contradict each other.
    """

    table: Table
    address: int
    type: NumberType | Unset = UNSET
    word_order: WordOrder | Unset = UNSET
    bit: int | Unset = UNSET
    scale: float = 1.0
    unit: str = ""
    values: dict[int, str] = field(default_factory=dict)
    minimum: float | Unset = UNSET
    maximum: float | Unset = UNSET
    debounce: float = 0.0
    access: Access | Unset = UNSET
    internal: bool = False
    text: str = ""

    def __post_init__(self) -> None:
        number, bits = "register" in self.table, self.bit is not UNSET
        options = [self.type, self.word_order, self.minimum, self.maximum]
        has_number = any(each is not UNSET for each in options) or self.scale != 1.0 or self.unit or self.values
        ends = [each for each in (self.minimum, self.maximum) if not isinstance(each, Unset)]
        last, texts = LAST_ADDRESS + 1 - self.size, list(self.values.values())
        rules = (
            (number or not bits, f"{self.table} has no bits"),
            (not has_number or (number and not bits), "type, word_order, scale, unit, values and limits need a number"),
            (not bits or 0 <= int(self.bit or 0) < WORD_BITS, f"bit must be 0 to 15, not {self.bit}"),
            (0 <= self.address <= last, f"address must be 0 to {last}, not {self.address}"),
            (
                math.isfinite(self.scale) and self.scale != 0.0,
                f"scale must not be {self.scale:g}",
            ),
            (not self.values or not self.is_float, "values need whole numbers"),
            (all(map(self._fits, self.values)), f"values must be numbers of the type, not {[*self.values]}"),
            (all(math.isfinite(each) for each in ends), "minimum and maximum must be numbers"),
            (len({*texts}) == len(texts), f"values must be different texts, not {', '.join(texts)}"),
            (not self.values or not self.unit, "an enumeration has no unit"),
            (not self.values or {self.minimum, self.maximum} == {UNSET}, "an enumeration has no limits"),
            (
                0.0 <= self.debounce <= MAX_DEBOUNCE_TIME,
                f"debounce must be 0 to 10 s, not {self.debounce:g}",
            ),
            (not self.debounce or self.kind is bool, "only a coil, a discrete input or a bit is debounced"),
            (self.table in ("coil", "holding_register") or not self.writable, f"{self.table} cannot be written"),
            (not bits or not self.writable, "a bit of a register cannot be written, only the whole register"),
            (self.limits[0] < self.limits[1], "minimum must be less than maximum"),
        )
        for holds, reason in rules:
            if not holds:
                raise ValueError(reason)

    # -------------------------------------------------------------------------------- kinds
    @property
    def size(self) -> int:
        """Return the number of registers; 1 for a coil or a discrete input."""
        return struct.calcsize(self._format) // 2

    @property
    def kind(self) -> Kind:
        """Return the type of the value: bool, int, float, or str for an enumeration."""
        if "register" not in self.table or self.bit is not UNSET:
            return bool
        return str if self.values else float if self.is_float or self.scale != 1.0 else int

    @property
    def is_float(self) -> bool:
        """Return whether the registers contain a floating-point number."""
        return self.type in LARGEST

    @property
    def readable(self) -> bool:
        """Return whether the point is read."""
        return self.access != "write" and (self.access is not UNSET or not self.writable)

    @property
    def writable(self) -> bool:
        """Return whether the point is written."""
        default = self.table in ("coil", "holding_register") and self.bit is UNSET
        return default if self.access is UNSET else self.access != "read"

    @property
    def limits(self) -> tuple[float, float]:
        """Return the minimum and the maximum value that can be written."""
        ends = sorted(float(f"{end * self.scale:.15g}") for end in self._ends)
        return (
            ends[0] if isinstance(self.minimum, Unset) else max(ends[0], self.minimum),
            ends[1] if isinstance(self.maximum, Unset) else min(ends[1], self.maximum),
        )

    @property
    def _ends(self) -> tuple[float, float]:
        """Return the minimum and the maximum number in the registers."""
        if self.is_float:
            return -LARGEST[str(self.type)], LARGEST[str(self.type)]
        width, signed = WORD_BITS * self.size, self._format[1].islower()
        return (-(2 ** (width - 1)), 2 ** (width - 1) - 1) if signed else (0, 2**width - 1)

    def _fits(self, number: int) -> bool:
        return self._ends[0] <= number <= self._ends[1]

    @property
    def _format(self) -> str:
        return FORMATS["uint16" if isinstance(self.type, Unset) else self.type]

    # -------------------------------------------------------------------------------- values
    def value(self, words: Sequence[int]) -> Value:
        """Return the value in registers, or in a coil or discrete input. Raises ValueError for an unknown number."""
        if self.kind is bool:
            return bool(words[0] if isinstance(self.bit, Unset) else words[0] >> self.bit & 1)
        packed = b"".join(word.to_bytes(2) for word in (words[::-1] if self.word_order == "low_first" else words))
        (number,) = struct.unpack(self._format, packed)
        if self.values:
            if number not in self.values:
                raise ValueError(f"is {number}, which is none of {', '.join(map(str, self.values))}")
            return self.values[number]
        return number if self.scale == 1.0 else float(f"{number * self.scale:.12g}")

    def number(self, value: Value) -> float:
        """Return the number that is written for a value. Raises ValueError with the allowed values."""
        if self.kind is bool:
            if not isinstance(value, bool):
                raise ValueError("must be true or false")
            return value
        if self.values:
            numbers = {text: number for number, text in self.values.items()}
            if value not in numbers:
                raise ValueError(f"must be one of {', '.join(numbers)}")
            return numbers[str(value)]
        low, high = self.limits
        if isinstance(value, bool | str) or not math.isfinite(value) or not low <= value <= high:
            raise ValueError(f"must be {low:g} to {high:g} {self.unit}".rstrip())
        if self.is_float:
            return value / self.scale
        if self.kind is int and value != int(value):
            raise ValueError("must be a whole number")
        return int(value) if self.kind is int else round(value / self.scale)

    def words(self, value: Value) -> list[int]:
        """Return the registers of a value; 0 or 1 for a coil. Raises ValueError with the allowed values."""
        number = self.number(value)
        if self.kind is bool:
            return [int(number)]
        packed = struct.pack(self._format, number)
        words = [int.from_bytes(packed[at : at + 2]) for at in range(0, len(packed), 2)]
        return words[::-1] if self.word_order == "low_first" else words


# Names before version 0.2.
LONGEST_DEBOUNCE = MAX_DEBOUNCE_TIME
