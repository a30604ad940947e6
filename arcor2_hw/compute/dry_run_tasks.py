"""The task of a dry run. Imports no numerics, so that the server can use it."""

from typing import ClassVar

from msgspec import field

from arcor2_hw.compute.program_walk import Graph
from arcor2_hw.compute.task import Task, WorkerKind
from arcor2_hw.data.base import Data
from arcor2_hw.data.dry_run import ActionDuration, Assumption, Prediction
from arcor2_hw.data.geometry import Pose
from arcor2_hw.data.robot import Joint, RobotMaxima
from arcor2_hw.messages import Message


class Move(Data, frozen=True):
    """A motion of a robot to a pose, or to joints.

    Attributes:
        pose: Target in the world, None for joints.
        joints: Target without a pose.
        linear: Whether the end effector moves in a straight line.
        speed: Fraction of the maxima.
        acceleration: Fraction of the maximum acceleration.
        safe: Whether the robot avoids obstacles instead of moving directly.
        dwell: Time at the target, s.
    """

    pose: Pose | None = None
    joints: list[Joint] = field(default_factory=list)
    linear: bool = False
    speed: float = 1.0
    acceleration: float = 1.0
    safe: bool = False
    dwell: float = 0.0


class ActionMoves(Data, frozen=True):
    """The motions of an action.

    Attributes:
        moves: The motions.
        method: Object type and method of the action.
        end_effector: Link of the end effector, or the arm of a robot with several; empty: the first one.
    """

    moves: list[Move]
    method: str
    end_effector: str = ""


class MovingRobot(Data, frozen=True):
    """A robot that moves. joints: joint values near which it starts; empty: unknown."""

    name: str
    maxima: RobotMaxima
    joints: list[Joint] = field(default_factory=list)


class KnownDuration(Data, frozen=True):
    """The duration of an action in earlier runs, s."""

    seconds: float
    source: ActionDuration


class DryRunAnswer(Data, frozen=True):
    """The prediction, and the additional time of the motions of each measured method, compared with the plan, s."""

    prediction: Prediction
    additions: dict[str, float] = field(default_factory=dict)


class DryRunTask(Task[DryRunAnswer], frozen=True):
    """Predict the times of one cycle of a program.

    Attributes:
        graph: The logic.
        names: Names of the devices, by id.
        first: Number of the first step.
        robots: The robots with models in the world of the task, by id.
        moves: The motions of actions, by id of the action.
        durations: The durations of earlier runs, by id of the action.
        measured: The durations of moving actions in runs of exactly this program, s, by id of the action.
        additions: Additional time of earlier motions of a method, compared with the plan, s, by method.
        assumptions: Assumptions about motions that cannot be planned.
    """

    result_type: ClassVar = DryRunAnswer
    function: ClassVar = "arcor2_hw.compute.dry_run_functions:dry_run"
    worker: ClassVar = WorkerKind.DRY_RUN
    timeout: ClassVar = 600.0
    label: ClassVar = Message.of("the dry run")
    cancellable: ClassVar = True

    graph: Graph
    names: dict[str, str]
    first: int = 0
    robots: dict[str, MovingRobot] = field(default_factory=dict)
    moves: dict[str, ActionMoves] = field(default_factory=dict)
    durations: dict[str, KnownDuration] = field(default_factory=dict)
    measured: dict[str, float] = field(default_factory=dict)
    additions: dict[str, float] = field(default_factory=dict)
    assumptions: list[Assumption] = field(default_factory=list)
