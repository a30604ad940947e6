"""The two-axis robot as an object type: its motions."""

import contextlib
import time
from typing import ClassVar, Final

from arcor2_hw.actions import action
from arcor2_hw.data.geometry import Pose
from arcor2_hw.data.project import ProjectRobotJoints
from arcor2_hw.data.robot import Joint, MoveEnd, MoveResult
from arcor2_hw.exceptions import Cancelled, DeviceError, DeviceFault, DeviceTimeout, NotInControl, OutOfRange, Refused

from . import registers as reg
from .bus import Bus
from .controlled import GOALS, POLL, REST_WITHIN, TwoAxisControlled
from .observed import JOINTS
from .settings import TwoAxisRobotSettings, within

REACHED: Final = 12
"""Ticks (1°) from the goal at which a joint that stands has arrived: a loaded servo rests short of its goal."""
STANDING: Final = 0.5
"""s both joints may stand, short of the goal, before the move counts as failed."""


class TwoAxisRobot(TwoAxisControlled):
    """A planar arm of two Dynamixel servos for fine manipulation."""

    _ABSTRACT = False
    urdf_package_name = "two_axis_robot.zip"
    CANCEL_MAPPING: ClassVar[dict[str, str]] = {"move": "stop", "move_to": "stop"}

    def __init__(self, obj_id: str, name: str, pose: Pose, settings: TwoAxisRobotSettings) -> None:
        super().__init__(obj_id, name, pose, settings)
        self.last_move: MoveResult | None = None

    # -------------------------------------------------------------------------------- moving
    def check_if_ready_to_move(self) -> None:
        """Raise what keeps the arm from moving now; return when nothing does."""
        super().check_if_ready_to_move()
        self._require_control()
        if self._teaching:
            raise Refused(f"{self.name} is in hand teaching mode")

    def move_to_pose(
        self, end_effector_id: str, target_pose: Pose, speed: float, safe: bool = True, linear: bool = True
    ) -> None:
        """Move to a position in the world, joint by joint; a straight line is refused.

        `safe` asks for a path without collisions: those are not known here, what checks them is the hub.
        Raises KinematicsException, OutOfRange, Refused, NotInControl, DeviceFault, Cancelled, DeviceTimeout.
        """
        stops = self._stops
        self._check_end_effector(end_effector_id)
        if linear:
            raise Refused(f"{self.name} does not move in a straight line; ask for a joint move (linear=false)")
        self._move_pose(target_pose, speed, 1.0, stops)

    def move_to_joints(self, target_joints: list[Joint], speed: float, safe: bool = True) -> None:
        """Move to joint values, both joints arriving together."""
        self._move(self._checked(target_joints), speed, 1.0, self._stops)

    @action
    def move(self, pose: Pose, speed: float = 0.25, acceleration: float = 0.5, *, an: str | None = None) -> None:
        """Move the tool centre point to a position; the heading is what comes of it.

        :param pose: where to
        :param speed: fraction of the configured maximum
        :param acceleration: fraction of the configured maximum
        """
        assert 0.01 <= speed <= 1.0
        assert 0.01 <= acceleration <= 1.0
        self._move_pose(pose, speed, acceleration, self._stops)

    @action
    def move_to(
        self, joints: ProjectRobotJoints, speed: float = 0.25, acceleration: float = 0.5, *, an: str | None = None
    ) -> None:
        """Move to stored joint values, both joints arriving together.

        :param joints: where to
        :param speed: fraction of the configured maximum
        :param acceleration: fraction of the configured maximum
        """
        assert 0.01 <= speed <= 1.0
        assert 0.01 <= acceleration <= 1.0
        self._move(self._checked(joints.joints), speed, acceleration, self._stops)

    def _move_pose(self, pose: Pose, speed: float, acceleration: float, stops: int) -> MoveResult:
        return self._move(self._solve(pose, self._angles(self._observer.current())), speed, acceleration, stops)

    def _move(self, q: tuple[float, float], speed: float, acceleration: float, stops: int) -> MoveResult:
        """Move; `stops` is the count of stops when the caller was called: one more since then, and nothing starts."""
        within(f"{self.name}: speed", speed, 0.001, 1.0)
        within(f"{self.name}: acceleration", acceleration, 0.01, 1.0)
        with self._moving():
            self._require_control()
            if self._teaching:
                raise Refused(f"{self.name} is in hand teaching mode")
            goals = self._ticks(q)
            self._check_servo_limits(goals)
            start = self._observer.fresh()
            began = time.monotonic()
            top, ramp = speed * self._axes.max_joint_speed, acceleration * self._axes.joint_acceleration
            distances = [abs(goal - servo.position) * reg.TICK for goal, servo in zip(goals, start.servos, strict=True)]
            longest = max(distances)
            blocks, slowest = {}, 0.0
            for number, goal, distance in zip(self._axes.ids, goals, distances, strict=True):
                part = distance / longest if longest else 1.0
                a, v = reg.profile(top * part, ramp * part)  # one shape for both, so that they arrive together
                slowest = max(slowest, distance / (v * reg.VELOCITY) + v * reg.VELOCITY / (a * reg.ACCELERATION))
                blocks[number] = b"".join(value.to_bytes(4, "little", signed=True) for value in (a, v, goal))

            def command(bus: Bus) -> None:
                if self._stops != stops or not self._ours:
                    raise Cancelled(f"a move of {self.name} was stopped")
                bus.sync_write(GOALS, blocks)

            try:
                self._observer.do(command)
                self._check_taken(goals, stops)
                self._wait_done(goals, 1.5 * slowest + 1.0, stops)
            except Cancelled:
                self._wait_rest(REST_WITHIN)
                self._note(speed, began, MoveEnd.STOPPED)
                raise
            except (DeviceFault, NotInControl):
                with contextlib.suppress(DeviceError):  # the servo that is well must not go on alone
                    self._observer.do(self._brake, urgent=True)
                self._note(speed, began, MoveEnd.SAFETY)
                raise
            return self._note(speed, began, MoveEnd.DONE)

    def _check_servo_limits(self, goals: tuple[int, int]) -> None:
        for number, goal, setup in zip(self._axes.ids, goals, self._observer.setups, strict=True):
            if not setup.min_position <= goal <= setup.max_position:
                raise OutOfRange(
                    f"{self._observer.bus.servo(number)} allows positions {setup.min_position} to "
                    f"{setup.max_position}, not {goal}"
                )

    def _check_taken(self, goals: tuple[int, int], stops: int) -> None:
        """Look whether both servos have the goal: nobody acknowledges a sync write."""
        for number, goal, servo in zip(self._axes.ids, goals, self._observer.fresh().servos, strict=True):
            if servo.goal != goal:
                self._require_control()
                if self._stops != stops:
                    raise Cancelled(f"a move of {self.name} was stopped")
                self.stop()
                raise DeviceFault(f"{self._observer.bus.servo(number)} did not take the goal {goal}", fault_code="goal")

    def _wait_done(self, goals: tuple[int, int], budget: float, stops: int) -> None:
        began = standing = time.monotonic()
        while True:
            if self._stops != stops:
                raise Cancelled(f"a move of {self.name} was stopped")
            snapshot = self._observer.fresh()
            self._require_control()
            now = time.monotonic()
            if not snapshot.standing:
                standing = now
            elif all(abs(s.position - g) <= REACHED for s, g in zip(snapshot.servos, goals, strict=True)):
                if self._stops == stops:
                    return
            elif now - standing > STANDING:
                short = " and ".join(
                    name
                    for name, s, g in zip(JOINTS, snapshot.servos, goals, strict=True)
                    if abs(s.position - g) > REACHED
                )
                raise DeviceFault(f"{short} of {self.name} stands short of its goal", fault_code="short_of_goal")
            if now - began > budget:
                self.stop()
                raise DeviceTimeout(f"a move of {self.name} did not end within {budget:.1f} s; it was stopped")
            time.sleep(POLL)

    def _note(self, speed: float, began: float, end: MoveEnd) -> MoveResult:
        newest = self._observer.newest()
        assert newest is not None
        self.last_move = MoveResult(self._world(self._angles(newest)), speed, time.monotonic() - began, end)
        return self.last_move
