"""Robot pose from depth: arms in front of a synthetic sensor, and scenes in which no pose may be found.

The sensor intersects rays with shapes in closed form and shares no code with the solver
(tests/calibration/depth_sensor.py). Picture: 1280 × 720, average of 8, noise 1.8 mm at 1 m growing with the square of
the distance, smooth noise of 0.8 mm at 1 m that all pictures share, whole millimetres, flying pixels at edges, 0.5 %
holes. Scene: a table, a wall, and on the arm a gripper and a cable that the model lacks; distance 1.0 to 1.8 m, 15 to
60° above, any joints above the table. The assumed pose is 50 mm and 5° off. The given fx and fy are off by 0.05 %, cx
and cy by 0.25 px.
"""

import math
import sys
import time
from typing import Final

import numpy as np

from arcor2_hw.calibration.refusals import CalibrationRefused
from arcor2_hw.calibration.results import RobotPose
from arcor2_hw.calibration.robot_pose import find_robot_pose
from arcor2_hw.data.geometry import Pose
from benchmarks.metrics import Metric, Report, median, percentile
from tests.calibration.depth_sensor import Block, Capsule, Sensor, arm, looking, shift, tool
from tests.calibration.workplace import (
    LARGE,
    View,
    configured_parameters,
    drawn,
    joints_above_the_table,
    surface_of_arm,
)

SEED: Final = 20261121
VIEWS: Final = 30
LONG: Final = 300
MAX_DEVIATIONS: Final = 4.0
"""Error, in standard deviations of the result, above which the verdict is wrong."""
MAX_ERROR: Final = 0.005
"""Position error above which a verdict is always wrong, m."""


def run(report: Report, long: bool) -> None:
    """Measure everything in this group."""
    count = LONG if long else VIEWS
    sys.stderr.write(f"robot pose: {count} views from seed {SEED}\n")
    distances, angles, seconds, refused, wrong = [], [], [], 0, 0
    for seed in range(SEED, SEED + count):
        view = drawn(seed, large=True)
        began = time.perf_counter()
        try:
            found = _solve(view)
        except CalibrationRefused as e:
            refused += 1
            sys.stderr.write(f"  seed {seed}: {e.reason.value} ({e.detail})\n")
            continue
        seconds.append(time.perf_counter() - began)
        distance, angle = view.error(found.pose)
        distances.append(distance * 1e3)
        angles.append(math.degrees(angle))
        beyond_own_deviation = (
            distance > MAX_DEVIATIONS * found.position_deviation or angle > MAX_DEVIATIONS * found.orientation_deviation
        )
        wrong += beyond_own_deviation or distance > MAX_ERROR
    note = f"p99 {percentile(distances, 99):.2f} mm, {percentile(angles, 99):.3f}°, seed {SEED}"
    report.add(Metric("robot_pose_mm", median(distances), len(distances), note))
    report.add(Metric("robot_pose_deg", median(angles), len(angles)))
    report.add(Metric("robot_pose_s", median(seconds), len(seconds), f"longest {max(seconds):.1f} s"))
    report.add(Metric("robot_pose_refused", 100.0 * refused / count, count))
    report.add(
        Metric("robot_pose_wrong", 100.0 * wrong / count, count, f"beyond {MAX_DEVIATIONS:g} own deviations, or 5 mm")
    )
    returned, scenes = 0, 0
    for view in _impostors(max(12, count // 3)):
        scenes += 1
        try:
            found = _solve(view)
        except CalibrationRefused:
            continue
        returned += view.error(found.pose)[0] > MAX_ERROR
    note = "no robot, a cupboard in its place, a joint 12° and more off, 0.3 m and more away"
    report.add(Metric("robot_pose_impostors", 100.0 * returned / scenes, scenes, note))


def _solve(view: View) -> RobotPose:
    return find_robot_pose(view.surface, view.depth, view.parameters, view.camera, view.assumed)


def _impostors(count: int) -> list[View]:
    """Return scenes without the robot, with a cupboard, with a wrong joint, or with a far-off assumed pose."""
    views = []
    for number in range(count):
        rng = np.random.default_rng(SEED + number)
        joints = joints_above_the_table(rng)
        links: list[Capsule | Block] = [*arm(joints), *tool(joints)]
        assumed, modelled = np.eye(4), list(joints)
        if number % 4 == 0:
            links = []
        elif number % 4 == 1:
            links = [Block(shift(0.0, 0.0, 0.35), (0.25, 0.35, 0.7))]
        elif number % 4 == 2:
            modelled[2] += math.radians(rng.uniform(12.0, 40.0)) * rng.choice([-1, 1])
        else:
            around = rng.uniform(-math.pi, math.pi)
            far = rng.uniform(0.3, 0.8)
            assumed = shift(far * math.cos(around), far * math.sin(around), 0.0)
        sensor = Sensor(shapes=links, wall=-2.0)
        for name, value in LARGE.items():
            setattr(sensor, name, value)
        around = rng.uniform(-math.pi, math.pi)
        eye = looking(np.array([0, 0, 0.35]), np.array([1.1 * math.cos(around), 1.1 * math.sin(around), 0.9]))
        depth = sensor.take(eye, rng)
        poses = (Pose.from_matrix(eye), Pose.from_matrix(assumed), Pose())
        views.append(View(surface_of_arm(modelled), depth, configured_parameters(sensor), *poses))
    return views
