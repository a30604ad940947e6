"""Pure functions of the UR driver: RTDE frames, dashboard answers, frames of reference, settings, time limits."""

import math
import struct

import pytest
from hypothesis import given, settings, strategies as st

from arcor2_drivers.universal_robots import dashboard, timing
from arcor2_drivers.universal_robots.geometry import from_vector, to_vector, world_from_base
from arcor2_drivers.universal_robots.rtde import MAX_FRAME, frames, recipe
from arcor2_drivers.universal_robots.settings import UrSettings
from arcor2_drivers.universal_robots.states import power_of, safety_of
from arcor2_hw.data.geometry import Orientation, Pose, Position
from arcor2_hw.data.robot import Mode, Power, Safety
from arcor2_hw.exceptions import DeviceFault, OutOfRange


def packed(kind: int, payload: bytes) -> bytes:
    return struct.pack(">HB", 3 + len(payload), kind) + payload


@settings(deadline=None)
@given(st.lists(st.tuples(st.integers(0, 255), st.binary(max_size=60)), max_size=6), st.data())
def test_frames_are_complete_however_the_bytes_are_split(sent: list[tuple[int, bytes]], data: st.DataObject) -> None:
    stream = b"".join(packed(kind, payload) for kind, payload in sent)
    cut = data.draw(st.integers(0, len(stream)))
    first, rest = frames(stream[:cut])
    second, rest = frames(rest + stream[cut:])
    assert first + second == sent
    assert rest == b""


@settings(deadline=None)
@given(st.binary(max_size=200))
def test_garbage_is_frames_or_a_value_error_within_bounded_memory(data: bytes) -> None:
    try:
        _, rest = frames(data)
    except ValueError:
        return
    assert len(rest) < MAX_FRAME


def test_a_recipe_defines_the_layout_and_names_missing_fields() -> None:
    number, layout = recipe(["timestamp", "actual_q", "robot_mode"], b"\x07DOUBLE,VECTOR6D,INT32,")
    assert (number, layout.size) == (7, 8 + 48 + 4)
    with pytest.raises(DeviceFault, match="no_such_thing"):
        recipe(["timestamp", "no_such_thing"], b"\x01DOUBLE,NOT_FOUND")
    for nonsense in (b"", b"\x01DOUBLE", b"\x01DOUBLE,WHAT"):
        with pytest.raises(ValueError):
            recipe(["timestamp", "actual_q"], nonsense)


@settings(deadline=None)
@given(st.text(max_size=80))
def test_dashboard_answers_are_decoded_or_a_device_fault(answer: str) -> None:
    for read in (dashboard.is_remote, dashboard.program_name):
        try:
            read(answer)
        except DeviceFault as e:
            assert e.detail == answer  # noqa: PT017
    assert dashboard.operational_mode(answer, True) in Mode
    version = dashboard.version(answer)
    assert version == "" or version in answer


def test_dashboard_answers_match_the_manual() -> None:
    assert dashboard.is_remote("true")
    assert not dashboard.is_remote("false\n")
    assert dashboard.program_name("PLAYING a b.urp") == "a b.urp"
    assert dashboard.operational_mode("MANUAL", False) is Mode.MANUAL_REDUCED_SPEED
    assert dashboard.operational_mode("AUTOMATIC", True) is Mode.AUTOMATIC_EXTERNAL
    assert dashboard.operational_mode("NONE", True) is Mode.OTHER
    assert dashboard.version("URSoftware 5.12.0.1101319 (Mar 21 2022)") == "5.12.0.1101319"


numbers = st.floats(-1.0, 1.0)


@settings(deadline=None)
@given(numbers, numbers, numbers, numbers, numbers, numbers)
def test_a_pose_survives_conversion_for_the_controller(
    x: float, y: float, z: float, a: float, b: float, c: float
) -> None:
    pose = Pose(Position(x, y, z), Orientation.from_rotation_vector(a, b, c))
    back = from_vector(to_vector(pose))
    assert back.position.distance_to(pose.position) < 1e-12
    assert back.orientation.angle_to(pose.orientation) < 1e-6


def test_the_controller_base_is_base_link_rotated_by_pi() -> None:
    at = world_from_base(Pose(Position(1.0, 2.0, 3.0))) * Pose(Position(0.1, 0.2, 0.3))
    assert at.position.distance_to(Position(0.9, 1.8, 3.3)) < 1e-12


def test_unknown_numbers_are_a_fault_without_power() -> None:
    assert safety_of(1) is Safety.NORMAL
    assert safety_of(99) is Safety.FAULT
    assert (power_of(3), power_of(5), power_of(7)) == (Power.OFF, Power.IDLE_BRAKED, Power.OPERATIONAL)


@settings(deadline=None)
@given(st.floats(0, 10), st.floats(0.01, 3), st.floats(0.05, 20))
def test_the_computed_time_is_the_minimum_for_speed_and_acceleration(d: float, v: float, a: float) -> None:
    took = timing.trapezoid(d, v, a)
    assert took >= d / v - 1e-9
    assert took >= 2.0 * math.sqrt(d / a) - 1e-9
    # The distance is covered exactly by accelerating for half of the time and braking for the other half, never above
    # v.
    top = min(v, a * took / 2.0)
    assert top * took - top * top / a == pytest.approx(d, abs=1e-6)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("host", " "),
        ("payload_mass", 41.0),
        ("payload_mass", math.nan),
        ("tcp_z", 1.5),
        ("max_tcp_speed", 0.0),
        ("max_joint_speed", 4.0),
        ("watchdog_frequency", 2.0),
        ("gripper_output", 18),
        ("part_sensor_input", -2),
        ("stop_deceleration", math.inf),
    ],
)
def test_an_invalid_setting_is_named(name: str, value: float | str) -> None:
    with pytest.raises(OutOfRange, match=name):
        UrSettings(**{"host": "127.0.0.1", name: value})  # type: ignore[arg-type]
