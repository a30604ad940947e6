"""Rigid motions as arrays."""

import math

import numpy as np
import pytest
from hypothesis import given, strategies as st

from arcor2_hw.calibration.rigid import (
    cross_matrix,
    inverted,
    mean_rotation,
    motion,
    moved,
    pose_difference,
    rotation_vector,
    turned,
)
from arcor2_hw.data.geometry import Orientation

axes = (
    st.tuples(*[st.floats(-1, 1)] * 3)
    .filter(lambda v: math.hypot(*v) > 0.1)
    .map(lambda v: np.array(v) / math.hypot(*v))
)
angles = st.one_of(st.floats(0, math.pi), st.floats(0, 1e-7), st.floats(math.pi - 1e-7, math.pi))


@given(axes, angles)
def test_rotation_vectors_round_trip(axis: np.ndarray, angle: float) -> None:
    rotation = turned(axis * angle)
    assert np.abs(rotation @ rotation.T - np.eye(3)).max() < 1e-12
    assert np.abs(rotation - Orientation.from_rotation_vector(*(axis * angle)).matrix()).max() < 1e-9
    back = rotation_vector(rotation)
    assert np.linalg.norm(back) <= math.pi + 1e-9
    assert np.abs(turned(back) - rotation).max() < 1e-7


@given(axes, st.floats(0, 3))
def test_motions_are_inverted_and_transformed(axis: np.ndarray, angle: float) -> None:
    pose = motion(turned(axis * angle), axis[::-1])
    assert np.abs(pose @ inverted(pose) - np.eye(4)).max() < 1e-12
    step = np.array([0.0, 0.0, math.pi / 2, 0.1, 0.0, 0.0])
    after = moved(pose, step)
    x, y, z = pose[:3, 3]
    assert after[:3, 3] == pytest.approx([-y + 0.1, x, z])
    assert pose_difference(pose, moved(pose, np.array([0.0, 0.2, 0.0, 0.0, 0.0, 0.0])))[1] == pytest.approx(0.2)


def test_batched_cross_products_match_single_ones() -> None:
    vectors = np.random.default_rng(1).normal(size=(5, 3))
    other = np.array([0.3, -0.2, 0.9])
    assert cross_matrix(vectors) @ other == pytest.approx(np.cross(vectors, other))


def test_mean_rotation_is_the_eigenvector_of_the_quaternions() -> None:
    random = np.random.default_rng(2)
    base = turned(np.array([0.4, -1.0, 2.0]))
    rotations = np.stack([base @ turned(0.3 * random.normal(size=3)) for _ in range(6)])
    weights = random.uniform(0.1, 1.0, 6)
    quaternions = [np.array(tuple(Orientation.from_matrix(each))) for each in rotations]
    total = sum(w * np.outer(q, q) for w, q in zip(weights, quaternions, strict=True))
    mean = Orientation(*map(float, np.linalg.eigh(total)[1][:, -1]))
    assert np.abs(mean_rotation(rotations, weights) - mean.matrix()).max() < 1e-12
