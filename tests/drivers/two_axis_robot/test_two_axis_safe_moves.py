"""Safe moves of the two-axis robot around obstacles of the scene, and refused ones."""

import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import arcor2_drivers
from arcor2_drivers.two_axis_robot.two_axis_robot import TwoAxisRobot
from arcor2_hw.data.geometry import Orientation, Pose, Position
from arcor2_hw.data.robot import Joint
from arcor2_hw.exceptions import PathBlocked
from arcor2_hw.kinematics.model import RobotModel
from tests.drivers.background_call import BackgroundCall
from tests.drivers.surroundings import BoxSurroundings
from tests.fakes.conftest import FakeProcess

URDF = Path(next(iter(arcor2_drivers.__path__))) / "two_axis_robot" / "urdf" / "two_axis_robot"
BASE = Pose(Position(0.3, 0.1, 0.05), Orientation.from_rotation_vector(0.0, 0.0, 0.5))
LINKS = {"link_1": 0.12, "link_2": 0.09}
LEFT, RIGHT = (0.9, 0.2), (-0.9, -0.2)


@pytest.fixture
def arm(fake: FakeProcess, make: Callable[..., TwoAxisRobot]) -> TwoAxisRobot:
    arm = make(fake.ready["port"], BASE, **LINKS)
    arm.connect()
    return arm


@pytest.fixture
def around(arm: TwoAxisRobot) -> BoxSurroundings:
    around = BoxSurroundings()
    arm.surround(around)
    arm.take_control()
    arm.move_to_joints(joints(LEFT), 1.0)
    around.boxes["pin"] = (BASE * Pose(Position(0.18, 0.0, 0.02))).position, (0.01, 0.01, 0.05)
    return around


def joints(values: tuple[float, ...]) -> list[Joint]:
    return [Joint(f"joint_{number}", value) for number, value in enumerate(values, 1)]


def values(arm: TwoAxisRobot) -> list[float]:
    return [joint.value for joint in arm.robot_joints()]


def touches(around: BoxSurroundings, *seen: list[float]) -> set[str]:
    return around.touches(RobotModel.load(URDF, LINKS), BASE, seen)


def test_a_move_folds_the_arm_around_a_pin(arm: TwoAxisRobot, around: BoxSurroundings) -> None:
    seen: list[list[float]] = []
    doing = BackgroundCall(arm.move_to_joints, joints(RIGHT), 1.0)
    while not doing.ended_at:
        time.sleep(0.005)
        sample = values(arm)
        if not seen or sample != seen[-1]:
            seen.append(sample)
    doing.result()
    assert values(arm) == pytest.approx(RIGHT, abs=0.03)
    assert max(abs(q[1]) for q in seen) > 0.5
    assert touches(around, *seen) == set()
    straight = [list(np.array(LEFT) + share * (np.array(RIGHT) - LEFT)) for share in np.linspace(0.0, 1.0, 200)]
    assert touches(around, *straight) == {"pin"}


def test_the_elbow_moves_to_the_free_side(arm: TwoAxisRobot, around: BoxSurroundings) -> None:
    pose = arm.forward_kinematics("tcp", joints((-0.2, -0.9)))
    blind = arm.inverse_kinematics("tcp", pose, joints((-0.2, -0.9)), avoid_collisions=False)
    assert [joint.value for joint in blind] == pytest.approx((-0.2, -0.9), abs=1e-6)
    elbow = BASE * Pose(Position(0.12 * np.cos(-0.2), 0.12 * np.sin(-0.2), 0.01))
    around.boxes["pin"] = elbow.position, (0.01, 0.01, 0.03)
    found = arm.inverse_kinematics("tcp", pose, joints((-0.2, -0.9)))
    assert found[1].value == pytest.approx(0.9, abs=0.02)
    assert touches(around, [joint.value for joint in found]) == set()
    at = arm.forward_kinematics("tcp", found).position
    assert at.distance_to(pose.position) < 2e-3
    around.boxes["pin"] = pose.position, (0.01, 0.01, 0.05)
    before = values(arm)
    for move in (
        lambda: arm.inverse_kinematics("tcp", pose),
        lambda: arm.move_to_pose("tcp", pose, 1.0, linear=False),
    ):
        with pytest.raises(arm.KinematicsException, match=r"arm/link_2 and pin"):
            move()
    assert values(arm) == pytest.approx(before, abs=0.01)


def test_the_arm_stops_before_an_obstacle_that_enters_its_path(arm: TwoAxisRobot, around: BoxSurroundings) -> None:
    pin = around.boxes.pop("pin")
    doing = BackgroundCall(arm.move_to_joints, joints(RIGHT), 0.05)  # slow: it must not reach the pin before it appears
    start = values(arm)
    while values(arm) == pytest.approx(start, abs=0.02):
        time.sleep(0.005)
        assert not doing.ended_at
    around.boxes["pin"] = pin
    with pytest.raises(PathBlocked, match="pin came into its path"):
        doing.result()
    assert touches(around, values(arm)) == set()
