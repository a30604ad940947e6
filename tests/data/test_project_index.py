"""Action points in the world: a parent object turns them, a parent action point only moves them."""

import math

import pytest

from arcor2_hw.data.geometry import Orientation, Pose, Position
from arcor2_hw.data.project import ActionPoint, NamedOrientation, Project
from arcor2_hw.data.project_index import ProjectIndex, global_pose, relative_pose
from arcor2_hw.data.scene import Scene, SceneObject
from arcor2_hw.exceptions import InvalidProject, NotFound

QUARTER = Orientation.from_rotation_vector(0, 0, math.pi / 2)


@pytest.fixture
def index() -> ProjectIndex:
    scene = Scene(
        "s",
        id="scn",
        objects=[
            SceneObject("table", "T", Pose(Position(1, 0, 0), QUARTER), id="obj_t"),
            SceneObject("clock", "C", id="obj_c"),
        ],
    )
    points = [
        ActionPoint("a", Position(1, 0, 0), "obj_t", id="a", orientations=[NamedOrientation("o", QUARTER, "ori_a")]),
        ActionPoint("b", Position(0, 1, 0), "a", id="b", orientations=[NamedOrientation("o", Orientation(), "ori_b")]),
        ActionPoint("free", Position(5, 6, 7), id="free"),
        ActionPoint("lost", Position(), "nowhere", id="lost"),
        ActionPoint("on_clock", Position(), "obj_c", id="on_clock"),
        ActionPoint("x", Position(), "y", id="x"),
        ActionPoint("y", Position(), "x", id="y"),
    ]
    return ProjectIndex(scene, Project("p", "scn", action_points=points))


def test_chain_of_parents(index: ProjectIndex) -> None:
    # a is 1 m along the table's x, which is the world's y. b is 1 m along a's y, which is the world's -x, because the
    # orientation of the action point a rotates nothing.
    point, orientation = index.orientation("ori_b")
    pose = global_pose(index, point, orientation.orientation)
    assert tuple(pose.position) == pytest.approx((0, 1, 0))
    assert pose.orientation.angle_to(QUARTER) < 1e-9
    point, orientation = index.orientation("ori_a")
    pose = global_pose(index, point, orientation.orientation)
    assert tuple(pose.position) == pytest.approx((1, 1, 0))
    assert pose.orientation.angle_to(QUARTER * QUARTER) < 1e-9
    assert tuple(global_pose(index, index.action_point("free")).position) == (5, 6, 7)


def test_relative_undoes_global(index: ProjectIndex) -> None:
    point = index.action_point("b")
    back = relative_pose(index, point, global_pose(index, point))
    assert back.position.distance_to(point.position) < 1e-9
    assert back.orientation.angle_to(Orientation()) < 1e-9


def test_impossible_parents_are_named(index: ProjectIndex) -> None:
    with pytest.raises(NotFound, match="nowhere"):
        global_pose(index, index.action_point("lost"))
    with pytest.raises(InvalidProject, match="clock has no pose"):
        global_pose(index, index.action_point("on_clock"))
    with pytest.raises(InvalidProject, match="ancestor"):
        global_pose(index, index.action_point("x"))
