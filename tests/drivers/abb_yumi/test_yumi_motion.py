"""Motion of a YuMi: joints, lines, paths, both arms coupled and concurrently, stop, clearance, kinematics."""

import itertools
import math
import time

import numpy as np
import pytest

from arcor2_drivers.abb_yumi.yumi import ArmId, MoveType, YuMi
from arcor2_hw.data.geometry import Orientation, Pose, Position
from arcor2_hw.data.project import ProjectRobotJoints
from arcor2_hw.data.robot import Joint, MoveEnd
from arcor2_hw.exceptions import Cancelled, InvalidData, NotFound, NotInControl, OutOfRange, Refused
from arcor2_hw.keep_alive import once_within

from .conftest import BackgroundCall, FakeYumi, under_way

ACROSS = Position(0.0, -0.30, 0.0)
"""Offset from the left arm's home position well into the right arm, m."""


def turned(robot: YuMi, arm: str, axis: int, by: float) -> list[Joint]:
    joints = robot.robot_joints(arm_id=arm)
    joints[axis - 1].value += by
    return joints


def shifted(pose: Pose, by: Position) -> Pose:
    return Pose(pose.position + by, pose.orientation)


def test_a_joint_move_arrives_in_the_computed_time(fake: FakeYumi, ready: YuMi) -> None:
    goal = turned(ready, "left", 1, 0.5)
    other = fake.arm("right")["joints"]
    began = time.monotonic()
    ready.move_to_joints(goal, 0.5, arm_id="left")
    took = time.monotonic() - began
    assert took > 0.45  # 0.5 rad at 0.5 rad/s and a ramp, twice as fast
    assert fake.arm("left")["joints"] == pytest.approx([math.degrees(joint.value) for joint in goal], abs=0.01)
    assert [joint.value for joint in ready.robot_joints(arm_id="left")] == pytest.approx(
        [joint.value for joint in goal], abs=1e-4
    )
    assert fake.arm("right")["joints"] == other
    done = ready.last_moves["left"]
    assert (done.end, done.speed) == (MoveEnd.DONE, 0.5)
    assert done.pose.position.distance_to(ready.get_end_effector_pose("tcp", "left").position) < 1e-6


def test_a_line_is_straight(fake: FakeYumi, ready: YuMi) -> None:
    start = ready.get_end_effector_pose("tcp", "left")
    target = shifted(start, Position(0.12, 0.05, 0.04))
    moving = BackgroundCall(ready.move_to_pose, "tcp", target, 0.3, arm_id="left")
    off = []
    under_way(fake, "left")
    first = Position(*fake.arm("left")["position"])
    direction = Position(0.12, 0.05, 0.04)
    length = math.hypot(*direction)
    while fake.moving("left"):
        time.sleep(0.01)  # without a pause, this thread would keep the driver's from feeding the watchdog
        way = Position(*fake.arm("left")["position"]) - first
        along = sum(a * b for a, b in zip(way, direction, strict=True)) / length
        off.append(math.sqrt(max(sum(a * a for a in way) - along * along, 0.0)))
    moving.result()
    assert len(off) > 5
    assert max(off) < 1e-3
    at = ready.get_end_effector_pose("tcp", "left")
    assert at.position.distance_to(target.position) < 2e-5
    assert at.orientation.angle_to(target.orientation) < 1e-4


def test_a_pose_is_reached_with_all_axes_together(ready: YuMi) -> None:
    start = ready.get_end_effector_pose("tcp", "right")
    spin = Pose(orientation=Orientation.from_rotation_vector(0.0, 0.0, 0.6))
    target = shifted(start, Position(0.1, -0.05, 0.05)) * spin
    ready.move_to_pose("tcp", target, 0.8, linear=False, arm_id="right")
    at = ready.get_end_effector_pose("tcp", "right")
    assert at.position.distance_to(target.position) < 5e-5
    assert at.orientation.angle_to(target.orientation) < 1e-4


def distance_to_line(point: Position, start: Position, end: Position) -> float:
    """Return the distance of a point from the straight line between two positions, m."""
    length = start.distance_to(end)
    along, to_point = (np.array([p.x, p.y, p.z]) - [start.x, start.y, start.z] for p in (end, point))
    share = np.clip(along @ to_point / length**2, 0.0, 1.0) if length else 0.0
    return float(np.linalg.norm(to_point - share * along))


def test_a_path_passes_its_waypoints(fake: FakeYumi, ready: YuMi) -> None:
    start = ready.get_end_effector_pose("tcp", "left")
    corners = [shifted(start, Position(*by)) for by in ((0.08, 0.0, 0.0), (0.08, 0.06, 0.0), (0.0, 0.06, 0.05))]
    flange = Position(*fake.arm("left")["position"])
    moving = BackgroundCall(ready.move_path, corners, 0.005, speed=0.4, arm_id="left")
    seen = []
    under_way(fake, "left")
    while fake.moving("left"):
        time.sleep(0.01)  # without a pause, this thread would keep the driver's from feeding the watchdog
        seen.append(Position(*fake.arm("left")["position"]))
    done = moving.result()
    assert done.end is MoveEnd.DONE
    for corner in corners[:2]:
        passed = flange + (corner.position - start.position)
        assert min(distance_to_line(passed, *ends) for ends in itertools.pairwise(seen)) < 0.02
    assert done.pose.position.distance_to(corners[-1].position) < 5e-5
    assert fake.arm("left")["moves_begun"] >= 1


def test_both_arms_start_and_arrive_together(fake: FakeYumi, ready: YuMi) -> None:
    far = turned(ready, "left", 1, -0.6)
    near = shifted(ready.get_end_effector_pose("tcp", "right"), Position(0.03, -0.02, 0.0))
    moving = BackgroundCall(ready.move_synchronously, {"left": far, "right": near}, 0.6)
    fake.control.wait_until(lambda t: any(arm["moving"] for arm in t["arms"].values()))
    alone = 0
    while fake.moving():
        arms = fake.truth()["arms"]
        alone += arms["left"]["moving"] is not arms["right"]["moving"]
    assert alone == 0
    done = moving.result()
    assert {arm: result.end for arm, result in done.items()} == {"left": MoveEnd.DONE, "right": MoveEnd.DONE}
    assert ready.get_end_effector_pose("tcp", "right").position.distance_to(near.position) < 5e-5
    assert [joint.value for joint in ready.robot_joints(arm_id="left")] == pytest.approx(
        [joint.value for joint in far], abs=1e-4
    )


def test_stopping_one_of_two_coupled_arms_stops_both(fake: FakeYumi, ready: YuMi) -> None:
    targets = {"left": turned(ready, "left", 6, 2.0), "right": turned(ready, "right", 6, 2.0)}
    moving = BackgroundCall(ready.move_synchronously, targets, 0.5)
    under_way(fake, "left", "right")
    ready.stop("right")
    with pytest.raises(Cancelled):
        moving.result()
    assert not fake.moving()
    assert {arm: result.end for arm, result in ready.last_moves.items()} == dict.fromkeys(
        ("left", "right"), MoveEnd.STOPPED
    )


def test_arms_move_concurrently_and_stop_separately(fake: FakeYumi, ready: YuMi) -> None:
    left = BackgroundCall(ready.move_to_joints, turned(ready, "left", 6, 1.5), 0.5, arm_id="left")
    right = BackgroundCall(ready.move_to_joints, turned(ready, "right", 6, 1.5), 0.5, arm_id="right")
    under_way(fake, "left", "right")
    assert ready.move_in_progress
    with pytest.raises(Refused) as error:
        ready.move_to_joints(turned(ready, "left", 6, 0.1), 0.5, arm_id="left")
    assert "left" in str(error.value)
    ready.stop("left")
    assert not fake.moving("left")
    assert fake.moving("right")
    with pytest.raises(Cancelled):
        left.result()
    right.result()


def test_stop_overtakes_a_motion_and_returns_at_standstill(fake: FakeYumi, ready: YuMi) -> None:
    goal = turned(ready, "left", 1, 1.2)
    for _ in range(3):
        moving = BackgroundCall(ready.move_to_joints, goal, 1.0, arm_id="left")
        under_way(fake, "left")
        ready.stop()
        assert fake.arm("left")["speed"] == 0.0
        with pytest.raises(Cancelled):
            moving.result()
    assert ready.control_owner() == "us"
    ready.move_to_joints(goal, 1.0, arm_id="left")


def test_a_stop_before_the_command_is_sent_cancels_it(fake: FakeYumi, ready: YuMi) -> None:
    begun = fake.arm("left")["moves_begun"]
    guard = ready._control.stops["left"].guard()
    goal = [joint.value for joint in turned(ready, "left", 1, 0.5)]
    ready.stop("left")
    with pytest.raises(Cancelled):
        ready._motion.to_joints("left", goal, 0.5, guard)
    assert fake.arm("left")["moves_begun"] == begun


def test_a_low_speed_override_slows_a_move_without_a_timeout(fake: FakeYumi, ready: YuMi) -> None:
    fake.do("speed_ratio", percent=25)
    began = time.monotonic()
    ready.move_to_joints(turned(ready, "left", 1, 0.4), 1.0, arm_id="left")
    assert time.monotonic() - began > 0.75
    assert once_within(lambda: ready.state().speed_override == 0.25, 10.0, 0.01)


def test_the_arms_keep_their_clearance(fake: FakeYumi, ready: YuMi) -> None:
    home = ready.get_end_effector_pose("tcp", "left")
    begun = fake.arm("left")["moves_begun"]
    for linear in (True, False):
        with pytest.raises(Refused) as error:
            ready.move_to_pose("tcp", shifted(home, ACROSS), 0.5, safe=False, linear=linear, arm_id="left")
        assert "too close" in str(error.value)
        assert "required 20 mm" in error.value.detail
    assert fake.arm("left")["moves_begun"] == begun


def at(robot: YuMi, arm: str, degrees: list[float]) -> list[Joint]:
    names = [joint.name for joint in robot.robot_joints(arm_id=arm)]
    return [Joint(name, math.radians(value)) for name, value in zip(names, degrees, strict=True)]


def test_the_path_of_the_other_arm_is_considered(fake: FakeYumi, ready: YuMi) -> None:
    """Each of the two paths is free while the other arm is at home; both at once collide."""
    left = at(ready, "left", [-26.0, -117.0, 42.0, 26.0, 25.0, 34.0, 132.0])
    right = at(ready, "right", [32.0, -139.0, 15.0, 5.0, 61.0, 3.0, -141.0])
    home = ready.robot_joints(arm_id="left")
    ready.move_to_joints(left, 1.0, arm_id="left")
    ready.move_to_joints(home, 1.0, arm_id="left")
    moving = BackgroundCall(ready.move_to_joints, right, 0.1, arm_id="right")
    under_way(fake, "right")
    begun = fake.arm("left")["moves_begun"]
    with pytest.raises(Refused) as error:
        ready.move_to_joints(left, 0.5, arm_id="left")
    assert "too close to the right arm" in str(error.value)
    ready.stop()
    with pytest.raises(Cancelled):
        moving.result()
    with pytest.raises(Refused):
        ready.move_synchronously({"left": left, "right": right}, 0.5)
    assert fake.arm("left")["moves_begun"] == begun


def test_an_arm_that_is_too_close_may_move_away(fake: FakeYumi, ready: YuMi) -> None:
    home = ready.robot_joints(arm_id="right")
    fake.do("place", arm="left", joints=[2.0, -139.0, 19.0, 7.0, 47.0, -4.0, 136.0])
    fake.do("place", arm="right", joints=[26.0, -138.0, 7.0, -15.0, 62.0, 33.0, -145.0])
    ready._observer.fresh()
    with pytest.raises(Refused) as error:
        ready.move_to_joints(turned(ready, "right", 1, 0.2), 0.5, arm_id="right")
    assert "too close" in str(error.value)
    ready.move_to_joints(home, 1.0, arm_id="right")


def test_inverse_kinematics_inverts_forward_kinematics(ready: YuMi) -> None:
    for arm in ("left", "right"):
        pose = shifted(ready.get_end_effector_pose("tcp", arm), Position(0.1, 0.0, 0.08))
        joints = ready.inverse_kinematics("tcp", pose, arm_id=arm)
        back = ready.forward_kinematics("tcp", joints, arm)
        assert back.position.distance_to(pose.position) < 5e-5
        assert back.orientation.angle_to(pose.orientation) < 1e-4


def test_the_seed_selects_the_solution(ready: YuMi) -> None:
    pose = ready.get_end_effector_pose("tcp", "left")
    here = ready.inverse_kinematics("tcp", pose, arm_id="left")
    seed = turned(ready, "left", 4, 0.6)
    seed[5].value -= 0.5
    there = ready.inverse_kinematics("tcp", pose, seed, arm_id="left")
    assert here[3].value == pytest.approx(ready.robot_joints(arm_id="left")[3].value, abs=1e-3)
    assert there[3].value - here[3].value > 0.2
    back = ready.forward_kinematics("tcp", there, "left")
    assert back.position.distance_to(pose.position) < 5e-5


def test_out_of_reach_is_a_kinematics_exception(fake: FakeYumi, ready: YuMi) -> None:
    far = Pose(Position(2.0, 0.0, 0.0))
    for call in (
        lambda: ready.inverse_kinematics("tcp", far, arm_id="left"),
        lambda: ready.move_to_pose("tcp", far, 0.5, arm_id="left"),
    ):
        with pytest.raises(YuMi.KinematicsException) as error:
            call()
        assert "left arm of yumi" in str(error.value)
    assert not fake.moving()


def test_bad_input_is_refused_before_anything_moves(fake: FakeYumi, ready: YuMi) -> None:
    begun = {arm: fake.arm(arm)["moves_begun"] for arm in ("left", "right")}
    joints = ready.robot_joints(arm_id="left")
    wrong = [Joint(joints[0].name, 3.2), *joints[1:]]
    with pytest.raises(OutOfRange) as error:
        ready.move_to_joints(wrong, 0.5, arm_id="left")
    assert "ROB_L_1" in str(error.value)
    for bad in (joints[:6], ready.robot_joints(arm_id="right"), [*joints, joints[0]]):
        with pytest.raises(InvalidData):
            ready.move_to_joints(bad, 0.5, arm_id="left")
    for speed in (0.0, 1.1, float("nan")):
        with pytest.raises(OutOfRange):
            ready.move_to_joints(joints, speed, arm_id="left")
    with pytest.raises(InvalidData):
        ready.move_to_joints(joints, 0.5)
    with pytest.raises(NotFound):
        ready.move_to_pose("nose", Pose(), 0.5, arm_id="left")
    with pytest.raises(OutOfRange):
        ready.move_to_pose("tcp", Pose(Position(float("nan"), 0.0, 0.0)), 0.5, arm_id="left")
    with pytest.raises(OutOfRange):
        ready.move_synchronously({"left": joints}, 0.5)
    with pytest.raises(OutOfRange):
        ready.move_path([], arm_id="left")
    with pytest.raises(OutOfRange):
        ready.set_tool(Pose(), 0.9, (0.0, 0.0, 0.0), arm_id="left")
    assert {arm: fake.arm(arm)["moves_begun"] for arm in ("left", "right")} == begun


def test_commands_need_control(robot: YuMi) -> None:
    joints = robot.robot_joints(arm_id="left")
    for call in (
        lambda: robot.move_to_joints(joints, 0.5, arm_id="left"),
        lambda: robot.set_hand_teaching_mode(True, "left"),
        lambda: robot.set_tool(Pose(), 0.1, (0.0, 0.0, 0.05), arm_id="left"),
        lambda: robot.grip(),
        lambda: robot.inverse_kinematics("tcp", robot.get_end_effector_pose("tcp", "left"), arm_id="left"),
    ):
        with pytest.raises(NotInControl):
            call()
    robot.stop()


def test_actions_move_the_arms(fake: FakeYumi, ready: YuMi) -> None:
    stored = {
        arm: ProjectRobotJoints("there", "obj_1", turned(ready, arm, 6, 0.2), True, arm) for arm in ("left", "right")
    }
    ready.move_both(stored["left"], stored["right"], 0.8)
    assert fake.arm("right")["joints"][5] == pytest.approx(math.degrees(0.2), abs=0.01)
    pose = shifted(ready.get_end_effector_pose("tcp", "right"), Position(0.05, 0.0, 0.05))
    ready.move(pose, ArmId.RIGHT, MoveType.LINEAR, 0.5)
    assert ready.get_end_effector_pose("tcp", "right").position.distance_to(pose.position) < 5e-5
    ready.move_to(stored["left"], ArmId.LEFT, 0.5)


def test_a_tool_changes_the_tcp(fake: FakeYumi, ready: YuMi) -> None:
    before = ready.get_end_effector_pose("tcp", "left")
    ready.set_tool(Pose(Position(0.0, 0.0, 0.186)), 0.3, (0.0, 0.01, 0.06), arm_id="left")
    assert fake.arm("left")["load"] == [0.3, 0.0, 10.0, 60.0]
    after = ready.get_end_effector_pose("tcp", "left")
    assert (before.inverted() * after).position.distance_to(Position(0.0, 0.0, 0.05)) < 1e-6
    target = shifted(after, Position(0.0, 0.0, 0.05))
    ready.move_to_pose("tcp", target, 0.5, arm_id="left")
    assert ready.get_end_effector_pose("tcp", "left").position.distance_to(target.position) < 5e-5
