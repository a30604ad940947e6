"""Control of a UR: moves, stops, no motion resumes by itself, the watchdog of the controller."""

import math
import signal
import threading
import time
from collections.abc import Callable
from concurrent.futures import Future
from typing import Any

import psutil
import pytest

from arcor2_drivers.universal_robots import timing
from arcor2_drivers.universal_robots.control_client import ControlClient
from arcor2_drivers.universal_robots.motion import Budget
from arcor2_drivers.universal_robots.move_actions import MoveType
from arcor2_drivers.universal_robots.observer import Sample
from arcor2_drivers.universal_robots.session import ControlSession
from arcor2_drivers.universal_robots.ur5e import UR5e
from arcor2_hw.data.geometry import Orientation, Pose, Position
from arcor2_hw.data.robot import Joint, Mode, MoveEnd, ProgramState
from arcor2_hw.exceptions import (
    Cancelled,
    ConnectionLost,
    DeviceError,
    DeviceFault,
    DeviceTimeout,
    InvalidData,
    NotInControl,
    OutOfRange,
    Refused,
    SafetyStop,
    Stale,
)
from tests.waiting import wait_for

from .conftest import BackgroundCall, FakeUr, make, moving


def turned(robot: UR5e, by: float, joint: int = 0) -> list[Joint]:
    joints = robot.robot_joints()
    joints[joint].value += by
    return joints


def shifted(robot: UR5e, y: float) -> Pose:
    here = robot.get_end_effector_pose("tcp")
    return Pose(here.position + Position(0.0, y, 0.0), here.orientation)


def far_move(robot: UR5e, fake: FakeUr, speed: float = 0.5) -> BackgroundCall:
    """Start a long joint move and wait until the arm moves."""
    doing = BackgroundCall(robot.move_to_joints, turned(robot, 3.0), speed)
    moving(fake)
    return doing


def await_standstill(fake: FakeUr) -> None:
    fake.control.wait_until(lambda t: not t["moving"])


def stays(fake: FakeUr, seconds: float = 0.6) -> None:
    q = fake.truth()["q"]
    until = time.monotonic() + seconds
    while time.monotonic() < until:
        assert fake.truth()["q"] == q
        time.sleep(0.02)


# ------------------------------------------------------------------------------------------------ taking control
def test_the_pose_is_that_of_our_tool_before_control_is_taken(fake: FakeUr) -> None:
    """Otherwise a target computed from the pose before the first motion would be off by the length of the tool."""
    robot = make(fake.host, tcp_z=0.25, tcp_x=0.02)
    robot.connect(30.0)
    try:
        before = robot.get_end_effector_pose("tcp")
        robot.take_control()
        after = robot.get_end_effector_pose("tcp")
    finally:
        robot.disconnect()
    assert before.position.distance_to(after.position) < 1e-3
    assert before.orientation.angle_to(after.orientation) < 1e-3


def test_control_is_taken_after_a_program_that_is_ending(
    robot: UR5e, fake: FakeUr, monkeypatch: pytest.MonkeyPatch
) -> None:
    fake.do("foreign_program", on=True)
    wait_for(lambda: robot.state().program is ProgramState.FOREIGN)
    pendant = robot._control._pendant
    state = pendant.state

    def ending(**options: Any) -> Any:
        fake.do("foreign_program", on=False)  # after the sample that shows it
        return state(**options)

    monkeypatch.setattr(pendant, "state", ending)
    robot.take_control()
    assert robot.control_owner() == "us"


def test_disconnecting_waits_for_the_last_stop_of_an_ended_session(
    ready: UR5e, fake: FakeUr, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Otherwise this stop would end the program of the next client that takes control."""
    stop = ControlSession._last_stop

    def late(session: ControlSession) -> None:
        if session.ended is not None:
            time.sleep(0.3)
        stop(session)

    monkeypatch.setattr(ControlSession, "_last_stop", late)
    session = ready._control.session
    assert session is not None
    fake.do("safeguard_stop", on=True)
    wait_for(lambda: session.ended)
    ready.disconnect()
    assert session._guard is not None
    assert not session._guard.is_alive()


def test_a_late_signal_is_not_the_reason_when_the_arm_has_no_power(
    ready: UR5e, fake: FakeUr, monkeypatch: pytest.MonkeyPatch
) -> None:
    request = ControlClient.request

    def late(client: ControlClient, command: str, arguments: tuple[Any, ...]) -> "Future[Any]":
        if command != "was_late":
            return request(client, command, arguments)
        answer = Future[Any]()
        answer.set_result(True)
        return answer

    monkeypatch.setattr(ControlClient, "request", late)
    session = ready._control.session
    assert session is not None
    fake.do("power", on=False)
    wait_for(lambda: session.ended)
    fake.do("brake_release")
    fake.control.wait_until(lambda t: t["robot_mode"] == "RUNNING")
    assert type(session.ended) is NotInControl


def test_control_is_taken_and_released(robot: UR5e, fake: FakeUr) -> None:
    with pytest.raises(NotInControl, match="not taken"):
        robot.move_to_joints(robot.robot_joints(), 0.5)
    assert robot.control_owner() is None
    robot.take_control()
    robot.take_control()
    truth = fake.truth()
    assert robot.control_owner() == "us"
    assert robot.state().program is ProgramState.PLAYING
    assert truth["watchdog"]
    assert truth["payload"] == pytest.approx(1.0)
    assert truth["tcp_offset"] == pytest.approx([0, 0, 0.1, 0, 0, 0])
    robot.release_control()
    robot.release_control()
    fake.control.wait_until(lambda t: t["program"] is None)
    assert fake.truth()["watchdog_trips"] == truth["watchdog_trips"], "the program was ended in order"


def test_reasons_against_control_are_named(robot: UR5e, fake: FakeUr) -> None:
    fake.do("remote_control", on=False)
    with pytest.raises(NotInControl, match="local control"):
        robot.take_control()
    fake.do("remote_control", on=True)
    fake.do("safeguard_stop")
    wait_for(lambda: robot.state().safety.value == "safeguard_stop")
    with pytest.raises(SafetyStop, match="safeguard stop") as stop:
        robot.take_control()
    assert stop.value.kind == "safeguard_stop"
    assert fake.truth()["program"] is None


def test_control_is_refused_without_a_payload(fake: FakeUr) -> None:
    robot = make(fake.host, payload_mass=-1.0)
    robot.connect(30.0)
    try:
        with pytest.raises(Refused, match="payload_mass"):
            robot.take_control()
        with pytest.raises(Refused, match="payload_mass"):
            robot.set_hand_teaching_mode(True)
    finally:
        robot.disconnect()


def test_control_is_taken_although_this_computer_was_busy(
    robot: UR5e, fake: FakeUr, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The control process does not run from arming the watchdog until its first commands wait."""
    trips, stopped = fake.truth()["watchdog_trips"], []
    open_session = ControlSession.open

    def busy(session: ControlSession, timeout: float, dashboard: bool) -> None:
        open_session(session, timeout, dashboard)
        if not stopped:
            assert session._process is not None
            stopped.append(psutil.Process(session._process.pid))
            stopped[0].suspend()
            fake.control.wait_until(lambda t: t["watchdog_trips"] > trips)
            threading.Timer(0.2, stopped[0].resume).start()

    monkeypatch.setattr(ControlSession, "open", busy)
    robot.take_control()
    assert fake.truth()["watchdog_trips"] == trips + 1
    assert robot.control_owner() == "us"
    robot.move_to_joints(turned(robot, 0.1), 0.5)


def test_registers_in_use_are_named(fake: FakeUr) -> None:
    fake.do("fieldbus", on=True)
    robot = make(fake.host)  # with this controller's version, ur_rtde can use only the lower registers
    robot.connect(30.0)
    try:
        with pytest.raises(NotInControl, match="0 to 23"):
            robot.take_control()
    finally:
        robot.disconnect()


def test_the_upper_registers_do_not_affect_a_fieldbus(start_fake: Callable[..., FakeUr]) -> None:
    fake = start_fake("--controller-version", "5.12")
    fake.do("fieldbus", on=True)
    robot = make(fake.host)
    robot.connect(30.0)
    try:
        robot.take_control()
        assert fake.truth()["register_offset"] == 24
        robot.move_to_joints(turned(robot, 0.2), 0.5)
        assert fake.truth()["q"][0] == pytest.approx(0.2, abs=1e-3)
    finally:
        robot.disconnect()


def test_power_and_brakes_are_separate_commands(start_fake: Callable[..., FakeUr]) -> None:
    fake = start_fake("--powered-off", "--time-scale", "0.1")
    robot = make(fake.host)
    robot.connect(30.0)
    try:
        with pytest.raises(Refused, match="not switched on"):
            robot.take_control()
        with pytest.raises(Refused, match="no power"):
            robot.release_brakes()
        robot.power_on()
        assert fake.truth()["robot_mode"] == "IDLE"
        robot.release_brakes()
        assert fake.truth()["robot_mode"] == "RUNNING"
        robot.take_control()
    finally:
        robot.disconnect()


# ------------------------------------------------------------------------------------------------ moving
def test_joint_moves_arrive(ready: UR5e, fake: FakeUr) -> None:
    target = turned(ready, 0.4)
    ready.move_to_joints(list(reversed(target)), 0.8)
    assert fake.truth()["q"] == pytest.approx([joint.value for joint in target], abs=1e-3)
    assert ready.last_move is not None
    assert (ready.last_move.end, ready.last_move.speed) == (MoveEnd.DONE, pytest.approx(0.8))
    assert ready.last_move.pose.position.distance_to(ready.get_end_effector_pose("tcp").position) < 1e-6


def test_a_linear_move_has_the_requested_speed(ready: UR5e, fake: FakeUr) -> None:
    start = ready.get_end_effector_pose("tcp")
    target = Pose(start.position + Position(0.0, -0.3, -0.1), start.orientation)
    doing = BackgroundCall(ready.move_to_pose, "tcp", target, 0.25)
    seen = []
    while fake.truth()["moving"] or not seen or len(seen) < 20:
        seen.append(ready.get_end_effector_pose("tcp").position)
        time.sleep(0.01)
    doing.result()
    away = start.position.distance_to(target.position)
    for at in seen:
        detour = start.position.distance_to(at) + at.distance_to(target.position) - away
        assert detour < 1e-4
    assert ready.get_end_effector_pose("tcp").position.distance_to(target.position) < 1e-3
    assert ready.last_move is not None
    assert ready.last_move.duration >= away / 0.25


def test_joint_moves_to_a_pose_use_the_controllers_kinematics(ready: UR5e) -> None:
    start = ready.get_end_effector_pose("tcp")
    target = Pose(start.position + Position(0.05, 0.2, 0.1), start.orientation)
    ready.move(target, MoveType.JOINT, 0.8)
    assert ready.get_end_effector_pose("tcp").position.distance_to(target.position) < 1e-3
    joints = ready.inverse_kinematics("tcp", start)
    assert ready.forward_kinematics("tcp", joints).position.distance_to(start.position) < 1e-6
    with pytest.raises(UR5e.KinematicsException, match="cannot reach"):
        ready.move_to_pose("tcp", Pose(Position(3.0, 0.0, 0.0)), 0.5)
    ready.move_to_joints(turned(ready, 0.1), 0.8)  # an unreachable pose does not end the control program


def test_a_denial_of_the_library_is_checked_once_more(robot: UR5e, monkeypatch: pytest.MonkeyPatch) -> None:
    """On a busy computer it rejects commands that the controller would accept. Repeatable commands are repeated."""
    denied = ["setTcp", "setPayload", "getInverseKinematicsHasSolution"]
    call = ControlSession.call

    def deny_once(session: ControlSession, what: str, command: str, *arguments: Any, **options: Any) -> Any:
        if command in denied:
            denied.remove(command)
            return False
        return call(session, what, command, *arguments, **options)

    monkeypatch.setattr(ControlSession, "call", deny_once)
    robot.take_control()
    pose = robot.get_end_effector_pose("tcp")
    joints = robot.inverse_kinematics("tcp", pose)
    assert robot.forward_kinematics("tcp", joints).position.distance_to(pose.position) < 1e-6
    assert denied == []


def test_bad_input_is_refused_before_anything_moves(ready: UR5e, fake: FakeUr) -> None:
    q = fake.truth()["q"]
    with pytest.raises(OutOfRange, match="speed"):
        ready.move_to_joints(ready.robot_joints(), 1.5)
    with pytest.raises(OutOfRange, match="speed"):
        ready.move_to_joints(ready.robot_joints(), math.nan)
    with pytest.raises(InvalidData, match="elbow_joint"):
        ready.move_to_joints(ready.robot_joints()[:5], 0.5)
    with pytest.raises(OutOfRange, match="shoulder_pan_joint"):
        ready.move_to_joints(turned(ready, 9.0), 0.5)
    with pytest.raises(OutOfRange, match="finite"):
        ready.move_to_pose("tcp", Pose(Position(math.nan, 0.0, 0.0)), 0.5)
    assert fake.truth()["q"] == q


def test_one_motion_at_a_time(ready: UR5e, fake: FakeUr) -> None:
    doing = far_move(ready, fake)
    with pytest.raises(Refused, match="moving already"):
        ready.move_to_joints(ready.robot_joints(), 0.5)
    wait_for(lambda: ready.state().moving)
    ready.stop()
    with pytest.raises(Cancelled):
        doing.result()


def test_manual_mode_limits_the_tcp_speed(ready: UR5e, fake: FakeUr) -> None:
    fake.do("operational_mode", mode="MANUAL")
    wait_for(lambda: ready.state().mode is Mode.MANUAL_REDUCED_SPEED)
    speeds = []
    for move in (
        lambda: ready.move_to_joints(turned(ready, 0.08), 1.0),
        lambda: ready.move_to_pose("tcp", shifted(ready, y=-0.15), 1.0),
    ):
        started = ready._observer.sample().timestamp
        move()
        samples = [sample for sample in tuple(ready._observer.ring) if sample.timestamp >= started]
        for first, last in zip(samples, samples[25:], strict=False):  # by the controller's clock
            way = math.dist(first.tcp[:3], last.tcp[:3])
            speeds.append(way / (last.timestamp - first.timestamp))
    assert 0.15 < max(speeds) < 0.28
    with pytest.raises(OutOfRange, match="twist"):
        ready.jog((0.3, 0.0, 0.0, 0.0, 0.0, 0.0))


def test_a_low_speed_slider_extends_the_move_timeout(
    ready: UR5e, fake: FakeUr, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(timing, "DURATION_MARGIN", 0.2)
    fake.do("speed_slider", fraction=0.2)
    ready.move_to_joints(turned(ready, 0.15), 0.5)  # five times as long as at full speed, with a tolerance of 50 %
    assert fake.truth()["q"][0] == pytest.approx(0.15, abs=1e-3)


def test_the_move_timeout_elapses_by_the_controllers_clock() -> None:
    budget = Budget(0.1)

    def exceeded(timestamp: float, slider: float = 1.0) -> bool:
        still = ((0.0,) * 6,) * 4
        return budget.exceeded(Sample(timestamp, time.monotonic(), *still, 7, 1, 2, slider, 0, 0, 0, 0, 0, 0))

    assert not exceeded(5.0)
    time.sleep(0.2)  # this process is delayed
    assert not exceeded(5.09)
    assert not exceeded(5.13, slider=0.2)
    assert exceeded(5.14)


def test_a_move_that_exceeds_its_time_is_stopped(ready: UR5e, fake: FakeUr, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(timing, "DURATION_MARGIN", 0.1)
    monkeypatch.setattr(timing, "DURATION_FACTOR", 0.1)
    with pytest.raises(DeviceTimeout, match="computed time"):
        ready.move_to_joints(turned(ready, 2.0), 0.5)
    await_standstill(fake)
    assert fake.truth()["q"][0] < 1.5
    stays(fake, 0.3)


# ------------------------------------------------------------------------------------------------ stopping
def test_stop_overtakes_the_move_and_reports_the_result(
    ready: UR5e, fake: FakeUr, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(
        timing, "STOP_REACTION_TIMEOUT", 10.0
    )  # on a busy machine the dashboard would stop the arm first
    for _ in range(5):
        doing = far_move(ready, fake)
        ready.stop()
        with pytest.raises(Cancelled, match="stopped"):
            doing.result()
        assert not fake.truth()["moving"], "stop returns at standstill"
        assert fake.do("stops")[-1]["code"] == 33, "the control program did not stop it"
        fake.do("place", q=[0.0, *fake.truth()["q"][1:]])
        time.sleep(0.05)
    assert ready.last_move is not None
    assert ready.last_move.end is MoveEnd.STOPPED
    assert ready.control_owner() == "us"
    stays(fake, 0.3)
    ready.move_to_joints(turned(ready, 0.1), 0.5)


def test_the_dashboard_stops_when_the_control_process_hangs(ready: UR5e, fake: FakeUr) -> None:
    doing = far_move(ready, fake)
    children = [child for child in psutil.Process().children() if "control_process" in " ".join(child.cmdline())]
    assert len(children) == 1
    children[0].send_signal(signal.SIGSTOP)
    ready.stop()
    with pytest.raises(DeviceError):
        doing.result()
    await_standstill(fake)
    assert fake.do("stops")[-1]["via"] == "dashboard"
    fake.control.wait_until(lambda t: t["program"] is None)
    ready.move_to_joints(turned(ready, 0.1), 0.5)  # a stop by this client does not end control


def test_a_stop_cancels_a_motion_that_waits(ready: UR5e, fake: FakeUr) -> None:
    taken = len(fake.do("commands_taken"))
    guard = ready._control.stops.guard()
    ready._control.stops.request()
    with pytest.raises(Cancelled):
        ready._control.session.call(  # type: ignore[union-attr]
            "a move", "moveJ", [0.0] * 6, 0.5, 0.5, True, stopped=guard.stopped
        )
    assert len(fake.do("commands_taken")) == taken


# ------------------------------------------------------------------------------------------------ safety
def test_after_a_safeguard_stop_nothing_moves_until_a_new_command(ready: UR5e, fake: FakeUr) -> None:
    doing = far_move(ready, fake)
    fake.do("safeguard_stop")
    with pytest.raises(SafetyStop) as stop:
        doing.result()
    assert stop.value.kind == "safeguard_stop"
    assert ready.last_move is not None
    assert ready.last_move.end is MoveEnd.SAFETY
    fake.control.wait_until(lambda t: not t["moving"] and t["program"] is None)
    fake.do("safeguard_stop", on=False)
    stays(fake)
    with pytest.raises(NotInControl, match="safeguard stop"):
        ready.move_to_joints(turned(ready, 0.1), 0.5)
    ready.take_control()
    ready.move_to_joints(turned(ready, 0.1), 0.5)


def test_without_a_dashboard_the_watchdog_ends_the_program_after_a_safeguard_stop(
    start_fake: Callable[..., FakeUr],
) -> None:
    fake = start_fake("--controller-version", "10.12")  # PolyScope X
    robot = make(fake.host)
    robot.connect(30.0)
    try:
        assert robot.identify().firmware.startswith("10.12")
        robot.take_control()
        robot.move_to_joints(turned(robot, 0.1), 0.5)
        doing = far_move(robot, fake)
        fake.do("safeguard_stop")
        with pytest.raises(SafetyStop):
            doing.result()
        fake.control.wait_until(lambda t: not t["moving"] and t["program"] is None)
        fake.do("safeguard_stop", on=False)
        stays(fake)
        with pytest.raises(Refused, match="pendant"):
            robot._pendant.do("stop", "Stopped")
        wait_for(lambda: robot.state().safety.value == "normal")
        robot.take_control()
        doing = far_move(robot, fake)
        robot.stop()
        with pytest.raises(Cancelled):
            doing.result()
    finally:
        robot.disconnect()


def test_a_protective_stop_is_acknowledged_only_on_request(ready: UR5e, fake: FakeUr) -> None:
    doing = far_move(ready, fake)
    fake.do("protective_stop")
    with pytest.raises(SafetyStop) as stop:
        doing.result()
    assert stop.value.kind == "protective_stop"
    fake.control.wait_until(lambda t: not t["moving"])
    with pytest.raises(SafetyStop):
        ready.take_control()
    with pytest.raises(InvalidData, match="confirmed_by"):
        ready.acknowledge_protective_stop(" ")
    with pytest.raises(Refused, match="5s"):
        ready.acknowledge_protective_stop("Eva")  # too early: the message of the controller
    with pytest.raises(Refused, match="acknowledge_protective_stop"):
        ready.acknowledge("protective_stop")
    assert fake.truth()["safety"] == "PROTECTIVE_STOP"

    def acknowledged() -> bool:
        try:
            ready.acknowledge_protective_stop("Eva")
        except Refused:
            return False
        return True

    wait_for(acknowledged)
    assert fake.truth()["safety"] == "NORMAL"
    stays(fake)
    assert ready.control_owner() is None
    ready.take_control()
    ready.move_to_joints(turned(ready, 0.1), 0.5)


def test_hand_teaching(ready: UR5e, fake: FakeUr) -> None:
    ready.set_hand_teaching_mode(True)
    assert ready.get_hand_teaching_mode()
    assert fake.truth()["freedrive"]
    with pytest.raises(Refused, match="hand teaching"):
        ready.move_to_joints(ready.robot_joints(), 0.5)
    ready.stop()
    assert not ready.get_hand_teaching_mode()
    assert not fake.truth()["freedrive"]


def test_a_jog_expires(ready: UR5e, fake: FakeUr) -> None:
    start = ready.get_end_effector_pose("tcp").position

    def jogs() -> bool:
        ready.jog((0.0, -0.1, 0.0, 0.0, 0.0, 0.0), valid_for=0.5)
        time.sleep(0.1)
        return bool(fake.truth()["moving"])

    for _ in range(5):
        wait_for(jogs)
    await_standstill(fake)
    way = ready.get_end_effector_pose("tcp").position - start
    assert way.y < -0.03
    assert abs(way.x) + abs(way.z) < 0.005
    assert ready.control_owner() == "us"


# ------------------------------------------------------------------------------------------------ connection losses
@pytest.mark.parametrize("fault", ["silence", "reset", "half_frame"])
def test_a_cable_cut_during_a_move(ready: UR5e, fake: FakeUr, fault: str) -> None:
    doing = far_move(ready, fake)
    scripts = fake.truth()["scripts_taken"]
    fake.do(fault)
    with pytest.raises((ConnectionLost, Stale)):
        doing.result()
    await_standstill(fake)
    time.sleep(0.2)
    fake.do("heal")
    wait_for(lambda: ready.connection.value == "back")
    stays(fake)
    truth = fake.truth()
    assert truth["program"] is None, "no program of this client continues"
    if fault != "reset":  # while a reset is handled, the library may send its stopped program once more
        assert truth["scripts_taken"] == scripts
    with pytest.raises(NotInControl):
        ready.move_to_joints(turned(ready, 0.1), 0.5)
    ready.take_control()
    ready.move_to_joints(turned(ready, 0.1), 0.5)


def test_a_silence_longer_than_the_timeout_of_the_library(ready: UR5e, fake: FakeUr) -> None:
    fake.do("silence")
    time.sleep(2.8)  # the library notices after 2.5 s
    fake.do("heal")
    wait_for(lambda: ready.connection.value == "back")
    fake.do("foreign_program", on=True)
    time.sleep(0.5)
    assert fake.truth()["program"] is not None, "no later command of this client ended it"


def test_the_watchdog_tolerates_a_slow_owner_for_a_limited_time(
    robot: UR5e, fake: FakeUr, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Once the watchdog is armed, the control process signals by itself; afterwards the owner must send pulses."""
    monkeypatch.setattr(ControlSession, "_watch", lambda _: None)  # an owner without a running guard
    session = ControlSession(robot._observer, robot._control.uses_upper_registers(), 2.5)
    session.open(8.0, dashboard=False)
    try:
        opened = time.monotonic()
        fake.control.wait_until(lambda t: t["program"] is None)
        assert time.monotonic() - opened > 0.5
        wait_for(lambda: session.ended is not None)
        assert "too slow" in str(session.ended)
    finally:
        session.end(NotInControl("the test is over"))


def test_a_program_stopped_at_the_pendant_ends_control(ready: UR5e, fake: FakeUr) -> None:
    doing = far_move(ready, fake)
    other = make(fake.host)
    other._pendant.dashboard.do("stop", "Stopped")
    other._pendant.dashboard.close()
    with pytest.raises(NotInControl, match="left remote control"):
        doing.result()


# ------------------------------------------------------------------------------------------------ inputs and outputs
def test_outputs_and_inputs(ready: UR5e, fake: FakeUr) -> None:
    for number in (0, 7, 8, 15, 16, 17):
        ready.set_digital_output(number, True)
        assert fake.truth()["digital_outputs"] >> number & 1
    ready.set_digital_output(8, False)
    assert not fake.truth()["digital_outputs"] >> 8 & 1
    for number in (0, 7, 8, 15, 16, 17):
        ready.set_digital_output(number, False)
    assert not ready.get_digital_input(4)
    doing = BackgroundCall(ready.wait_for_input, 4, True, 5.0)
    fake.do("set_input", bit=4, on=True)
    doing.result()
    fake.do("set_input", bit=4, on=False)
    wait_for(lambda: not ready.get_digital_input(4))
    waiting = BackgroundCall(ready.wait_for_input, 4, True, 30.0)
    while not waiting.over:  # a stop before the wait begins does not end it
        ready.stop()
        time.sleep(0.01)
    with pytest.raises(Cancelled):
        waiting.result()


def test_pick_and_place_use_the_part_sensor(fake: FakeUr) -> None:
    size = {"part_size_x": 0.1, "part_size_y": 0.08, "part_size_z": 0.02, "part_offset_z": 0.01}
    robot = make(fake.host, gripper_output=0, part_sensor_input=1, **size)
    robot.connect(30.0)
    try:
        robot.take_control()
        start = robot.get_end_effector_pose("tcp")
        target = Pose(start.position + Position(0.0, 0.0, -0.1), start.orientation)
        with pytest.raises(DeviceFault, match="picked nothing") as fault:
            robot.pick(target, approach=0.05, slow_speed=0.5)
        assert fault.value.fault_code == "nothing_held"
        assert not fake.truth()["digital_outputs"] & 1
        assert robot.parts == {}
        picking = BackgroundCall(robot.pick, target, approach=0.05, slow_speed=0.5)
        fake.control.wait_until(lambda t: t["digital_outputs"] & 1)
        at = robot.get_end_effector_pose("tcp").position
        fake.do("set_input", bit=1, on=True)
        picking.result()
        part = robot.parts["part of ur"]
        assert (part.link, part.in_link.position.z) == ("tcp", 0.01)
        assert at.distance_to(target.position) < 0.002, "it grips at the part"
        up = target.position - Position(*Position(0.0, 0.0, 0.05).rotated(target.orientation))
        assert robot.get_end_effector_pose("tcp").position.distance_to(up) < 0.002
        placing = BackgroundCall(robot.place, target, approach=0.05, slow_speed=0.5)
        fake.control.wait_until(lambda t: not t["digital_outputs"] & 1)
        fake.do("set_input", bit=1, on=False)
        placing.result()
        assert robot.parts == {}

        # A part that slips out during the last motion is not at the place, although the gripper would open there.
        picking = BackgroundCall(robot.pick, target, approach=0.05, slow_speed=0.5)
        fake.control.wait_until(lambda t: t["digital_outputs"] & 1)
        fake.do("set_input", bit=1, on=True)
        picking.result()
        placing = BackgroundCall(robot.place, target, approach=0.05, slow_speed=0.05)
        wait_for(lambda: robot.get_end_effector_pose("tcp").position.distance_to(up) > 0.01)
        fake.do("set_input", bit=1, on=False)
        with pytest.raises(DeviceFault, match="lost the part on the way down") as fault:
            placing.result()
        assert fault.value.fault_code == "part_lost"
        assert robot.parts == {}
        robot.set_digital_output(0, False)
        with pytest.raises(AssertionError):
            robot.pick(target, approach=0.9)
    finally:
        fake.do("set_input", bit=1, on=False)
        robot.disconnect()


def test_a_stop_ends_the_whole_pick_and_keeps_the_gripper(fake: FakeUr) -> None:
    robot = make(fake.host, gripper_output=0, gripper_time=1.0)
    robot.connect(30.0)
    try:
        robot.take_control()
        start = robot.get_end_effector_pose("tcp")
        picking = BackgroundCall(robot.pick, start, approach=0.0, slow_speed=0.5)
        fake.control.wait_until(lambda t: t["digital_outputs"] & 1)
        robot.stop()
        with pytest.raises(Cancelled):
            picking.result()
        stays(fake, 0.3)
        assert fake.truth()["digital_outputs"] & 1, "a stop does not open a gripper"
    finally:
        robot.disconnect()


def test_the_tool_is_set(ready: UR5e, fake: FakeUr) -> None:
    before = ready.get_end_effector_pose("tcp").position
    ready.set_tool(Pose(Position(0.0, 0.0, 0.2), Orientation()), 2.0, (0.0, 0.0, 0.05))
    truth = fake.truth()
    assert truth["payload"] == pytest.approx(2.0)
    assert truth["payload_cog"] == pytest.approx([0.0, 0.0, 0.05])
    wait_for(lambda: abs(ready.get_end_effector_pose("tcp").position.distance_to(before) - 0.1) < 1e-6)
    with pytest.raises(OutOfRange, match="mass"):
        ready.set_tool(Pose(), 9.0, (0.0, 0.0, 0.0))
