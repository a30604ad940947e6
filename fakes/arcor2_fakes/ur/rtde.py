"""RTDE frames and recipes: pure functions and tables, no I/O.

A frame is a big-endian u16 size that counts its three header bytes, a u8 type, and the payload. Source: Universal
Robots, "Real-Time Data Exchange (RTDE) Guide", protocol version 2.
"""

import struct
from collections.abc import Iterator
from enum import IntEnum

HEADER = struct.Struct(">HB")
MAX_FRAME = 0xFFFF
MAX_NAMES = 512  # variables in one recipe; the controller's own limit is lower


class Kind(IntEnum):
    """Frame types."""

    REQUEST_PROTOCOL_VERSION = 86
    GET_CONTROLLER_VERSION = 118
    TEXT_MESSAGE = 77
    DATA = 85
    SETUP_OUTPUTS = 79
    SETUP_INPUTS = 73
    START = 83
    PAUSE = 80


class FramingError(ValueError):
    """The bytes are not a frame; the connection cannot be used any more."""


FORMATS = {
    "BOOL": "?",
    "UINT8": "B",
    "UINT32": "I",
    "UINT64": "Q",
    "INT32": "i",
    "DOUBLE": "d",
    "VECTOR3D": "3d",
    "VECTOR6D": "6d",
    "VECTOR6INT32": "6i",
    "VECTOR6UINT32": "6I",
}


def _each(kind: str, names: str) -> dict[str, str]:
    return dict.fromkeys(names.split(), kind)


def _registers(direction: str) -> dict[str, str]:
    return {
        **_each("UINT32", f"{direction}_bit_registers0_to_31 {direction}_bit_registers32_to_63"),
        **{f"{direction}_bit_register_{i}": "BOOL" for i in range(64, 128)},
        **{f"{direction}_int_register_{i}": "INT32" for i in range(48)},
        **{f"{direction}_double_register_{i}": "DOUBLE" for i in range(48)},
    }


OUTPUTS = {
    **_each(
        "DOUBLE",
        "timestamp actual_execution_time speed_scaling target_speed_fraction actual_momentum actual_main_voltage "
        "actual_robot_voltage actual_robot_current standard_analog_input0 standard_analog_input1 "
        "standard_analog_output0 standard_analog_output1 io_current euromap67_24V_voltage euromap67_24V_current "
        "tool_analog_input0 tool_analog_input1 tool_output_current tool_temperature tcp_force_scalar payload "
        "joint_position_deviation_ratio collision_detection_ratio",
    ),
    **_each(
        "VECTOR6D",
        "target_q target_qd target_qdd target_current target_moment actual_q actual_qd actual_current "
        "actual_current_window actual_current_as_torque joint_control_output actual_TCP_pose actual_TCP_speed "
        "actual_TCP_force target_TCP_pose target_TCP_speed joint_temperatures actual_joint_voltage payload_inertia "
        "ft_raw_wrench tcp_offset",
    ),
    **_each("VECTOR3D", "actual_tool_accelerometer elbow_position elbow_velocity payload_cog"),
    **_each("VECTOR6INT32", "joint_mode"),
    **_each("UINT64", "actual_digital_input_bits actual_digital_output_bits"),
    **_each("INT32", "robot_mode safety_mode safety_status tool_output_voltage time_scale_source"),
    **_each(
        "UINT32",
        "runtime_state robot_status_bits safety_status_bits analog_io_types tool_mode tool_analog_input_types "
        "script_control_line euromap67_input_bits euromap67_output_bits",
    ),
    **_each("UINT8", "tool_output_mode tool_digital_output0_mode tool_digital_output1_mode"),
    **_registers("output"),
    **_registers("input"),
}

INPUTS = {
    **_each("UINT32", "speed_slider_mask"),
    **_each("DOUBLE", "speed_slider_fraction standard_analog_output_0 standard_analog_output_1"),
    **_each(
        "UINT8",
        "standard_digital_output_mask standard_digital_output configurable_digital_output_mask "
        "configurable_digital_output tool_digital_output_mask tool_digital_output standard_analog_output_mask "
        "standard_analog_output_type",
    ),
    **_each("VECTOR6D", "external_force_torque"),
    **_registers("input"),
}


def pack(kind: int, payload: bytes = b"") -> bytes:
    """Return a frame."""
    return HEADER.pack(HEADER.size + len(payload), kind) + payload


class Deframer:
    """Cuts a byte stream into frames."""

    def __init__(self) -> None:
        self._buffer = bytearray()

    def feed(self, data: bytes) -> Iterator[tuple[int, bytes]]:
        """Return the frames completed by `data`, as (type, payload). Raise `FramingError` for an impossible size."""
        self._buffer += data
        start = 0
        try:
            while len(self._buffer) - start >= HEADER.size:
                size, kind = HEADER.unpack_from(self._buffer, start)
                if size < HEADER.size:
                    raise FramingError(f"invalid frame length: {size} bytes")
                if len(self._buffer) - start < size:
                    break
                payload = bytes(self._buffer[start + HEADER.size : start + size])
                start += size
                yield kind, payload
        finally:
            del self._buffer[:start]


def split_names(payload: bytes) -> list[str]:
    """Return the variable names of a set-up request; a trailing comma is ignored. Raise `FramingError`."""
    try:
        names = [name for name in payload.decode("ascii").split(",") if name]
    except UnicodeDecodeError as e:
        raise FramingError("a variable name is not ASCII") from e
    if len(names) > MAX_NAMES:
        raise FramingError(f"{len(names)} variables in one recipe")
    return names
