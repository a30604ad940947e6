"""States of the safety system with their remedies, jogging, and differences between controllers."""

import itertools
import math
import statistics
import time
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from arcor2_drivers.universal_robots import timing
from arcor2_drivers.universal_robots.ur5e import UR5e
from arcor2_hw.data.device import Health
from arcor2_hw.data.geometry import Pose, Position
from arcor2_hw.data.robot import Mode, Power, Safety
from arcor2_hw.exceptions import (
    Cancelled,
    InvalidData,
    NotConnected,
    NotFound,
    NotInControl,
    Refused,
    SafetyStop,
)
from arcor2_hw.objects.motion_path import MotionPath
from arcor2_hw.objects.safe_moves import SafeMoves
from tests.waiting import wait_for

from .conftest import BackgroundCall, FakeUr, make, moving


def far_move(robot: UR5e, fake: FakeUr) -> BackgroundCall:
    joints = robot.robot_joints()
    joints[0].value += 2.5
    doing = BackgroundCall(robot.move_to_joints, joints, 0.5)
    moving(fake)
    return doing


def small_move(robot: UR5e) -> None:
    joints = robot.robot_joints()
    joints[0].value += 0.05
    robot.move_to_joints(joints, 0.5)


def switched_on(robot: UR5e) -> None:
    robot.power_on()
    robot.release_brakes()
    robot.take_control()
    small_move(robot)


@pytest.fixture
def whole(fake: FakeUr) -> Iterator[FakeUr]:
    """Return a controller that is set back to running after the test."""
    yield fake
    fake.do("emergency_stop", on=False)
    if fake.truth()["robot_mode"] != "RUNNING":
        fake.do("brake_release")
        fake.control.wait_until(lambda t: t["robot_mode"] == "RUNNING")


@pytest.mark.parametrize("system", [False, True])
def test_an_emergency_stop_switches_power_off_until_a_person_restores_it(
    ready: UR5e, whole: FakeUr, system: bool
) -> None:
    doing = far_move(ready, whole)
    whole.do("emergency_stop", system=system)
    with pytest.raises(SafetyStop) as stop:
        doing.result()
    assert stop.value.kind == "emergency_stop"
    wait_for(lambda: ready.state().power is Power.OFF)
    assert ready.state().safety is Safety.EMERGENCY_STOP
    assert [(alarm.code, bool(alarm.remedy)) for alarm in ready.alarms()] == [("emergency_stop", True)]
    assert ready.health is Health.CHECK_FUNCTION
    with pytest.raises(SafetyStop, match="emergency stop"):
        ready.take_control()
    with pytest.raises(Refused, match="safety mode"):
        ready.power_on()  # the button is still pressed
    with pytest.raises(Refused, match="neither a fault nor a violation"):
        ready.restart_safety("Eva")
    whole.do("emergency_stop", on=False)
    wait_for(lambda: ready.state().safety is Safety.NORMAL)
    time.sleep(0.2)
    assert ready.state().power is Power.OFF, "releasing the button switches nothing on"
    switched_on(ready)


@pytest.mark.parametrize(("command", "safety"), [("violation", Safety.VIOLATION), ("fault", Safety.FAULT)])
def test_a_violation_or_fault_needs_a_safety_restart_on_request(
    ready: UR5e, whole: FakeUr, command: str, safety: Safety
) -> None:
    doing = far_move(ready, whole)
    whole.do(command)
    with pytest.raises(SafetyStop) as stop:
        doing.result()
    assert stop.value.kind == safety.value
    wait_for(lambda: ready.health is Health.FAILURE)
    with pytest.raises(Refused, match="no protective stop"):
        ready.acknowledge_protective_stop("Eva")
    with pytest.raises(InvalidData, match="confirmed_by"):
        ready.restart_safety("")
    ready.restart_safety("Eva")
    state = ready.state()
    assert (state.safety, state.power) == (Safety.NORMAL, Power.OFF)
    switched_on(ready)


def test_reduced_mode_continues_the_motion_and_is_reported(ready: UR5e, fake: FakeUr) -> None:
    fake.do("reduced", on=True)
    wait_for(lambda: ready.state().safety is Safety.REDUCED)
    assert ready.alarms() == []
    small_move(ready)
    fake.do("reduced", on=False)
    wait_for(lambda: ready.state().safety is Safety.NORMAL)


def test_recovery_mode_refuses_commands(ready: UR5e, fake: FakeUr) -> None:
    doing = far_move(ready, fake)
    fake.do("recovery", on=True)
    with pytest.raises(SafetyStop) as stop:
        doing.result()
    assert stop.value.kind == "recovery"
    with pytest.raises(SafetyStop, match="recovery"):
        ready.take_control()
    assert "pendant" in ready.alarms()[0].remedy
    fake.do("recovery", on=False)
    wait_for(lambda: ready.state().safety is Safety.NORMAL)
    ready.take_control()
    small_move(ready)


def test_a_safeguard_stop_ends_a_jog_and_hand_teaching(ready: UR5e, fake: FakeUr) -> None:
    ready.set_hand_teaching_mode(True)
    fake.do("safeguard_stop")
    fake.control.wait_until(lambda t: t["program"] is None)
    wait_for(lambda: ready.control_owner() is None)
    assert not ready.get_hand_teaching_mode()
    fake.do("safeguard_stop", on=False)
    wait_for(lambda: ready.state().safety is Safety.NORMAL)
    ready.take_control()
    ready.jog((0.0, -0.1, 0.0, 0.0, 0.0, 0.0), valid_for=0.8)
    moving(fake)
    fake.do("safeguard_stop")
    fake.control.wait_until(lambda t: not t["moving"] and t["program"] is None)
    with pytest.raises((SafetyStop, NotInControl)):
        ready.jog((0.0, -0.1, 0.0, 0.0, 0.0, 0.0))


def test_local_control_refuses_power_and_safety_commands(ready: UR5e, fake: FakeUr) -> None:
    ready.release_control()
    fake.control.wait_until(lambda t: t["program"] is None)
    fake.do("protective_stop")
    fake.do("remote_control", on=False)
    wait_for(lambda: ready.state().safety is Safety.PROTECTIVE_STOP)
    with pytest.raises(NotInControl, match="local control"):
        ready.acknowledge_protective_stop("Eva")
    with pytest.raises(NotFound):
        ready.acknowledge("nothing")
    assert ready.control_owner() == "pendant"
    fake.do("remote_control", on=True)
    wait_for(lambda: _acknowledged(ready))


def _acknowledged(robot: UR5e) -> bool:
    try:
        robot.acknowledge_protective_stop("Eva")
    except Refused:
        return False
    return True


# ------------------------------------------------------------------------------------------------ jogging
def test_a_late_jog_is_dropped(ready: UR5e, fake: FakeUr) -> None:
    """A jog that waited longer than its validity moves nothing, nor does a jog that was stopped while it waited."""
    session = ready._control.session
    assert session is not None
    taken = len(fake.do("commands_taken"))
    with pytest.raises(Cancelled):
        session.speed("speedJ", [0.5] + [0.0] * 5, 1.0, -0.01, lambda: False)
    with pytest.raises(Cancelled):
        session.speed("speedJ", [0.5] + [0.0] * 5, 1.0, 1.0, lambda: True)
    assert len(fake.do("commands_taken")) == taken
    assert not fake.truth()["moving"]


def await_moved(fake: FakeUr, q: list[float]) -> None:
    """Wait until the arm has left a joint configuration; it may have stopped again."""
    wait_for(lambda: math.dist(fake.truth()["q"], q) > 1e-3)


def test_a_long_jog_delays_neither_the_watchdog_nor_a_stop(
    ready: UR5e, fake: FakeUr, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(timing, "JOG_STOP_TIMEOUT", 10.0)  # on a busy machine the dashboard would stop the arm first
    trips = fake.truth()["watchdog_trips"]
    ready.jog(joint_velocities=[0.3, 0.0, 0.0, 0.0, 0.0, 0.0], valid_for=1.0)
    time.sleep(0.5)
    assert fake.truth()["moving"], "longer than the time of the watchdog"
    ready.stop()
    assert not fake.truth()["moving"]
    assert fake.do("stops")[-1]["via"] == "rtde"
    assert fake.truth()["watchdog_trips"] == trips


def test_a_jog_ends_before_a_safe_move_is_planned(ready: UR5e, fake: FakeUr, monkeypatch: pytest.MonkeyPatch) -> None:
    """Otherwise the arm leaves the start of the path while a busy computer plans it."""
    plan = SafeMoves.to_joints

    def slowly(*arguments: Any, **options: Any) -> MotionPath:
        time.sleep(0.3)
        return plan(*arguments, **options)

    monkeypatch.setattr(SafeMoves, "to_joints", slowly)
    target = ready.robot_joints()
    target[1].value += 0.2
    ready.jog(joint_velocities=[0.3, 0.0, 0.0, 0.0, 0.0, 0.0], valid_for=1.0)
    moving(fake)
    ready.move_to_joints(target, 0.5)
    assert fake.truth()["q"] == pytest.approx([joint.value for joint in target], abs=1e-3)


def test_a_move_ends_a_previous_jog(ready: UR5e, fake: FakeUr) -> None:
    ready.jog(joint_velocities=[0.3, 0.0, 0.0, 0.0, 0.0, 0.0], valid_for=1.0)
    moving(fake)
    target = ready.robot_joints()
    target[1].value += 0.2
    ready.move_to_joints(target, 0.5)
    assert fake.truth()["q"] == pytest.approx([joint.value for joint in target], abs=1e-3)
    ready.jog(joint_velocities=[0.3, 0.0, 0.0, 0.0, 0.0, 0.0], valid_for=1.0)
    here = ready.get_end_effector_pose("tcp")
    ready.move_path([Pose(here.position + Position(0.0, 0.0, 0.05), here.orientation)])
    assert not fake.truth()["moving"]


@pytest.mark.parametrize("frame", ["base", "tool"])
def test_a_jog_follows_its_frame_and_expires(ready: UR5e, fake: FakeUr, frame: str) -> None:
    start, q = ready.get_end_effector_pose("tcp"), fake.truth()["q"]
    ready.jog((0.0, 0.0, 0.1, 0.0, 0.0, 0.0), frame=frame, valid_for=0.3)  # type: ignore[arg-type]
    await_moved(fake, q)
    fake.control.wait_until(lambda t: not t["moving"])
    way = ready.get_end_effector_pose("tcp").position - start.position
    along = Position(0.0, 0.0, 1.0)
    if frame == "tool":
        along = along.rotated(start.orientation)
    length = way.x * along.x + way.y * along.y + way.z * along.z
    assert length > 0.01
    assert way.distance_to(Position(along.x * length, along.y * length, along.z * length)) < 2e-3


def test_single_joints_are_jogged(ready: UR5e, fake: FakeUr) -> None:
    q = fake.truth()["q"]
    ready.jog(joint_velocities=[0.0, 0.0, 0.0, 0.0, 0.0, -0.5], valid_for=0.3)
    await_moved(fake, q)
    fake.control.wait_until(lambda t: not t["moving"])
    turned = [b - a for a, b in zip(q, fake.truth()["q"], strict=True)]
    assert turned[5] < -0.05
    assert max(map(abs, turned[:5])) < 1e-3


# ------------------------------------------------------------------------------------------------ versions
@pytest.mark.parametrize(
    ("version", "rate", "upper"),
    [("3.15", 125.0, True), ("5.4", 500.0, True), ("5.12", 500.0, True), ("10.12", 500.0, False)],
)
def test_every_generation_is_observed_controlled_and_moved(
    start_fake: Callable[..., FakeUr], version: str, rate: float, upper: bool
) -> None:
    fake = start_fake("--controller-version", version, "--frequency", str(rate), "--time-scale", "0.1")
    robot = make(fake.host)
    robot.connect(30.0)
    try:
        assert robot.identify().firmware.startswith(version)
        received = robot.samples_received
        wait_for(lambda: robot.samples_received - received >= rate / 2.0)
        times = [sample.timestamp for sample in robot._observer.ring][-100:]
        periods = [later - earlier for earlier, later in itertools.pairwise(times)]
        assert statistics.median(periods) == pytest.approx(1.0 / rate, rel=0.01)
        assert robot.samples_missed <= 0.02 * rate
        robot.take_control()
        assert fake.truth()["register_offset"] == (24 if upper else 0)
        small_move(robot)
        here = robot.get_end_effector_pose("tcp")
        robot.move_path([Pose(here.position + Position(0.0, -0.05, 0.0), here.orientation)])
        inertia = (0.01, 0.01, 0.01, 0.0, 0.0, 0.0)
        if version in ("3.15", "5.4"):
            with pytest.raises(Refused, match=r"5\.10"):
                robot.set_tool(Pose(), 1.0, (0.0, 0.0, 0.0), inertia)
        else:
            robot.set_tool(Pose(), 1.0, (0.0, 0.0, 0.0), inertia)
        doing = far_move(robot, fake)
        robot.stop()
        with pytest.raises(Cancelled):
            doing.result()
        assert not fake.truth()["moving"]
    finally:
        robot.disconnect()


def test_polyscope_x_refuses_commands_that_need_a_dashboard(start_fake: Callable[..., FakeUr]) -> None:
    fake = start_fake("--controller-version", "10.12", "--powered-off", "--time-scale", "0.1")
    robot = make(fake.host)
    robot.connect(30.0)
    try:
        assert robot.state().mode is Mode.OTHER
        with pytest.raises(Refused, match=r"no dashboard server\. Use the pendant for 'power on'"):
            robot.power_on()
        with pytest.raises(Refused, match="not switched on"):
            robot.take_control()
        fake.do("brake_release")
        wait_for(lambda: robot.state().power is Power.OPERATIONAL)
        fake.do("protective_stop")
        wait_for(lambda: robot.state().safety is Safety.PROTECTIVE_STOP)
        with pytest.raises(Refused, match="pendant"):
            robot.acknowledge_protective_stop("Eva")
    finally:
        robot.disconnect()


def test_an_e_series_controller_without_its_dashboard_is_not_connected(fake: FakeUr) -> None:
    fake.do("refuse", wire="dashboard")
    robot = make(fake.host)
    try:
        with pytest.raises(NotConnected, match=f"{fake.host}:29999"):
            robot.connect(2.0)
    finally:
        fake.do("heal")
        robot.disconnect()
