"""Payloads of Sparkplug B 3.0 (chapter 6): the part of its Protocol Buffers schema that an edge node uses."""

import enum
from collections.abc import Iterable
from typing import Any, Final, NamedTuple

from google.protobuf import descriptor_pb2, descriptor_pool, message_factory
from google.protobuf.message import DecodeError

Value = bool | int | float | str | None
REBIRTH: Final = "Node Control/Rebirth"
SESSION: Final = "bdSeq"


class Kind(enum.IntEnum):
    """Data types of metrics, with their numbers."""

    INT32 = 3
    INT64 = 4
    DOUBLE = 10
    BOOLEAN = 11
    STRING = 12


GOOD: Final = 192
STALE: Final = 500
BAD: Final = 0
"""The quality codes of the specification."""
_FIELDS: Final = {
    Kind.INT32: "int_value",
    Kind.INT64: "long_value",
    Kind.DOUBLE: "double_value",
    Kind.BOOLEAN: "boolean_value",
    Kind.STRING: "string_value",
}


class Metric(NamedTuple):
    """A metric of a payload.

    name: omitted in data messages if the metric has an alias. quality: None to omit it. unit: omitted if empty.
    """

    name: str | None
    alias: int | None
    kind: Kind
    value: Value
    time_ms: int
    quality: int | None = None
    unit: str = ""
    historical: bool = False


def _schema() -> descriptor_pb2.FileDescriptorProto:
    field = descriptor_pb2.FieldDescriptorProto
    package = "arcor2_hw.sparkplug"
    file = descriptor_pb2.FileDescriptorProto(name="arcor2_hw/sparkplug.proto", package=package, syntax="proto2")

    def add(name: str, fields: dict[int, tuple[str, Any]], oneof: range = range(0)) -> None:
        message = file.message_type.add(name=name)
        if oneof:
            message.oneof_decl.add(name="value")
        for number, (field_name, kind) in fields.items():
            repeated, kind = isinstance(kind, list), kind[0] if isinstance(kind, list) else kind
            made = message.field.add(
                name=field_name,
                number=number,
                label=field.LABEL_REPEATED if repeated else field.LABEL_OPTIONAL,
                type=field.TYPE_MESSAGE if isinstance(kind, str) else kind,
                type_name=f".{package}.{kind}" if isinstance(kind, str) else None,
            )
            if number in oneof:
                made.oneof_index = 0

    u32, u64, flag, text = field.TYPE_UINT32, field.TYPE_UINT64, field.TYPE_BOOL, field.TYPE_STRING
    add(
        "PropertyValue",
        {1: ("type", u32), 2: ("is_null", flag), 3: ("int_value", u32), 8: ("string_value", text)},
        range(3, 9),
    )
    add("PropertySet", {1: ("keys", [text]), 2: ("values", ["PropertyValue"])})
    add(
        "Metric",
        {
            1: ("name", text), 2: ("alias", u64), 3: ("timestamp", u64), 4: ("datatype", u32),
            5: ("is_historical", flag), 7: ("is_null", flag), 9: ("properties", "PropertySet"),
            10: ("int_value", u32), 11: ("long_value", u64), 13: ("double_value", field.TYPE_DOUBLE),
            14: ("boolean_value", flag), 15: ("string_value", text),
        },
        range(10, 16),
    )  # fmt: skip
    add("Payload", {1: ("timestamp", u64), 2: ("metrics", ["Metric"]), 3: ("seq", u64)})
    return file


_pool = descriptor_pool.DescriptorPool()
_pool.Add(_schema())
_Payload: Any = message_factory.GetMessageClass(_pool.FindMessageTypeByName("arcor2_hw.sparkplug.Payload"))


def encode(metrics: Iterable[Metric], time_ms: int, seq: int | None) -> bytes:
    """Return a payload.

    Args:
        metrics: the metrics.
        time_ms: time of sending since 1970 in UTC, ms.
        seq: number of the message, 0 to 255; None for a death certificate.
    """
    payload = _Payload(timestamp=time_ms)
    if seq is not None:
        payload.seq = seq
    for each in metrics:
        metric = payload.metrics.add(timestamp=each.time_ms)
        if each.alias is not None:
            metric.alias = each.alias
        if each.name is not None:
            metric.name = each.name
            metric.datatype = each.kind
        if each.historical:
            metric.is_historical = True
        if each.value is None:
            metric.is_null = True
        else:
            setattr(metric, _FIELDS[each.kind], each.value)
        if each.quality is not None:
            metric.properties.keys.append("Quality")
            metric.properties.values.add(type=Kind.INT32, int_value=each.quality)
        if each.unit:
            metric.properties.keys.append("engUnit")
            metric.properties.values.add(type=Kind.STRING, string_value=each.unit)
    encoded: bytes = payload.SerializeToString()
    return encoded


def requests_rebirth(payload: bytes) -> bool:
    """Return whether a command requests a rebirth. A payload that cannot be decoded requests nothing."""
    try:
        command = _Payload.FromString(payload)
    except DecodeError:
        return False
    return any(metric.name == REBIRTH and metric.boolean_value for metric in command.metrics)
