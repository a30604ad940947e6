"""UrPathed: motions that run as programs of our own on the controller: paths with blends, lines that end at a force."""

import itertools
import math
import time
from collections.abc import Callable
from typing import Final

from arcor2_hw.data.geometry import Pose, Position
from arcor2_hw.data.robot import MoveEnd, MoveResult
from arcor2_hw.exceptions import Cancelled, DeviceFault, DeviceTimeout, NotInControl, OutOfRange, SafetyStop

from .arrival import at_joints, at_pose
from .control import ControlSession
from .frames import from_vector, turned, world_from_base
from .observer import Sample
from .program import ENDED, Limit, RunState, joint, linear, motion_program
from .script_port import ScriptPort
from .session_times import POLL, PROGRAM_GONE, REST_WITHIN
from .settings import within
from .states import program_plays
from .timing import GRACE, SLOWEST_FRACTION, joint_budget, linear_budget
from .ur_service import UrServiced

STARTS_WITHIN: Final = 1.0
"""Seconds from the program's text to its first line; a controller takes some tens of milliseconds."""
MOST_WAYPOINTS: Final = 200
LONGEST_BLEND: Final = 0.5
FORCE_LIMITS: Final = (1.0, 100.0)
"""N: below, the noise of the sensor counts; above, the controller's own supervision comes first."""
FARTHEST: Final = 1.0
CONTACT_SPEED: Final = 0.05
NO_CONTACT: Final = "no_contact"
FORCE_LIMIT: Final = "force_limit"
RUNS: Final = 1 << 20


class UrPathed(UrServiced):
    """A Universal Robots arm on paths, and in contact."""

    _ABSTRACT = True
    _runs = 0

    # -------------------------------------------------------------------------------- force
    def wrench(self) -> tuple[float, float, float, float, float, float]:
        """Give force (N) and torque (N m) on the TCP by the controller's measurement, along the axes of the world.

        Raises NotConnected, ConnectionLost, Stale.
        """
        force = self._observer.sample().force
        by = world_from_base(self._pose).orientation
        return (*turned((force[0], force[1], force[2]), by), *turned((force[3], force[4], force[5]), by))

    def move_until_contact(
        self, direction: tuple[float, float, float], force: float, max_distance: float, speed: float = CONTACT_SPEED
    ) -> MoveResult:
        """Move along a direction of the world until the force (N) against it is met, at most `max_distance` m.

        The force is looked at by the controller, in every cycle, as the change since the start. Without contact the
        arm stands at the end of the way and DeviceFault `no_contact` is raised. Raises OutOfRange, and as a move.
        """
        length = math.hypot(*direction)
        if len(direction) != 3 or not math.isfinite(length) or length < 1e-9:
            raise OutOfRange(f"{self.name}: direction must be three numbers, not all zero")
        within(f"{self.name}: force", force, *FORCE_LIMITS)
        within(f"{self.name}: max_distance", max_distance, 0.001, FARTHEST)
        here = self._world(self._observer.sample())
        x, y, z = (max_distance * value / length for value in direction)
        target = Pose(here.position + Position(x, y, z), here.orientation)
        unit = turned(
            (x / max_distance, y / max_distance, z / max_distance), world_from_base(self._pose).orientation.inverted()
        )
        result, state = self._guarded_line(target, speed, Limit(force, unit), self._stops)
        if state is not RunState.PUSHED:
            raise DeviceFault(
                f"{self.name} met nothing within {max_distance:g} m", f"no force of {force:g} N", NO_CONTACT
            )
        return result

    def move_force_limited(self, target: Pose, force: float, speed: float) -> MoveResult:
        """Move the TCP in a line to a pose in the world, and stop where a force (N) acts on it, from any side.

        Raises DeviceFault `force_limit` when it was stopped so; the arm stands where it met the force.
        """
        within(f"{self.name}: force", force, *FORCE_LIMITS)
        result, state = self._guarded_line(target, speed, Limit(force), self._stops)
        if state is RunState.PUSHED:
            raise DeviceFault(f"{self.name} was stopped by a force of {force:g} N", "on its way", FORCE_LIMIT)
        return result

    def _guarded_line(self, target: Pose, speed: float, limit: Limit, stops: int) -> tuple[MoveResult, RunState]:
        within(f"{self.name}: speed", speed, 0.001, 1.0)
        vector = self._controller_vector(target)
        with self._moving():
            session = self._controlled()
            start = self._observer.sample()
            self._solve(session, vector, list(start.q))
            tcp_speed = min(speed * self._ur.max_tcp_speed, self._tcp_speed_cap())
            ramp = self._ur.tcp_acceleration
            budget = self._line_budget(from_vector(start.tcp), from_vector(vector), tcp_speed, ramp)
            line = [linear(vector, tcp_speed, ramp)]
            fraction = tcp_speed / self._ur.max_tcp_speed
            return self._run_own(session, "a move with a force", line, budget, at_pose(vector), fraction, stops, limit)

    # -------------------------------------------------------------------------------- paths
    def move_path(
        self, waypoints: list[Pose], blend: float = 0.0, linear: bool = True, speed: float = 0.25
    ) -> MoveResult:
        """Move the TCP through poses in the world; at each but the last it rounds the corner within `blend` m.

        Lines between the poses, or joint moves with `linear` false. A blend of 0 stands at each pose; it must be less
        than half the way to the next pose. Raises OutOfRange, KinematicsException, and as a move.
        """
        return self._path(waypoints, blend, linear, speed, self._stops)

    def _path(self, waypoints: list[Pose], blend: float, in_lines: bool, speed: float, stops: int) -> MoveResult:
        within(f"{self.name}: speed", speed, 0.001, 1.0)
        within(f"{self.name}: blend", blend, 0.0, LONGEST_BLEND)
        if not 1 <= len(waypoints) <= MOST_WAYPOINTS:
            raise OutOfRange(f"{self.name}: a path has 1 to {MOST_WAYPOINTS} waypoints, not {len(waypoints)}")
        vectors = [self._controller_vector(pose) for pose in waypoints]
        with self._moving():
            session = self._controlled()
            start = self._observer.sample()
            self._check_blend(blend, [list(start.tcp), *vectors])
            configurations = [list(start.q)]
            for vector in vectors:
                configurations.append(self._solve(session, vector, configurations[-1]))
            blends = [*[blend] * (len(vectors) - 1), 0.0]
            if in_lines:
                top, ramp = min(speed * self._ur.max_tcp_speed, self._tcp_speed_cap()), self._ur.tcp_acceleration
                moves = [linear(vector, top, ramp, r) for vector, r in zip(vectors, blends, strict=True)]
                poses = [from_vector(vector) for vector in ([*start.tcp], *vectors)]
                budgets = [self._line_budget(a, b, top, ramp) for a, b in itertools.pairwise(poses)]
                fraction = top / self._ur.max_tcp_speed
            else:
                top, ramp = min(speed * self._ur.max_joint_speed, self._joint_speed_cap()), self._ur.joint_acceleration
                moves = [joint(q, top, ramp, r) for q, r in zip(configurations[1:], blends, strict=True)]
                pairs = itertools.pairwise(configurations)
                budgets = [joint_budget(tuple(a), b, top, ramp) for a, b in pairs]
                fraction = top / self._ur.max_joint_speed
            budget = sum(budgets) - GRACE * (len(budgets) - 1)
            reached = at_pose(vectors[-1]) if in_lines else at_joints(configurations[-1])
            return self._run_own(session, "a path", moves, budget, reached, fraction, stops)[0]

    @staticmethod
    def _line_budget(a: Pose, b: Pose, speed: float, ramp: float) -> float:
        return linear_budget(a.position.distance_to(b.position), a.orientation.angle_to(b.orientation), speed, ramp)

    def _check_blend(self, blend: float, vectors: list[list[float]]) -> None:
        """Refuse blends that would overlap: the controller would end the program on the way."""
        for number, (a, b) in enumerate(itertools.pairwise(vectors), 1):
            way = math.dist(a[:3], b[:3])
            if len(vectors) > 2 and blend > 0.0 and blend >= way / 2.0:
                raise OutOfRange(
                    f"{self.name}: blend must be less than half the way of {way:.3f} m to waypoint {number}"
                )

    # -------------------------------------------------------------------------------- the run of a program
    def _run_own(
        self,
        session: ControlSession,
        what: str,
        moves: list[str],
        budget: float,
        reached: Callable[[Sample], bool],
        fraction: float,
        stops: int,
        limit: Limit | None = None,
    ) -> tuple[MoveResult, RunState]:
        """Run moves as a program of our own and wait for its end; then the control program plays again."""
        began = time.monotonic()
        self._runs = (self._runs + 1) % RUNS
        tool = self.tool()
        text = motion_program(
            self._runs, moves, session.registers, self._ur.watchdog_frequency, tool, self._ur.stop_deceleration, limit
        )
        try:
            port = session.play(self._runs, text, lambda: self._stops == stops)
            try:
                state = self._wait_own(session, port, what, self._runs, stops, budget)
            finally:
                port.close()
        except Cancelled:
            self._note(fraction, began, MoveEnd.STOPPED)
            raise
        except SafetyStop:
            self._note(fraction, began, MoveEnd.SAFETY)
            raise
        result = self._note(fraction, began, MoveEnd.STOPPED if state is RunState.STOPPED else MoveEnd.DONE)
        newest = self._observer.newest()
        arrived = newest is not None and reached(newest)
        session.resume()
        self._tell_tool(session, tool)
        if state is RunState.STOPPED:
            raise Cancelled(f"{what} of {self.name} was stopped")
        if state is RunState.ARRIVED and not arrived:
            raise DeviceFault(f"{what} of {self.name} ended before its target")
        return result, state

    def _wait_own(
        self, session: ControlSession, port: ScriptPort, what: str, number: int, stops: int, budget: float
    ) -> RunState:
        """Return how the run ended, once nothing plays and the arm stands."""
        began = last = time.monotonic()
        stopped_at = 0.0
        gone_since: float | None = None  # by the controller's time
        timed_out = False
        while True:
            time.sleep(POLL)
            port.drain()
            if session.ended is not None:
                raise session.ended
            sample = self._observer.newest()
            assert sample is not None
            now = time.monotonic()
            run, state = sample.run(session.upper)
            plays = program_plays(sample.runtime)
            if run == number and state in ENDED and not plays and not sample.moving:
                if timed_out:
                    session.resume()
                    raise DeviceTimeout(f"{what} of {self.name} did not end in the time computed; it was stopped")
                return RunState(state)
            if run != number and now - began > STARTS_WITHIN:
                error = DeviceFault(f"the controller of {self.name} did not start the program of {what}")
                session.end(error)
                raise error
            if plays or run != number or gone_since is None:
                gone_since = sample.timestamp
            if sample.timestamp - gone_since > PROGRAM_GONE + (REST_WITHIN if state in ENDED else 0.0):
                session.end(NotInControl(f"{what} of {self.name} was stopped at the controller, not by this driver"))
                continue
            if self._stops != stops and stopped_at == 0.0:
                stopped_at = now
            if stopped_at and now - stopped_at > REST_WITHIN / 2.0:
                session.stop_by_dashboard()
            budget -= (now - last) * max(sample.speed_fraction, SLOWEST_FRACTION)
            last = now
            if budget < 0.0 and not timed_out:
                timed_out = True
                self._stops += 1
                session.stop_motion(self._ur.stop_deceleration)

    def stop(self) -> None:
        """Stop what we move and return when it stands; called past everything else. It is no safety function.

        Raises NotInControl when a program that is not ours plays, DeviceTimeout when the arm does not come to rest.
        """
        super().stop()
        session, until = self._session, time.monotonic() + REST_WITHIN
        while session is not None and session.own is not None and session.ended is None and time.monotonic() < until:
            time.sleep(POLL)  # the next command may come at once
