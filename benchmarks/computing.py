"""Compute workers: start time, round trip of a task, and worlds of many bodies."""

import time
from typing import Final

from arcor2_hw.collision.description import Obstacle, RobotSource, StoredFile, WorldBody, WorldItem, WorldRobot
from arcor2_hw.collision.lines import first_hit
from arcor2_hw.compute import kinematics_tasks as t
from arcor2_hw.data.geometry import Orientation, Pose, Position
from arcor2_hw.data.object_type import Box
from arcor2_hw.data.robot import Joint
from arcor2_hw.kinematics import primitives
from arcor2_server.compute.workers import Compute
from benchmarks.metrics import Metric, Report, median, percentile
from benchmarks.models import UR5E

BODIES: Final = 1000
ROUNDS: Final = 100


async def run(report: Report) -> None:
    """Measure everything in this group."""
    for metric in (lines(), *await tasks(), await reachability()):
        report.add(metric)


def lines() -> Metric:
    """Measure the collision check of a line among 1,000 boxes, which runs in the server."""
    placed = {
        f"b{n}": Obstacle.of(Box(f"b{n}", 0.2, 0.2, 0.2), Pose(Position(n % 10, n // 10 % 10, n // 100)))
        for n in range(BODIES)
    }
    taken = []
    for number in range(ROUNDS):
        start, end = Position(-1, number / 10, 0.5), Position(11, 10 - number / 10, 9.5)
        began = time.perf_counter()
        first_hit(start, end, placed.items(), 0.01)
        taken.append(1e3 * (time.perf_counter() - began))
    return Metric("computing_line_1000_ms", median(taken), len(taken), f"p99 {percentile(taken, 99):.2f} ms")


async def tasks() -> list[Metric]:
    """Measure the start of a worker, the round trip of a task, and of a task after one of many bodies moved."""
    model = RobotSource(StoredFile(str(UR5E), "ur5e"))
    compute = Compute(idle=60.0)
    try:
        began = time.perf_counter()
        described = await compute.run(t.DescribeRobot(model))
        start = 1e3 * (time.perf_counter() - began)
        joints = [Joint(joint.name, 0.3) for joint in described.joints]
        round_trip, world = [], []
        items: dict[str, WorldItem] = {f"b{n}": box(n) for n in range(BODIES)}
        check = t.CheckLines([t.Line(Position(-1, 0, 0), Position(11, 9, 9))])
        await compute.run(check, world=items)
        for number in range(ROUNDS):
            began = time.perf_counter()
            await compute.run(t.SolveForward(model, "tcp", joints))
            round_trip.append(1e3 * (time.perf_counter() - began))
            items[f"b{number}"] = box(number, 0.01 * number)
            began = time.perf_counter()
            await compute.run(check, world=items)
            world.append(1e3 * (time.perf_counter() - began))
    finally:
        await compute.close()
    return [
        Metric("computing_start_ms", start, 1),
        Metric(
            "computing_question_ms", median(round_trip), len(round_trip), f"p99 {percentile(round_trip, 99):.2f} ms"
        ),
        Metric("computing_world_1000_ms", median(world), len(world), f"p99 {percentile(world, 99):.2f} ms"),
    ]


async def reachability() -> Metric:
    """Measure the reachability of 1,000 points with three orientations each, in batches as in the server."""
    robot = WorldRobot("arm", RobotSource(StoredFile(str(UR5E), "ur5e")))
    turns = [Orientation(1, 0, 0, 0), Orientation(0, 0.5**0.5, 0, 0.5**0.5), Orientation(0.5**0.5, 0, 0, 0.5**0.5)]
    points = [Position(0.12 * (n % 10) - 0.6, 0.12 * (n // 10 % 10) - 0.6, 0.1 * (n // 100)) for n in range(1000)]
    poses = [Pose(point, turn) for point in points for turn in turns]
    world: dict[str, WorldItem] = {"arm": robot} | {f"b{n}": box(n, 2.0) for n in range(20)}
    compute = Compute(idle=60.0)
    try:
        await compute.run(t.JudgePoses("arm", "tcp", poses[:1]), world=world)
        began = time.perf_counter()
        for start in range(0, len(poses), 100):
            await compute.run(t.JudgePoses("arm", "tcp", poses[start : start + 100]), world=world, background=True)
        taken = time.perf_counter() - began
    finally:
        await compute.close()
    return Metric("computing_reach_3000_s", taken, len(poses))


def box(number: int, aside: float = 0.0) -> WorldBody:
    """Return box `number` of a grid."""
    place = Position(number % 10 + 3.0, number // 10 % 10 + aside, number // 100)
    return WorldBody(f"b{number}", primitives.Box(0.2, 0.2, 0.2), Pose(place))
