"""Conversion of values between programs and OPC UA: types, ranges, quality. Pure functions."""

import math
from datetime import UTC
from typing import Any, Final

from asyncua import ua

from arcor2_hw.data.base import Timestamp, now
from arcor2_hw.data.device import Quality

_T: Final = ua.VariantType
INTEGERS: Final = {
    _T.SByte: (-128, 127),
    _T.Byte: (0, 255),
    _T.Int16: (-(1 << 15), (1 << 15) - 1),
    _T.UInt16: (0, (1 << 16) - 1),
    _T.Int32: (-(1 << 31), (1 << 31) - 1),
    _T.UInt32: (0, (1 << 32) - 1),
    _T.Int64: (-(1 << 63), (1 << 63) - 1),
    _T.UInt64: (0, (1 << 64) - 1),
}
FLOATS: Final = {_T.Float: 3.4028234663852886e38, _T.Double: math.inf}


def type_of(value: ua.DataValue, data_type: ua.DataValue) -> ua.VariantType | None:
    """Return the type of a variable from its value, else from its DataType attribute; None when unknown."""
    if value.Value is not None and value.Value.VariantType is not _T.Null:
        return None if value.Value.is_array else value.Value.VariantType
    node = None if data_type.Value is None else data_type.Value.Value
    if isinstance(node, ua.NodeId) and node.NamespaceIndex == 0:
        try:
            return _T(int(str(node.Identifier)))
        except ValueError:
            return None
    return None


def fits(kind: ua.VariantType | None, digital: bool) -> bool:
    """Return whether a variable of this type may be a point."""
    return kind is _T.Boolean if digital else kind in INTEGERS or kind in FLOATS


def quality(value: ua.DataValue) -> Quality:
    """Return the quality of a value: the two upper bits of its status (OPC 10000-4, 7.39)."""
    severity = 0 if value.StatusCode is None else int(value.StatusCode.value) >> 30
    return (Quality.GOOD, Quality.UNCERTAIN, Quality.BAD, Quality.BAD)[severity]


def content(value: ua.DataValue) -> Any:
    """Return the content of a value; None if it is empty."""
    return None if value.Value is None else value.Value.Value


def is_bad(value: ua.DataValue) -> bool:
    """Return whether a value is missing or its quality is bad."""
    return content(value) is None or quality(value) is Quality.BAD


def stamp(value: ua.DataValue) -> Timestamp:
    """Return the time stamp of the source, or else of the server, or else the present time."""
    time: Any = value.SourceTimestamp or value.ServerTimestamp
    if time is None:
        return now()
    return str((time if time.tzinfo else time.replace(tzinfo=UTC)).isoformat(timespec="microseconds"))


def raw(value: float, scale: float, kind: ua.VariantType) -> int | float:
    """Return the raw value of a physical value. Raises ValueError with the range."""
    if kind in INTEGERS:
        low, high = INTEGERS[kind]
        number = value / scale
        if not math.isfinite(number) or not low <= round(number) <= high:
            ends = sorted((low * scale, high * scale))
            raise ValueError(f"must be {ends[0]:g} to {ends[1]:g}")
        return round(number)
    if not math.isfinite(value) or abs(value / scale) > FLOATS[kind]:
        raise ValueError("must be a finite number of its type")
    return value / scale
