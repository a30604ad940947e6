"""Motion: moves of one arm or of both coupled, with clearance between the arms, and stopping."""

import contextlib
import math
import threading
import time
from collections.abc import Iterator
from typing import Final

import numpy as np

from arcor2_hw.data.geometry import Pose
from arcor2_hw.data.robot import Joint, MoveEnd, MoveResult
from arcor2_hw.exceptions import (
    Cancelled,
    ConnectionLost,
    DeviceError,
    DeviceTimeout,
    NotConnected,
    NotInControl,
    OutOfRange,
    Refused,
    SafetyStop,
    WatchdogTripped,
)
from arcor2_hw.keep_alive import once_within
from arcor2_hw.objects.arm import StopGuard, exclusive_motion

from . import nominal
from .arm_line import ArmLine, Command, CommandRefused
from .arms import Arms, other_arm
from .clearance import Clearance, joint_path
from .control import Control
from .frames import to_degrees
from .kinematics import Kinematics
from .motion_lines import MAX_WAYPOINTS, Code, Status
from .nominal import Array
from .observer import STANDSTILL_SPEED, Observer
from .session import ControlSession
from .settings import ARMS

RAMP_TIME: Final = 0.2
"""Time that accelerating and braking add to a motion, s."""
DURATION_FACTOR: Final = 1.5
"""Factor on the computed time of a motion."""
DURATION_MARGIN: Final = 3.0
"""Time added to the computed time of a motion, s."""
MIN_SPEED_OVERRIDE: Final = 0.05
"""Minimum speed override that extends the time limit of a motion; lower ones count as this value."""
STANDSTILL_TIMEOUT: Final = 2.0
"""Time after which a stopped arm must be at standstill, s; from full speed it takes 0.2 s."""
STOP_REPEAT_INTERVAL: Final = 0.15
"""Time after which a stop is sent again, s: the two sockets of an arm have no common order."""
MAX_DURATION: Final = 600.0
"""Longest joint motion, s."""


class Motion:
    """Moves the arms, each executing one motion at a time."""

    def __init__(self, arms: Arms, observer: Observer, control: Control, kinematics: Kinematics) -> None:
        self._arms, self._observer, self._control, self._kinematics = arms, observer, control, kinematics
        self._locks = {arm: threading.Lock() for arm in ARMS}
        self.clearance = Clearance(arms.name, arms.tools, arms.settings.clearance)
        self.last: dict[str, MoveResult] = {}

    def in_progress(self, arms: tuple[str, ...] = ARMS) -> bool:
        """Return whether one of the arms executes a motion."""
        return any(self._locks[arm].locked() for arm in arms)

    def check_ready(self, arms: tuple[str, ...]) -> None:
        """Raise what prevents arms from moving."""
        for arm in arms:
            if self._locks[arm].locked():
                raise Refused("The {arm} arm of {name} is moving already.", arm=arm, name=self._arms.name)
            self._control.current()
            self._control.check_stiff(arm)

    # -------------------------------------------------------------------------------- moving
    def to_joints(self, arm: str, goal: list[float], speed: float, guard: StopGuard) -> MoveResult:
        """Move an arm to joint values."""
        self._arms.within("speed", speed, 0.001, 1.0)
        with self._exclusive((arm,)):
            session, start = self._control.current(), self._kinematics.present(arm)
            self._claim(arm, [joint_path(start, np.array(goal))])
            duration = self._joint_time(start, goal, speed)
            with self._kinematics.staging[arm]:
                session.lines[arm].ask(Code.STAGE_JOINTS, *to_degrees(goal))
                command = self._start(session, arm, guard, Code.MOVE_JOINTS, duration)
            return self._finish(session, {arm: command}, {arm: guard}, duration, speed)[arm]

    def to_pose(self, arm: str, pose: Pose, linear: bool, speed: float, guard: StopGuard) -> MoveResult:
        """Move the TCP of an arm to a pose in the world, in a line or with all axes together."""
        self._arms.within("speed", speed, 0.001, 1.0)
        with self._exclusive((arm,)):
            session, start = self._control.current(), self._kinematics.present(arm)
            with self._kinematics.staging[arm]:
                joints, target = self._kinematics.solve(session, arm, pose)
                self._claim(arm, self._paths(arm, start, [target.pose] if linear else [], joints))
                if linear:
                    self._send_speed(session, arm, speed)
                    duration = self._line_time(arm, [pose], speed)
                    command = self._start(session, arm, guard, Code.MOVE_LINEAR)
                else:
                    duration = self._joint_time(start, joints, speed)
                    session.lines[arm].ask(Code.STAGE_JOINTS, *to_degrees(joints))
                    command = self._start(session, arm, guard, Code.MOVE_JOINTS, duration)
            return self._finish(session, {arm: command}, {arm: guard}, duration, speed)[arm]

    def along(self, arm: str, waypoints: list[Pose], blend: float, speed: float, guard: StopGuard) -> MoveResult:
        """Move the TCP of an arm in lines through poses in the world."""
        self._arms.within("speed", speed, 0.001, 1.0)
        self._arms.within("blend", blend, 0.0, 0.2)
        if not 1 <= len(waypoints) <= MAX_WAYPOINTS:
            given = len(waypoints)
            raise OutOfRange(
                "{name}: waypoints must be 1 to {most_waypoints} poses, not {given}.",
                name=self._arms.name,
                most_waypoints=MAX_WAYPOINTS,
                given=given,
            )
        with self._exclusive((arm,)):
            session, start = self._control.current(), self._kinematics.present(arm)
            line = session.lines[arm]
            with self._kinematics.staging[arm]:
                line.ask(Code.CLEAR_PATH)
                joints, flanges = [*map(float, start)], []
                for pose in waypoints:
                    joints, target = self._kinematics.solve(session, arm, pose, joints)
                    flanges.append(target.pose)
                    line.ask(Code.APPEND)
                self._claim(arm, self._paths(arm, start, flanges, joints))
                self._send_speed(session, arm, speed)
                line.ask(Code.ZONE, blend * 1e3)
                duration = self._line_time(arm, waypoints, speed)
                command = self._start(session, arm, guard, Code.RUN_PATH)
            return self._finish(session, {arm: command}, {arm: guard}, duration, speed)[arm]

    def synchronously(self, targets: dict[str, Pose | list[Joint]], speed: float) -> dict[str, MoveResult]:
        """Move both arms, coupled in the controller: they start and arrive together, and when one stops, both do."""
        self._arms.within("speed", speed, 0.001, 1.0)
        if set(targets) != set(ARMS):
            given = ", ".join(targets)
            raise OutOfRange(
                "{name}: targets must be both {arms}; received: {given}.",
                name=self._arms.name,
                arms=" and ".join(ARMS),
                given=given,
            )
        guards = {arm: self._control.stops[arm].guard() for arm in ARMS}
        goals = {
            arm: self._arms.joint_values(target, arm) for arm, target in targets.items() if not isinstance(target, Pose)
        }
        with self._exclusive(ARMS), contextlib.ExitStack() as staged:
            session = self._control.current()
            for arm in ARMS:
                staged.enter_context(self._kinematics.staging[arm])
            for arm, target in targets.items():
                if isinstance(target, Pose):
                    goals[arm], _ = self._kinematics.solve(session, arm, target)
            starts = {arm: self._kinematics.present(arm) for arm in ARMS}
            self.clearance.claim_both({arm: joint_path(starts[arm], np.array(goals[arm])) for arm in ARMS})
            duration = max(self._joint_time(starts[arm], goals[arm], speed) for arm in ARMS)
            for arm in ARMS:
                session.lines[arm].ask(Code.STAGE_JOINTS, *to_degrees(goals[arm]))
            meeting = int(time.monotonic()) % 1000
            commands: dict[str, Command] = {}
            try:
                for arm in ARMS:
                    commands[arm] = self._start(session, arm, guards[arm], Code.MOVE_TOGETHER, meeting, duration)
            except DeviceError:
                for arm, command in commands.items():  # this arm waits for the other one, and must not start later
                    session.lines[arm].stop()
                    session.lines[arm].forget(command)
                raise
            return self._finish(session, commands, guards, duration, speed)

    # -------------------------------------------------------------------------------- clearance, speed and time
    @contextlib.contextmanager
    def _exclusive(self, arms: tuple[str, ...]) -> Iterator[None]:
        with contextlib.ExitStack() as held:
            for arm in arms:
                held.enter_context(exclusive_motion(self._locks[arm], f"The {arm} arm of {self._arms.name}"))
                held.callback(self.clearance.free, arm)
            self._control.current()
            for arm in arms:
                self._control.check_stiff(arm)
            yield

    def _paths(self, arm: str, start: Array, flanges: list[Pose], goal: list[float]) -> list[Array]:
        """Return joint paths for motions to flange poses (robot's frame): in lines, or with all axes together."""
        paths, at = [joint_path(start, np.array(goal))], start
        for flange in flanges:
            path = nominal.straight(arm, at, flange.matrix())
            if path is None:
                raise Refused(
                    "The path of the {arm} arm of {name} cannot be checked: nominal kinematics have no "
                    "solution along the line. Use a joint move, or a pose in between.",
                    arm=arm,
                    name=self._arms.name,
                )
            paths.append(path)
            at = path[-1]
        return paths

    def _claim(self, arm: str, paths: list[Array]) -> None:
        """Reserve paths. Raise Refused if they lead too close to the other arm."""
        self.clearance.claim(arm, np.vstack(paths), self._kinematics.present(other_arm(arm)))

    def _send_speed(self, session: ControlSession, arm: str, speed: float) -> None:
        turning = math.degrees(speed * self._arms.settings.max_joint_speed)
        session.lines[arm].ask(Code.SPEED, speed * self._arms.settings.max_tcp_speed * 1e3, max(turning, 0.1))

    def _joint_time(self, start: Array, goal: list[float], speed: float) -> float:
        longest = float(np.abs(np.array(goal) - start).max())
        duration = longest / (speed * self._arms.settings.max_joint_speed) + RAMP_TIME
        if duration > MAX_DURATION:
            raise OutOfRange(
                "{robot}: at speed {speed:g} the move would take {duration:.0f} s. At most {longest:.0f} s is allowed.",
                robot=self._arms.name,
                speed=speed,
                duration=duration,
                longest=MAX_DURATION,
            )
        return duration

    def _line_time(self, arm: str, poses: list[Pose], speed: float) -> float:
        at = self._arms.tcp(self._observer.sample(), arm)
        duration, settings = RAMP_TIME, self._arms.settings
        for pose in poses:
            distance = at.position.distance_to(pose.position) / (speed * settings.max_tcp_speed)
            duration += max(distance, at.orientation.angle_to(pose.orientation) / (speed * settings.max_joint_speed))
            at = pose
        return duration

    # -------------------------------------------------------------------------------- from start to end of a motion
    def _start(self, session: ControlSession, arm: str, guard: StopGuard, code: Code, *values: float) -> Command:
        command = session.lines[arm].start(code, *values, stopped=guard.stopped)
        if command is None:
            raise Cancelled(
                "The move of the {arm} arm of {name} was stopped before it started.", arm=arm, name=self._arms.name
            )
        return command

    def _finish(
        self,
        session: ControlSession,
        commands: dict[str, Command],
        guards: dict[str, StopGuard],
        duration: float,
        speed: float,
    ) -> dict[str, MoveResult]:
        """Wait for the end of motions and return their results. An error of one stops all of them."""
        started, end = time.monotonic(), MoveEnd.DONE
        try:
            self._wait_done(session, commands, guards, DURATION_FACTOR * duration + DURATION_MARGIN)
        except DeviceError as error:
            cause = self._cause(session, guards, error)
            end = MoveEnd.SAFETY if isinstance(cause, SafetyStop) else MoveEnd.STOPPED
            with contextlib.suppress(DeviceError):
                self._record(commands, speed, started, end)
            raise cause from (None if cause is error else error)
        finally:
            for arm, command in commands.items():
                session.lines[arm].forget(command)
        return self._record(commands, speed, started, end)

    def _wait_done(
        self, session: ControlSession, commands: dict[str, Command], guards: dict[str, StopGuard], budget: float
    ) -> None:
        left, stop_sent, last = dict(commands), 0.0, time.monotonic()
        while left:
            for arm, command in list(left.items()):
                line = session.lines[arm]
                answer = line.poll(command, 0.02)
                if answer is not None and answer.status != Status.ACCEPTED:
                    line.checked(answer, command)
                    del left[arm]
            now = time.monotonic()
            stopped = [arm for arm in left if guards[arm].stopped()]
            if stopped and now - stop_sent > STOP_REPEAT_INTERVAL:
                stop_sent = now
                for arm in stopped:
                    session.lines[arm].stop()
            panel = self._observer.known_panel
            budget -= (now - last) * max(panel.speed_ratio if panel is not None else 1.0, MIN_SPEED_OVERRIDE)
            last = now
            if budget < 0.0:
                raise DeviceTimeout(
                    "A move of {name} did not end within the computed time. It was stopped.", name=self._arms.name
                )

    def _cause(self, session: ControlSession, guards: dict[str, StopGuard], error: DeviceError) -> DeviceError:
        """Stop the arms that still move, and return the error that describes the cause."""
        stopped = [self._control.stopped_at[arm] for arm, guard in guards.items() if guard.stopped()]
        for arm in guards:
            if session.ended is None:
                session.lines[arm].stop()
        lost = isinstance(session.ended, ConnectionLost) and min(stopped, default=0.0) > session.ended_at
        if stopped and not lost and not isinstance(session.ended, SafetyStop):
            return Cancelled("The move of {name} was stopped.", name=self._arms.name)
        if isinstance(error, CommandRefused):
            if error.status is Status.WATCHDOG:
                return WatchdogTripped(error.message, error.detail)
            if error.status is Status.STOPPED:
                return Cancelled(error.message, error.detail)
            return error
        return self._control.explained(error)

    def _record(
        self, commands: dict[str, Command], speed: float, started: float, end: MoveEnd
    ) -> dict[str, MoveResult]:
        ended = time.monotonic()
        sample = self._observer.fresh().value
        results = {arm: MoveResult(self._arms.tcp(sample, arm), speed, ended - started, end) for arm in commands}
        self.last |= results
        return results

    # -------------------------------------------------------------------------------- stopping
    def stop(self, arms: tuple[str, ...]) -> None:
        """Stop arms and wait for standstill. Raise NotInControl while a foreign program moves them, DeviceTimeout."""
        self._control.request_stop(arms)
        session = self._control.session
        if session is None or session.ended is not None:
            self._check_no_foreign_motion()
            self._await_rest(arms)
            return
        if not all(_stop_all([session.lines[arm] for arm in arms])) and session.ended is None:
            self._control.stop_rapid()
        if not once_within(lambda: session.ended is not None or not self.in_progress(arms), STANDSTILL_TIMEOUT, 0.005):
            raise self._no_rest()
        if session.ended is not None:
            self._await_rest(arms)

    def _no_rest(self) -> DeviceTimeout:
        return DeviceTimeout(
            "{robot} did not come to a standstill within {limit:g} s of a stop. Press the emergency stop.",
            robot=self._arms.name,
            limit=STANDSTILL_TIMEOUT,
        )

    def _await_rest(self, arms: tuple[str, ...]) -> None:
        """Wait until the arms that we controlled are at standstill. Without observation the watchdog stops them."""
        newest, panel = self._observer.newest(), self._observer.known_panel
        if newest is None or panel is None or not panel.ours or not self._observer.observing.online:
            return
        until = time.monotonic() + STANDSTILL_TIMEOUT
        with contextlib.suppress(ConnectionLost, NotConnected):
            self._observer.fresh()
            while max(self._observer.fresh().value.speeds[arm] for arm in arms) > STANDSTILL_SPEED:
                if time.monotonic() > until:
                    raise self._no_rest()

    def _check_no_foreign_motion(self) -> None:
        newest, panel = self._observer.newest(), self._observer.known_panel
        if newest is not None and panel is not None and newest.moving and newest.running and not panel.ours:
            raise NotInControl(
                "{robot} is being moved by {programs}. Stop it there.",
                self._observer.rws.address,
                robot=self._arms.name,
                programs=panel.program_names,
            )


def _stop_all(lines: list[ArmLine]) -> list[bool]:
    """Stop arms concurrently. Return whether each is at standstill."""
    if len(lines) == 1:
        return [lines[0].stop()]
    stopped = [False] * len(lines)

    def stop(place: int) -> None:
        stopped[place] = lines[place].stop()

    threads = [threading.Thread(target=stop, args=(place,), daemon=True) for place in range(len(lines))]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    return stopped
