"""Straight lines and timing, against independent arithmetic."""

import itertools

import numpy as np
import pytest

from arcor2_hw.collision.sweep import Sweep
from arcor2_hw.collision.world import CollisionWorld
from arcor2_hw.data.geometry import Orientation, Pose, Position
from arcor2_hw.exceptions import InvalidData
from arcor2_hw.kinematics.errors import MotionInCollision, NoStraightLine, OutOfReach
from arcor2_hw.kinematics.model import RobotModel
from arcor2_hw.kinematics.shapes import Array, Box
from arcor2_hw.planning.paths import LINE_TOLERANCE, ORIENTATION_TOLERANCE, free_line, interpolate, straight_line
from arcor2_hw.planning.timing import MotionLimits, Trajectory, along_line, point_to_point, with_stops
from tests.kinematics import kin_robots

READY = np.array((0.0, -1.57, 1.57, -1.57, -1.57, 0.0))


def line_off(start: Position, end: Position, at: Position) -> float:
    a, b, p = (np.array([*each]) for each in (start, end, at))
    way = (b - a) / np.linalg.norm(b - a)
    return float(np.linalg.norm((p - a) - way * ((p - a) @ way)))


def moved(pose: Pose, x: float, y: float, z: float, *turn: float) -> Pose:
    turned = Orientation.from_rotation_vector(*(turn or (0.0, 0.0, 0.0))) * pose.orientation
    return Pose(pose.position + Position(x, y, z), turned)


@pytest.mark.parametrize("model", [kin_robots.ur(), kin_robots.six_axes()], ids=["ur5e", "six axes"])
def test_the_tip_stays_on_the_line_and_rotates_evenly(model: RobotModel) -> None:
    arm = model.arm(next(iter(model.end_effectors), "tool"))
    chance = np.random.default_rng(2)
    middle = READY if model.name == "ur5e" else np.array((0.1, 0.6, -1.4, 0.3, 0.9, 0.2))
    done = 0
    for _ in range(16):
        start = middle + chance.uniform(-0.1, 0.1, 6)
        here = arm.pose(start)
        there = moved(here, *chance.uniform(-0.15, 0.15, 3), *chance.uniform(-0.4, 0.4, 3))
        try:
            way = straight_line(arm, start, there.matrix())
        except OutOfReach:
            continue
        done += 1
        assert np.allclose(arm.forward(way[-1]), there.matrix(), atol=1e-6)
        whole = here.position.distance_to(there.position)
        for a, b in itertools.pairwise(way):
            assert np.abs(b - a).max() < 0.6
            for share in np.linspace(0.0, 1.0, 7):
                at = arm.pose(a + share * (b - a))
                assert line_off(here.position, there.position, at.position) < 3.0 * LINE_TOLERANCE
                come = here.position.distance_to(at.position) / whole
                assert at.orientation.angle_to(interpolate(here, there, come).orientation) < 6.0 * ORIENTATION_TOLERANCE
    assert done >= 5


def test_an_impossible_line_is_refused_with_the_point_where_it_fails() -> None:
    arm = kin_robots.ur().arm("tcp")
    here = arm.pose(READY)
    with pytest.raises(OutOfReach):
        straight_line(arm, READY, moved(here, 1.5, 0.0, 0.0).matrix())
    # Past the axis of the base, where a tool that points down has no space.
    near = Pose(Position(-0.45, 0.12, here.position.z), here.orientation)
    with pytest.raises(NoStraightLine, match=r"arm cannot go straight: after 0\.\d+ m"):
        straight_line(arm, READY, near.matrix(), "arm")
    # Through the axis of the shoulder: the base would have to flip.
    start = np.array((0.0, -2.2, 2.2, -1.57, -1.57, 0.0))
    over = arm.pose(start)
    beyond = Pose(Position(-over.position.x, -over.position.y, over.position.z), over.orientation)
    with pytest.raises(NoStraightLine):
        straight_line(arm, start, beyond.matrix())


def test_a_planar_arm_follows_the_line_with_a_free_heading() -> None:
    arm = RobotModel.load(kin_robots.TWO_AXIS).arm("tcp")
    start = np.array((0.3, 1.2))
    here = arm.pose(start)
    way = straight_line(arm, start, moved(here, -0.05, 0.04, 0.0).matrix())
    assert len(way) > 2
    for a, b in itertools.pairwise(way):
        at = arm.pose((a + b) / 2.0).position
        assert line_off(here.position, here.position + Position(-0.05, 0.04, 0.0), at) < 2.0 * LINE_TOLERANCE


def test_a_colliding_line_is_refused_with_the_point_of_collision() -> None:
    model = kin_robots.ur()
    arm = model.arm("tcp")
    here = arm.pose(READY)
    world = CollisionWorld()
    world.add_robot("arm", model, Pose())
    sweep = Sweep(world, "arm", arm)
    there = moved(here, 0.0, 0.3, 0.0)
    assert len(free_line(sweep, READY, there.matrix())) > 2
    world.put("post", Box(0.02, 0.02, 0.3), Pose(here.position + Position(0.0, 0.2, 0.0)))
    with pytest.raises(MotionInCollision, match=r"arm cannot go straight: 0\.1\d\d m along its line .*post"):
        free_line(sweep, READY, there.matrix(), "arm")


# ------------------------------------------------------------------------------------------------ timing
def rates(timed: Trajectory, period: float = 0.002) -> tuple[Array, Array, Array]:
    """Return values, and velocities and accelerations computed from differences."""
    q = np.array([values for _, values, _ in timed.sampled(period)][:-1])
    v = np.diff(q, axis=0) / period
    return q, v, np.diff(v, axis=0) / period


LIMITS = MotionLimits(np.array((1.0, 2.0)), np.array((4.0, 5.0)), np.array((40.0, 50.0)))


def test_point_to_point_motion_uses_the_limits_fully() -> None:
    start, goal = np.array((0.0, 1.0)), np.array((1.5, -0.5))
    timed = point_to_point(start, goal, LIMITS)
    q, v, a = rates(timed)
    way = goal - start
    assert np.abs(q - (start + np.outer((q[:, 0] - start[0]) / way[0], way))).max() < 1e-9
    assert np.allclose(timed.at(timed.duration)[0], goal)
    assert np.allclose(timed.at(timed.duration)[1], 0.0, atol=1e-9)
    assert (np.abs(v).max(axis=0) <= LIMITS.velocity * 1.001).all()
    assert (np.abs(a).max(axis=0) <= LIMITS.acceleration * 1.02).all()
    assert np.abs(np.diff(a, axis=0) / 0.002).max() < 51.0
    # Joint 1: 1.5 rad at 1 rad/s, and the ramps of velocity and acceleration.
    assert timed.duration == pytest.approx(1.5 + 1.0 / 4.0 + 4.0 / 40.0, abs=1e-6)
    assert point_to_point(goal, goal, LIMITS).duration == 0.0


def test_motion_with_stops_rests_at_each_waypoint() -> None:
    way = [np.array(q) for q in ((0.0, 0.0), (0.5, 0.0), (0.5, 0.8))]
    timed = with_stops(way, LIMITS)
    alone = point_to_point(way[0], way[1], LIMITS).duration
    values, velocity = timed.at(alone)
    assert np.allclose(values, way[1])
    assert np.allclose(velocity, 0.0, atol=1e-9)
    assert np.allclose(timed.at(timed.duration + 9.0)[0], way[2])
    q, _, _ = rates(timed)
    assert np.minimum(np.abs(q[:, 1]), np.abs(q[:, 0] - 0.5)).max() < 1e-9


def test_a_line_has_the_requested_tip_speed() -> None:
    arm = kin_robots.ur().arm("tcp")
    here = arm.pose(READY)
    there = moved(here, 0.1, 0.25, 0.0)
    way = straight_line(arm, READY, there.matrix())
    lengths = [here.position.distance_to(arm.pose(q).position) for q in way]
    timed = along_line(way, MotionLimits.of(arm), lengths, 0.1, 0.5)
    period = 0.01
    at = np.array([[*arm.pose(values).position] for _, values, _ in timed.sampled(period)][:-1])
    speed = np.linalg.norm(np.diff(at, axis=0), axis=1) / period
    assert speed.max() <= 0.103
    assert np.median(speed) > 0.095
    assert timed.duration == pytest.approx(lengths[-1] / 0.1 + 0.1 / 0.5, rel=0.05)
    for values in at:
        assert line_off(here.position, there.position, Position(*values)) < 2.0 * LINE_TOLERANCE


def test_invalid_limits_are_refused() -> None:
    arm = kin_robots.ur().arm("tcp")
    for speed in (0.0, 1.1, float("nan")):
        with pytest.raises(InvalidData):
            MotionLimits.of(arm, speed)
    with pytest.raises(InvalidData, match="acceleration"):
        MotionLimits(np.ones(2), np.array((1.0, 0.0)), np.ones(2))
    with pytest.raises(InvalidData):
        along_line([READY, READY + 0.1], MotionLimits.of(arm), [0.0], 0.1, 0.5)
