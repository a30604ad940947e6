"""Motion programs of a UR: blends, contact, force limits, their watchdog and their stop."""

import os
import signal
import subprocess
import sys
import textwrap
import time

import pytest

from arcor2_drivers.universal_robots import paths
from arcor2_drivers.universal_robots.move_actions import MoveType
from arcor2_drivers.universal_robots.program import Limit, Registers, RunState, Tool, linear, motion_program
from arcor2_drivers.universal_robots.ur5e import UR5e
from arcor2_fakes.ur.language import parse
from arcor2_hw.data.geometry import Orientation, Pose, Position
from arcor2_hw.data.robot import MoveEnd
from arcor2_hw.exceptions import Cancelled, DeviceFault, DeviceTimeout, NotInControl, OutOfRange, Refused, SafetyStop
from tests.waiting import wait_for

from .conftest import BackgroundCall, FakeUr, make, moving


def shifted(pose: Pose, x: float = 0.0, y: float = 0.0, z: float = 0.0) -> Pose:
    return Pose(pose.position + Position(x, y, z), pose.orientation)


def followed(robot: UR5e, doing: BackgroundCall) -> list[Position]:
    """Return the TCP poses during a motion."""
    seen = []
    while not doing.ended_at:
        seen.append(robot.get_end_effector_pose("tcp").position)
        time.sleep(0.004)
    return seen


def test_a_motion_program_arms_its_watchdog_before_it_moves() -> None:
    for limit in (None, Limit(10.0), Limit(10.0, (0.0, 0.0, -1.0))):
        text = motion_program(
            7, [linear([0.1] * 6, 0.2, 1.2, 0.05)], Registers.of(True), 10.0, Tool(Pose(), 1.0, (0, 0, 0.1)), 5.0, limit
        )
        parse(text)
        assert text.isascii()
        lines = [line.strip() for line in text.splitlines()]
        assert lines[1] == 'rtde_set_watchdog("input_int_register_42", 10, "stop")'
        assert lines.index("mover = run moves()") > 1
        assert any("r=0.05" in line for line in lines)


def test_a_path_rounds_its_corners_and_keeps_control(ready: UR5e, fake: FakeUr) -> None:
    start = ready.get_end_effector_pose("tcp")
    corner, end = shifted(start, y=-0.15), shifted(start, y=-0.15, z=-0.15)
    doing = BackgroundCall(ready.move_path, [corner, end], 0.03, True, 0.3)
    seen = [place.distance_to(corner.position) for place in followed(ready, doing)]
    result = doing.result()
    assert result.end is MoveEnd.DONE
    assert result.speed == pytest.approx(0.3)
    assert result.pose.position.distance_to(end.position) < 1e-3
    assert 0.001 < min(seen) <= 0.03
    truth = fake.truth()
    assert truth["watchdog"], "the control program runs again, with its watchdog"
    assert truth["payload"] == pytest.approx(1.0)
    assert ready.control_owner() == "us"
    ready.move_to_pose("tcp", start, 0.5)


def test_without_a_blend_each_waypoint_is_reached(ready: UR5e) -> None:
    start = ready.get_end_effector_pose("tcp")
    corner, end = shifted(start, y=-0.1), shifted(start, y=-0.1, z=0.1)
    doing = BackgroundCall(ready.move_through, corner, end, 0.0, MoveType.JOINT, 0.5)
    assert min(place.distance_to(corner.position) for place in followed(ready, doing)) < 1e-3
    doing.result()
    assert ready.get_end_effector_pose("tcp").position.distance_to(end.position) < 1e-3


def test_an_invalid_path_is_refused_without_motion(ready: UR5e, fake: FakeUr) -> None:
    start, q, scripts = ready.get_end_effector_pose("tcp"), fake.truth()["q"], fake.truth()["scripts_taken"]
    near, far = shifted(start, y=-0.1), shifted(start, z=-3.0)
    with pytest.raises(OutOfRange, match="half the distance"):
        ready.move_path([near, shifted(start, y=-0.2)], blend=0.06)
    with pytest.raises(OutOfRange, match="waypoints"):
        ready.move_path([])
    with pytest.raises(OutOfRange, match="blend"):
        ready.move_path([near], blend=-0.1)
    with pytest.raises(UR5e.KinematicsException, match="cannot reach"):
        ready.move_path([near, far])
    assert (fake.truth()["q"], fake.truth()["scripts_taken"]) == (q, scripts)


def test_a_stop_ends_a_path_and_the_next_command_is_accepted(ready: UR5e, fake: FakeUr) -> None:
    start = ready.get_end_effector_pose("tcp")
    doing = BackgroundCall(ready.move_path, [shifted(start, y=-0.3), shifted(start, y=-0.3, z=-0.3)], 0.02, True, 0.2)
    moving(fake)
    with pytest.raises(Refused, match="moving already"):
        ready.move_to_joints(ready.robot_joints(), 0.5)
    ready.stop()
    assert not fake.truth()["moving"]
    with pytest.raises(Cancelled):
        doing.result()
    assert ready.last_move is not None
    assert ready.last_move.end is MoveEnd.STOPPED
    assert ready.control_owner() == "us"
    ready.move_to_pose("tcp", start, 0.5)


def test_a_path_stops_although_the_control_process_hangs(ready: UR5e, fake: FakeUr) -> None:
    start = ready.get_end_effector_pose("tcp")
    doing = BackgroundCall(ready.move_path, [shifted(start, y=-0.4)], 0.0, True, 0.1)
    moving(fake)
    assert ready._control.session is not None
    assert ready._control.session._process is not None
    os.kill(ready._control.session._process.pid, signal.SIGSTOP)
    ready.stop()
    assert not fake.truth()["moving"]
    with pytest.raises((Cancelled, NotInControl)):
        doing.result()
    fake.control.wait_until(lambda t: t["program"] is None)


def test_a_path_stops_when_its_process_is_killed(fake: FakeUr) -> None:
    code = textwrap.dedent(
        f"""
        from arcor2_drivers.universal_robots.settings import UrSettings
        from arcor2_drivers.universal_robots.ur5e import UR5e
        from arcor2_hw.data.geometry import Pose, Position
        robot = UR5e("obj_1", "ur", Pose(), UrSettings({fake.host!r}, payload_mass=1.0))
        robot.connect(30.0)
        robot.take_control()
        here = robot.get_end_effector_pose("tcp")
        robot.move_path([Pose(here.position + Position(0.0, -0.4, 0.0), here.orientation)], speed=0.1)
        """
    )
    with subprocess.Popen([sys.executable, "-c", code]) as owner:
        moving(fake)
        owner.kill()
        fake.control.wait_until(lambda t: not t["moving"])
        fake.control.wait_until(lambda t: t["program"] is None)


def test_a_path_stopped_at_the_pendant_ends_control(ready: UR5e, fake: FakeUr) -> None:
    start = ready.get_end_effector_pose("tcp")
    doing = BackgroundCall(ready.move_path, [shifted(start, y=-0.3)], 0.0, True, 0.1)
    moving(fake)
    other = make(fake.host)
    other._pendant.dashboard.do("stop", "Stopped")
    other._pendant.dashboard.close()
    with pytest.raises(NotInControl, match="left remote control"):
        doing.result()


def test_a_path_does_not_resume_after_a_safeguard_stop(ready: UR5e, fake: FakeUr) -> None:
    start = ready.get_end_effector_pose("tcp")
    doing = BackgroundCall(ready.move_path, [shifted(start, y=-0.3)], 0.0, True, 0.1)
    moving(fake)
    fake.do("safeguard_stop")
    with pytest.raises(SafetyStop):
        doing.result()
    fake.control.wait_until(lambda t: not t["moving"] and t["program"] is None)
    q = fake.truth()["q"]
    fake.do("safeguard_stop", on=False)
    time.sleep(0.4)
    assert fake.truth()["q"] == q


def test_a_path_that_times_out_is_stopped(ready: UR5e, fake: FakeUr, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(paths, "linear_budget", lambda *_: 0.2)
    start = ready.get_end_effector_pose("tcp")
    with pytest.raises(DeviceTimeout, match="computed time"):
        ready.move_path([shifted(start, y=-0.3)], speed=0.1)
    assert not fake.truth()["moving"]
    ready.move_to_joints(ready.robot_joints(), 0.5)


# ------------------------------------------------------------------------------------------------ force
def test_a_move_ends_at_contact_and_the_wrench_is_reported(fake: FakeUr) -> None:
    """The scene turns base_link by 90° about z; directions and forces are in the world frame."""
    turn = Orientation.from_rotation_vector(0.0, 0.0, 1.5707963267948966)
    robot = make(fake.host, Pose(Position(0.2, 0.0, 0.3), turn))
    robot.connect(30.0)
    try:
        robot.take_control()
        start = robot.get_end_effector_pose("tcp")
        x, y, z = fake.truth()["tcp_pose"][:3]
        fake.do("obstacle", point=[x, y + 0.03, z], normal=[0.0, -1.0, 0.0])  # in base, which is +x in this world
        result = robot.move_until_contact((2.0, 0.0, 0.0), 12.0, 0.1, 0.03)
        way = result.pose.position - start.position
        assert way.x == pytest.approx(0.03 + 12.0 / 20_000.0, abs=5e-4)
        assert abs(way.y) < 1e-3
        wait_for(lambda: robot.wrench()[0] < -5.0)
        assert robot.wrench()[0] == pytest.approx(-12.0, abs=6.0), "the force is opposite to the motion"
        assert abs(robot.wrench()[1]) < 1.0
        assert fake.truth()["safety"] == "NORMAL"
        with pytest.raises(DeviceFault, match="made no contact") as fault:
            robot.move_until_contact((-1.0, 0.0, 0.0), 12.0, 0.02, 0.05)
        assert fault.value.fault_code == "no_contact"
        assert robot.control_owner() == "us"
    finally:
        fake.do("no_obstacle")
        robot.disconnect()


def test_a_careful_move_stops_at_a_lateral_force(ready: UR5e, fake: FakeUr) -> None:
    start = ready.get_end_effector_pose("tcp")
    try:
        x, y, z = fake.truth()["tcp_pose"][:3]
        fake.do("obstacle", point=[x, y, z - 0.04], normal=[0.0, 0.0, 1.0], stiffness=5000.0)
        with pytest.raises(DeviceFault, match="force of 20 N") as fault:
            ready.move_carefully(shifted(start, y=-0.1, z=-0.1), 20.0, 0.05)
        assert fault.value.fault_code == "force_limit"
        assert 15.0 < fake.truth()["tcp_force"][2] < 45.0
        ready.move_carefully(start, 60.0, 0.1)  # away from the obstacle
        with pytest.raises(DeviceFault, match="made no contact"):
            ready.move_to_contact(10.0, 0.02, 0.05)
        ready.move_to_contact(10.0, 0.1, 0.05)  # the tool points down
        assert ready.get_end_effector_pose("tcp").position.z == pytest.approx(start.position.z - 0.04, abs=0.01)
    finally:
        fake.do("no_obstacle")


def test_a_collision_is_a_protective_stop(ready: UR5e, fake: FakeUr) -> None:
    start = ready.get_end_effector_pose("tcp")
    try:
        z = fake.truth()["tcp_pose"][2]
        fake.do("obstacle", point=[0.0, 0.0, z - 0.02], normal=[0.0, 0.0, 1.0])
        with pytest.raises(SafetyStop) as stop:
            ready.move_to_pose("tcp", shifted(start, z=-0.1), 0.2)
        assert stop.value.kind == "protective_stop"
    finally:
        fake.do("no_obstacle")
        fake.control.wait_until(lambda t: not t["moving"])
        wait_for(lambda: _acknowledged(ready))


def _acknowledged(robot: UR5e) -> bool:
    try:
        robot.acknowledge_protective_stop("Eva")
    except Refused:
        return False
    return True


@pytest.mark.parametrize(
    ("direction", "force", "distance"),
    [((0.0, 0.0, 0.0), 10.0, 0.1), ((0.0, 0.0, 1.0), 0.1, 0.1), ((0.0, 0.0, 1.0), 10.0, 3.0)],
)
def test_invalid_arguments_of_a_contact_are_refused(
    ready: UR5e, direction: tuple[float, float, float], force: float, distance: float
) -> None:
    with pytest.raises(OutOfRange):
        ready.move_until_contact(direction, force, distance)


def test_the_inertia_is_sent_to_the_controller(ready: UR5e, fake: FakeUr) -> None:
    inertia = (0.01, 0.02, 0.03, 0.0, 0.0, 0.001)
    ready.set_tool(Pose(Position(0.0, 0.0, 0.1)), 2.0, (0.0, 0.0, 0.05), inertia)
    assert fake.truth()["payload_inertia"] == pytest.approx(inertia)
    assert ready._control.tool.inertia == inertia
    start = ready.get_end_effector_pose("tcp")
    ready.move_path([shifted(start, z=0.02)])
    truth = fake.truth()
    assert truth["payload_inertia"] == pytest.approx(inertia), "a path does not change the tool"
    assert truth["payload"] == pytest.approx(2.0)
    assert truth["tcp_offset"] == pytest.approx([0.0, 0.0, 0.1, 0.0, 0.0, 0.0])
    with pytest.raises(OutOfRange, match="six numbers"):
        ready.set_tool(Pose(), 1.0, (0.0, 0.0, 0.0), (1.0,))


def test_run_states_fit_their_register() -> None:
    assert max(RunState) < 8
    assert ((1 << 20) - 1) * 8 + 7 < 1 << 31
