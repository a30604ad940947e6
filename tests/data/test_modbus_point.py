"""Points on Modbus: number formats, word orders, scales, enumerations, ranges, and contradictions."""

import math
import struct
from typing import Any

import pytest

from arcor2_hw.data.modbus_point import FORMATS, Point
from arcor2_hw.objects.mapped_device import blocks


@pytest.mark.parametrize(
    ("options", "words", "value"),
    [
        ({}, [0x8001], 32769),
        ({"type": "int16"}, [0x8001], -32767),
        ({"type": "uint32"}, [0x0001, 0x86A0], 100000),
        ({"type": "uint32", "word_order": "low_first"}, [0x86A0, 0x0001], 100000),
        ({"type": "int32", "word_order": "high_first"}, [0xFFFF, 0xFFFE], -2),
        ({"type": "float32"}, [0x4148, 0x0000], 12.5),
        ({"type": "float32", "word_order": "low_first"}, [0x0000, 0x4148], 12.5),
        ({"type": "uint64", "word_order": "low_first"}, [0x7788, 0x5566, 0x3344, 0x1122], 0x1122334455667788),
        ({"type": "int64"}, [0xFFFF, 0xFFFF, 0xFFFF, 0xFFFD], -3),
        ({"type": "float64"}, [0xC004, 0x0000, 0x0000, 0x0000], -2.5),
        ({"scale": 0.1}, [3], 0.3),
        ({"type": "int16", "scale": -0.5}, [0xFFFE], 1.0),
        ({"values": {0: "off", 7: "on"}}, [7], "on"),
    ],
)
def test_registers_and_values_match(options: dict[str, Any], words: list[int], value: object) -> None:
    point = Point("holding_register", 10, **options)
    assert point.value(words) == value
    assert type(point.value(words)) is point.kind
    assert point.words(point.value(words)) == words
    assert point.size == len(words)


def test_bits_are_bool() -> None:
    point = Point("input_register", 10, bit=3)
    assert [point.value([word]) for word in (0, 8, 7, 0xFFFF)] == [False, True, False, True]
    assert Point("coil", 1).value([1]) is True
    assert [Point("coil", 1).words(on) for on in (False, True)] == [[0], [1]]


@pytest.mark.parametrize(
    ("options", "value", "problem"),
    [
        ({}, 65536, "must be 0 to 65535"),
        ({}, -1, "must be 0 to 65535"),
        ({}, 1.5, "must be a whole number"),
        ({}, True, "must be 0 to 65535"),
        ({"type": "int16", "scale": 0.1, "unit": "mm"}, 4000.0, "must be -3276.8 to 3276.7 mm"),
        ({"scale": 0.1, "minimum": 1.0, "maximum": 5.0, "unit": "bar"}, 5.1, "must be 1 to 5 bar"),
        ({"type": "float32"}, math.nan, "must be"),
        ({"type": "float32"}, 1e39, "must be"),
        ({"type": "float32", "minimum": 0.0}, -0.1, "must be 0 to"),
        ({"values": {1: "soft", 2: "hard"}}, "medium", "must be one of soft, hard"),
        ({"values": {1: "soft", 2: "hard"}}, 1, "must be one of soft, hard"),
    ],
)
def test_values_that_cannot_be_written_are_refused(options: dict[str, Any], value: Any, problem: str) -> None:
    with pytest.raises(ValueError, match=problem):
        Point("holding_register", 0, **options).words(value)


def test_a_coil_takes_no_number() -> None:
    with pytest.raises(ValueError, match="must be true or false"):
        Point("coil", 0).words(1)


def test_an_unknown_number_of_an_enumeration_is_an_error() -> None:
    with pytest.raises(ValueError, match="is 9, which is none of 0, 1"):
        Point("input_register", 0, values={0: "off", 1: "on"}).value([9])


@pytest.mark.parametrize("type_", FORMATS)
def test_the_limits_of_a_type_can_be_written(type_: str) -> None:
    point = Point("holding_register", 0, type=type_)  # type: ignore[arg-type] # each of its types
    for end in point.limits:
        if "64" not in type_:  # a float cannot represent the limits of 64 bits
            assert point.value(point.words(point.kind(end))) == pytest.approx(end)
    assert point.size == struct.calcsize(FORMATS[type_]) // 2


@pytest.mark.parametrize(
    ("table", "options", "problem"),
    [
        ("coil", {"type": "float32"}, "need a number"),
        ("coil", {"scale": 0.1}, "need a number"),
        ("discrete_input", {"values": {0: "a"}}, "need a number"),
        ("coil", {"bit": 1}, "coil has no bits"),
        ("input_register", {"bit": 1, "unit": "mm"}, "need a number"),
        ("input_register", {"bit": 16}, "bit must be 0 to 15"),
        ("input_register", {"address": 65536}, "address must be 0 to 65535"),
        ("input_register", {"address": -1}, "address must be 0 to 65535"),
        ("input_register", {"address": 65535, "type": "uint32"}, "address must be 0 to 65534, not 65535"),
        ("input_register", {"scale": 0.0}, "scale must not be 0"),
        ("input_register", {"scale": math.inf}, "scale must not be inf"),
        ("input_register", {"values": {0: "a", 1: "a"}}, "values must be different texts"),
        ("input_register", {"values": {0: "a"}, "type": "float32"}, "values need whole numbers"),
        ("input_register", {"values": {65536: "a"}}, "values must be numbers of the type"),
        ("input_register", {"values": {-1: "a"}}, "values must be numbers of the type"),
        ("holding_register", {"maximum": math.inf}, "minimum and maximum must be numbers"),
        ("input_register", {"values": {0: "a"}, "unit": "mm"}, "an enumeration has no unit"),
        ("holding_register", {"values": {0: "a"}, "maximum": 3.0}, "an enumeration has no limits"),
        ("holding_register", {"minimum": 5.0, "maximum": 5.0}, "minimum must be less than maximum"),
        ("input_register", {"debounce": 0.1}, "is debounced"),
        ("discrete_input", {"debounce": 11.0}, "debounce must be 0 to 10 s"),
        ("input_register", {"access": "write"}, "input_register cannot be written"),
        ("holding_register", {"bit": 2, "access": "read_write"}, "a bit of a register cannot be written"),
    ],
)
def test_contradictions_are_refused(table: Any, options: dict[str, Any], problem: str) -> None:
    with pytest.raises(ValueError, match=problem):
        Point(table, **{"address": 0, **options})


def test_adjacent_points_share_a_request() -> None:
    points = {
        "b": Point("input_register", 101, type="float32"),
        "a": Point("input_register", 100),
        "c": Point("input_register", 104),
        "flag": Point("input_register", 104, bit=1),
        "written": Point("holding_register", 0),
        "read": Point("holding_register", 1, access="read"),
        "coil": Point("coil", 0, access="read_write"),
    }
    assert blocks(points) == [
        ("coil", 0, 1, ["coil"]),
        ("holding_register", 1, 1, ["read"]),
        ("input_register", 100, 3, ["a", "b"]),
        ("input_register", 104, 1, ["c", "flag"]),
    ]
    many = {f"p{n}": Point("input_register", 2 * n, type="float32") for n in range(100)}
    assert [(first, count) for _, first, count, _ in blocks(many)] == [(0, 124), (124, 76)]
