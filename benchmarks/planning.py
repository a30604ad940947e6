"""Path planning in a cluttered cell: share of solved problems, time, and validity; compared with OMPL.

Run as a program, this module solves the same problems with OMPL, in a separate process because its bindings print
leaked objects at exit.
"""

import itertools
import json
import os
import subprocess
import sys
import time
from typing import Final

import numpy as np

from arcor2_hw.collision.sweep import Sweep
from arcor2_hw.collision.world import CollisionWorld
from arcor2_hw.data.geometry import Pose, Position
from arcor2_hw.exceptions import KinematicsError
from arcor2_hw.kinematics.model import RobotModel
from arcor2_hw.kinematics.shapes import Array, Box
from arcor2_hw.planning.planner import Planner
from benchmarks.metrics import Metric, median, percentile

PLANS: Final = 20
SEED: Final = 20
WITHIN: Final = 2.0
FINE: Final = 0.003
"""Step of the fastest joint between two checks of a found path, rad."""

Problem = tuple[Array, Array]


def metrics(model: RobotModel) -> list[Metric]:
    """Measure plans between joint positions with a blocked direct path."""
    world, problems = cell(model)
    arm = model.arm("tcp")
    times, cpu, ratios, found = [], [], [], 0
    for number, (start, goal) in enumerate(problems):
        planner = Planner(Sweep(world, "arm", arm))
        began, used = time.perf_counter(), time.process_time()
        try:
            path = planner.to_joints(start, goal, within=WITHIN, seed=number)
        except KinematicsError:
            path = []
        times.append(time.perf_counter() - began)
        cpu.append(time.process_time() - used)
        if path and is_valid(world, path, start, goal):
            found += 1
            ratios.append(length(path, planner.sweep.levers) / length([start, goal], planner.sweep.levers))
    load = f"load {os.getloadavg()[0]:.1f}, seed {SEED}"
    other = ompl()
    note = (
        f"{median(cpu) * 1e3:.0f} ms on a core; 95th percentile {percentile(times, 95) * 1e3:.0f} ms; "
        f"{median(ratios):.2f} times the direct path; {other}; {load}"
    )
    return [
        Metric("kinematics_plans_found", float(found), len(problems), f"of {len(problems)}; each checked again"),
        Metric("kinematics_plan_ms", median(times) * 1e3, len(times), note),
    ]


def cell(model: RobotModel, seed: int = SEED) -> tuple[CollisionWorld, list[Problem]]:
    """Return a cell with a floor, two walls and 20 boxes, and pairs of free joints with a blocked direct path."""
    chance = np.random.default_rng(seed)
    world = CollisionWorld()
    world.add_robot("arm", model, Pose())
    world.put("floor", Box(2.4, 2.4, 0.1), Pose(Position(0.0, 0.0, -0.06)))
    world.put("wall", Box(0.05, 2.4, 2.4), Pose(Position(-0.7, 0.0, 1.0)))
    world.put("side", Box(2.4, 0.05, 2.4), Pose(Position(0.0, -0.8, 1.0)))
    for number in range(20):
        offset = chance.normal(size=3)
        offset *= chance.uniform(0.4, 0.95) / np.linalg.norm(offset)
        offset[2] = abs(offset[2])
        world.put(f"box {number}", Box(*map(float, chance.uniform(0.06, 0.18, 3))), Pose(Position(*map(float, offset))))
    sweep = Sweep(world, "arm", model.arm("tcp"))
    problems: list[Problem] = []
    while len(problems) < PLANS:
        start, goal = (free_joints(sweep, chance) for _ in range(2))
        if not sweep.is_free_between(start, goal):
            problems.append((start, goal))
    return world, problems


def free_joints(sweep: Sweep, chance: np.random.Generator) -> Array:
    """Return random collision-free joints of an arm on a table, with its upper arm above the table."""
    while True:
        q = chance.uniform((-np.pi, -np.pi, -2.5, -np.pi, -np.pi, -np.pi), (np.pi, 0.0, 2.5, np.pi, np.pi, np.pi))
        if sweep.is_free(q):
            return q


def is_valid(world: CollisionWorld, path: list[Array], start: Array, goal: Array) -> bool:
    """Check a path: its start, its goal, and collisions in finer steps than during planning."""
    if not (np.array_equal(path[0], start) and np.allclose(path[-1], goal)):
        return False
    return all(
        world.is_free("arm", a + share * (b - a))
        for a, b in itertools.pairwise(path)
        for share in np.linspace(0.0, 1.0, 2 + int(np.abs(b - a).max() / FINE))
    )


def length(path: list[Array], levers: Array) -> float:
    """Return the length of a path in joint values times their levers, m."""
    return float(sum(np.linalg.norm((b - a) * levers) for a, b in itertools.pairwise(path)))


# ------------------------------------------------------------------------------------------------ OMPL
def ompl() -> str:
    """Return OMPL's results for the same problems as text, or that OMPL is not installed."""
    done = subprocess.run(
        [sys.executable, "-m", "benchmarks.planning"], capture_output=True, text=True, timeout=300, check=False
    )
    try:
        result = json.loads(done.stdout)
    except json.JSONDecodeError:
        return "OMPL is not installed"
    return f"OMPL {result['found']} in {result['median']:.0f} ms ({result['cpu']:.0f} on a core)"


def plan_with_ompl(model: RobotModel) -> dict[str, float]:
    """Solve each problem with OMPL's RRTConnect and path simplifier, at the same resolution."""
    from ompl import base, geometric, util

    util.setLogLevel(util.LogLevel.LOG_NONE)
    util.RNG.setSeed(SEED)
    world, problems = cell(model)
    sweep = Sweep(world, "arm", model.arm("tcp"))
    times, cpu, found = [], [], 0
    for start, goal in problems:
        space = base.RealVectorStateSpace(6)
        bounds = base.RealVectorBounds(6)
        for joint in range(6):
            bounds.setLow(joint, float(min(start[joint], goal[joint]) - np.pi))
            bounds.setHigh(joint, float(max(start[joint], goal[joint]) + np.pi))
        space.setBounds(bounds)
        about = base.SpaceInformation(space)
        about.setStateValidityChecker(lambda state: sweep.is_free(np.array([state[n] for n in range(6)])))
        # Limit the L2 step so that no point of the robot moves farther than the resolution.
        step = sweep.resolution / float(np.linalg.norm(sweep.levers))
        about.setStateValidityCheckingResolution(step / space.getMaximumExtent())
        about.setup()
        ends = [space.allocState(), space.allocState()]
        for state, q in zip(ends, (start, goal), strict=True):
            for n in range(6):
                state[n] = float(q[n])
        problem = base.ProblemDefinition(about)
        problem.setStartAndGoalStates(*ends)
        planner = geometric.RRTConnect(about)
        planner.setProblemDefinition(problem)
        planner.setup()
        began, used = time.perf_counter(), time.process_time()
        planner.solve(WITHIN)
        if problem.hasExactSolution():
            geometric.PathSimplifier(about).reduceVertices(problem.getSolutionPath())
            found += 1
        times.append(time.perf_counter() - began)
        cpu.append(time.process_time() - used)
    return {"found": found, "median": median(times) * 1e3, "cpu": median(cpu) * 1e3}


if __name__ == "__main__":
    from benchmarks.models import UR5E

    print(json.dumps(plan_with_ompl(RobotModel.load(UR5E))), flush=True)
