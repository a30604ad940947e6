"""Safe moves of the UR around obstacles of the scene, and refused ones."""

import itertools
import math
import time
from pathlib import Path

import numpy as np
import pytest

import arcor2_drivers
from arcor2_drivers.universal_robots.ur5e import UR5e
from arcor2_hw.data.geometry import Pose, Position
from arcor2_hw.data.robot import Joint
from arcor2_hw.exceptions import Cancelled, NotInControl, PathBlocked
from arcor2_hw.kinematics.model import RobotModel
from tests.drivers.surroundings import BoxSurroundings

from .conftest import HOME, BackgroundCall, FakeUr, moving

URDF = Path(next(iter(arcor2_drivers.__path__))) / "universal_robots" / "urdf" / "ur5e"
BESIDE = [1.6, *HOME[1:]]


@pytest.fixture
def around(robot: UR5e) -> BoxSurroundings:
    around = BoxSurroundings()
    robot.surround(around)
    return around


def joints(robot: UR5e, values: list[float]) -> list[Joint]:
    return [Joint(joint.name, value) for joint, value in zip(robot.robot_joints(), values, strict=True)]


def between(robot: UR5e) -> Position:
    """Return the TCP halfway between HOME and BESIDE, by our model: a straight move passes this position."""
    model = RobotModel.load(URDF, {"tcp_z": 0.1}).arm("tcp")
    return model.pose(np.array([0.8, *HOME[1:]])).position


def touches(around: BoxSurroundings, *seen: list[float]) -> set[str]:
    return around.touches(RobotModel.load(URDF, {"tcp_z": 0.1}), Pose(), seen)


def test_a_joint_move_follows_the_checked_path_around_an_obstacle(
    ready: UR5e, around: BoxSurroundings, fake: FakeUr
) -> None:
    at = between(ready)
    around.boxes["post"] = Position(at.x, at.y, at.z - 0.05), (0.06, 0.06, 0.5)
    seen: list[list[float]] = []
    doing = BackgroundCall(ready.move_to_joints, joints(ready, BESIDE), 1.0)
    while not doing.ended_at:
        time.sleep(0.01)
        seen.append(fake.truth()["q"])
    doing.result()
    assert np.allclose(fake.truth()["q"], BESIDE, atol=1e-3)
    assert len(seen) > 20
    assert touches(around, *seen) == set()
    # A straight, unchecked move goes through it.
    straight = [list(np.array(HOME) + share * (np.array(BESIDE) - HOME)) for share in np.linspace(0.0, 1.0, 200)]
    assert touches(around, *straight) == {"post"}
    ready.move_to_joints(joints(ready, HOME), 1.0, safe=False)
    assert np.allclose(fake.truth()["q"], HOME, atol=1e-3)


def test_a_pose_is_reached_in_a_free_configuration(ready: UR5e, around: BoxSurroundings, fake: FakeUr) -> None:
    goal = [0.9, -1.0, 1.4, -1.9, -1.57, 0.0]
    pose = ready.forward_kinematics("tcp", joints(ready, goal))
    model = RobotModel.load(URDF)
    elbow = Pose.from_matrix(model.link_poses(np.array(goal))["forearm_link"]).position
    around.boxes["lamp"] = elbow, (0.1, 0.1, 0.1)
    ready.move_to_pose("tcp", pose, 1.0, linear=False)
    assert ready.get_end_effector_pose("tcp").position.distance_to(pose.position) < 1e-3
    assert np.abs(np.array(fake.truth()["q"]) - goal).max() > 0.3
    assert touches(around, fake.truth()["q"]) == set()


def test_inverse_kinematics_of_the_controller_in_a_free_configuration(ready: UR5e, around: BoxSurroundings) -> None:
    goal = [0.9, -1.0, 1.4, -1.9, -1.57, 0.0]
    pose = ready.forward_kinematics("tcp", joints(ready, goal))
    near = joints(ready, goal)
    assert [j.value for j in ready.inverse_kinematics("tcp", pose, near)] == pytest.approx(goal, abs=1e-6)
    elbow = Pose.from_matrix(RobotModel.load(URDF).link_poses(np.array(goal))["forearm_link"]).position
    around.boxes["lamp"] = elbow, (0.1, 0.1, 0.1)
    found = ready.inverse_kinematics("tcp", pose, near)
    assert touches(around, [joint.value for joint in found]) == set()
    assert ready.forward_kinematics("tcp", found).position.distance_to(pose.position) < 1e-6
    blind = ready.inverse_kinematics("tcp", pose, near, avoid_collisions=False)
    assert [joint.value for joint in blind] == pytest.approx(goal, abs=1e-6)
    around.boxes["crate"] = pose.position, (0.2, 0.2, 0.2)
    with pytest.raises(ready.KinematicsException, match="ur reaches the pose only in collision: tool of ur and crate"):
        ready.inverse_kinematics("tcp", pose, near)


def test_a_line_into_an_obstacle_is_refused_without_motion(ready: UR5e, around: BoxSurroundings, fake: FakeUr) -> None:
    here = ready.get_end_effector_pose("tcp")
    there = Pose(here.position + Position(0.0, 0.25, 0.0), here.orientation)
    around.boxes["post"] = here.position + Position(0.0, 0.17, 0.05), (0.03, 0.03, 0.3)
    with pytest.raises(ready.KinematicsException, match=r"ur cannot go straight: 0\.\d+ m along its line .* and post"):
        ready.move_to_pose("tcp", there, 1.0)
    assert np.allclose(fake.truth()["q"], HOME, atol=1e-6)
    del around.boxes["post"]
    ready.move_to_pose("tcp", there, 1.0)
    assert ready.get_end_effector_pose("tcp").position.distance_to(there.position) < 1e-3


def test_a_stop_between_waypoints_ends_the_move(ready: UR5e, around: BoxSurroundings, fake: FakeUr) -> None:
    at = between(ready)
    around.boxes["post"] = Position(at.x, at.y, at.z - 0.05), (0.06, 0.06, 0.5)
    doing = BackgroundCall(ready.move_to_joints, joints(ready, BESIDE), 0.3)
    moving(fake)
    ready.stop()
    with pytest.raises(Cancelled):
        doing.result()
    q = fake.truth()["q"]
    assert math.dist(q, BESIDE) > 0.3
    assert not fake.truth()["moving"]
    for a, b in itertools.pairwise([fake.truth()["q"] for _ in range(5)]):
        assert a == b


@pytest.mark.parametrize("line", [False, True])
def test_the_arm_stops_before_an_obstacle_that_enters_its_path(
    ready: UR5e, around: BoxSurroundings, fake: FakeUr, line: bool
) -> None:
    here = ready.get_end_effector_pose("tcp")
    # Slow, so that the arm does not reach the post before it appears.
    if line:
        there = Pose(here.position + Position(0.0, 0.3, 0.0), here.orientation)
        doing = BackgroundCall(ready.move_to_pose, "tcp", there, 0.1)
        post = here.position + Position(0.0, 0.24, 0.05)
    else:
        at = between(ready)
        post = Position(at.x, at.y, at.z - 0.05)
        doing = BackgroundCall(ready.move_to_joints, joints(ready, BESIDE), 0.1)
    moving(fake)
    around.boxes["post"] = post, (0.03, 0.03, 0.4)
    with pytest.raises(PathBlocked, match=r"ur stopped: post came into its path"):
        doing.result()
    stopped = fake.truth()
    assert not stopped["moving"]
    assert touches(around, stopped["q"]) == set()
    # It accepts further commands.
    del around.boxes["post"]
    ready.move_to_joints(joints(ready, HOME), 1.0)
    assert np.allclose(fake.truth()["q"], HOME, atol=1e-3)


def test_the_tool_set_at_run_time_is_used(ready: UR5e, around: BoxSurroundings) -> None:
    pose = ready.get_end_effector_pose("tcp")
    found = ready.safe_moves.forward("tcp", ready.robot_joints())
    assert found.position.distance_to(pose.position) < 1e-4
    ready.set_tool(Pose(Position(0.0, 0.05, 0.2)), 1.0, (0.0, 0.0, 0.05))
    pose = ready.get_end_effector_pose("tcp")
    found = ready.safe_moves.forward("tcp", ready.robot_joints())
    assert found.position.distance_to(pose.position) < 1e-4


@pytest.mark.parametrize("tcp", [(0.0, 0.0, 0.2), (0.12, 0.05, 0.1), (0.0, -0.15, -0.05)])
def test_the_tool_is_kept_clear_of_obstacles(
    robot: UR5e, around: BoxSurroundings, tcp: tuple[float, float, float]
) -> None:
    robot._control.stated_tool = robot._control.stated_tool._replace(tcp=Pose(Position(*tcp)))
    flange = Pose(Position(*(-value for value in tcp)))
    at = robot.safe_moves.forward("tcp", robot.robot_joints())
    base = (at * flange).position
    for share, hit in ((0.3, True), (0.9, True), (1.15, False)):
        point = Position(*(a + share * (b - a) for a, b in zip(base, at.position, strict=True)))
        around.boxes["chip"] = point, (0.004, 0.004, 0.004)
        found = robot.safe_moves.contacts(robot.robot_joints())
        assert any("tool of ur and chip" in pair for pair in found) is hit, (share, found)


def test_planning_needs_control(robot: UR5e, around: BoxSurroundings) -> None:
    for move in (
        lambda: robot.move_to_joints(joints(robot, BESIDE), 0.5),
        lambda: robot.move_to_pose("tcp", Pose(), 0.5),
    ):
        with pytest.raises(NotInControl):
            move()
