"""Motion: moves of a UR arm by the control program, its kinematics, and stopping."""

import contextlib
import math
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple

from arcor2_hw.data.geometry import Pose
from arcor2_hw.data.robot import MoveResult
from arcor2_hw.exceptions import Cancelled, DeviceFault, DeviceTimeout, NotInControl, Refused
from arcor2_hw.keep_alive import once_within
from arcor2_hw.objects import Robot
from arcor2_hw.objects.arm import StopGuard, exclusive_motion
from arcor2_hw.objects.single_arm import MotionLog

from .arm import Arm
from .control import Control
from .geometry import JOINTS, from_vector
from .observer import Observer, Sample
from .pendant import Pendant
from .session import ControlSession
from .settings import MANUAL_TCP_SPEED
from .states import program_plays
from .timing import (
    MIN_SPEED_FRACTION,
    POLL_INTERVAL,
    STALLED_MOVE_TIMEOUT,
    STANDSTILL_TIMEOUT,
    joint_budget,
    linear_budget,
)

JOINT_TOLERANCE = 0.01
POSITION_TOLERANCE = 0.002
ANGLE_TOLERANCE = 0.02
"""Tolerances within which a target is reached: rad of a joint, m and rad of the TCP."""


class Move(NamedTuple):
    """A motion: name, command or lines of URScript, longest time in s, check for arrival, fraction of the maximum."""

    name: str
    command: Sequence[Any]
    budget: float
    reached: Callable[[Sample], bool]
    fraction: float


def at_pose(vector: Sequence[float]) -> Callable[[Sample], bool]:
    """Return a check whether the TCP is at a pose in the controller's base."""
    target = from_vector(vector)

    def reached(sample: Sample) -> bool:
        at = from_vector(sample.tcp)
        near = at.position.distance_to(target.position) < POSITION_TOLERANCE
        return near and at.orientation.angle_to(target.orientation) < ANGLE_TOLERANCE

    return reached


def at_joints(q: Sequence[float]) -> Callable[[Sample], bool]:
    """Return a check whether the joints have their values."""
    return lambda sample: max(abs(a - b) for a, b in zip(sample.q, q, strict=True)) < JOINT_TOLERANCE


class Motion:
    """Moves the arm, one motion at a time."""

    def __init__(self, arm: Arm, observer: Observer, pendant: Pendant, control: Control, lock: threading.Lock) -> None:
        self._arm, self._observer, self._pendant, self._control = arm, observer, pendant, control
        self._lock = lock
        self.log = MotionLog(self._tcp)

    def _tcp(self) -> Pose | None:
        newest = self._observer.newest()
        return None if newest is None else self._arm.tcp(newest)

    @contextlib.contextmanager
    def exclusive(self) -> Iterator[None]:
        """Reserve the arm for one motion. Raise Refused while it moves or is in hand teaching mode."""
        with exclusive_motion(self._lock, self._arm.name):
            self.check_not_teaching()
            yield

    def check_not_teaching(self) -> None:
        """Raise Refused in hand teaching mode."""
        if self._control.teaching:
            raise Refused("{name} is in hand teaching mode.", name=self._arm.name)

    # -------------------------------------------------------------------------------- moving
    def to_pose(self, target: Pose, linear: bool, speed: float, acceleration: float, guard: StopGuard) -> MoveResult:
        """Move the TCP to a pose in the world, in a line or by the joints of the controller's kinematics."""
        self._arm.check_speed(speed, acceleration)
        vector = self._arm.vector(target)
        with self.exclusive():
            session = self._control.current()
            q = self.solve(session, vector, self._observer.sample().q)
            move = self.line(vector, speed, acceleration) if linear else self.joints(q, speed, acceleration)
            return self.run(session, move, guard)

    def to_joints(self, q: list[float], speed: float, acceleration: float, guard: StopGuard) -> MoveResult:
        """Move to joint values; all joints arrive together."""
        self._arm.check_speed(speed, acceleration)
        with self.exclusive():
            return self.run(self._control.current(), self.joints(q, speed, acceleration), guard)

    def line(self, vector: list[float], speed: float, acceleration: float = 1.0) -> Move:
        """Return a linear move to a pose in the controller's base."""
        settings = self._arm.settings
        top, ramp = self.tcp_speed(speed), acceleration * settings.tcp_acceleration
        budget = linear_budget(from_vector(self._observer.sample().tcp), from_vector(vector), top, ramp)
        fraction = top / settings.max_tcp_speed
        return Move("a linear move", ("moveL", vector, top, ramp, True), budget, at_pose(vector), fraction)

    def joints(self, q: list[float], speed: float, acceleration: float = 1.0) -> Move:
        """Return a joint move."""
        settings = self._arm.settings
        top, ramp = self.joint_speed(speed), acceleration * settings.joint_acceleration
        budget = joint_budget(self._observer.sample().q, q, top, ramp)
        return Move("a joint move", ("moveJ", q, top, ramp, True), budget, at_joints(q), top / settings.max_joint_speed)

    def tcp_speed(self, fraction: float) -> float:
        """Return the TCP speed for a fraction of the maximum, m/s; limited in manual mode."""
        return min(fraction * self._arm.settings.max_tcp_speed, self._speed_limit())

    def joint_speed(self, fraction: float) -> float:
        """Return the joint speed for a fraction of the maximum, rad/s.

        In manual mode the TCP stays below its limit even if every joint moves it with its largest lever arm.
        """
        levers = 3.0 * self._arm.model.reach + len(JOINTS) * math.hypot(*self._control.stated_tool.tcp.position)
        return min(fraction * self._arm.settings.max_joint_speed, self._speed_limit() / levers)

    def _speed_limit(self) -> float:
        return MANUAL_TCP_SPEED if self._pendant.manual else math.inf

    def run(self, session: ControlSession, move: Move, guard: StopGuard) -> MoveResult:
        """Start an asynchronous motion and wait until it is observed to have ended."""
        number, _ = self._observer.sample().operation(session.upper)
        with self.log.recorded(move.fraction, lambda: self.wait_rest(session)):
            session.do(move.name, *move.command, stopped=guard.stopped)
            self._wait_done(session, move, number, guard)
        assert self.log.last is not None
        return self.log.last

    def _wait_done(self, session: ControlSession, move: Move, number: int, guard: StopGuard) -> None:
        what = f"{move.name} of {self._arm.name}"
        clock = Budget(move.budget)
        standing: float | None = None  # by the controller's clock: this process may be delayed
        while True:
            guard.check(what)
            if session.ended is not None:
                raise session.ended
            sample = self._observer.newest()
            assert sample is not None
            latest, running = sample.operation(session.upper)
            if latest != number and not running and not sample.moving and move.reached(sample):
                return
            if sample.moving or running or standing is None:
                standing = sample.timestamp
            elif sample.timestamp - standing > STALLED_MOVE_TIMEOUT:
                raise DeviceFault("{what} ended before its target.", what=what)
            if clock.exceeded(sample):
                self._control.stops.request()
                session.stop_motion(self._arm.settings.stop_deceleration)
                raise DeviceTimeout("{what} did not end within the computed time. It was stopped.", what=what)
            time.sleep(POLL_INTERVAL)

    # -------------------------------------------------------------------------------- stopping
    def stop(self) -> None:
        """Stop the arm and wait for standstill. Raise NotInControl while a foreign program moves it, DeviceTimeout."""
        self._control.stops.request()
        session = self._control.session
        if session is None or session.ended is not None:
            newest = self._observer.newest()
            if newest is not None and newest.moving and program_plays(newest.runtime):
                raise NotInControl(
                    "{name} is being moved by {program}. Stop it there.",
                    name=self._arm.name,
                    program=self._pendant.program(),
                )
            return
        session.stop_motion(self._arm.settings.stop_deceleration)
        if self._control.teaching and session.ended is None:
            self._control.set_teaching(False)
        self.wait_rest(session)
        self._control.note_stop(session)
        # The control program accepts the next command only then.
        once_within(lambda: session.own is None or session.ended is not None, STANDSTILL_TIMEOUT, POLL_INTERVAL)

    def end_jog(self, session: ControlSession) -> None:
        """End a jog and wait for standstill, where a path can be planned. Raise DeviceFault or DeviceTimeout."""
        if session.end_jog():
            self.wait_rest(session)

    def wait_rest(self, session: ControlSession) -> None:
        """Wait for standstill; use the dashboard when it takes too long. Raise DeviceTimeout."""
        until, dashboard_at = time.monotonic() + STANDSTILL_TIMEOUT, time.monotonic() + STANDSTILL_TIMEOUT / 2
        while True:
            newest = self._observer.newest()
            if newest is None or (session.ended is not None and not isinstance(session.ended, Cancelled)):
                return  # the watchdog or the safety system stops the arm
            if not newest.moving and newest.age < POLL_INTERVAL + 2.0 * self._observer.period:
                return
            now = time.monotonic()
            if now > until:
                raise DeviceTimeout(
                    "{robot} did not come to a standstill within {limit:g} s of a stop. Press the emergency stop.",
                    robot=self._arm.name,
                    limit=STANDSTILL_TIMEOUT,
                )
            if now > dashboard_at and session.ended is None:
                session.stop_by_dashboard()
            time.sleep(POLL_INTERVAL)

    # -------------------------------------------------------------------------------- kinematics of the controller
    def solve(self, session: ControlSession, vector: list[float], near: Sequence[float]) -> list[float]:
        """Return the joint values for a pose in the controller's base, nearest to `near`. Raise KinematicsException."""
        # Checked first: without a solution get_inverse_kin ends the control program with an error.
        q: list[float] = []
        if session.ask("inverse kinematics", "getInverseKinematicsHasSolution", vector, list(near)):
            q = session.ask("inverse kinematics", "getInverseKinematics", vector, list(near))
        if len(q) != len(JOINTS) or not all(map(math.isfinite, q)):
            position = ", ".join(f"{value:.3f}" for value in vector[:3])
            raise Robot.KinematicsException(
                "{name} cannot reach the pose.", f"in the controller's base: {position}", name=self._arm.name
            )
        return q


class Budget:
    """Remaining time of a motion, by the controller's clock: this process may be delayed.

    It elapses more slowly while the speed slider is down.
    """

    def __init__(self, seconds: float) -> None:
        self._left = seconds
        self._last: float | None = None

    def exceeded(self, sample: Sample) -> bool:
        """Subtract the time since the sample of the last call. Return whether no time is left."""
        if self._last is not None:
            self._left -= (sample.timestamp - self._last) * max(sample.speed_fraction, MIN_SPEED_FRACTION)
        self._last = sample.timestamp
        return self._left < 0.0
