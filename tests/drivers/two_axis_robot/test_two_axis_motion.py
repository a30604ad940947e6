"""Two-axis robot: settings, kinematics, control, motion, stop, hand teaching."""

import math
import time
from collections.abc import Callable
from typing import Any

import pytest
from hypothesis import given, strategies as st

from arcor2_drivers.two_axis_robot import kinematics
from arcor2_drivers.two_axis_robot.motion import STALL_TIME
from arcor2_drivers.two_axis_robot.settings import TwoAxisRobotSettings
from arcor2_drivers.two_axis_robot.two_axis_robot import TwoAxisRobot
from arcor2_hw.data.device import Connection, Health
from arcor2_hw.data.geometry import Orientation, Pose, Position
from arcor2_hw.data.robot import Joint, MoveEnd, Power
from arcor2_hw.exceptions import Cancelled, DeviceFault, NotConnected, NotInControl, OutOfRange, Refused
from tests.fakes.conftest import FakeProcess
from tests.waiting import wait_for

from .conftest import BackgroundCall, moving, standing

WRONG = [
    ("port", " "),
    ("baud_rate", 12345),
    ("id_1", 253),
    ("id_2", 1),
    ("direction_2", 0),
    ("homing_offset_1", 2.0),
    ("link_2", 0.0),
    ("upper_1", -3.0),
    ("max_joint_speed", math.nan),
    ("watchdog", 1.0),
    ("current_limit", 9.0),
]


def joints(a: float, b: float) -> list[Joint]:
    return [Joint("joint_1", a), Joint("joint_2", b)]


@pytest.mark.parametrize(("name", "value"), WRONG, ids=[name for name, _ in WRONG])
def test_an_invalid_setting_is_named(name: str, value: Any) -> None:
    settings: dict[str, Any] = {"port": "/dev/ttyUSB0", name: value}
    with pytest.raises(OutOfRange, match=name if name != "upper_1" else "lower_1"):
        TwoAxisRobotSettings(**settings)


@given(st.floats(-3.1, 3.1), st.floats(-3.1, 3.1), st.floats(0.01, 1.0), st.floats(0.01, 1.0))
def test_inverse_kinematics_inverts_forward_kinematics(q1: float, q2: float, first: float, second: float) -> None:
    x, y, _ = kinematics.forward((first, second), (q1, q2))
    solutions = kinematics.inverse((first, second), x, y)
    assert 1 <= len(solutions) <= 2
    for solution in solutions:
        at = kinematics.forward((first, second), solution)
        assert math.hypot(at[0] - x, at[1] - y) < 1e-6
    if abs(math.sin(q2)) > 0.01 and math.hypot(x, y) > 1e-3:
        wide = ((-math.pi, math.pi),) * 2
        near = kinematics.nearest(solutions, (q1, q2), wide)
        assert near is not None
        assert math.hypot(near[0] - q1, near[1] - q2) < 1e-3


def test_the_elbow_is_on_the_side_of_the_seed(fake: FakeProcess, make: Callable[..., TwoAxisRobot]) -> None:
    turned = Pose(Position(1.0, 2.0, 0.5), Orientation.from_rotation_vector(0.0, 0.0, math.pi / 2))
    robot = make(fake.ready["port"], turned, link_1=0.2, link_2=0.1)
    straight = robot.forward_kinematics("tcp", joints(0.0, 0.0))
    assert straight.position.distance_to(Position(1.0, 2.3, 0.5)) < 1e-9
    target = robot.forward_kinematics("tcp", joints(0.3, 1.0))
    left = robot.inverse_kinematics("tcp", target, joints(0.2, 0.8))
    right = robot.inverse_kinematics("tcp", target, joints(0.2, -0.8))
    assert [round(joint.value, 9) for joint in left] == [0.3, 1.0]
    assert right[1].value == pytest.approx(-1.0)
    for far in (Position(1.0, 2.4, 0.5), Position(1.0, 2.05, 0.5), Position(1.0, 2.2, 0.6)):
        with pytest.raises(TwoAxisRobot.KinematicsException, match="arm"):
            robot.inverse_kinematics("tcp", Pose(far, target.orientation), joints(0.0, 0.0))
    over = target.orientation * Orientation.from_rotation_vector(math.pi, 0.0, 0.0)
    with pytest.raises(TwoAxisRobot.KinematicsException, match="plane"):
        robot.inverse_kinematics("tcp", Pose(target.position, over), joints(0.0, 0.0))


def test_connecting_observes_and_writes_nothing(fake: FakeProcess, robot: TwoAxisRobot) -> None:
    fake.control.do("place", servo=2, ticks=1024)
    robot.connect()
    wait_for(lambda: abs(robot.robot_joints()[1].value + math.pi / 2) <= 1e-9)
    assert robot.connection is Connection.ONLINE
    assert robot.health is Health.NORMAL
    assert robot.identify().model == "XM430-W350 + XM430-W350"
    state = robot.state()
    assert state.power is Power.OFF
    assert state.not_ready_because == ["control is not taken"]
    with pytest.raises(NotInControl):
        robot.move_to_joints(joints(0.1, 0.1), 0.5)
    robot.stop()
    robot.disconnect()
    robot.disconnect()
    assert robot.connection is Connection.OFFLINE
    truth = fake.truth()
    assert all(servo["writes"] == [] for servo in truth["servos"].values())
    with pytest.raises(NotConnected):
        robot.robot_joints()


def test_a_complete_cycle(fake: FakeProcess, make: Callable[..., TwoAxisRobot]) -> None:
    fake.control.do("place", servo=1, ticks=2500)
    robot = make(fake.ready["port"], homing_offset_1=0.1, current_limit=0.5, direction_2=-1)
    robot.connect()
    robot.take_control()
    robot.take_control()
    first, second = fake.truth()["servos"]["1"], fake.truth()["servos"]["2"]
    assert [name for name, _ in first["writes"] if name != "led"] == [  # written to feed the watchdog
        "homing_offset", "current_limit", "watchdog", "goal", "watchdog", "torque",
    ]  # fmt: skip
    assert first["homing_offset"] == 65
    assert first["current_limit"] == 186
    assert first["ticks"] == first["goal"] == 2565  # the joint did not jump
    assert first["watchdog"] == 20
    robot.move_to_joints(joints(-0.5, 0.7), 1.0)
    truth = fake.truth()["servos"]
    assert truth["1"]["angle"] == pytest.approx(-0.5, abs=0.002)
    assert truth["2"]["angle"] == pytest.approx(-0.7, abs=0.002)
    assert robot.last_move is not None
    assert robot.last_move.end is MoveEnd.DONE
    target = Pose(Position(0.18, 0.05, 0.0))
    robot.move(target, 1.0, 1.0)
    assert robot.get_end_effector_pose("tcp").position.distance_to(target.position) < 0.0005
    with pytest.raises(Refused, match="straight line"):
        robot.move_to_pose("tcp", target, 0.5)
    robot.release_control()
    truth = fake.truth()["servos"]
    assert [servo["watchdog"] for servo in truth.values()] == [0, 0]
    assert [servo["torque"] for servo in truth.values()] == [1, 1]
    assert robot.control_owner() is None
    assert second["writes"][0][0] == "current_limit"


def test_both_joints_arrive_together(fake: FakeProcess, ready: TwoAxisRobot) -> None:
    doing = BackgroundCall(ready.move_to_joints, joints(1.2, 0.6), 0.6)
    moving(fake)
    halfway = fake.control.wait_until(lambda t: t["servos"]["1"]["angle"] > 0.6)["servos"]
    assert halfway["2"]["angle"] == pytest.approx(halfway["1"]["angle"] / 2, rel=0.15)
    with pytest.raises(Refused, match="moving already"):
        ready.move_to_joints(joints(0.0, 0.0), 0.5)
    doing.result()


@pytest.mark.parametrize("phase", [0.05, 0.8])
def test_stop_overtakes_the_move(fake: FakeProcess, ready: TwoAxisRobot, phase: float) -> None:
    doing = BackgroundCall(ready.move_to_joints, joints(2.0, -2.0), 1.0)
    moving(fake)
    fake.control.wait_until(lambda t: t["servos"]["1"]["angle"] > 2.0 * phase)
    at = fake.truth()["servos"]["1"]["angle"]
    ready.stop()
    truth = fake.truth()
    assert standing(truth)
    assert truth["servos"]["1"]["angle"] < 2.0
    assert truth["servos"]["1"]["angle"] >= at
    with pytest.raises(Cancelled):
        doing.result()
    assert ready.last_move is not None
    assert ready.last_move.end is MoveEnd.STOPPED
    ready.check_if_ready_to_move()  # a stop does not end control


def test_bad_input_is_refused_before_anything_moves(fake: FakeProcess, ready: TwoAxisRobot) -> None:
    for wrong in (joints(2.7, 0.0), joints(math.nan, 0.0)):
        with pytest.raises(OutOfRange, match="joint_1"):
            ready.move_to_joints(wrong, 0.5)
    with pytest.raises(TwoAxisRobot.KinematicsException, match="joint_2"):
        ready.move_to_joints(joints(0.0, 0.0)[:1], 0.5)
    for speed in (0.0, 1.1, math.nan):
        with pytest.raises(OutOfRange, match="speed"):
            ready.move_to_joints(joints(0.1, 0.1), speed)
    assert all(abs(servo["angle"]) < 1e-9 for servo in fake.truth()["servos"].values())


def test_hand_teaching(fake: FakeProcess, ready: TwoAxisRobot) -> None:
    ready.set_hand_teaching_mode(True)
    assert ready.get_hand_teaching_mode()
    fake.control.do("place", servo=1, ticks=2348)
    with pytest.raises(Refused, match="hand teaching"):
        ready.move_to_joints(joints(0.0, 0.0), 0.5)
    ready.set_hand_teaching_mode(False)
    servo = fake.truth()["servos"]["1"]
    assert servo["torque"] == 1
    assert servo["goal"] == servo["ticks"] == 2348
    ready.move_to_joints(joints(0.3, 0.0), 1.0)


def angles(fake: FakeProcess) -> list[float]:
    return [fake.truth()["servos"][number]["angle"] for number in ("1", "2")]


def test_a_jog_expires_unless_renewed(fake: FakeProcess, ready: TwoAxisRobot) -> None:
    ready.move_to_joints(joints(0.0, 1.0), 0.5)
    began = time.monotonic()
    for _ in range(5):
        ready.jog(joint_velocities=[0.4, 0.0], valid_for=0.5)
        time.sleep(0.1)
    renewed = time.monotonic() - began
    fake.control.wait_until(standing)
    lasted = time.monotonic() - began
    first, second = angles(fake)
    assert 0.4 * renewed * 0.6 < first < 0.4 * lasted + 0.05
    assert second == pytest.approx(1.0, abs=0.03)


def test_a_jog_along_the_axes_of_a_frame(fake: FakeProcess, ready: TwoAxisRobot) -> None:
    ready.move_to_joints(joints(0.3, 1.2), 0.5)
    for frame, axis in (("base", (1.0, 0.0)), ("tool", (math.cos(1.5), math.sin(1.5)))):
        before = ready.forward_kinematics("tcp", ready.robot_joints()).position
        at = angles(fake)
        ready.jog((0.05, 0.0, 0.0, 0.0, 0.0, 0.0), frame=frame, valid_for=0.3)  # type: ignore[arg-type]
        wait_for(lambda at=at: math.dist(angles(fake), at) > 0.01)
        fake.control.wait_until(standing)
        moved = ready.get_end_effector_pose("tcp").position - before
        way = math.hypot(moved.x, moved.y)
        assert 0.008 < way < 0.1
        assert (moved.x * axis[0] + moved.y * axis[1]) / way > 0.95
        ready.move_to_joints(joints(0.3, 1.2), 0.5)


def test_a_jog_ends_at_the_limit_and_by_a_stop(fake: FakeProcess, ready: TwoAxisRobot) -> None:
    ready.move_to_joints(joints(2.55, 1.0), 0.8)
    ready.jog(joint_velocities=[1.0, 0.0], valid_for=0.5)
    wait_for(lambda: angles(fake)[0] > 2.57)
    fake.control.wait_until(standing)
    assert angles(fake)[0] == pytest.approx(2.6, abs=0.02)
    ready.jog(joint_velocities=[-0.5, 0.0], valid_for=1.0)
    fake.control.wait_until(lambda truth: abs(truth["servos"]["1"]["speed"]) > 0.1)
    ready.stop()
    assert angles(fake)[0] > 2.2


def test_invalid_jogs_are_refused(ready: TwoAxisRobot) -> None:
    ready.move_to_joints(joints(0.0, 1.0), 0.8)
    for twist in ((0.0, 0.0, 0.1, 0.0, 0.0, 0.0), (0.1, 0.0, 0.0, 0.0, 0.0, 0.1)):
        with pytest.raises(Refused, match="plane"):
            ready.jog(twist)
    for wrong in ({}, {"joint_velocities": [0.1]}, {"joint_velocities": [99.0, 0.0]}):
        with pytest.raises(OutOfRange):
            ready.jog(**wrong)  # type: ignore[arg-type]
    with pytest.raises(Refused, match="cannot be jogged in frame 'user'"):
        ready.jog((0.1, 0.0, 0.0, 0.0, 0.0, 0.0), frame="user")
    ready.move_to_joints(joints(0.0, 0.0), 0.8)
    with pytest.raises(Refused, match="stretched"):
        ready.jog((0.1, 0.0, 0.0, 0.0, 0.0, 0.0))
    ready.release_control()
    with pytest.raises(NotInControl):
        ready.jog(joint_velocities=[0.1, 0.0])


def test_the_slowest_move_does_not_count_as_standstill(fake: FakeProcess, ready: TwoAxisRobot) -> None:
    ready.move_to_joints(joints(0.045, 0.0), 0.01, safe=False)
    assert fake.truth()["servos"]["1"]["angle"] == pytest.approx(0.045, abs=math.radians(1.2))


def test_a_late_state_does_not_count_as_standstill(
    fake: FakeProcess, ready: TwoAxisRobot, monkeypatch: pytest.MonkeyPatch
) -> None:
    observer = ready._observer
    fresh, calls = observer.fresh, 0

    def late() -> Any:
        nonlocal calls
        calls += 1
        snapshot = fresh()
        if calls == 3:  # the first state after the servos accepted their goals
            time.sleep(1.5 * STALL_TIME)
        return snapshot

    monkeypatch.setattr(observer, "fresh", late)
    ready.move_to_joints(joints(0.5, 0.5), 1.0, safe=False)
    assert calls > 3
    assert fake.truth()["servos"]["2"]["angle"] == pytest.approx(0.5, abs=math.radians(1.2))


def test_a_joint_that_stops_short_of_its_goal_is_named(ready: TwoAxisRobot, monkeypatch: pytest.MonkeyPatch) -> None:
    observer = ready._observer
    fresh, position = observer.fresh, observer.fresh().value.servos[1].position

    def blocked() -> Any:
        snapshot = fresh()
        first, second = snapshot.value.servos
        servos = first, second._replace(position=position)
        return snapshot._replace(value=snapshot.value._replace(servos=servos))

    monkeypatch.setattr(observer, "fresh", blocked)
    with pytest.raises(DeviceFault, match="joint_2 of arm stopped short") as caught:
        ready.move_to_joints(joints(0.3, 0.3), 1.0, safe=False)
    assert caught.value.fault_code == "short_of_goal"
