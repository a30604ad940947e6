"""Tests that the robot and the press of the demo keep their distance while they work at the same time."""

from itertools import pairwise

import numpy as np
import pytest

from arcor2_drivers.two_axis_robot import kinematics as two_axis_kinematics
from arcor2_hw.collision.world import CollisionWorld
from arcor2_hw.data.geometry import Orientation, Pose, Position
from arcor2_hw.kinematics.inverse import InverseKinematics
from arcor2_hw.kinematics.model import RobotModel
from arcor2_hw.kinematics.shapes import Box
from arcor2_server.demo.workplace import Workplace, load
from tests.kinematics.kin_robots import TWO_AXIS, ur

MIN_DISTANCE = 0.04
"""Smallest allowed distance, m."""
SEED = np.array((0.0, -1.4, 2.0, -2.2, -1.57, 0.0))
STEPS = 12


def base(cell: Workplace, name: str) -> Pose:
    (found,) = (each for each in cell.objects if each.name == name)
    assert found.position is not None
    return Pose(Position(*found.position), Orientation.from_rotation_vector(*found.rotation))


def target(cell: Workplace, name: str) -> Pose:
    """Return the pose of an action point in the world. The parents are not rotated."""
    (point,) = (each for each in cell.points if each.name == name)
    origin = base(cell, point.parent).position if point.parent else Position()
    offset = Position(*point.position)
    position = Position(origin.x + offset.x, origin.y + offset.y, origin.z + offset.z)
    return Pose(position, Orientation.from_rotation_vector(*point.rotation))


def interpolated(joints: list[np.ndarray]) -> list[np.ndarray]:
    return [one + (two - one) * t for one, two in pairwise(joints) for t in np.linspace(0.0, 1.0, STEPS)]


def robot_path(cell: Workplace) -> list[np.ndarray]:
    """Return the joints from above the nest to the stop and the tester, as `load_tester` moves."""
    tool = Pose(Position(0.0, 0.0, 0.15)).matrix()
    inverse = InverseKinematics(ur().arm("tcp", tool))
    approach = {each.name: float(each.parameters.get("approach", 0.0)) for each in cell.steps}  # type: ignore[arg-type]
    origin = np.linalg.inv(base(cell, "robot").matrix())
    found, q = [], SEED
    for name, back in (
        ("nest", approach["into_nest"]),
        ("stop", approach["pick"]),
        ("stop", 0.0),
        ("stop", approach["pick"]),
        ("fixture", approach["insert"]),
    ):
        q = inverse.solve(origin @ (target(cell, name) * Pose(Position(0.0, 0.0, -back))).matrix(), q)
        found.append(q)
    return interpolated(found)


def press_path(cell: Workplace) -> list[np.ndarray]:
    """Return the joints of the press from its place next to the nest along the label and back."""
    origin = np.linalg.inv(base(cell, "press").matrix())
    found: list[np.ndarray] = []
    for name in ("beside", "label_begin", "label_end", "beside"):
        x, y, _ = (origin @ target(cell, name).matrix())[:3, 3]
        options = [np.array(q) for q in two_axis_kinematics.inverse((0.15, 0.10), x, y)]
        found.append(min(options, key=lambda q: float(abs(q - found[-1]).max())) if found else options[0])
    return interpolated(found)[:: STEPS // 4]


@pytest.fixture(scope="module")
def cell() -> Workplace:
    return load()


def test_robot_and_press_keep_their_distance(cell: Workplace) -> None:
    world = CollisionWorld(MIN_DISTANCE)
    path, press = robot_path(cell), press_path(cell)
    world.add_robot("robot", ur(), base(cell, "robot"), path[0])
    world.add_robot("press", RobotModel.load(TWO_AXIS), base(cell, "press"), press[0])
    flange = base(cell, "robot") * Pose.from_matrix(ur().link_poses(path[0])["flange"])
    for name, size, at in (("gripper", (0.06, 0.06, 0.145), 0.0775), ("board", (0.08, 0.06, 0.002), 0.149)):
        world.put(name, Box(*size), flange * Pose(Position(0.0, 0.0, at)))
        world.attach(name, "robot", "flange", touching=["gripper", "board"])
    touched = set()
    for press_joints in press:
        world.set_joints("press", press_joints)
        for q in path:
            touched |= {str(contact) for contact in world.contacts("robot", q) if "press" in str(contact)}
    assert touched == set()
