"""Motion: one point-to-point motion at a time, checked for arrival by observation. At most one motion is queued."""

import contextlib
import math
import threading
import time
from collections.abc import Callable, Iterator
from typing import Final

from arcor2_hw.data.geometry import Pose
from arcor2_hw.exceptions import ConnectionLost, DeviceError, DeviceFault, DeviceTimeout, NotInControl, Refused
from arcor2_hw.objects import Robot
from arcor2_hw.objects.arm import StopGuard, exclusive_motion, named_joints
from arcor2_hw.objects.safe_moves import SafeMoves
from arcor2_hw.objects.settings import within
from arcor2_hw.objects.single_arm import MotionLog, move_around_obstacles, on_free_line

from . import alarms, kinematics
from .control import Control
from .frames import Command
from .kinematics import JOINTS, Joints, Tool, Unreachable
from .observer import Observer, Sample
from .settings import DobotMagicianSettings

JUMP, JOINT_TO_POSE, LINE_TO_POSE, JOINT_TO_ANGLES = 0, 1, 2, 4
"""Modes of a point-to-point motion (id 84)."""
POSITION_REACHED: Final = 0.001
ANGLE_REACHED: Final = math.radians(0.5)
"""Tolerances within which a target is reached, m and rad."""
SHORT_OF_TARGET: Final = 0.5
"""Time at standstill short of the target, its command done, after which a move has failed, s."""
SLOWEST: Final = 0.01
"""Lowest speed, as a fraction of the maximum."""


class Motion:
    """Moves the arm. Poses are in the world; speeds are fractions of the maxima."""

    def __init__(
        self,
        robot: Robot,
        observer: Observer,
        control: Control,
        settings: DobotMagicianSettings,
        motion_lock: threading.Lock,
    ) -> None:
        self._robot, self._observer, self._control, self._settings = robot, observer, control, settings
        self._lock = motion_lock
        self._who = observer.who
        self.safe = SafeMoves(robot)
        self.log = MotionLog(self._tcp)

    # -------------------------------------------------------------------------------- kinematics
    def world(self, tool: Tool) -> Pose:
        """Return the tool in the world."""
        return self._robot.pose * tool.pose

    def forward(self, q: Joints) -> Pose:
        """Return the tool in the world for joint values."""
        return self.world(kinematics.forward(q, self._settings.tool_x, self._settings.tool_z))

    def solve(self, pose: Pose) -> tuple[Tool, Joints]:
        """Return tool and joint values for a pose. Raise KinematicsException."""
        try:
            tool = kinematics.tool_of(self._robot.pose.inverted() * pose)
            q = kinematics.inverse(tool, self._settings.tool_x, self._settings.tool_z)
        except (Unreachable, ValueError) as e:
            where = ", ".join(f"{value:.3f}" for value in pose.position)
            raise Robot.KinematicsException(
                "{robot} cannot reach the pose: {reason}", f"in the world: {where}", robot=self._robot.name, reason=e
            ) from None
        return tool._replace(r=q[0] + q[3]), q

    # -------------------------------------------------------------------------------- moving
    def check_ready(self) -> None:
        """Raise what prevents the arm from moving."""
        if self._lock.locked():
            raise Refused("{name} is moving already. Wait until the motion ends, or stop it.", name=self._robot.name)
        self._control.require()
        if faults := self.obstacles(self._observer.sample()):
            raise Refused("{device} cannot move: {faults}", device=self._who, faults=", ".join(faults))

    @staticmethod
    def obstacles(sample: Sample) -> list[str]:
        """Return the alarms that prevent the arm from moving."""
        active = sorted(sample.alarms - {alarms.RESET})
        return [f"alarm {alarms.title(code)}: {alarms.describe(code)[0]}" for code in active]

    @contextlib.contextmanager
    def _exclusive(self) -> Iterator[None]:
        self.check_ready()
        with exclusive_motion(self._lock, self._robot.name):
            yield

    def to_pose(self, pose: Pose, mode: int, speed: float, guard: StopGuard) -> None:
        """Move the tool to a pose."""
        self._check_speed(speed)
        tool, q = self.solve(pose)
        with self._exclusive():
            self._to_tool(tool, q, mode, speed, guard)

    def to_joints(self, q: Joints, speed: float, guard: StopGuard) -> None:
        """Move to joint values; all joints arrive together."""
        self._check_speed(speed)
        with self._exclusive():
            self._to_angles(q, speed, guard)

    def line_safely(self, pose: Pose, speed: float, guard: StopGuard) -> None:
        """Move in a line. Raise PathBlocked if it collides."""
        self._check_speed(speed)
        tool, q = self.solve(pose)
        with self._exclusive(), on_free_line(self._robot, self.safe, pose):
            self._to_tool(tool, q, LINE_TO_POSE, speed, guard)

    def go_around(self, q: Joints, speed: float, guard: StopGuard) -> None:
        """Move to joint values around obstacles, stopping at each waypoint: the path is straight in joint space."""
        self._check_speed(speed)
        with self._exclusive():
            move_around_obstacles(
                self._robot,
                self.safe,
                named_joints(JOINTS, q),
                speed,
                guard,
                lambda waypoint: self._to_angles(kinematics.values(self._robot.name, waypoint), speed, guard),
            )

    def home(self, guard: StopGuard) -> None:
        """Home the arm."""
        with self._exclusive():
            self._run("homing", 1.0, self._settings.home_timeout, lambda _: True, guard, Command.HOME, "I", 0)

    def _check_speed(self, speed: float) -> None:
        within(f"{self._who}: speed", speed, SLOWEST, 1.0)

    def _to_tool(self, tool: Tool, q: Joints, mode: int, speed: float, guard: StopGuard) -> None:
        start = self._observer.sample()
        budget = max(self._joint_time(start.q, q, speed), self._line_time(start.tool, tool, speed))
        if mode == JUMP:
            budget += 2.0 * self._line_time(tool, tool._replace(z=tool.z + 0.5), speed)

        def reached(sample: Sample) -> bool:
            distance = math.dist(sample.tool[:3], tool[:3])
            return distance < POSITION_REACHED and abs(sample.tool.r - tool.r) < ANGLE_REACHED

        what = "a linear move" if mode == LINE_TO_POSE else "a move"
        numbers = (*(value * 1000.0 for value in tool[:3]), math.degrees(tool.r))
        self._run(what, speed, budget, reached, guard, Command.PTP, "B4f", mode, *numbers)

    def _to_angles(self, q: Joints, speed: float, guard: StopGuard) -> None:
        budget = self._joint_time(self._observer.sample().q, q, speed)

        def reached(sample: Sample) -> bool:
            return max(abs(a - b) for a, b in zip(sample.q, q, strict=True)) < ANGLE_REACHED

        angles = map(math.degrees, q)
        self._run("a joint move", speed, budget, reached, guard, Command.PTP, "B4f", JOINT_TO_ANGLES, *angles)

    def _joint_time(self, start: Joints, end: Joints, speed: float) -> float:
        angle = max(abs(a - b) for a, b in zip(start, end, strict=True))
        return _time(angle, self._settings.max_joint_speed * speed, self._settings.joint_acceleration * speed)

    def _line_time(self, start: Tool, end: Tool, speed: float) -> float:
        distance = math.dist(start[:3], end[:3])
        return _time(distance, self._settings.max_tcp_speed * speed, self._settings.tcp_acceleration * speed)

    # -------------------------------------------------------------------------------- from start to end of a motion
    def _run(
        self,
        operation: str,
        speed: float,
        budget: float,
        reached: Callable[[Sample], bool],
        guard: StopGuard,
        command: Command,
        layout: str,
        *values: float,
    ) -> None:
        """Put a motion into the empty queue, start it, and wait until it is observed to have ended."""
        started, operation = time.monotonic(), f"{operation} of {self._who}"
        with self._control.commands:
            guard.check(operation)
            self._control.require()
            self._observer.set(Command.PTP_COMMON, "2f", speed * 100.0, speed * 100.0)
            index = self._observer.queue(command, layout, *values)
            self._observer.set(Command.QUEUE_START)
        with self.log.recorded(speed, self._await_standstill):
            self._wait_done(operation, index, started + budget, reached, guard)

    def _await_standstill(self) -> None:
        with contextlib.suppress(DeviceError):  # the caller of `stop` receives it
            self._control.wait_rest()

    def _wait_done(
        self, operation: str, index: int, deadline: float, reached: Callable[[Sample], bool], guard: StopGuard
    ) -> None:
        def done(sample: Sample) -> bool:
            if faults := self.obstacles(sample):
                self._control.send_stop()
                code = min(sample.alarms - {alarms.RESET})
                raise DeviceFault("{what} failed: {fault}", "", alarms.title(code), what=operation, fault=faults[0])
            if sample.index >= index and sample.unchanged > SHORT_OF_TARGET and not reached(sample):
                raise DeviceFault("{what} ended before its target.", what=operation)
            return sample.index >= index and reached(sample)

        def go_on() -> None:
            guard.check(operation)
            if not self._control.ours:
                self._observer.observing.check()
                raise NotInControl("{what}: control was lost. The arm completes the motion.", what=operation)

        try:
            self._observer.wait(done, max(deadline - time.monotonic(), 0.0), operation, go_on)
        except ConnectionLost as e:
            raise ConnectionLost("{reason} The arm completes {what}.", e.detail, reason=e, what=operation) from None
        except DeviceTimeout as e:
            self._control.send_stop()
            raise DeviceTimeout("{what} did not end within the computed time. It was stopped.", what=operation) from e

    def _tcp(self) -> Pose:
        newest = self._observer.newest()
        return self.world(newest.tool) if newest is not None else self._robot.pose


def _time(distance: float, speed: float, acceleration: float) -> float:
    """Return the time limit of a motion, s: 1.5 times the computed time plus 2 s."""
    return 1.5 * (distance / speed + speed / acceleration) + 2.0
