"""Dry runs: the predicted cycle of the demo compared with its real cycles, and 1,000 motions."""

import asyncio
import itertools
import json
import random
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Final

import psutil

from arcor2_hw.client import Client, Rest
from arcor2_hw.client.dry_runs import dry_run
from arcor2_hw.data.base import Unset
from arcor2_hw.data.dry_run import Prediction
from arcor2_hw.data.geometry import Orientation, Pose, Position
from arcor2_hw.data.object_type import Box
from arcor2_hw.data.parameter import Parameter
from arcor2_hw.data.project import Action, ActionParameter, ActionPoint, Flow, LogicItem, NamedOrientation, Project
from arcor2_hw.data.run_trace import RunTrace
from arcor2_hw.data.scene import Scene, SceneObject
from benchmarks.metrics import Metric, Report, median
from benchmarks.server_process import server

BOARDS: Final = 5
DEMO_WITHIN: Final = 400.0
PROJECT: Final = "Test, label and sort boards"
BRANCHES: Final = ("into_nest", "into_bad_box")
"""The actions that follow `is_good`, for good and for bad boards."""
FIRST: Final = "take_over"
"""The action that follows `clear_nest` if the board is in the tester already, as in all cycles but the first."""
PARALLEL: Final = {"test_and_fetch": ("this_board", "next_board"), "label_and_load": ("this_label", "next_load")}
"""The actions that run calls at once, and their calls."""
MOTIONS: Final = 1000
REPEATS: Final = 5
BOXES: Final = 20
CRATE: Final = '''"""An obstacle."""

from arcor2_hw.objects import CollisionObject


class Crate(CollisionObject):
    """A crate."""

    _ABSTRACT = False
'''


async def run(report: Report, folder: Path) -> None:
    """Measure everything in this group."""
    await _demo(report, folder / "dry-run-demo")
    await _motions(report, folder / "dry-run-motions")


# ------------------------------------------------------------------------------------------------ the demo
async def _demo(report: Report, directory: Path) -> None:
    process = await asyncio.create_subprocess_exec(
        *(sys.executable, "-m", "arcor2_server.cli.main", "demo", "--once", "--port", "0"),
        *("--boards", str(BOARDS), "--data-dir", str(directory)),
        stdout=asyncio.subprocess.DEVNULL,
    )
    async with asyncio.timeout(DEMO_WITHIN):
        if await process.wait():
            raise RuntimeError("The demo failed.")
    async with server(directory) as (url, _), Client(url, "benchmark", reconnect=False) as client:
        project = await _opened(client, PROJECT)
        actions = {action.name: action.id for action in project.all_actions()}
        run = (await client.list_runs()).runs[0].number
        trace = await client.rest.run_trace(run)
        real, reductions = real_cycles(trace), shortened_by(trace)
        first = {actions["clear_nest"]: actions[FIRST]}
        branches = {name: {**first, actions["is_good"]: actions[name]} for name in BRANCHES}
        # With an unsaved edit, the server does not measure how much longer motions take than planned.
        await client.add_action_point(name="edit", position=Position())
        planned = {name: await _predicted(client, branches[name]) for name in BRANCHES}
        await client.close_project(force=True)
        await _opened(client, PROJECT)
        predicted = {name: await _predicted(client, branches[name]) for name in BRANCHES}
    for metric, times in (("dry_run_demo_percent", predicted), ("dry_run_demo_planned_percent", planned)):
        seen = [name for name in BRANCHES if real[name]]
        deviations = {name: 100.0 * abs(times[name] / median(real[name]) - 1.0) for name in seen}
        notes = [f"{name}: {times[name]:.2f} s, real {', '.join(f'{s:.2f}' for s in real[name])} s" for name in seen]
        report.add(Metric(metric, max(deviations.values()), sum(len(real[name]) for name in seen), "; ".join(notes)))
    shares = [share for found in reductions.values() for share in found]
    notes = [f"{name}: {', '.join(f'{share:.1f}' for share in found)} %" for name, found in reductions.items() if found]
    report.add(Metric("demo_parallel_percent", median(shares), len(shares), "; ".join(notes)))


def _cycles(trace: RunTrace) -> Iterator[tuple[str, float, dict[str, float]]]:
    """Return the result for the board, the duration and the durations of the actions of each cycle of a demo run, s.

    The first cycle is left out, because the robot starts elsewhere, and so is the last one, which ends the order.
    """
    starts = [number for number, span in enumerate(trace.spans) if span.action_id == trace.spans[0].action_id]
    for begin, end in itertools.pairwise(starts[1:]):
        durations = {span.name: span.duration for span in trace.spans[begin:end]}
        if "all_sent" not in durations:
            for name in durations.keys() & BRANCHES:
                yield name, trace.spans[end].start - trace.spans[begin].start, durations


def real_cycles(trace: RunTrace) -> dict[str, list[float]]:
    """Return the durations of the cycles of a demo run, s, by the result for the board."""
    found: dict[str, list[float]] = {name: [] for name in BRANCHES}
    for name, cycle, _ in _cycles(trace):
        found[name].append(cycle)
    return found


def shortened_by(trace: RunTrace) -> dict[str, list[float]]:
    """Return the reduction of each cycle of `real_cycles` by parallel work, %.

    Without parallel work, the branches would be executed one after the other.
    """
    found: dict[str, list[float]] = {name: [] for name in BRANCHES}
    for name, cycle, durations in _cycles(trace):
        saved = sum(
            sum(durations[call] for call in calls) - durations[action]
            for action, calls in PARALLEL.items()
            if action in durations
        )
        found[name].append(100.0 * saved / (cycle + saved))
    return found


async def _opened(client: Client, name: str) -> Project:
    known = {entry.name: entry.id for entry in await client.list_projects()}
    await client.open_project(id=known[name])
    project: Project = (await client.next_event("OpenProject")).data.project
    return project


async def _predicted(client: Client, branches: dict[str, str]) -> float:
    prediction = (await dry_run(client, branches=branches)).prediction
    assert isinstance(prediction, Prediction)
    if not isinstance(prediction.problem, Unset):
        raise AssertionError(prediction.problem.reason)
    return prediction.summary.cycle


# ------------------------------------------------------------------------------------------------ 1,000 motions
async def _motions(report: Report, directory: Path) -> None:
    async with server(directory) as (url, process), Client(url, "benchmark", reconnect=False) as client:
        await _create(client.rest)
        await _opened(client, "motions")
        samples, used = [], []
        for _ in range(1 + REPEATS):
            begin = time.perf_counter()
            found = await dry_run(client)
            samples.append(time.perf_counter() - begin)
            used.append(sum(child.cpu_times().user for child in process.children() if _computes(child)))
        prediction = found.prediction
        assert isinstance(prediction, Prediction)
        failed = sum(not isinstance(span.error, Unset) for span in prediction.trace.spans)
    first, *later = samples
    core = (used[-1] - used[0]) / REPEATS
    note = (
        f"first, with the start of the worker, {first:.2f} s; fastest {min(later):.2f} s; {core:.2f} s on a core; "
        f"{failed} motions fail"
    )
    report.add(Metric("dry_run_1000_s", median(later), len(later), note))


def _computes(process: psutil.Process) -> bool:
    return "arcor2_hw.compute" in process.cmdline()


async def _create(rest: Rest) -> None:
    """Save a scene with an arm, a floor and 20 boxes, and a project of 1,000 motions to different poses."""
    await rest.put_model(Box("Floor", 2.4, 2.4, 0.1))
    await rest.put_model(Box("Crate", 0.1, 0.1, 0.1))
    await rest.put_object_type("Crate", CRATE, Box("Crate", 0.1, 0.1, 0.1))
    await rest.put_object_type("Floor", CRATE.replace("Crate", "Floor"), Box("Floor", 2.4, 2.4, 0.1))
    objects = [
        SceneObject("arm", "UR5e", Pose(), [Parameter("host", "string", '"192.168.0.10"')], "obj_arm"),
        SceneObject("floor", "Floor", Pose(Position(0.0, 0.0, -0.06)), id="obj_floor"),
        *(
            SceneObject(
                f"box_{n}", "Crate", Pose(Position(0.15 * (n % 5) - 0.3, -0.5 - 0.1 * (n // 5), 0.1 * (n // 5)))
            )
            for n in range(BOXES)
        ),
    ]
    objects = [obj if obj.id else SceneObject(obj.name, obj.type, obj.pose, id=f"obj_{obj.name}") for obj in objects]
    await rest.put_scene(Scene("motions", id="scn_motions", objects=objects))
    chance = random.Random(1)
    ids = ["START", *(f"act_{n}" for n in range(MOTIONS)), "END"]
    logic = [LogicItem(start, end, id=f"lit_{end}") for start, end in itertools.pairwise(ids)]
    points = [_point(number, chance) for number in range(MOTIONS)]
    await rest.put_project(Project("motions", "scn_motions", id="pro_motions", action_points=points, logic=logic))


def _point(number: int, chance: random.Random) -> ActionPoint:
    """Return an action point with a motion to it: every second one in a line."""
    position = Position(chance.uniform(0.3, 0.5), chance.uniform(-0.25, 0.25), chance.uniform(0.2, 0.4))
    down = NamedOrientation("down", Orientation(1.0, 0.0, 0.0, 0.0), f"ori_{number}")
    parameters = [
        ActionParameter("pose", "pose", json.dumps(down.id)),
        ActionParameter("move_type", "string_enum", '"linear"' if number % 2 else '"joint"'),
        ActionParameter("speed", "double", "0.5"),
        ActionParameter("acceleration", "double", "0.5"),
    ]
    action = Action(f"move_{number}", "obj_arm/move", f"act_{number}", parameters, [Flow()])
    return ActionPoint(f"p{number}", position, id=f"acp_{number}", orientations=[down], actions=[action])
