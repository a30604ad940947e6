"""Geometry against plain matrices, and the wire form of mutable and immutable data."""

import math

import msgspec
import numpy as np
import pytest
from hypothesis import given, strategies as st

from arcor2_hw.data.geometry import Orientation, Pose, Position, make_pose_abs, make_pose_rel
from arcor2_hw.data.object_type import Box, Model3dType, ObjectModel
from arcor2_hw.data.project import Action, Flow, ProjectRobotJoints, parse_link
from arcor2_hw.data.scene import SceneObject

lengths = st.floats(-10, 10)
positions = st.builds(Position, lengths, lengths, lengths)
orientations = (
    st.tuples(*[st.floats(-1, 1)] * 4).filter(lambda q: sum(v * v for v in q) > 1e-3).map(lambda q: Orientation(*q))
)
poses = st.builds(Pose, positions, orientations)


def homogeneous(pose: Pose) -> np.ndarray:
    """Return the homogeneous matrix by the textbook formula, independent of the code under test."""
    x, y, z, w = pose.orientation
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w), pose.position.x],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w), pose.position.y],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y), pose.position.z],
            [0, 0, 0, 1],
        ]
    )


@given(poses, poses)
def test_composition_and_inverse_agree_with_matrices(a: Pose, b: Pose) -> None:
    np.testing.assert_allclose(homogeneous(make_pose_abs(a, b)), homogeneous(a) @ homogeneous(b), atol=1e-9)
    np.testing.assert_allclose(
        homogeneous(make_pose_rel(a, b)), np.linalg.inv(homogeneous(a)) @ homogeneous(b), atol=1e-9
    )
    np.testing.assert_allclose(a.matrix(), homogeneous(a), atol=1e-9)
    np.testing.assert_allclose(homogeneous(Pose.from_matrix(a.matrix())), homogeneous(a), atol=1e-7)


@given(orientations)
def test_rotation_vector_and_back(q: Orientation) -> None:
    vector = q.rotation_vector()
    assert math.hypot(*vector) <= math.pi + 1e-9
    assert q.angle_to(Orientation.from_rotation_vector(*vector)) < 1e-7


@given(orientations, orientations)
def test_angle_between_is_symmetric_and_zero_only_to_itself(a: Orientation, b: Orientation) -> None:
    assert a.angle_to(b) == pytest.approx(b.angle_to(a), abs=1e-7)
    assert a.angle_to(a) < 1e-7


def test_an_orientation_is_normalised_and_zero_is_refused_on_the_wire_too() -> None:
    q = msgspec.json.decode(b'{"x": 0, "y": 0, "z": 3, "w": 4}', type=Orientation)
    assert tuple(q) == pytest.approx((0, 0, 0.6, 0.8))
    for bad in (b'{"x": 0, "y": 0, "z": 0, "w": 0}', b'{"w": 1e999}'):
        with pytest.raises(msgspec.ValidationError):
            msgspec.json.decode(bad, type=Orientation)


def test_default_poses_share_nothing() -> None:
    first, second = Pose(), Pose()
    first.position.x = 1.0
    assert second.position.x == 0.0


def test_unset_is_left_out_and_null_is_refused() -> None:
    assert (
        msgspec.json.encode(SceneObject("a", "T", id="obj_1"))
        == b'{"name":"a","type":"T","parameters":[],"id":"obj_1"}'
    )
    with pytest.raises(msgspec.ValidationError):
        msgspec.json.decode(b'{"name": "a", "type": "T", "pose": null}', type=SceneObject)
    with pytest.raises(msgspec.ValidationError):
        msgspec.json.decode(b'{"name": "a", "robot_id": "r", "joints": [], "arm_id": null}', type=ProjectRobotJoints)


def test_a_model_has_exactly_the_field_of_its_kind() -> None:
    box = Box("b", 1, 2, 3)
    assert ObjectModel.of(box) == ObjectModel(Model3dType.BOX, box=box)
    assert ObjectModel.of(box).model() is box
    for bad in (
        {"type": "Box"},
        {"type": "Sphere", "box": {"id": "b", "size_x": 1, "size_y": 1, "size_z": 1}},
        {"type": "Box", "box": {"id": "b", "size_x": 0, "size_y": 1, "size_z": 1}},
    ):
        with pytest.raises(msgspec.ValidationError):
            msgspec.convert(bad, ObjectModel)


def test_references_are_taken_apart_or_refused() -> None:
    assert Action("a", "obj_1/move").parse_type() == ("obj_1", "move")
    assert parse_link("act_1/default/0") == ("act_1", "default", 0)
    for bad in ("act_1", "act_1/default", "act_1/default/x", "/default/0", "a/b/0/1", "a/default/-1"):
        with pytest.raises(ValueError):
            parse_link(bad)
    with pytest.raises(ValueError):
        Flow(outputs=["x", "x"])
