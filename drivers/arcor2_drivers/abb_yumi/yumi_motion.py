"""YumiMotion: moving the arms of a YuMi, one or both in step, and stopping them."""

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
)

from . import nominal
from .arm_line import ArmLine, Command, Unwilling
from .clearance import joint_path, other_arm
from .frames import to_degrees
from .motion_lines import MOST_WAYPOINTS, Code, Status
from .nominal import Array
from .observer import AT_REST, world
from .session import ControlSession, stop_rapid
from .settings import ARMS, YumiSettings
from .yumi_kinematics import YumiKinematics

RAMP: Final = 0.2
"""Seconds that speeding up and braking add to a motion."""
SLACK: Final = 1.5
GRACE: Final = 3.0
"""A move may take `SLACK` times what it should, and as many seconds more."""
SLOWEST: Final = 0.05
"""Time runs slower for a move while the speed override is down, but not slower than this."""
REST_WITHIN: Final = 2.0
"""Seconds after which an arm that was told to stop must stand; from full speed it takes 0.2."""
STOP_AGAIN: Final = 0.15
"""Seconds after which a motion that has not heard of its stop is told again: the two sockets have no common order."""
LONGEST: Final = 600.0
"""Seconds a joint motion may be made to last."""


class YumiMotion(YumiKinematics):
    """A YuMi whose arms move."""

    _ABSTRACT = True

    def __init__(self, obj_id: str, name: str, pose: Pose, settings: YumiSettings) -> None:
        super().__init__(obj_id, name, pose, settings)
        self._arm_moves = {arm: threading.Lock() for arm in ARMS}
        self.last_moves: dict[str, MoveResult] = {}

    @property
    def move_in_progress(self) -> bool:
        """Tell whether a motion of any arm that we commanded is under way."""
        return any(lock.locked() for lock in self._arm_moves.values())

    def check_if_ready_to_move(self, arm_id: str | None = None) -> None:
        """Raise what keeps an arm, or any when none is named, from moving now; return when nothing does."""
        for arm in self._arms(arm_id):
            if self._arm_moves[arm].locked():
                raise self._busy(arm)
            self._controlled()
            self._stiff(arm)

    def _busy(self, arm: str) -> Refused:
        return Refused(f"the {arm} arm of {self.name} is moving already")

    # -------------------------------------------------------------------------------- moving
    def move_to_pose(
        self,
        end_effector_id: str,
        target_pose: Pose,
        speed: float,
        safe: bool = True,
        linear: bool = True,
        arm_id: str | None = None,
    ) -> None:
        """Move an arm's TCP to a pose in the world, in a line or with all axes together.

        The path keeps clear of the other arm, whatever `safe` says; other collisions are the hub's to check.
        Raises KinematicsException, OutOfRange, Refused, NotInControl, SafetyStop, Cancelled, DeviceTimeout.
        """
        self._check_end_effector(end_effector_id)
        arm = self._arm(arm_id)
        self._move_pose(arm, target_pose, linear, speed, self._stops[arm])

    def move_to_joints(
        self, target_joints: list[Joint], speed: float, safe: bool = True, arm_id: str | None = None
    ) -> None:
        """Move an arm to joint values, all axes arriving together; it keeps clear of the other arm."""
        arm = self._arm(arm_id)
        self._move_joints(arm, self._checked_joints(target_joints, arm), speed, self._stops[arm])

    def _move_joints(self, arm: str, goal: list[float], speed: float, stops: int) -> MoveResult:
        self._within("speed", speed, 0.001, 1.0)
        with self._moving((arm,)):
            session = self._controlled()
            start = self._present(arm)
            self._clearance.claim(arm, joint_path(start, np.array(goal)), self._present(other_arm(arm)))
            duration = self._joint_time(start, goal, speed)
            with self._staging[arm]:
                session.lines[arm].ask(Code.STAGE_JOINTS, *to_degrees(goal))
                begun = self._begin(session, arm, Code.MOVE_JOINTS, duration, stops=stops)
            return self._finish(session, {arm: begun}, {arm: stops}, duration, speed)[arm]

    def _move_pose(self, arm: str, pose: Pose, linear: bool, speed: float, stops: int) -> MoveResult:
        self._within("speed", speed, 0.001, 1.0)
        with self._moving((arm,)):
            session = self._controlled()
            start = self._present(arm)
            with self._staging[arm]:
                joints, target = self._solve(session, arm, pose, None)
                self._claim(arm, start, [target.pose] if linear else [], joints)
                if linear:
                    self._tell_speed(session, arm, speed)
                    duration = self._line_time(arm, [pose], speed)
                    begun = self._begin(session, arm, Code.MOVE_LINEAR, stops=stops)
                else:
                    duration = self._joint_time(start, joints, speed)
                    session.lines[arm].ask(Code.STAGE_JOINTS, *to_degrees(joints))
                    begun = self._begin(session, arm, Code.MOVE_JOINTS, duration, stops=stops)
            return self._finish(session, {arm: begun}, {arm: stops}, duration, speed)[arm]

    def move_path(
        self,
        waypoints: list[Pose],
        blend: float = 0.0,
        linear: bool = True,
        speed: float = 0.25,
        arm_id: str | None = None,
    ) -> MoveResult:
        """Move an arm's TCP in lines through poses in the world; `blend` is the radius at corners, m, up to 0.2."""
        arm = self._arm(arm_id)
        stops = self._stops[arm]
        self._within("speed", speed, 0.001, 1.0)
        self._within("blend", blend, 0.0, 0.2)
        if not linear:
            raise Refused(f"{self.name} runs paths in lines only")
        if not 1 <= len(waypoints) <= MOST_WAYPOINTS:
            raise OutOfRange(f"{self.name}: waypoints must be 1 to {MOST_WAYPOINTS} poses, not {len(waypoints)}")
        with self._moving((arm,)):
            session = self._controlled()
            line, start = session.lines[arm], self._present(arm)
            with self._staging[arm]:
                line.ask(Code.CLEAR_PATH)
                seed: list[float] = [*map(float, start)]
                flanges = []
                for pose in waypoints:
                    seed, target = self._solve(session, arm, pose, seed)
                    flanges.append(target.pose)
                    line.ask(Code.APPEND)
                self._claim(arm, start, flanges, seed)
                self._tell_speed(session, arm, speed)
                line.ask(Code.ZONE, blend * 1e3)
                duration = self._line_time(arm, waypoints, speed)
                begun = self._begin(session, arm, Code.RUN_PATH, stops=stops)
            return self._finish(session, {arm: begun}, {arm: stops}, duration, speed)[arm]

    def move_synchronously(self, targets: dict[str, Pose | list[Joint]], speed: float = 0.25) -> dict[str, MoveResult]:
        """Move both arms so that they start and arrive together; keys are arm ids, poses are in the world.

        The arms go with all axes together and are coupled in the controller: when one stops, both do.
        """
        self._within("speed", speed, 0.001, 1.0)
        if set(targets) != set(ARMS):
            raise OutOfRange(f"{self.name}: targets must name both {' and '.join(ARMS)}; given: {', '.join(targets)}")
        stops = dict(self._stops)
        checked = {
            arm: None if isinstance(target, Pose) else self._checked_joints(target, arm)
            for arm, target in targets.items()
        }
        with self._moving(ARMS), contextlib.ExitStack() as staged:
            session = self._controlled()
            for arm in ARMS:
                staged.enter_context(self._staging[arm])
            goals = {}
            for arm, target in targets.items():
                goal = checked[arm]
                goals[arm] = self._solve(session, arm, target, None)[0] if isinstance(target, Pose) else goal or []
            starts = {arm: self._present(arm) for arm in ARMS}
            self._clearance.claim_both({arm: joint_path(starts[arm], np.array(goals[arm])) for arm in ARMS})
            duration = max(self._joint_time(starts[arm], goals[arm], speed) for arm in ARMS)
            for arm in ARMS:
                session.lines[arm].ask(Code.STAGE_JOINTS, *to_degrees(goals[arm]))
            meeting = int(time.monotonic()) % 1000
            begun: dict[str, Command] = {}
            try:
                for arm in ARMS:
                    begun[arm] = self._begin(session, arm, Code.MOVE_TOGETHER, meeting, duration, stops=stops[arm])
            except DeviceError:
                for arm, command in begun.items():  # it waits for its partner, and must not begin later
                    session.lines[arm].stop()
                    session.lines[arm].forget(command)
                raise
            return self._finish(session, begun, stops, duration, speed)

    # -------------------------------------------------------------------------------- how a motion goes
    @contextlib.contextmanager
    def _moving(self, arms: tuple[str, ...]) -> Iterator[None]:
        with contextlib.ExitStack() as held:
            for arm in arms:
                if not self._arm_moves[arm].acquire(blocking=False):
                    raise self._busy(arm)
                held.callback(self._arm_moves[arm].release)
                held.callback(self._clearance.free, arm)
            self._controlled()
            for arm in arms:
                self._stiff(arm)
            yield

    def _claim(self, arm: str, start: Array, flanges: list[Pose], goal: list[float]) -> None:
        """Have the way judged: of the lines through flange poses (robot's frame), and of the axes going evenly."""
        parts, at = [joint_path(start, np.array(goal))], start
        for flange in flanges:
            part = nominal.straight(arm, at, flange.matrix())
            if part is None:
                raise Refused(
                    f"the way of the {arm} arm of {self.name} cannot be judged: nominal kinematics lose the line",
                    "move with all axes together, or by way of another pose",
                )
            parts.append(part)
            at = part[-1]
        self._clearance.claim(arm, np.vstack(parts), self._present(other_arm(arm)))

    def _tell_speed(self, session: ControlSession, arm: str, speed: float) -> None:
        turning = math.degrees(speed * self._yumi.max_joint_speed)
        session.lines[arm].ask(Code.SPEED, speed * self._yumi.max_tcp_speed * 1e3, max(turning, 0.1))

    def _joint_time(self, start: Array, goal: list[float], speed: float) -> float:
        longest = float(np.abs(np.array(goal) - start).max())
        duration = longest / (speed * self._yumi.max_joint_speed) + RAMP
        if duration > LONGEST:
            raise OutOfRange(
                f"{self.name}: at speed {speed:g} the move would take {duration:.0f} s, {LONGEST:.0f} s are allowed"
            )
        return duration

    def _line_time(self, arm: str, poses: list[Pose], speed: float) -> float:
        at = world(self._pose, self._observer.sample().targets[arm], self._tools[arm])
        duration = RAMP
        for pose in poses:
            distance = at.position.distance_to(pose.position) / (speed * self._yumi.max_tcp_speed)
            duration += max(distance, at.orientation.angle_to(pose.orientation) / (speed * self._yumi.max_joint_speed))
            at = pose
        return duration

    def _begin(self, session: ControlSession, arm: str, code: Code, *values: float, stops: int) -> Command:
        command = session.lines[arm].begin(code, *values, valid=lambda: self._stops[arm] == stops)
        if command is None:
            raise Cancelled(f"the move of the {arm} arm of {self.name} was stopped before it began")
        return command

    def _finish(
        self, session: ControlSession, begun: dict[str, Command], stops: dict[str, int], duration: float, speed: float
    ) -> dict[str, MoveResult]:
        """Wait for the end of motions; give what was done. Whatever goes wrong with one stops all of them."""
        began, end = time.monotonic(), MoveEnd.DONE
        try:
            self._wait_done(session, begun, stops, SLACK * duration + GRACE)
        except DeviceError as error:
            told = self._judged_end(session, begun, stops, error)
            end = MoveEnd.SAFETY if isinstance(told, SafetyStop) else MoveEnd.STOPPED
            with contextlib.suppress(DeviceError):
                self._note(begun, speed, began, end)
            raise told from (None if told is error else error)
        finally:
            for arm, command in begun.items():
                session.lines[arm].forget(command)
        return self._note(begun, speed, began, end)

    def _wait_done(
        self, session: ControlSession, begun: dict[str, Command], stops: dict[str, int], budget: float
    ) -> None:
        left, told, last = dict(begun), 0.0, time.monotonic()
        while left:
            for arm, command in list(left.items()):
                line = session.lines[arm]
                found = line.poll(command, 0.02)
                if found is not None and found.status != Status.ACCEPTED:
                    line.judged(found, command)
                    del left[arm]
            now = time.monotonic()
            stopped = [arm for arm in left if self._stops[arm] != stops[arm]]
            if stopped and now - told > STOP_AGAIN:
                told = now
                for arm in stopped:
                    session.lines[arm].stop()
            override = self._observer.known_panel
            ratio = override.speed_ratio if override is not None else 1.0
            budget -= (now - last) * max(ratio, SLOWEST)
            last = now
            if budget < 0.0:
                raise DeviceTimeout(f"a move of {self.name} did not end in the time computed for it; it was stopped")

    def _judged_end(
        self, session: ControlSession, begun: dict[str, Command], stops: dict[str, int], error: DeviceError
    ) -> DeviceError:
        """Stop what still moves, and give the error that says what happened."""
        stopped = [self._stopped_at[arm] for arm in begun if self._stops[arm] != stops[arm]]
        for arm in begun:
            if session.ended is None:
                session.lines[arm].stop()
        lost = isinstance(session.ended, ConnectionLost) and min(stopped, default=0.0) > session.ended_at
        if stopped and not lost and not isinstance(session.ended, SafetyStop):
            return Cancelled(f"the move of {self.name} was stopped")
        if isinstance(error, Unwilling):
            if error.status is Status.WATCHDOG:
                return ConnectionLost(str(error), error.detail)
            if error.status is Status.STOPPED:
                return Cancelled(str(error), error.detail)
            return error
        return self._explained(error)

    def _note(self, begun: dict[str, Command], speed: float, began: float, end: MoveEnd) -> dict[str, MoveResult]:
        ended = time.monotonic()
        sample = self._observer.sample_after(ended)
        results = {
            arm: MoveResult(world(self._pose, sample.targets[arm], self._tools[arm]), speed, ended - began, end)
            for arm in begun
        }
        self.last_moves |= results
        return results

    # -------------------------------------------------------------------------------- stopping
    def stop(self, arm_id: str | None = None) -> None:
        """Stop an arm, or both, and return when it stands; called past everything else. It is no safety function.

        An arm that moves together with the other stops it too. Raises NotInControl when a program that is not ours
        moves the robot, DeviceTimeout when an arm does not come to rest.
        """
        arms = self._arms(arm_id)
        self._count_stop(arms)
        session = self._session
        if session is None or session.ended is not None:
            self._refuse_foreign()
            self._await_rest(arms)
            return
        lines = [session.lines[arm] for arm in arms]
        if not all(_all_at_once(lines)) and session.ended is None:
            self._stop_by_rws(session)
        until = time.monotonic() + REST_WITHIN
        while session.ended is None and any(self._arm_moves[arm].locked() for arm in arms):
            if time.monotonic() > until:
                raise DeviceTimeout(f"{self.name} did not come to rest within {REST_WITHIN:g} s of a stop")
            time.sleep(0.005)
        if session.ended is not None:
            self._await_rest(arms)

    def _await_rest(self, arms: tuple[str, ...]) -> None:
        """Wait until arms that were ours are seen to stand; what cannot be observed is left to the watchdog."""
        newest, panel = self._observer.newest(), self._observer.known_panel
        if newest is None or panel is None or not panel.ours or not self._observer.observing.online:
            return
        until = time.monotonic() + REST_WITHIN
        with contextlib.suppress(ConnectionLost, NotConnected):
            self._observer.sample_after(time.monotonic())
            while max(self._observer.sample_after(time.monotonic()).speeds[arm] for arm in arms) > AT_REST:
                if time.monotonic() > until:
                    raise DeviceTimeout(f"{self.name} did not come to rest within {REST_WITHIN:g} s of a stop")

    def _refuse_foreign(self) -> None:
        newest, panel = self._observer.newest(), self._observer.known_panel
        if newest is not None and panel is not None and newest.moving and newest.running and not panel.ours:
            raise NotInControl(f"{self._programs(panel)} moves {self.name}, not we", self._observer.rws.address)

    def _stop_by_rws(self, session: ControlSession) -> None:
        """The second way to stop: RAPID itself, which costs control."""
        try:
            stop_rapid(self._commanding())
        finally:
            session.end(NotInControl(f"{self.name} was stopped by stopping RAPID"), wait=False)
            self._mastership_back()


def _all_at_once(lines: list[ArmLine]) -> list[bool]:
    """Stop several arms without one waiting for the other; tell of each whether it stands."""
    if len(lines) == 1:
        return [lines[0].stop()]
    stood = [False] * len(lines)

    def stop(place: int) -> None:
        stood[place] = lines[place].stop()

    threads = [threading.Thread(target=stop, args=(place,), daemon=True) for place in range(len(lines))]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    return stood
