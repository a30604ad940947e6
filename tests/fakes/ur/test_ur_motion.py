"""Motion of the fake arm in simulated time: limits, straightness, stopping, pausing."""

import math
from itertools import pairwise

import pytest
from hypothesis import given, strategies as st

from arcor2_fakes.trapezoid import Trapezoid
from arcor2_fakes.ur.kinematics import Chain, from_pose
from arcor2_fakes.ur.motion import Arm, JointSpeed
from arcor2_fakes.ur.paths import MotionRefused

DT = 0.002
HOME = (0.0, -math.pi / 2, math.pi / 2, -math.pi / 2, -math.pi / 2, 0.0)


def arm():
    return Arm(Chain(), HOME)


def run(arm, seconds=30.0, each=lambda: None):
    """Run until the motion has ended; return its duration, s."""
    for n in range(round(seconds / DT)):
        if not arm.busy:
            return n * DT
        arm.step(DT)
        each()
    raise AssertionError("the motion does not end")


@given(st.floats(1e-6, 10), st.floats(0.01, 4), st.floats(0.01, 40))
def test_a_profile_stays_within_its_limits(length, velocity, acceleration):
    profile = Trapezoid(length, velocity, acceleration)
    assert profile.duration >= length / velocity
    steps = [profile.position(profile.duration * i / 200) for i in range(201)]
    dt = profile.duration / 200
    speeds = [(b - a) / dt for a, b in pairwise(steps)]
    assert steps[0] == 0.0
    assert steps[-1] == pytest.approx(length)
    assert min(speeds) >= -1e-9
    assert max(speeds) <= velocity * (1 + 1e-6)
    assert max(abs(b - a) / dt for a, b in pairwise(speeds)) <= acceleration * (1 + 1e-3)


def test_a_joint_move_stays_within_velocity_and_acceleration():
    a, goal = arm(), (1.0, -1.0, 1.2, -2.0, -1.0, 0.5)
    peak, jump, last = 0.0, 0.0, a.qd

    def watch():
        nonlocal peak, jump, last
        peak = max(peak, *map(abs, a.qd))
        jump = max(jump, *(abs(x - y) / DT for x, y in zip(a.qd, last, strict=True)))
        last = a.qd

    a.move_joints(goal, 0.8, 1.6)
    took = run(a, each=watch)
    assert a.q == pytest.approx(goal, abs=1e-12)
    assert peak == pytest.approx(0.8, rel=1e-3)
    assert jump <= 1.6 * 1.02
    assert took == pytest.approx(1.0 / 0.8 + 0.8 / 1.6, abs=2 * DT)  # the largest joint change is 1 rad


def test_a_linear_move_is_straight_at_constant_speed():
    a = arm()
    start = a.pose
    goal = (start[0] + 0.1, start[1] - 0.2, start[2] + 0.1, *start[3:])
    away, speeds = 0.0, []

    def watch():
        nonlocal away
        here = a.pose[:3]
        along = [(x - s) for x, s in zip(here, start, strict=False)]
        line = [(g - s) for g, s in zip(goal[:3], start, strict=False)]
        f = sum(x * y for x, y in zip(along, line, strict=True)) / sum(x * x for x in line)
        away = max(away, math.dist(along, [f * x for x in line]))
        speeds.append(math.hypot(*a.twist()[:3]))

    a.move_linear(from_pose(goal), 0.25, 1.2)
    took = run(a, each=watch)
    assert a.pose == pytest.approx(goal, abs=1e-6)
    assert away < 1e-6
    assert max(speeds) == pytest.approx(0.25, rel=0.01)
    assert took == pytest.approx(math.sqrt(0.06) / 0.25 + 0.25 / 1.2, abs=0.01)


def test_an_unreachable_line_is_refused():
    a = arm()
    a.move_linear(from_pose((-2.0, *a.pose[1:])), 0.5, 1.2)
    with pytest.raises(MotionRefused):
        run(a)
    assert math.hypot(*a.pose[:3]) < 1.0


@pytest.mark.parametrize("linear", [False, True])
def test_stop_decelerates_to_standstill(linear):
    a = arm()
    a.move_joints((2.0, *HOME[1:]), 1.0, 3.0)
    for _ in range(400):
        a.step(DT)
    before = a.q
    a.halt(2.0, linear)
    took = run(a)
    assert not a.moving
    if not linear:
        assert took == pytest.approx(1.0 / 2.0, abs=2 * DT)
        assert a.q[0] - before[0] == pytest.approx(0.25, abs=0.01)  # v^2 / 2a
    assert before[0] < a.q[0] < 1.9


def test_pause_stops_on_the_path_and_resumes():
    a, goal = arm(), (1.0, -1.0, 1.2, -2.0, -1.0, 0.5)
    a.move_joints(goal, 1.0, 2.0)
    for _ in range(300):
        a.step(DT)
    a.hold()
    for _ in range(150):
        a.step(DT)
    assert not a.moving
    assert a.busy
    resting = a.q
    f = (resting[0] - HOME[0]) / (goal[0] - HOME[0])
    assert resting == pytest.approx([h + f * (g - h) for h, g in zip(HOME, goal, strict=True)], abs=1e-9)
    a.go_on()
    run(a)
    assert a.q == pytest.approx(goal)


def test_slider_slows_the_path():
    a = arm()
    a.slider = 0.5
    for _ in range(200):
        a.step(DT)
    a.move_joints((1.0, *HOME[1:]), 1.0, 10.0)
    assert run(a) == pytest.approx(2 * (1.0 + 0.1), abs=0.02)


def test_joint_limit_stops_velocity_control():
    a = arm()
    a.motion = JointSpeed((3.0, 0, 0, 0, 0, 0), 10.0)
    with pytest.raises(MotionRefused):
        run(a)
    assert a.q[0] <= math.tau
