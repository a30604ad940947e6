"""The function of the dry run: it simulates one cycle of a program in the collision world of the scene."""

import math
import statistics
import time
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import msgspec
from msgspec import UNSET

from arcor2_hw.collision.sweep import Sweep
from arcor2_hw.compute.dry_run_tasks import ActionMoves, DryRunAnswer, DryRunTask, Move, MovingRobot
from arcor2_hw.compute.program_walk import OUTSIDE, Step, Visit, walk
from arcor2_hw.compute.worker_state import WorkerState
from arcor2_hw.data.base import Unset
from arcor2_hw.data.dry_run import ActionDuration, Assumption, DryRunProblem, DurationSource, Prediction
from arcor2_hw.data.geometry import Pose
from arcor2_hw.data.robot import Joint
from arcor2_hw.data.run_trace import RunTrace, Span, traced_devices
from arcor2_hw.data.trace_comparison import summarize
from arcor2_hw.messages import Message
from arcor2_hw.planning.motion_times import FARTHEST, RESOLUTION, MotionTimer, Outcome

if TYPE_CHECKING:
    from arcor2_hw.compute.world_replica import WorldReplica
    from arcor2_hw.kinematics.shapes import Array

LOOKAHEAD: Final = 24
"""Number of moves by which the configuration is chosen in which a robot starts."""
SETTLING: Final = 0.05
"""Time by which a motion takes longer than planned when no run shows it, s: for the command and standstill."""
PERIOD: Final = 0.2
"""Time between two reports of the progress, s."""


def dry_run(task: DryRunTask, state: WorkerState) -> DryRunAnswer:
    """Predict the times of one cycle.

    The cycle is simulated twice: the first time only to know where each robot is when the cycle ends, because that is
    where the next one starts. Motions with the same start are computed once.
    """
    walked = walk(task.graph, task.first)
    cycle = _Cycle(task, state, walked.visits)
    cycle.run()
    cycle.run()
    return cycle.answer(walked.assumptions)


class _Record(NamedTuple):
    """A simulated action. planned: duration of its motions, s; None if it has none, or they cannot be planned."""

    visit: Visit
    planned: float | None
    reason: Message | None


class _Robot:
    """A robot during the simulation. `q`: joint values of its model; None until its first motion."""

    def __init__(self, key: str, robot: MovingRobot, world: "WorldReplica") -> None:
        self.key, self.name, self._maxima, self._world = key, robot.name, robot.maxima, world.collisions
        self.standing = world.collisions.robot(key)
        self._timers: dict[str, MotionTimer] = {}
        model = self.standing.model
        self.q: Array | None = model.values(robot.joints, model.neutral()) if robot.joints else None
        self.moved = False

    def timer(self, end_effector: str) -> MotionTimer:
        """Return the timer of an arm. The other joints of the robot keep their present values."""
        links = self.standing.model.end_effectors
        fitting = [link for link in links if end_effector in (link, link.partition("_")[0])]
        link = fitting[0] if fitting else next(iter(links))
        if link not in self._timers or len(links) > 1:
            sweep = Sweep(self._world, self.key, self.standing.model.arm(link), RESOLUTION, FARTHEST)
            self._timers[link] = MotionTimer(sweep, self.standing.base, self.name, self._maxima)
        return self._timers[link]

    def place(self, q: "Array") -> None:
        """Set the joint values. The world needs them only for other robots and other arms."""
        self.q, self.moved = q, True
        if len(self._world.robots) > 1 or len(self.standing.model.end_effectors) > 1:
            self._world.set_joints(self.key, q)


class _Cycle:
    """The simulation of one cycle. `run` starts at the present joint values of the robots."""

    def __init__(self, task: DryRunTask, state: WorkerState, visits: list[Visit]) -> None:
        self._task, self._state, self._visits = task, state, visits
        world = state.world() if task.robots else None
        self._robots = {} if world is None else {key: _Robot(key, one, world) for key, one in task.robots.items()}
        self._ahead = self._moves_by_robot(visits)
        self._computed: dict[tuple[Any, ...], tuple[Outcome, Array]] = {}
        self._records: list[_Record] = []
        self._problem: DryRunProblem | Unset = UNSET
        self._done, self._reported = 0, time.monotonic()

    def _moves_by_robot(self, visits: list[Visit]) -> dict[str, list[tuple[str, Move]]]:
        """Return the end effectors and moves of each robot, in their order."""
        found: dict[str, list[tuple[str, Move]]] = {key: [] for key in self._robots}
        for visit in visits:
            step = self._task.graph.steps[visit.step]
            moves = self._task.moves.get(step.action_id)
            if moves is not None and step.device in found:
                found[step.device] += [(moves.end_effector, move) for move in moves.moves]
        return found

    # -------------------------------------------------------------------------------- simulation
    def run(self) -> None:
        """Simulate the actions."""
        self._records, self._problem = [], UNSET
        for visit in self._visits:
            step = self._task.graph.steps[visit.step]
            moves, robot = self._task.moves.get(step.action_id), self._robots.get(step.device)
            planned = moves is not None and robot is not None
            self._records.append(_Record(visit, *(self._moves(step, robot, moves) if planned else (None, None))))  # type: ignore[arg-type]
            self._report()

    def _report(self) -> None:
        self._done += 1
        if (now := time.monotonic()) >= self._reported + PERIOD:
            self._reported = now
            self._state.progress(self._done / (2 * len(self._visits)), "")

    def _moves(self, step: Step, robot: _Robot, moves: ActionMoves) -> tuple[float | None, Message | None]:
        """Return the duration of the motions of an action, and the reason if one fails."""
        whole: float | None = 0.0
        first: Message | None = None
        for move in moves.moves:
            outcome = self._move(robot, moves.end_effector, move)
            if outcome.reason is not None and first is None:
                first = outcome.reason
                if isinstance(self._problem, Unset):
                    place = UNSET if outcome.place is None else outcome.place
                    self._problem = DryRunProblem(step.action_id, step.name, first.text, place, **first.translation())
            if whole is not None:
                whole = None if outcome.seconds is None else whole + outcome.seconds + move.dwell
        return whole, first

    def _move(self, robot: _Robot, end_effector: str, move: Move) -> Outcome:
        timer = robot.timer(end_effector)
        if robot.q is None:
            robot.q = self._start(robot, timer, move)
        others = tuple(
            other.q.tobytes() for other in self._robots.values() if other is not robot and other.q is not None
        )
        key = (robot.key, end_effector, robot.q.tobytes(), msgspec.msgpack.encode(move), others)
        if (found := self._computed.get(key)) is None:
            outcome = _computed(timer, timer.arm.of(robot.q), move)
            found = self._computed[key] = (outcome, timer.arm.whole(outcome.q, robot.q))
        robot.place(found[1])
        return found[0]

    def _start(self, robot: _Robot, timer: MotionTimer, move: Move) -> "Array":
        """Return the start of a robot: the configuration at its first target from which most of its next moves succeed.

        The configuration of a real robot is known only while it is online.
        """
        neutral = robot.standing.model.neutral()
        own = self._ahead[robot.key]
        following = [one for end_effector, one in own[:LOOKAHEAD] if robot.timer(end_effector).arm is timer.arm]
        if len(own) <= LOOKAHEAD:
            following += following[:1]  # the next cycle
        best, fewest = neutral, math.inf
        for q in timer.starts(_target(move)):
            failed, at = 0, q
            for one in following:
                outcome = _computed(timer, at, one)
                failed, at = failed + (outcome.reason is not None), outcome.q
            if failed < fewest:
                best, fewest = timer.arm.whole(q, neutral), failed
            if not failed:
                break
        return best

    # -------------------------------------------------------------------------------- result
    def answer(self, assumptions: list[Assumption]) -> DryRunAnswer:
        """Return the result of the last simulation.

        Args:
            assumptions: Assumptions about branches.
        """
        additions = self._measured_additions()
        known = self._task.additions | additions
        durations: list[ActionDuration] = []
        calls = {visit.call for visit in self._visits}
        seconds = [0.0] * len(self._records)
        for number, (visit, planned, _) in enumerate(self._records):
            if number not in calls:  # a call takes as long as the steps that it executes
                step = self._task.graph.steps[visit.step]
                seconds[number], source = self._duration(step, planned, known)
                durations.append(source)
        spans = self._spans(seconds)
        trace = RunTrace(0, devices=traced_devices(spans, self._task.names), spans=spans)
        every = [*assumptions, *self._assumptions(known), *self._task.assumptions]
        return DryRunAnswer(Prediction(trace, summarize(trace), durations, every, self._problem), additions)

    def _spans(self, seconds: list[float]) -> list[Span]:
        """Return the spans in the order of their start. `seconds`: the durations of the visits, 0 of calls."""
        steps, visits = self._task.graph.steps, self._visits
        starts, ends = [0.0] * len(visits), [0.0] * len(visits)
        whole = 0.0
        for number, visit in enumerate(visits):
            if visit.call == OUTSIDE:
                starts[number] = whole
            else:
                # Branches start together, other steps after the one before them.
                parallel = bool(steps[visits[visit.call].step].branches)
                starts[number] = (starts if parallel else ends)[visit.call]
            ends[number] = starts[number] + seconds[number]
            around = visit.call
            while around != OUTSIDE:
                ends[around] = max(ends[around], ends[number])
                around = visits[around].call
            whole = max(whole, ends[number])
        order = sorted(range(len(visits)), key=lambda number: starts[number])
        numbers = {visit: number for number, visit in enumerate(order, 1)}
        spans: list[Span] = []
        for number in order:
            visit, _, reason = self._records[number]
            step = steps[visit.step]
            spans.append(
                Span(
                    numbers[number],
                    step.action_id,
                    step.name,
                    step.device,
                    round(starts[number], 6),
                    round(ends[number] - starts[number], 6),
                    visit.branch,
                    UNSET if reason is None else reason.text,
                    call=UNSET if visit.call == OUTSIDE else numbers[visit.call],
                    lane=visit.lane or UNSET,
                )
            )
        return spans

    def _duration(self, step: Step, planned: float | None, additions: dict[str, float]) -> tuple[float, ActionDuration]:
        if planned is not None:
            moves = self._task.moves[step.action_id]
            addition = additions.get(moves.method, SETTLING * len(moves.moves))
            return max(0.0, planned + addition), ActionDuration(step.action_id, DurationSource.PLANNED)
        if (known := self._task.durations.get(step.action_id)) is not None:
            return known.seconds, known.source
        return 0.0, ActionDuration(step.action_id, DurationSource.UNKNOWN)

    def _measured_additions(self) -> dict[str, float]:
        """Return the additional time of the motions of each method compared with the plan, in runs of this program, s.

        This is the time for commands, settling and gripping.
        """
        longer: dict[str, list[float]] = {}
        for visit, planned, reason in self._records:
            action = self._task.graph.steps[visit.step].action_id
            if planned is not None and reason is None and (real := self._task.measured.get(action)) is not None:
                longer.setdefault(self._task.moves[action].method, []).append(real - planned)
        return {method: statistics.median(values) for method, values in longer.items()}

    def _assumptions(self, additions: dict[str, float]) -> list[Assumption]:
        planned = (record.visit.step for record in self._records if record.planned is not None)
        methods = {self._task.moves[self._task.graph.steps[step].action_id].method for step in planned}
        found = [
            Message.of("{name} starts where the cycle ends.", name=robot.name)
            for robot in self._robots.values()
            if robot.moved
        ]
        if methods & additions.keys():
            found.append(Message.of("Motions take as much longer than planned as in earlier runs."))
        if methods - additions.keys():
            text = "Each motion takes {seconds:g} s longer than planned, because no run of this program shows how much."
            found.append(Message.of(text, seconds=SETTLING))
        return [Assumption(message.text, **message.translation()) for message in found]


def _target(move: Move) -> Pose | list[Joint]:
    return move.joints if move.pose is None else move.pose


def _computed(timer: MotionTimer, start: "Array", move: Move) -> Outcome:
    return timer.move(
        start,
        _target(move),
        linear=move.linear,
        speed=move.speed,
        acceleration=move.acceleration,
        safe=move.safe,
    )
