"""The dry run in the compute worker: times, collisions and reach of motions, and the durations of other actions."""

import itertools
from pathlib import Path

import pytest
from msgspec.structs import replace

from arcor2_hw.collision.description import RobotSource, StoredFile, WorldBody, WorldRobot
from arcor2_hw.compute.dry_run_functions import SETTLING, dry_run
from arcor2_hw.compute.dry_run_tasks import ActionMoves, DryRunTask, KnownDuration, Move, MovingRobot
from arcor2_hw.compute.program_walk import END_STEP, Edge, Graph, Step
from arcor2_hw.compute.worker_state import WorkerState
from arcor2_hw.data.base import UNSET, Unset
from arcor2_hw.data.dry_run import ActionDuration, DryRunProblem, DurationSource, Prediction
from arcor2_hw.data.geometry import Orientation, Pose, Position
from arcor2_hw.data.robot import RobotMaxima
from arcor2_hw.kinematics.primitives import Box
from arcor2_hw.planning.motion_times import trapezoid_time
from tests.kinematics import kin_robots

DOWN = Orientation(1.0, 0.0, 0.0, 0.0)
MAXIMA = RobotMaxima(3.0, 10.0, 1.0, 5.0)
LINE, JOINTS = "arm.line", "arm.joints"


def at(x: float, y: float, z: float = 0.3) -> Pose:
    return Pose(Position(x, y, z), DOWN)


def line(x: float, y: float, z: float = 0.3, **more: float) -> ActionMoves:
    return ActionMoves([Move(at(x, y, z), linear=True, speed=0.5, acceleration=0.5, **more)], LINE)


def program(moves: dict[str, ActionMoves], *others: str, **more: object) -> DryRunTask:
    """Return a program whose moving actions come first; the others belong to the device "belt"."""
    actions = [*moves, *others]
    targets = [*range(1, len(actions)), END_STEP]
    steps = [
        Step(name, name.upper(), "arm" if name in moves else "belt", [Edge(target)])
        for name, target in zip(actions, targets, strict=True)
    ]
    return DryRunTask(
        Graph(steps),
        {"arm": "Arm", "belt": "Belt"},
        0,
        {"arm": MovingRobot("Arm", MAXIMA)},
        moves,
        **more,  # type: ignore[arg-type]
    )


def predict(task: DryRunTask, *bodies: WorldBody) -> Prediction:
    state = WorkerState(lambda share, text: None)
    model = StoredFile(str(kin_robots.UR / "ur5e" / "ur5e.urdf"), "ur5e.urdf")
    assert Path(model.path).is_file()
    state.change("", [WorldRobot("arm", RobotSource(model)), *bodies], [])
    return dry_run(task, state).prediction


def problem_of(prediction: Prediction) -> DryRunProblem:
    assert not isinstance(prediction.problem, Unset)
    return prediction.problem


def test_a_line_takes_the_time_of_its_speed_profile() -> None:
    # From b to a the cycle begins: it ends where it started.
    found = predict(program({"a": line(0.4, 0.2), "b": line(0.4, -0.2), "c": line(0.4, 0.2)}))
    times = [span.duration for span in found.trace.spans]
    expected = trapezoid_time(0.4, 0.5, 2.5) + SETTLING
    assert times == pytest.approx([SETTLING, expected, expected], abs=2e-3)
    assert found.problem is UNSET
    assert [span.start for span in found.trace.spans] == pytest.approx([0.0, *itertools.accumulate(times[:-1])])
    assert found.summary.cycle == pytest.approx(sum(times))
    assert {each.source for each in found.durations} == {DurationSource.PLANNED}
    assert "Arm starts where the cycle ends." in [each.text for each in found.assumptions]


def test_the_maximum_velocity_of_a_joint_slows_down_a_line() -> None:
    # Near the base, the same line needs a faster rotation than the joint permits.
    near = {"a": line(0.25, 0.25), "b": line(0.25, -0.25)}
    fast = {key: ActionMoves([replace(one.moves[0], speed=1.0)], LINE) for key, one in near.items()}
    task = replace(program(fast), robots={"arm": MovingRobot("Arm", RobotMaxima(3.0, 10.0, 3.0, 50.0))})
    found = predict(task)
    assert found.trace.spans[1].duration > 1.5 * (trapezoid_time(0.5, 3.0, 25.0) + SETTLING)


def test_a_collision_on_the_path_is_reported_with_action_obstacle_and_place() -> None:
    post = WorldBody("post", Box(0.04, 0.04, 1.0), Pose(Position(0.4, 0.0, 0.5)))
    found = predict(program({"a": line(0.4, 0.25), "b": line(0.4, -0.25)}, "stop"), post)
    problem = problem_of(found)
    assert problem.action_id in ("a", "b")
    assert "Arm would collide on its path" in problem.reason
    assert "post" in problem.reason
    assert not isinstance(problem.values, Unset)
    contact = problem.values["contact"]
    assert not isinstance(contact, str)
    assert contact.key == "{first} and {second}"
    pose = problem.pose
    assert not isinstance(pose, Unset)
    assert abs(pose.position.y) < 0.25
    failed = [span.action_id for span in found.trace.spans if span.error]
    assert failed[0] == problem.action_id


def test_a_target_out_of_reach_has_no_planned_time() -> None:
    known = {"far": KnownDuration(2.5, ActionDuration("far", DurationSource.ACTION, 3))}
    found = predict(program({"near": line(0.4, 0.2), "far": line(3.0, 0.0)}, durations=known))
    problem = problem_of(found)
    assert (problem.action_id, problem.pose) == ("far", at(3.0, 0.0))
    assert problem.reason.startswith("The pose is 3.01 m from the robot")
    assert found.trace.spans[1].duration == 2.5
    assert found.durations[1].source is DurationSource.ACTION


def test_other_actions_have_their_earlier_duration_or_none() -> None:
    known = {"belt_on": KnownDuration(1.25, ActionDuration("belt_on", DurationSource.METHOD, 4))}
    task = replace(program({}, "belt_on", "belt_off", durations=known), robots={})
    found = predict(task)
    assert [(span.duration, span.device) for span in found.trace.spans] == [(1.25, "belt"), (0.0, "belt")]
    assert [each.source for each in found.durations] == [DurationSource.METHOD, DurationSource.UNKNOWN]
    assert found.summary.devices[0].name == "Belt"


def test_the_measured_extra_time_of_motions_is_added() -> None:
    moves = {"a": line(0.4, 0.2), "b": line(0.4, -0.2), "c": line(0.4, 0.2)}
    planned = trapezoid_time(0.4, 0.5, 2.5)
    measured = {"a": 0.2, "b": planned + 0.2, "c": planned + 0.2}
    found = predict(program(moves, measured=measured))
    assert [span.duration for span in found.trace.spans] == pytest.approx([0.2, planned + 0.2, planned + 0.2], abs=5e-3)
    # After an edit, the addition of the method is still known.
    edited = predict(program({"a": line(0.5, 0.1), "b": line(0.5, -0.1)}, additions={LINE: 0.2}))
    assert edited.trace.spans[1].duration == pytest.approx(trapezoid_time(0.2, 0.5, 2.5) + 0.2, abs=5e-3)


def test_a_safe_motion_goes_around_an_obstacle() -> None:
    post = WorldBody("post", Box(0.04, 0.04, 1.0), Pose(Position(0.45, 0.0, 0.5)))
    direct = {key: ActionMoves([Move(at(0.45, y), speed=0.5)], JOINTS) for key, y in (("a", 0.3), ("b", -0.3))}
    assert "post" in problem_of(predict(program(direct), post)).reason
    safe = {key: ActionMoves([replace(one.moves[0], safe=True)], JOINTS) for key, one in direct.items()}
    assert predict(program(safe), post).problem is UNSET


def test_branches_of_parallel_work_start_together_and_the_longest_counts() -> None:
    end = [Edge(END_STEP)]
    steps = [
        Step("bring", "Bring", "belt", [Edge(1)]),
        Step("both", "Both", "", [Edge(6)], branches=[2, 3]),
        Step("call test", "Call test", "", end, function="test"),
        Step("call fetch", "Call fetch", "", end, function="fetch"),
        Step("close", "Close", "tester", [Edge(5)]),
        Step("measure", "Measure", "tester", end),
        Step("report", "Report", "erp", end),
        Step("run", "Run", "belt", end),
    ]
    seconds = {"bring": 1.0, "close": 0.5, "measure": 2.0, "run": 1.5, "report": 0.25}
    known = {key: KnownDuration(value, ActionDuration(key, DurationSource.ACTION, 1)) for key, value in seconds.items()}
    graph = Graph(steps, functions={"test": 4, "fetch": 7})
    found = predict(DryRunTask(graph, {"belt": "Belt"}, durations=known))
    spans = {span.action_id: (span.start, span.duration) for span in found.trace.spans}
    assert spans == {
        "bring": (0.0, 1.0),
        "both": (1.0, 2.5),
        "call test": (1.0, 2.5),
        "close": (1.0, 0.5),
        "measure": (1.5, 2.0),
        "call fetch": (1.0, 1.5),
        "run": (1.0, 1.5),
        "report": (3.5, 0.25),
    }
    assert found.summary.cycle == pytest.approx(3.75)
    by_number = {span.number: span for span in found.trace.spans}
    outer = {
        span.action_id: "" if isinstance(span.call, Unset) else by_number[span.call].action_id
        for span in found.trace.spans
    }
    assert [outer[key] for key in ("both", "call fetch", "measure", "run")] == ["", "both", "call test", "call fetch"]
    lanes = {span.action_id: span.lane for span in found.trace.spans}
    assert [lanes[key] for key in ("report", "close", "run")] == [UNSET, "call test", "call fetch"]
    assert {each.action_id for each in found.durations} == set(seconds), "calls have no separate duration"
