"""Ways through a cluttered cell: how many are found, in which time, and whether they are free; beside OMPL's.

Run as a program it plans the same with OMPL: in a process of its own, as what its bindings keep is listed at the end.
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
"""rad of the fastest joint between two checks of what was found."""

Problem = tuple[Array, Array]


def metrics(model: RobotModel) -> list[Metric]:
    """Plan from joints to joints, straight between which something is in the way."""
    world, problems = cell(model)
    arm = model.arm("tcp")
    times, cpu, ratios, found = [], [], [], 0
    for number, (start, goal) in enumerate(problems):
        planner = Planner(Sweep(world, "arm", arm))
        began, used = time.perf_counter(), time.process_time()
        try:
            way = planner.to_joints(start, goal, within=WITHIN, seed=number)
        except KinematicsError:
            way = []
        times.append(time.perf_counter() - began)
        cpu.append(time.process_time() - used)
        if way and is_right(world, way, start, goal):
            found += 1
            ratios.append(length(way, planner.sweep.levers) / length([start, goal], planner.sweep.levers))
    load = f"load {os.getloadavg()[0]:.1f}, seed {SEED}"
    other = ompl()
    note = (
        f"{median(cpu) * 1e3:.0f} ms on a core; 95th percentile {percentile(times, 95) * 1e3:.0f} ms; "
        f"{median(ratios):.2f} times the straight way; {other}; {load}"
    )
    return [
        Metric("kinematics_plans_found", float(found), len(problems), f"of {len(problems)}; each looked at again"),
        Metric("kinematics_plan_ms", median(times) * 1e3, len(times), note),
    ]


def cell(model: RobotModel, seed: int = SEED) -> tuple[CollisionWorld, list[Problem]]:
    """Give a robot on a floor before two walls among 20 boxes, and free joints with something straight between them."""
    chance = np.random.default_rng(seed)
    world = CollisionWorld()
    world.add_robot("arm", model, Pose())
    world.put("floor", Box(2.4, 2.4, 0.1), Pose(Position(0.0, 0.0, -0.06)))
    world.put("wall", Box(0.05, 2.4, 2.4), Pose(Position(-0.7, 0.0, 1.0)))
    world.put("side", Box(2.4, 0.05, 2.4), Pose(Position(0.0, -0.8, 1.0)))
    for number in range(20):
        way = chance.normal(size=3)
        way *= chance.uniform(0.4, 0.95) / np.linalg.norm(way)
        way[2] = abs(way[2])
        world.put(f"box {number}", Box(*map(float, chance.uniform(0.06, 0.18, 3))), Pose(Position(*map(float, way))))
    sweep = Sweep(world, "arm", model.arm("tcp"))
    problems: list[Problem] = []
    while len(problems) < PLANS:
        start, goal = (free_joints(sweep, chance) for _ in range(2))
        if not sweep.is_free_between(start, goal):
            problems.append((start, goal))
    return world, problems


def free_joints(sweep: Sweep, chance: np.random.Generator) -> Array:
    """Give random joints as an arm on a table has them, its upper arm above it, that are in collision with nothing."""
    while True:
        q = chance.uniform((-np.pi, -np.pi, -2.5, -np.pi, -np.pi, -np.pi), (np.pi, 0.0, 2.5, np.pi, np.pi, np.pi))
        if sweep.is_free(q):
            return q


def is_right(world: CollisionWorld, way: list[Array], start: Array, goal: Array) -> bool:
    """Look at a way again: where it begins and ends, and all along it, finer than it was planned."""
    if not (np.array_equal(way[0], start) and np.allclose(way[-1], goal)):
        return False
    return all(
        world.is_free("arm", a + share * (b - a))
        for a, b in itertools.pairwise(way)
        for share in np.linspace(0.0, 1.0, 2 + int(np.abs(b - a).max() / FINE))
    )


def length(way: list[Array], levers: Array) -> float:
    """Give the length of a way in joint values times their levers, m."""
    return float(sum(np.linalg.norm((b - a) * levers) for a, b in itertools.pairwise(way)))


# ------------------------------------------------------------------------------------------------ OMPL
def ompl() -> str:
    """Say what OMPL needs for the same problems; that it is not there, if so."""
    done = subprocess.run(
        [sys.executable, "-m", "benchmarks.planning"], capture_output=True, text=True, timeout=300, check=False
    )
    try:
        told = json.loads(done.stdout)
    except json.JSONDecodeError:
        return "OMPL is not there"
    return f"OMPL {told['found']} in {told['median']:.0f} ms ({told['cpu']:.0f} on a core)"


def plan_with_ompl(model: RobotModel) -> dict[str, float]:
    """Let RRTConnect and the path simplifier of OMPL plan to the joints of each problem, at our resolution."""
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
        # No point travels farther than the resolution: of an L2 step, by the root of the levers' squares.
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
