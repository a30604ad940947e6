"""Differences between the models of the e-series: the lengths of the links, the payload and the reach."""

from collections.abc import Callable, Iterator
from typing import NamedTuple

import pytest

from arcor2_drivers.universal_robots.move_actions import MoveType
from arcor2_drivers.universal_robots.settings import UrSettings
from arcor2_drivers.universal_robots.universal_robot import UniversalRobot
from arcor2_drivers.universal_robots.ur5e import UR3e, UR5e, UR10e
from arcor2_hw.data.geometry import Pose, Position
from arcor2_hw.exceptions import OutOfRange
from tests.drivers.universal_robots.conftest import HOME, FakeUr

PAYLOADS: dict[type[UniversalRobot], float] = {UR3e: 3.0, UR5e: 5.0, UR10e: 12.5}
"""Greatest payload according to the data sheets, kg."""


class Cell(NamedTuple):
    """A robot and its controller."""

    robot: UniversalRobot
    fake: FakeUr


@pytest.fixture(params=PAYLOADS, ids=lambda kind: kind.__name__)
def cell(request: pytest.FixtureRequest, start_fake: Callable[..., FakeUr]) -> Iterator[Cell]:
    fake = start_fake("--model", request.param.__name__.lower(), "--time-scale", "0.1")
    fake.do("place", q=HOME)
    robot = request.param("obj_1", "ur", Pose(), UrSettings(fake.host, payload_mass=1.0, tcp_z=0.25, tcp_x=0.02))
    robot.connect(30.0)
    yield Cell(robot, fake)
    robot.disconnect()


def test_the_pose_is_computed_with_the_links_of_the_model(cell: Cell) -> None:
    """Before control is taken, the driver computes the pose; afterwards the controller does, with its own links."""
    before = cell.robot.get_end_effector_pose("tcp")
    cell.robot.take_control()
    after = cell.robot.get_end_effector_pose("tcp")
    assert before.position.distance_to(after.position) < 1e-3
    assert before.orientation.angle_to(after.orientation) < 1e-3


def test_a_pose_is_reached(cell: Cell) -> None:
    cell.robot.take_control()
    start = cell.robot.get_end_effector_pose("tcp")
    target = Pose(start.position + Position(0.03, 0.02, 0.04), start.orientation)
    cell.robot.move(target, MoveType.JOINT, 0.8)
    assert cell.robot.get_end_effector_pose("tcp").position.distance_to(target.position) < 1e-3
    assert cell.robot.forward_kinematics("tcp", cell.robot.robot_joints()).position.distance_to(target.position) < 1e-3
    with pytest.raises(UniversalRobot.KinematicsException, match="cannot reach"):
        cell.robot.move_to_pose("tcp", Pose(Position(3.0, 0.0, 0.0)), 0.5)


@pytest.mark.parametrize("kind", PAYLOADS)
def test_the_payload_of_the_model_is_the_limit(kind: type[UniversalRobot]) -> None:
    most = PAYLOADS[kind]
    kind("obj_1", "ur", Pose(), UrSettings("127.0.0.1", payload_mass=most))
    with pytest.raises(OutOfRange, match="payload_mass"):
        kind("obj_1", "ur", Pose(), UrSettings("127.0.0.1", payload_mass=most + 0.01))
