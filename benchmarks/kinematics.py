"""Kinematics and collision checks of the UR5e: durations, and the share of solved poses.

Random numbers are seeded. Times of single calls are medians of rounds, to reduce the influence of other load; the notes
show processor time.
"""

import os
import time
from collections.abc import Callable
from typing import Final

import numpy as np

from arcor2_hw.collision.world import CollisionWorld
from arcor2_hw.data.geometry import Orientation, Pose, Position
from arcor2_hw.kinematics.errors import OutOfReach
from arcor2_hw.kinematics.inverse import InverseKinematics
from arcor2_hw.kinematics.model import RobotModel
from arcor2_hw.kinematics.shapes import Array, Box
from arcor2_hw.planning.reachability import Reach, Reachability
from benchmarks import planning, safe_moves
from benchmarks.metrics import Metric, Report, median, percentile
from benchmarks.models import UR5E

SEED: Final = 20
POSES: Final = 5000
ORIENTATIONS: Final = (
    Orientation(1.0, 0.0, 0.0, 0.0),
    Orientation(0.0, 2**-0.5, 0.0, 2**-0.5),
    Orientation(2**-0.5, 0.0, 0.0, 2**-0.5),
)


async def run(report: Report) -> None:
    """Measure everything in this group."""
    model = RobotModel.load(UR5E)
    chance = np.random.default_rng(SEED)
    report.add(forward(model, chance))
    report.add(nearest(model))
    for metric in (*inverse(model, chance), *checks(model, chance), *reachability(model, chance)):
        report.add(metric)
    for metric in (*planning.metrics(model), *safe_moves.metrics()):
        report.add(metric)


def each(call: Callable[[Array], object], values: Array, rounds: int) -> float:
    """Return the median duration of a call over rounds, s, without the time of the loop itself."""
    taken = []
    for _ in range(rounds):
        began = time.perf_counter()
        for _value in values:
            pass
        empty = time.perf_counter() - began
        began = time.perf_counter()
        for value in values:
            call(value)
        taken.append((time.perf_counter() - began - empty) / len(values))
    return median(taken)


def forward(model: RobotModel, chance: np.random.Generator) -> Metric:
    """Measure forward kinematics, joints to the matrix of the tip."""
    arm = model.arm("tcp")
    taken = each(arm.forward, chance.uniform(-np.pi, np.pi, (2000, 6)), 51)
    return Metric("kinematics_forward_us", taken * 1e6, 51 * 2000, f"load {os.getloadavg()[0]:.1f}, seed {SEED}")


def nearest(model: RobotModel) -> Metric:
    """Compare the processor time of the nearest solution with that of a solver in C++, called from Python."""
    from ur_analytic_ik import ur5e

    arm, chance = model.arm("tcp"), np.random.default_rng(SEED)
    solve, reference = InverseKinematics(arm).solve, ur5e.inverse_kinematics_closest
    joints, seeds = chance.uniform(-np.pi, np.pi, (2, 200, 6))
    targets = [arm.forward(q) for q in joints]
    poses = [ur5e.forward_kinematics(*q) for q in joints]  # with the frames of the manufacturer's DH parameters
    for pose, seed in zip(poses, seeds, strict=True):
        if not np.allclose(ur5e.forward_kinematics(*reference(pose, *seed)[0]), pose, atol=1e-6):
            raise AssertionError("The solver that is compared does not reach its pose.")
    here, there = [], []
    for _ in range(51):
        began = time.thread_time()
        for target, seed in zip(targets, seeds, strict=True):
            solve(target, seed)
        between = time.thread_time()
        for pose, seed in zip(poses, seeds, strict=True):
            reference(pose, *seed)
        here.append((between - began) / len(joints))
        there.append((time.thread_time() - between) / len(joints))
    ratio = median([one / other for one, other in zip(here, there, strict=True)])
    note = (
        f"{median(here) * 1e6:.1f} µs, in C++ {median(there) * 1e6:.1f} µs; load {os.getloadavg()[0]:.1f}, seed {SEED}"
    )
    return Metric("kinematics_inverse_per_cpp", ratio, len(here) * len(joints), note)


def inverse(model: RobotModel, chance: np.random.Generator) -> list[Metric]:
    """Measure inverse kinematics of poses computed from random joints, from random seeds."""
    arm = model.arm("tcp")
    solver = InverseKinematics(arm)
    times, missed = [], 0
    for _ in range(POSES):
        target, seed = arm.forward(chance.uniform(-np.pi, np.pi, 6)), chance.uniform(-np.pi, np.pi, 6)
        began = time.perf_counter()
        try:
            found = solver.solve(target, seed)
        except OutOfReach:
            missed += 1
            continue
        times.append(time.perf_counter() - began)
        missed += not np.allclose(arm.forward(found), target, atol=1e-5)
    note = f"p99 {percentile(times, 99) * 1e3:.2f} ms, longest {max(times) * 1e3:.1f} ms"
    return [
        Metric("kinematics_inverse_reached", 100.0 * (1.0 - missed / POSES), POSES, f"{missed} not solved"),
        Metric("kinematics_inverse_ms", median(times) * 1e3, len(times), note),
    ]


def checks(model: RobotModel, chance: np.random.Generator) -> list[Metric]:
    """Measure collision checks of free configurations among 20 boxes in reach, and among 1,000."""
    metrics = []
    for count in (20, 1000):
        world = _cluttered(model, count, chance)
        # Only free configurations: checks of colliding ones end earlier.
        tried = chance.uniform(-np.pi, np.pi, (2000, 6))
        free = np.array([q for q in tried if world.is_free("arm", q)])[:500]
        taken = each(lambda q, world=world: world.is_free("arm", q), free, 11)  # type: ignore[misc]
        name = f"kinematics_check_{count}_us"
        metrics.append(Metric(name, taken * 1e6, 11 * len(free), f"{len(free)} free configurations"))
    return metrics


def reachability(model: RobotModel, chance: np.random.Generator) -> list[Metric]:
    """Measure the reachability of 1,000 points with 3 orientations each, and again after one of 20 boxes was moved."""
    world = _cluttered(model, 20, chance)
    reach = Reachability(world, "arm", model.arm("tcp"))
    points = chance.uniform((-0.85, -0.85, 0.0), (0.85, 0.85, 0.85), (1000, 3))
    poses = [Pose(Position(*map(float, point)), turn) for point in points for turn in ORIENTATIONS]
    times, cpu = [], []
    for _ in range(5):
        reach.forget()
        began, used = time.perf_counter(), time.process_time()
        judged = reach.judge(poses)
        times.append(time.perf_counter() - began)
        cpu.append(time.process_time() - used)
    counts = ", ".join(f"{sum(one.reach is kind for one in judged)} {kind.value}" for kind in Reach)
    note = f"{counts}; {median(cpu):.2f} s on a core"
    moved = []
    for number in range(20):
        world.move(f"box {number}", Pose(Position(*map(float, chance.uniform((-0.8, -0.8, 0.0), (0.8, 0.8, 0.8))))))
        began = time.perf_counter()
        reach.judge(poses)
        moved.append(time.perf_counter() - began)
    return [
        Metric("kinematics_reach_3000_s", median(times), len(times), note),
        Metric("kinematics_reach_moved_ms", median(moved) * 1e3, len(moved)),
    ]


def _cluttered(model: RobotModel, count: int, chance: np.random.Generator) -> CollisionWorld:
    """Return a robot among boxes of 50 to 150 mm within its reach, none at its base."""
    world = CollisionWorld()
    world.add_robot("arm", model, Pose())
    for number in range(count):
        offset = chance.normal(size=3)
        offset *= chance.uniform(0.45, 0.95) / np.linalg.norm(offset)
        sizes = chance.uniform(0.05, 0.15, 3) * (1.0 if count < 100 else 0.3)
        turn = Orientation.from_rotation_vector(*map(float, chance.uniform(-2.0, 2.0, 3)))
        world.put(f"box {number}", Box(*map(float, sizes)), Pose(Position(*map(float, offset)), turn))
    return world
