"""SingleArm: a robot with one arm, one end effector and a model for safe moves; results of its motions."""

import contextlib
import dataclasses
import time
from collections.abc import Callable, Iterator

from arcor2_hw.data.geometry import Pose
from arcor2_hw.data.robot import Joint, MoveEnd, MoveResult
from arcor2_hw.exceptions import Cancelled, SafetyStop
from arcor2_hw.objects.arm import TCP, StopGuard
from arcor2_hw.objects.connected import Connected
from arcor2_hw.objects.robot import Robot
from arcor2_hw.objects.safe_moves import SafeMoves
from arcor2_hw.objects.surroundings import Surroundings


@dataclasses.dataclass
class Recording:
    """A motion in progress. `end` is its outcome, None while unknown."""

    end: MoveEnd | None = None


class MotionLog:
    """Stores the result of the last motion.

    Args:
        tcp: Returns the present pose of the end effector in the world; None if it is unknown.
    """

    def __init__(self, tcp: Callable[[], Pose | None]) -> None:
        self._tcp = tcp
        self.last: MoveResult | None = None

    @contextlib.contextmanager
    def recorded(self, speed: float, await_standstill: Callable[[], object] = lambda: None) -> Iterator[Recording]:
        """Record the result of the motion in the context.

        An error other than Cancelled and SafetyStop leaves no result unless the context sets the end.

        Args:
            speed: Fraction of the maximum.
            await_standstill: Called after the motion was cancelled, before its result is recorded.
        """
        started, recording = time.monotonic(), Recording()
        try:
            yield recording
            recording.end = recording.end or MoveEnd.DONE
        except Cancelled:
            recording.end = MoveEnd.STOPPED
            await_standstill()
            raise
        except SafetyStop:
            recording.end = MoveEnd.SAFETY
            raise
        finally:
            if recording.end is not None and (pose := self._tcp()) is not None:
                self.last = MoveResult(pose, speed, time.monotonic() - started, recording.end)


class SingleArm(Connected, Robot):
    """A robot with the end effector TCP. A driver sets `safe_moves` and `motions` in `__init__`."""

    _ABSTRACT = True
    safe_moves: SafeMoves
    motions: MotionLog

    def surround(self, surroundings: Surroundings) -> None:
        """Store the access to objects around the arm, and load its model."""
        super().surround(surroundings)
        self.safe_moves.prepare()

    def get_end_effectors_ids(self) -> set[str]:
        """Return the only end effector, the tool center point."""
        return {TCP}

    def grippers(self) -> set[str]:
        """Return no gripper."""
        return set()

    def suctions(self) -> set[str]:
        """Return no suction cup."""
        return set()

    @property
    def last_move(self) -> MoveResult | None:
        """Return the result of the last motion."""
        return self.motions.last


@contextlib.contextmanager
def on_free_line(robot: Robot, moves: SafeMoves, target: Pose) -> Iterator[None]:
    """Monitor the surroundings while an arm moves in a line to a pose in the world.

    Raises:
        KinematicsException: The line is interrupted or in collision.
        PathBlocked: An obstacle entered the line, and the arm was stopped.
    """
    path = moves.line(TCP, robot.robot_joints(), target)
    path.require_begin(robot.name, robot.robot_joints())
    with moves.monitored(path):
        yield


def move_around_obstacles(
    robot: Robot,
    moves: SafeMoves,
    goal: list[Joint],
    speed: float,
    guard: StopGuard,
    move: Callable[[list[Joint]], object],
) -> None:
    """Move to joint values around obstacles, and stop at each waypoint.

    Args:
        robot: The arm.
        moves: Its safe moves.
        goal: Joint values at the end.
        speed: Fraction of the maximum.
        guard: Guard of the command.
        move: Moves straight in joint space to joint values and waits for standstill there.

    Raises:
        KinematicsException: No path was found.
        PathBlocked: An obstacle entered the path, and the arm was stopped.
    """
    path = moves.to_joints(robot.robot_joints(), goal, speed, stopped=guard.stopped)
    path.require_begin(robot.name, robot.robot_joints())
    with moves.monitored(path):
        for waypoint in path.waypoints[1:]:
            move(waypoint)
