"""Paths: motions that run as motion programs on the controller: paths with blends, and lines that end at a force."""

import itertools
import math
import time
from typing import Final

from arcor2_hw.data.geometry import Pose, Position
from arcor2_hw.data.robot import MoveEnd, MoveResult
from arcor2_hw.exceptions import Cancelled, DeviceFault, DeviceTimeout, OutOfRange
from arcor2_hw.objects.arm import StopGuard

from .arm import Arm
from .control import Control
from .geometry import Vector3, from_vector, rotated
from .motion import Budget, Motion, Move, at_joints, at_pose
from .observer import Observer
from .program import ENDED, Limit, RunState, joint, linear, motion_program
from .script_port import ScriptPort
from .session import ControlSession
from .states import program_plays
from .timing import (
    POLL_INTERVAL,
    PROGRAM_GONE_TIMEOUT,
    STANDSTILL_TIMEOUT,
    START_TIMEOUT,
    joint_budget,
    linear_budget,
    path_budget,
)

MAX_WAYPOINTS: Final = 200
MAX_BLEND: Final = 0.5
"""Maximum blend radius, m."""
FORCE_LIMITS: Final = (1.0, 100.0)
"""Range of force limits, N. Below it, the noise of the sensor triggers; above it, the controller's own limit
applies."""
MAX_CONTACT_DISTANCE: Final = 1.0
"""Maximum distance of a move until contact, m."""
NO_CONTACT: Final = "no_contact"
FORCE_LIMIT: Final = "force_limit"
RUN_NUMBERS: Final = 1 << 20


class Paths:
    """Runs motion programs."""

    def __init__(self, arm: Arm, observer: Observer, control: Control, motion: Motion) -> None:
        self._arm, self._observer, self._control, self._motion = arm, observer, control, motion
        self._runs = 0

    # -------------------------------------------------------------------------------- force
    def wrench(self) -> tuple[float, float, float, float, float, float]:
        """Return force (N) and torque (N m) at the TCP, along the axes of the world."""
        force, world = self._observer.sample().force, self._arm.base.orientation
        return *rotated((force[0], force[1], force[2]), world), *rotated((force[3], force[4], force[5]), world)

    def until_contact(self, direction: Vector3, force: float, max_distance: float, speed: float) -> MoveResult:
        """Move along a direction of the world until the opposing force is reached.

        Raise DeviceFault without contact.
        """
        arm, length = self._arm, math.hypot(*direction)
        if len(direction) != 3 or not math.isfinite(length) or length < 1e-9:
            raise OutOfRange("{name}: direction must be three numbers, not all zero.", name=arm.name)
        arm.within("force", force, *FORCE_LIMITS)
        arm.within("max_distance", max_distance, 0.001, MAX_CONTACT_DISTANCE)
        here = arm.tcp(self._observer.sample())
        x, y, z = (value / length for value in direction)
        target = Pose(here.position + Position(*(max_distance * value for value in (x, y, z))), here.orientation)
        limit = Limit(force, rotated((x, y, z), arm.base.orientation.inverted()))
        result, state = self._guarded_line(target, speed, limit)
        if state is not RunState.PUSHED:
            raise DeviceFault(
                "{robot} made no contact within {distance:g} m.",
                f"no force of {force:g} N",
                NO_CONTACT,
                robot=arm.name,
                distance=max_distance,
            )
        return result

    def force_limited(self, target: Pose, force: float, speed: float) -> MoveResult:
        """Move the TCP in a line to a pose in the world. Raise DeviceFault if a force stops it."""
        self._arm.within("force", force, *FORCE_LIMITS)
        result, state = self._guarded_line(target, speed, Limit(force))
        if state is RunState.PUSHED:
            raise DeviceFault(
                "A force of {force:g} N stopped {name}.",
                "before its target",
                FORCE_LIMIT,
                force=force,
                name=self._arm.name,
            )
        return result

    def _guarded_line(self, target: Pose, speed: float, limit: Limit) -> tuple[MoveResult, RunState]:
        guard, settings = self._control.stops.guard(), self._arm.settings
        self._arm.check_speed(speed)
        vector = self._arm.vector(target)
        with self._motion.exclusive():
            session, start = self._control.current(), self._observer.sample()
            self._motion.solve(session, vector, start.q)
            top, ramp = self._motion.tcp_speed(speed), settings.tcp_acceleration
            budget = linear_budget(from_vector(start.tcp), from_vector(vector), top, ramp)
            fraction = top / settings.max_tcp_speed
            move = Move("a move with a force", [linear(vector, top, ramp)], budget, at_pose(vector), fraction)
            return self._run(session, move, guard, limit)

    # -------------------------------------------------------------------------------- paths
    def follow(self, waypoints: list[Pose], blend: float, in_lines: bool, speed: float) -> MoveResult:
        """Move the TCP through poses in the world, rounding the corners within `blend` m.

        Raises:
            OutOfRange: A parameter is out of range, or a blend is half the distance to the next waypoint or more.
            KinematicsException: A waypoint cannot be reached.
        """
        arm, motion, guard, settings = self._arm, self._motion, self._control.stops.guard(), self._arm.settings
        arm.check_speed(speed)
        arm.within("blend", blend, 0.0, MAX_BLEND)
        if not 1 <= len(waypoints) <= MAX_WAYPOINTS:
            raise OutOfRange(
                "{name}: a path has 1 to {max_waypoints} waypoints, not {count}.",
                name=arm.name,
                max_waypoints=MAX_WAYPOINTS,
                count=len(waypoints),
            )
        vectors = [arm.vector(pose) for pose in waypoints]
        with motion.exclusive():
            session, start = self._control.current(), self._observer.sample()
            points = [list(start.tcp), *vectors]
            self._check_blend(blend, points)
            configurations = [list(start.q)]
            for vector in vectors:
                configurations.append(motion.solve(session, vector, configurations[-1]))
            blends = [*[blend] * (len(vectors) - 1), 0.0]
            if in_lines:
                top, ramp = motion.tcp_speed(speed), settings.tcp_acceleration
                lines = [linear(vector, top, ramp, r) for vector, r in zip(vectors, blends, strict=True)]
                pairs = itertools.pairwise(map(from_vector, points))
                budgets = [linear_budget(a, b, top, ramp) for a, b in pairs]
                reached, fraction = at_pose(vectors[-1]), top / settings.max_tcp_speed
            else:
                top, ramp = motion.joint_speed(speed), settings.joint_acceleration
                lines = [joint(q, top, ramp, r) for q, r in zip(configurations[1:], blends, strict=True)]
                budgets = [joint_budget(a, b, top, ramp) for a, b in itertools.pairwise(configurations)]
                reached, fraction = at_joints(configurations[-1]), top / settings.max_joint_speed
            move = Move("a path", lines, path_budget(budgets), reached, fraction)
            return self._run(session, move, guard)[0]

    def _check_blend(self, blend: float, points: list[list[float]]) -> None:
        """Raise OutOfRange for blends that overlap, because the controller would abort the program."""
        for number, (a, b) in enumerate(itertools.pairwise(points), 1):
            distance = math.dist(a[:3], b[:3])
            if len(points) > 2 and blend > 0.0 and blend >= distance / 2.0:
                raise OutOfRange(
                    "{name}: blend must be less than half the distance of {distance:.3f} m to waypoint {number}.",
                    name=self._arm.name,
                    distance=distance,
                    number=number,
                )

    # -------------------------------------------------------------------------------- the run of a motion program
    def _run(
        self, session: ControlSession, move: Move, guard: StopGuard, limit: Limit | None = None
    ) -> tuple[MoveResult, RunState]:
        """Run a motion program and wait for its end; then let the control program play again."""
        settings, tool, what = self._arm.settings, self._control.tool, f"{move.name} of {self._arm.name}"
        self._runs = (self._runs + 1) % RUN_NUMBERS
        frequency, deceleration = settings.watchdog_frequency, settings.stop_deceleration
        program = motion_program(self._runs, move.command, session.registers, frequency, tool, deceleration, limit)
        with self._motion.log.recorded(move.fraction) as recording:
            port = session.play(self._runs, program, guard.stopped)
            try:
                state = self._wait_end(session, port, what, guard, move.budget)
            finally:
                port.close()
            if state is RunState.STOPPED:
                recording.end = MoveEnd.STOPPED
        newest = self._observer.newest()
        arrived = newest is not None and move.reached(newest)
        session.resume()
        self._control.send_tool(session, tool)
        if state is RunState.STOPPED:
            raise Cancelled("{what} was stopped.", what=what)
        if state is RunState.ARRIVED and not arrived:
            raise DeviceFault("{what} ended before its target.", what=what)
        assert self._motion.log.last is not None
        return self._motion.log.last, state

    def _wait_end(
        self, session: ControlSession, port: ScriptPort, operation: str, guard: StopGuard, budget: float
    ) -> RunState:
        """Return how the run ended, once no program plays and the arm is at standstill."""
        started, clock = time.monotonic(), Budget(budget)
        stopped_at: float | None = None
        gone_since: float | None = None  # by the controller's clock
        timed_out = False
        while True:
            time.sleep(POLL_INTERVAL)
            port.drain()
            if session.ended is not None:
                raise session.ended
            sample = self._observer.newest()
            assert sample is not None
            now = time.monotonic()
            number, state = sample.run(session.upper)
            plays, ours = program_plays(sample.runtime), number == self._runs
            if ours and state in ENDED and not plays and not sample.moving:
                if timed_out:
                    session.resume()
                    raise DeviceTimeout("{what} did not end within the computed time. It was stopped.", what=operation)
                return RunState(state)
            if not ours and now - started > START_TIMEOUT:
                error = DeviceFault(
                    "The controller of {name} did not start the program of {what}.", name=self._arm.name, what=operation
                )
                session.end(error)
                raise error
            if plays or not ours or gone_since is None:
                gone_since = sample.timestamp
            if sample.timestamp - gone_since > PROGRAM_GONE_TIMEOUT + (STANDSTILL_TIMEOUT if state in ENDED else 0.0):
                session.end(session.program_gone())
                continue
            if guard.stopped() and stopped_at is None:
                stopped_at = now
            if stopped_at is not None and now - stopped_at > STANDSTILL_TIMEOUT / 2.0:
                session.stop_by_dashboard()
            if clock.exceeded(sample) and not timed_out:
                timed_out = True
                self._control.stops.request()
                session.stop_motion(self._arm.settings.stop_deceleration)
