"""Safe moves of the Dobot around obstacles of the scene, and refused ones."""

import time
from pathlib import Path

import numpy as np
import pytest

import arcor2_drivers
from arcor2_drivers.dobot_magician.dobot_magician import DobotMagician
from arcor2_hw.data.geometry import Pose, Position
from arcor2_hw.data.robot import Joint
from arcor2_hw.exceptions import Cancelled, PathBlocked
from arcor2_hw.kinematics.model import RobotModel
from tests.drivers.background_call import BackgroundCall
from tests.drivers.surroundings import BoxSurroundings
from tests.fakes.conftest import FakeProcess

from .conftest import BASE

URDF = Path(next(iter(arcor2_drivers.__path__))) / "dobot_magician" / "urdf" / "dobot_magician"
LEFT, RIGHT = (0.9, 0.6, 0.9, 0.0), (-0.9, 0.6, 0.9, 0.0)


@pytest.fixture
def around(arm: DobotMagician) -> BoxSurroundings:
    around = BoxSurroundings()
    arm.surround(around)
    arm.move_to_joints(joints(LEFT), 1.0)
    around.boxes["box"] = (BASE * Pose(Position(0.2, 0.0, -0.05))).position, (0.06, 0.06, 0.2)
    return around


def joints(values: tuple[float, ...]) -> list[Joint]:
    return [Joint(f"joint_{number}", value) for number, value in enumerate(values, 1)]


def values(arm: DobotMagician) -> list[float]:
    return [joint.value for joint in arm.robot_joints()]


def touches(around: BoxSurroundings, *seen: list[float]) -> set[str]:
    return around.touches(RobotModel.load(URDF, {"tool_x": 0.0597, "tool_z": 0.0}), BASE, seen)


def test_the_model_agrees_with_the_arm(arm: DobotMagician, around: BoxSurroundings) -> None:
    reported, computed = arm.get_end_effector_pose("tcp"), arm.safe_moves.forward("tcp", arm.robot_joints())
    assert reported.position.distance_to(computed.position) < 1e-5
    assert reported.orientation.angle_to(computed.orientation) < 1e-4


@pytest.mark.parametrize("to_pose", [False, True])
def test_a_joint_move_goes_around(arm: DobotMagician, around: BoxSurroundings, to_pose: bool) -> None:
    seen: list[list[float]] = []
    goal = arm.forward_kinematics("tcp", joints(RIGHT))
    if to_pose:
        doing = BackgroundCall(arm.move_to_pose, "tcp", goal, 1.0, True, False)
    else:
        doing = BackgroundCall(arm.move_to_joints, joints(RIGHT), 1.0)
    while not doing.ended_at:
        sample = values(arm)
        if not seen or sample != seen[-1]:
            seen.append(sample)
        arm._observer.fresh()
    doing.result()
    assert arm.get_end_effector_pose("tcp").position.distance_to(goal.position) < 1e-3
    assert touches(around, *seen) == set()
    straight = [list(np.array(LEFT) + share * (np.array(RIGHT) - LEFT)) for share in np.linspace(0.0, 1.0, 100)]
    assert touches(around, *straight) == {"box"}


def test_a_blocked_move_is_refused_without_motion(arm: DobotMagician, around: BoxSurroundings) -> None:
    before = values(arm)
    inside = around.boxes["box"][0] + Position(0.0, 0.0, 0.05)
    pose = Pose(inside, arm.get_end_effector_pose("tcp").orientation)
    for move in (
        lambda: arm.move_to_pose("tcp", pose, 1.0, linear=False),
        lambda: arm.move_to_pose("tcp", pose, 1.0),
        lambda: arm.inverse_kinematics("tcp", pose),
    ):
        with pytest.raises(arm.KinematicsException, match=r"arm/\w+ and box"):
            move()
    assert values(arm) == pytest.approx(before, abs=1e-6)
    assert arm.inverse_kinematics("tcp", pose, avoid_collisions=False)


def test_a_line_past_an_obstacle_is_executed(arm: DobotMagician, around: BoxSurroundings) -> None:
    here = arm.get_end_effector_pose("tcp")
    there = Pose(here.position + Position(0.0, 0.0, 0.03), here.orientation)
    arm.move_to_pose("tcp", there, 1.0)
    assert arm.get_end_effector_pose("tcp").position.distance_to(there.position) < 1e-3


def test_a_stop_ends_a_safe_move(arm: DobotMagician, around: BoxSurroundings, fake: FakeProcess) -> None:
    doing = BackgroundCall(arm.move_to_joints, joints(RIGHT), 0.2)
    start = values(arm)
    while values(arm) == pytest.approx(start, abs=0.01):
        time.sleep(0.005)
        assert not doing.ended_at
    arm.stop()
    with pytest.raises(Cancelled):
        doing.result()
    at = values(arm)
    assert abs(at[0] - RIGHT[0]) > 0.3
    arm._observer.fresh()
    assert values(arm) == pytest.approx(at, abs=1e-6)


def test_the_arm_stops_before_an_obstacle_that_enters_its_path(arm: DobotMagician, around: BoxSurroundings) -> None:
    box = around.boxes.pop("box")
    doing = BackgroundCall(arm.move_to_joints, joints(RIGHT), 0.05)  # slow: it must not reach the box before it appears
    start = values(arm)
    while values(arm) == pytest.approx(start, abs=0.01):
        time.sleep(0.005)
        assert not doing.ended_at
    around.boxes["box"] = box
    with pytest.raises(PathBlocked, match="box came into its path"):
        doing.result()
    assert touches(around, values(arm)) == set()
    del around.boxes["box"]
    arm.move_to_joints(joints(RIGHT), 1.0)
