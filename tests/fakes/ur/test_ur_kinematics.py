"""Kinematics of the fake: consistency, published numbers, and singularities."""

import math

import numpy as np
import pytest
from hypothesis import given, strategies as st

from arcor2_fakes.ur.kinematics import (
    IDENTITY,
    MODELS,
    Chain,
    NoSolution,
    compose,
    difference,
    from_pose,
    invert,
    to_pose,
)

joints = st.tuples(*[st.floats(-math.pi, math.pi)] * 6)
offsets = st.tuples(*[st.floats(-0.3, 0.3)] * 3, *[st.floats(-1.5, 1.5)] * 3)


def far(a, b):
    shift, turn = difference(a, b)
    return max(map(abs, (*shift, *turn)))


@pytest.mark.parametrize(
    ("q", "pose"),
    [
        # Straight up: the sum of all vertical links, and the lateral offsets d4 and d6.
        ((0, -math.pi / 2, 0, -math.pi / 2, 0, 0), (0, -0.2329, 1.0794, 0, 2.2214415, -2.2214415)),
        # Stretched out along -x.
        ((0, 0, 0, 0, 0, 0), (-0.8172, -0.2329, 0.0628, math.pi / 2, 0, 0)),
    ],
)
def test_known_poses_of_the_ur5e(q, pose):
    assert to_pose(Chain().forward(q)) == pytest.approx(pose, abs=1e-6)


@given(q=joints, tcp=offsets, model=st.sampled_from(sorted(MODELS)))
def test_every_solution_reaches_the_pose(q, tcp, model):
    chain = Chain(model)
    chain.set_tcp(tcp)
    pose = chain.forward(q)
    solutions = chain.solutions(pose, q[5])
    assert solutions
    assert max(far(pose, chain.forward(s)) for s in solutions) < 1e-5
    assert far(pose, chain.forward(chain.inverse(pose, q))) < 1e-6


@given(q=joints)
def test_inverse_kinematics_follows_the_seed(q):
    chain = Chain()
    if abs(math.sin(q[4])) < 0.01 or abs(math.sin(q[2])) < 0.01:
        return  # at a singularity the neighbour is not unique
    p4 = chain.flange(q)[3]
    z = chain.flange(q)[2]
    if math.hypot(p4[0] - 0.0996 * z[0], p4[1] - 0.0996 * z[1]) < 0.1333 + 1e-3:
        return  # shoulder singularity
    assert chain.inverse(chain.forward(q), q) == pytest.approx(q, abs=1e-5)


def test_unreachable_poses_have_no_solution():
    with pytest.raises(NoSolution):
        Chain().inverse(from_pose((2.0, 0.0, 0.0, 0.0, 0.0, 0.0)), (0.0,) * 6)


@given(pose=st.tuples(*[st.floats(-2, 2)] * 3, *[st.floats(-1.8, 1.8)] * 3))
def test_pose_round_trip(pose):
    assert to_pose(from_pose(pose)) == pytest.approx(pose, abs=1e-9)


@pytest.mark.parametrize("axis", [(1, 0, 0), (0, -1, 0), (0, 0, 1), (1, 1, 0), (-1, 2, 3)])
@pytest.mark.parametrize("angle", [math.pi, math.pi - 1e-9, math.pi - 1e-4, 1e-9, 0.0])
def test_rotation_vectors_at_zero_and_pi(axis, angle):
    k = np.array(axis) / np.linalg.norm(axis)
    frame = from_pose((0.0, 0.0, 0.0, *(k * angle)))
    assert far(from_pose(to_pose(frame)), frame) < 1e-7


@given(q=joints, tcp=offsets)
def test_jacobian_is_the_derivative(q, tcp):
    chain = Chain()
    chain.set_tcp(tcp)
    jacobian, step = chain.jacobian(q), 1e-6
    for i in range(6):
        moved = [v + step * (j == i) for j, v in enumerate(q)]
        shift, turn = difference(chain.forward(q), chain.forward(moved))
        assert np.array((*shift, *turn)) / step == pytest.approx(jacobian[:, i], abs=1e-4)


@given(pose=offsets)
def test_inverse_frame(pose):
    frame = from_pose(pose)
    assert far(compose(frame, invert(frame)), IDENTITY) < 1e-12
