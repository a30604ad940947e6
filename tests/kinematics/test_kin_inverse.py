"""Inverse kinematics: round trip, nearest solution first, within limits, all configurations."""

import itertools
import math

import numpy as np
import pytest
from hypothesis import assume, given, settings, strategies as st

from arcor2_drivers.dobot_magician import kinematics as dobot_kinematics
from arcor2_drivers.two_axis_robot import kinematics as two_axis_kinematics
from arcor2_fakes.ur.kinematics import Chain
from arcor2_hw.collision.world import CollisionWorld, collision_check
from arcor2_hw.data.geometry import Orientation, Pose, Position
from arcor2_hw.kinematics.arm import Arm
from arcor2_hw.kinematics.dh import DhRow, calibrated
from arcor2_hw.kinematics.errors import OnlyInCollision, OutOfReach
from arcor2_hw.kinematics.inverse import InverseKinematics
from arcor2_hw.kinematics.model import RobotModel
from arcor2_hw.kinematics.shapes import Array, Sphere
from tests.kinematics.kin_robots import DOBOT, TWO_AXIS, joint, links, six_axes, ur, urdf
from tests.kinematics.test_kin_model import rows_of

TURN = st.floats(-2.0 * math.pi, 2.0 * math.pi)
SIX = st.tuples(TURN, TURN, TURN, TURN, TURN, TURN)


def assert_there(arm: Arm, q: Array, target: Array, within: float = 2e-5) -> None:
    assert arm.within(q)
    assert np.allclose(arm.forward(q), target, atol=within)


def wrapped(q: Array) -> Array:
    return np.remainder(q + np.pi, 2.0 * np.pi) - np.pi


def is_among(q: Array, found: list[Array], within: float = 1e-4) -> bool:
    return any(np.abs(wrapped(other - q)).max() < within for other in found)


# ------------------------------------------------------------------------------------------------ the UR's kind
@pytest.mark.parametrize("name", ["ur3e", "ur5e", "ur10e"])
@given(values=SIX, seed=SIX)
def test_forward_after_inverse_is_the_pose(name: str, values: tuple[float, ...], seed: tuple[float, ...]) -> None:
    arm = ur(name).arm("tcp", Pose(Position(0.01, -0.03, 0.12)).matrix())
    assume(arm.smallest(np.array(values)) > 1e-4)
    target = arm.forward(np.array(values))
    inverse = InverseKinematics(arm)
    assert inverse.has_closed_form
    assert_there(arm, inverse.solve(target, np.array(seed)), target)


@given(SIX)
def test_a_seed_that_is_a_solution_is_returned(values: tuple[float, ...]) -> None:
    arm = ur().arm("tcp")
    q = np.array(values)
    assume(not arm.dexterity(q).near_singularity)
    assert np.allclose(InverseKinematics(arm).solve(arm.forward(q), q), q, atol=1e-6)


@given(SIX)
def test_configurations_match_an_independent_solver(values: tuple[float, ...]) -> None:
    arm, q = ur().arm("tcp"), np.array(values)
    assume(not arm.dexterity(q).near_singularity)
    chain = Chain("ur5e")
    expected = [np.array(each) for each in chain.solutions(chain.forward(values))]
    # Where the other configurations are nearly singular, both lose digits.
    assume(not any(arm.dexterity(each).near_singularity for each in expected))
    found = InverseKinematics(arm).solutions(arm.forward(q))
    assert len(found) == len(expected)
    assert all(is_among(each, expected) for each in found)
    assert is_among(q, found)


def test_solutions_are_sorted_by_their_distance_from_the_seed() -> None:
    """The solutions equal those of an independent solver, each at the turns nearest to the seed."""
    arm, chain, chance = ur().arm("tcp"), Chain("ur5e"), np.random.default_rng(4)
    arm.lower[2], arm.upper[2] = -4.0, 1.0
    inverse = InverseKinematics(arm)
    compared = 0
    for _ in range(200):
        q = chance.uniform(-math.pi, math.pi, 6)
        seed = chance.uniform(-7.0, 7.0, 6) if chance.random() < 0.5 else q + chance.uniform(-0.2, 0.2, 6)
        configurations = np.array(chain.solutions(chain.forward(q.tolist())))
        if any(arm.dexterity(each).near_singularity for each in configurations):
            continue
        turns = configurations[:, :, None] + 2.0 * math.pi * np.arange(-2, 3)
        turns[(turns < arm.lower[:, None]) | (turns > arm.upper[:, None])] = np.inf
        best = np.abs(turns - seed[:, None]).argmin(axis=2)
        nearest = np.take_along_axis(turns, best[:, :, None], axis=2)[:, :, 0]
        expected = sorted(nearest[np.isfinite(nearest).all(axis=1)].tolist(), key=lambda each: math.dist(each, seed))
        target = arm.forward(q)
        found = inverse.solutions(target, seed)
        assert np.allclose(found, np.array(expected), atol=1e-6)
        assert np.array_equal(inverse.solve(target, seed), found[0])
        assert all(np.array_equal(*pair) for pair in zip(inverse.candidates(target, seed), found, strict=True))
        compared += len(found)
    assert compared > 600


def test_poses_at_and_near_singularities_are_reached() -> None:
    arm = ur().arm("tcp", Pose(Position(0.01, -0.03, 0.12)).matrix())
    inverse = InverseKinematics(arm)
    chance = np.random.default_rng(3)
    quarter = np.arange(-4, 5) * math.pi / 2.0
    for _ in range(300):
        q = chance.choice(quarter, 6) + chance.choice((0.0, 1e-3, -1e-5, 1e-7, 1e-9, 0.5, -1.3), 6)
        q = np.clip(q, arm.lower, arm.upper)
        target = arm.forward(q)
        assert_there(arm, inverse.solve(target, chance.uniform(-6.0, 6.0, 6)), target)


def test_poses_slightly_out_of_reach_are_reached_within_the_tolerance() -> None:
    """Near a singularity, a joint changes by the square root of a pose error, and with it the reach of the others."""
    arm = ur().arm("tcp")
    inverse, chance = InverseKinematics(arm), np.random.default_rng(1)
    for _ in range(200):
        q = chance.choice((-math.pi, -math.pi / 2.0, 0.0, math.pi / 2.0, math.pi), 6) + chance.choice((0.0, 1e-3), 6)
        q[2] = chance.choice((0.0, 1e-3))
        error = Orientation.from_rotation_vector(*chance.uniform(-2e-6, 2e-6, 3))
        target = arm.forward(q) @ Pose(Position(*chance.uniform(-3e-7, 3e-7, 3)), error).matrix()
        assert_there(arm, inverse.solve(target, chance.uniform(-6.0, 6.0, 6)), target)


def test_at_a_singularity_the_free_joint_keeps_the_seeds_value() -> None:
    arm = ur().arm("tcp")
    inverse = InverseKinematics(arm)
    for q in (
        (0.3, -1.2, 1.4, -0.4, 0.0, 0.7),
        (0.3, -1.2, 0.0, -0.4, 1.3, 0.7),
        (0.0, -math.pi / 2, 0.0, 0.0, 0.0, 0.0),
    ):
        target = arm.forward(np.array(q))
        assert_there(arm, inverse.solve(target, np.array(q)), target)
    free = np.array((0.3, -1.2, 1.4, -0.4, 0.0, 0.7))
    assert np.allclose(inverse.solve(arm.forward(free), free), free, atol=1e-6)


def test_all_turns_are_given_on_request_and_the_nearest_otherwise() -> None:
    arm = ur().arm("tcp")
    q = np.array((0.5, -1.2, 1.4, -0.4, 1.3, 0.7))
    inverse = InverseKinematics(arm)
    plain, all_of_them = (inverse.solutions(arm.forward(q), q, turns=turns) for turns in (False, True))
    assert len(plain) == 8
    assert len(all_of_them) == 8 * 2**6  # each joint has two turns within +-360 degrees
    assert np.allclose(all_of_them[0], q, atol=1e-6)
    assert all(arm.within(each) for each in all_of_them)
    distances = [math.dist(each, q) for each in all_of_them]
    assert distances == sorted(distances)
    far = q + (2.0 * math.pi) * np.array((-1, 0, -1, 1, 0, 0))
    assert np.allclose(inverse.solve(arm.forward(q), far), far, atol=1e-6)
    # Beyond the limit there is no other turn, however close the seed is.
    beyond = q + 2.0 * math.pi * np.array((2, 0, 0, 0, 0, 0))
    found = inverse.solutions(arm.forward(q), beyond)
    assert len(found) == 8
    assert all(arm.within(each) for each in found)
    assert is_among(q, found)


def test_joint_limits_remove_configurations() -> None:
    arm = ur().arm("tcp")
    q = np.array((0.5, -1.2, 1.4, -0.4, 1.3, 0.7))
    arm.lower[2], arm.upper[2] = -3.0, 0.0  # an elbow that bends only in one direction
    found = InverseKinematics(arm).solutions(arm.forward(q), q)
    assert len(found) == 4
    assert all(each[2] <= 0.0 for each in found)
    arm.lower[2], arm.upper[2] = -0.1, 0.1
    with pytest.raises(OutOfReach):
        InverseKinematics(arm).solve(arm.forward(q), q)


@settings(max_examples=50)
@given(SIX, st.lists(st.tuples(*[st.floats(-2e-3, 2e-3)] * 4), min_size=6, max_size=6))
def test_a_calibrated_arm_has_its_own_configurations(
    values: tuple[float, ...], deltas: list[tuple[float, ...]]
) -> None:
    rows = [row.plus(DhRow(*delta)) for row, delta in zip(rows_of("ur5e"), deltas, strict=True)]
    arm, q = calibrated(ur(), "tcp", rows).arm("tcp"), np.array(values)
    assume(not arm.dexterity(q).near_singularity)
    inverse = InverseKinematics(arm)
    assert inverse.has_closed_form
    target = arm.forward(q)
    assert np.allclose(inverse.solve(target, q), q, atol=1e-5)
    for each in inverse.solutions(target, q):
        assert_there(arm, each, target)


# ------------------------------------------------------------------------------------------------ others
def test_an_arm_without_closed_form_is_solved_numerically() -> None:
    arm = six_axes(wrist=0.06).arm("tool")
    inverse = InverseKinematics(arm)
    assert not inverse.has_closed_form
    chance = np.random.default_rng(8)
    lower, upper = np.maximum(arm.lower, -math.pi), np.minimum(arm.upper, math.pi)
    missed = 0
    for _ in range(100):
        q, seed = chance.uniform(lower, upper), chance.uniform(lower, upper)
        target = arm.forward(q)
        try:
            found = inverse.solve(target, seed)
        except OutOfReach:
            missed += 1
            continue
        assert_there(arm, found, target)
        assert np.array_equal(InverseKinematics(arm).solve(target, seed), found)  # the same question, the same answer
        near = np.clip(q + chance.uniform(-0.02, 0.02, 6), lower, upper)
        if not arm.dexterity(q).near_singularity:
            assert np.abs(inverse.solve(target, near) - q).max() < 0.1
    assert missed <= 1


@pytest.mark.parametrize("elbow", ["0 1 0", "0 -1 0"])
@given(st.tuples(*[st.floats(-1.9, 1.9)] * 6), st.tuples(*[st.floats(-1.9, 1.9)] * 6))
def test_an_industrial_arm_is_solved_in_closed_form(
    elbow: str, values: tuple[float, ...], seed: tuple[float, ...]
) -> None:
    arm, q = six_axes(elbow=elbow).arm("tool"), np.array(values)
    inverse = InverseKinematics(arm)
    assert inverse.has_closed_form
    target = arm.forward(q)
    assume(arm.smallest(q) > 1e-4)
    assert_there(arm, inverse.solve(target, np.array(seed)), target)
    if not arm.dexterity(q).near_singularity:
        assert np.allclose(inverse.solve(target, q), q, atol=1e-6)


def test_closed_form_and_numerical_solutions_agree() -> None:
    arm = six_axes().arm("tool")
    q = np.array((0.4, 0.5, -0.6, 0.8, 0.9, -0.3))
    computing, searching = InverseKinematics(arm), InverseKinematics(arm)
    searching._form = None
    computed, searched = (each.solutions(arm.forward(q), q) for each in (computing, searching))
    assert np.allclose(computed[0], q, atol=1e-6)
    for one, other in itertools.combinations(computed, 2):
        assert np.abs(wrapped(one - other)).max() > 1e-3
    flipped = q + np.array((0, 0, 0, -math.pi, 0, math.pi))
    flipped[4] = -q[4]
    assert is_among(flipped, computed)
    assert len(searched) == len(computed) >= 4
    assert all(is_among(each, computed) for each in searched)
    # A straight wrist: joints 4 and 6 turn about one axis, and the share of the seed is used.
    straight = np.array((0.4, 0.5, -0.6, 0.8, 0.0, -0.3))
    assert np.allclose(computing.solve(arm.forward(straight), straight), straight, atol=1e-6)


@given(st.tuples(*(st.floats(low, high) for low, high in dobot_kinematics.LIMITS.values())))
def test_dobot_joints_match_its_driver(q: tuple[float, float, float, float]) -> None:
    arm = RobotModel.load(DOBOT).arm("tcp")
    target = arm.forward(np.array(q))
    tool = dobot_kinematics.tool_of(Pose.from_matrix(target))
    try:
        expected = dobot_kinematics.inverse(tool, 0.0597, 0.0)
    except dobot_kinematics.Unreachable:
        assume(False)
    out = math.hypot(tool.x, tool.y)
    assume(out > 0.08)  # above its base the arm may also face backwards
    found = InverseKinematics(arm).solutions(target, np.array(q))
    assert np.allclose(found[0], q, atol=1e-4)
    # Nearly stretched, the elbow may point down as well; the driver's is above.
    assert is_among(np.array(expected), found) or abs(q[1] - q[2] - math.pi / 2.0) < 0.3


def test_a_dobot_cannot_tilt_its_tool() -> None:
    arm = RobotModel.load(DOBOT).arm("tcp")
    target = arm.forward(np.array((0.2, 0.5, 0.4, 0.1)))
    tilted = target.copy()
    tilted[:3, :3] = target[:3, :3] @ np.array(
        ((1, 0, 0), (0, math.cos(0.1), -math.sin(0.1)), (0, math.sin(0.1), math.cos(0.1)))
    )
    with pytest.raises(OutOfReach):
        InverseKinematics(arm).solve(tilted)
    slightly = target.copy()
    slightly[:3, :3] = target[:3, :3] @ np.array(
        ((1, 0, 0), (0, math.cos(0.01), -math.sin(0.01)), (0, math.sin(0.01), math.cos(0.01)))
    )
    q = InverseKinematics(arm).solve(slightly)
    assert np.allclose(arm.forward(q)[:3, 3], target[:3, 3], atol=1e-5)


@settings(max_examples=40, deadline=None)
@given(st.tuples(st.floats(-2.6, 2.6), st.floats(-2.6, 2.6)), st.floats(-3.0, 3.0))
def test_two_joints_reach_a_position_with_any_heading(q: tuple[float, float], heading: float) -> None:
    assume(abs(q[1]) > 0.05)
    arm = RobotModel.load(TWO_AXIS).arm("tcp")
    target = arm.forward(np.array(q))
    target[:3, :3] = Pose().matrix()[:3, :3]
    c, s = math.cos(heading), math.sin(heading)
    target[:2, :2] = (c, -s), (s, c)
    found = InverseKinematics(arm).solutions(target, np.array(q))
    assert np.allclose(found[0], q, atol=1e-3)
    expected = [
        each
        for each in two_axis_kinematics.inverse((0.15, 0.1), float(target[0, 3]), float(target[1, 3]))
        if all(abs(value) <= 2.63 for value in each)  # within the millimetre that a pose may be off
    ]
    assert all(
        any(np.allclose(wrapped(each - np.array(other)), 0.0, atol=0.02) for other in expected) for each in found
    )
    upside_down = target.copy()
    upside_down[:3, 1:3] *= -1.0
    with pytest.raises(OutOfReach):
        InverseKinematics(arm).solve(upside_down)


def test_prismatic_and_revolute_joints_can_be_mixed() -> None:
    text = links("base", "x", "y", "z", "tool")
    text += joint("x", "base", "x", kind="prismatic", axis="1 0 0", limit='<limit lower="0" upper="2"/>')
    text += joint("y", "x", "y", kind="prismatic", axis="0 1 0", limit='<limit lower="-1" upper="1"/>')
    text += joint("z", "y", "z", kind="prismatic", axis="0 0 -1", limit='<limit lower="0" upper="1"/>')
    text += joint("turn", "z", "tool", kind="continuous", limit="")
    arm = RobotModel.load(urdf(text)).arm("tool")
    q = np.array((1.9, -0.9, 0.3, 40.0))
    found = InverseKinematics(arm).solutions(arm.forward(q), q)
    assert len(found) == 1
    assert np.allclose(found[0], q, atol=1e-6)
    arm.upper[0] = 1.8
    with pytest.raises(OutOfReach):
        InverseKinematics(arm).solve(arm.forward(q), q)


# ------------------------------------------------------------------------------------------------ refusals
def test_an_unreachable_pose_is_refused_with_its_position() -> None:
    inverse = InverseKinematics(ur().arm("tcp"))
    for position in ((1.5, 0.0, 0.3), (1.05, 0.0, 0.3), (0.0, 0.0, 0.2)):
        with pytest.raises(OutOfReach, match="ur5e cannot reach") as refused:
            inverse.solve(Pose(Position(*position)).matrix())
        assert f"{position[0]:.3f}" in refused.value.detail
        assert refused.value.code == "out_of_reach"
        assert inverse.solutions(Pose(Position(*position)).matrix()) == []
    broken = Pose().matrix()
    broken[0, 3] = math.nan
    with pytest.raises(OutOfReach, match="not finite"):
        inverse.solve(broken)
    with pytest.raises(OutOfReach, match="6 finite joint values"):
        inverse.solve(Pose().matrix(), np.zeros(5))


def test_another_configuration_avoids_collisions_or_they_are_named() -> None:
    arm = ur().arm("tcp")
    q = np.array((0.5, -1.2, 1.4, -1.8, -1.5, 0.7))
    target = arm.forward(q)
    world = CollisionWorld()
    world.add_robot("arm", ur(), Pose())
    inverse, blocked = InverseKinematics(arm), collision_check(world, "arm", arm)
    assert blocked(q) == ""
    assert np.allclose(inverse.solve(target, q, blocked), q, atol=1e-6)
    elbow = ur().link_poses(q)["forearm_link"]
    world.put("lamp", Sphere(0.03), Pose.from_matrix(elbow @ Pose(Position(0.0, 0.0, 0.03)).matrix()))
    assert blocked(q) in ("arm/forearm_link and lamp", "arm/upper_arm_link and lamp")
    other = inverse.solve(target, q, blocked)
    assert np.abs(wrapped(other - q)).max() > 0.1
    assert_there(arm, other, target)
    assert world.is_free("arm", other)
    free = inverse.solutions(target, q, blocked)
    assert 0 < len(free) < len(inverse.solutions(target, q))
    world.put("wall", Sphere(0.03), Pose.from_matrix(target))
    world.put("part", Sphere(0.05), Pose.from_matrix(target @ Pose(Position(0.0, 0.0, -0.02)).matrix()))
    with pytest.raises(OnlyInCollision, match=r"arm/.*(part|wall|lamp)") as refused:
        inverse.solve(target, q, blocked)
    assert refused.value.code == "in_collision"
