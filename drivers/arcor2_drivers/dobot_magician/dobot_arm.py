"""DobotArm: taking control of a Dobot Magician, moving it, stopping it. Never is more than one motion queued."""

import contextlib
import logging
import math
import threading
import time
from collections.abc import Callable, Iterator
from typing import ClassVar, Final

from arcor2_hw.data.device import LossReaction
from arcor2_hw.data.geometry import Pose
from arcor2_hw.data.robot import Joint, MoveEnd, MoveResult
from arcor2_hw.exceptions import (
    Cancelled,
    ConnectionLost,
    DeviceError,
    DeviceFault,
    DeviceTimeout,
    NotInControl,
    OutOfRange,
    Refused,
)

from . import alarms
from .dobot_observed import DobotObserved
from .frames import Command
from .kinematics import JOINTS, Joints, Tool
from .observer import STANDING, Sample
from .settings import DobotMagicianSettings, within

JUMP, JOINT_TO_POSE, LINE_TO_POSE, JOINT_TO_ANGLES = 0, 1, 2, 4
"""Modes of a point-to-point motion (id 84)."""
POSITION_REACHED: Final = 0.001
ANGLE_REACHED: Final = math.radians(0.5)
SHORT_OF_TARGET: Final = 0.5
"""Seconds an arm may stand, its command done, short of the target before the move counts as failed."""
REST_WITHIN: Final = 2.0
SLOWEST: Final = 0.01
WAKE: Final = 0.05

log = logging.getLogger(__name__)


class DobotArm(DobotObserved):
    """A Dobot Magician under control."""

    _ABSTRACT = True
    # It has no watchdog: a motion that was begun is done. There is never a second one behind it.
    loss_reaction: ClassVar[LossReaction] = LossReaction.continues()

    def __init__(self, obj_id: str, name: str, pose: Pose, settings: DobotMagicianSettings) -> None:
        super().__init__(obj_id, name, pose, settings)
        self._stops = 0
        self._orders = threading.Lock()
        self._belt_runs = False
        self._left_running = False
        self.last_move: MoveResult | None = None

    # -------------------------------------------------------------------------------- control
    def take_control(self) -> None:
        """Take control of an arm that stands: empty its queue, tell it tool and speeds. Harmless when it is ours.

        Nothing that runs is touched: while the arm moves, for whoever it is, control is refused. What waits in a queue
        that stands still would run at our first start, so it is dropped.
        Raises NotInControl, NotConnected, ConnectionLost, DeviceTimeout, Refused when a value is not taken.
        """
        if self._in_control:
            return
        sample, until = self._observer.after(time.monotonic()), time.monotonic() + 2.0 * STANDING
        while sample.moving:  # one that has just come to rest counts as moving for a moment
            if time.monotonic() > until:
                raise NotInControl(
                    f"{self._who} moves, and not for us: somebody else has control; it is refused until it stands"
                )
            sample = self._observer.after(sample.monotonic)
        has = self._dobot
        joint, ramp = math.degrees(has.max_joint_speed), math.degrees(has.joint_acceleration)
        tcp, tcp_ramp = has.max_tcp_speed * 1000.0, has.tcp_acceleration * 1000.0
        with self._orders:
            self._empty_queue()
            self._tell(Command.END_EFFECTOR, "3f", has.tool_x * 1000.0, 0.0, has.tool_z * 1000.0)
            self._tell(Command.PTP_JOINT, "8f", *[joint] * 4, *[ramp] * 4)
            self._tell(Command.PTP_COORDINATE, "4f", tcp, joint, tcp_ramp, ramp)
            self._tell(Command.PTP_JUMP, "2f", has.jump_height * 1000.0, has.jump_limit * 1000.0)
            self._in_control = True
            self._left_running = False
            self._observer.check()
        self._observer.observing.settled()

    def release_control(self) -> None:
        """Stop what we move and give control back; harmless when it is not ours."""
        if self._in_control:
            if self.move_in_progress or self._belt_runs:
                self.stop()
            self._drop_control()

    def control_owner(self) -> str | None:
        """Tell who has control: "us", "somebody else" when it moves without us, or nobody."""
        if self._in_control:
            return "us"
        newest = self._observer.newest()
        return "somebody else" if newest is not None and self._observer.observing.online and newest.moving else None

    def _drop_control(self) -> None:
        if self._in_control and (self.move_in_progress or self._belt_runs):
            self._left_running = True
        super()._drop_control()

    def disconnect(self) -> None:
        """Stop what we move, as nothing in the arm would, and close; harmless when closed."""
        if self._in_control and (self.move_in_progress or self._belt_runs):
            self._stops += 1
            with contextlib.suppress(DeviceError):  # it is gone
                self._send_stop()
        super().disconnect()
        self._left_running = False

    def _tell(self, command: Command, layout: str, *values: float) -> None:
        """Set values and see them taken. Raises Refused."""
        self._observer.set(command, layout, *values)
        kept = self._observer.get(command, layout)
        if any(abs(a - b) > 1e-3 * max(1.0, abs(b)) for a, b in zip(kept, values, strict=True)):
            raise Refused(f"{self._who} did not take {command.name.lower()}", f"told {values}, has {kept}")

    def _require_control(self) -> None:
        self._observer.check()
        if not self._in_control:
            raise NotInControl(f"{self._who}: control is not taken")

    # -------------------------------------------------------------------------------- moving
    def check_if_ready_to_move(self) -> None:
        """Raise what keeps the arm from moving now; return when nothing does."""
        super().check_if_ready_to_move()
        self._require_control()
        obstacles = self._obstacles(self._observer.sample())
        if obstacles:
            raise Refused(f"{self._who} cannot move: {', '.join(obstacles)}")

    def move_to_pose(
        self, end_effector_id: str, target_pose: Pose, speed: float, safe: bool = True, linear: bool = True
    ) -> None:
        """Move the tool to a pose in the world, in a line or with all joints together.

        With `safe` a line that meets something in the scene is refused; a joint move leads around it, standing at each
        waypoint, or is refused. An obstacle that comes into the path meanwhile stops the arm.
        Raises KinematicsException, PathBlocked, OutOfRange, Refused, NotInControl, DeviceFault, Cancelled,
        DeviceTimeout.
        """
        stops = self._stops
        self._check_end_effector(end_effector_id)
        if not safe:
            self._move_pose(target_pose, LINE_TO_POSE if linear else JOINT_TO_POSE, speed, stops)
            return
        within(f"{self._who}: speed", speed, SLOWEST, 1.0)
        tool, q = self._solve(target_pose)
        if not linear:
            self._go_around(q, speed, stops)
            return
        with self._moving():
            way = self.safe_moves.line(end_effector_id, self.robot_joints(), target_pose)
            way.require_begin(self.name, self.robot_joints())
            with self.safe_moves.monitored(way):
                self._drive_tool(tool, q, LINE_TO_POSE, speed, stops)

    def move_to_joints(self, target_joints: list[Joint], speed: float, safe: bool = True) -> None:
        """Move to joint values, all joints arriving together; with `safe` around what stands in the way, or not at all.

        Raises as `move_to_pose`, and InvalidData.
        """
        stops = self._stops
        q = self._checked_joints(target_joints)
        if safe:
            within(f"{self._who}: speed", speed, SLOWEST, 1.0)
            self._go_around(q, speed, stops)
        else:
            self._move_joints(q, speed, stops)

    def _go_around(self, q: Joints, speed: float, stops: int) -> None:
        """Plan a way and drive it, standing at each waypoint: as the checked way is straight in joint space."""
        with self._moving():
            goal = [Joint(name, value) for name, value in zip(JOINTS, q, strict=True)]
            way = self.safe_moves.to_joints(self.robot_joints(), goal, speed, stopped=lambda: self._stops != stops)
            way.require_begin(self.name, self.robot_joints())
            with self.safe_moves.monitored(way):
                for waypoint in way.waypoints[1:]:
                    self._drive_joints(self._checked_joints(waypoint), speed, stops)

    def home(self) -> None:
        """Reference the axes: the arm runs to its switches and back, some twenty seconds. Keep clear of it.

        Raises Refused, NotInControl, DeviceFault, Cancelled, DeviceTimeout.
        """
        stops = self._stops
        with self._moving():
            self._run("homing", 1.0, self._dobot.home_timeout, lambda _: True, stops, Command.HOME, "I", 0)

    def _move_pose(self, target: Pose, mode: int, speed: float, stops: int) -> MoveResult:
        """Move; `stops` is the count of stops when the caller was called: one more since then, and nothing starts."""
        within(f"{self._who}: speed", speed, SLOWEST, 1.0)
        tool, q = self._solve(target)
        with self._moving():
            return self._drive_tool(tool, q, mode, speed, stops)

    def _drive_tool(self, tool: Tool, q: Joints, mode: int, speed: float, stops: int) -> MoveResult:
        start = self._observer.sample()
        budget = max(self._joint_time(start.q, q, speed), self._line_time(start.tool, tool, speed))
        if mode == JUMP:
            budget += 2.0 * self._line_time(tool, tool._replace(z=tool.z + 0.5), speed)

        def reached(sample: Sample) -> bool:
            away = math.dist(sample.tool[:3], tool[:3])
            return away < POSITION_REACHED and abs(sample.tool.r - tool.r) < ANGLE_REACHED

        what = "a linear move" if mode == LINE_TO_POSE else "a move"
        numbers = (*(value * 1000.0 for value in tool[:3]), math.degrees(tool.r))
        return self._run(what, speed, budget, reached, stops, Command.PTP, "B4f", mode, *numbers)

    def _move_joints(self, q: Joints, speed: float, stops: int) -> MoveResult:
        within(f"{self._who}: speed", speed, SLOWEST, 1.0)
        with self._moving():
            return self._drive_joints(q, speed, stops)

    def _drive_joints(self, q: Joints, speed: float, stops: int) -> MoveResult:
        budget = self._joint_time(self._observer.sample().q, q, speed)

        def reached(sample: Sample) -> bool:
            return max(abs(a - b) for a, b in zip(sample.q, q, strict=True)) < ANGLE_REACHED

        angles = map(math.degrees, q)
        return self._run("a joint move", speed, budget, reached, stops, Command.PTP, "B4f", JOINT_TO_ANGLES, *angles)

    def _joint_time(self, start: Joints, end: Joints, speed: float) -> float:
        way = max(abs(a - b) for a, b in zip(start, end, strict=True))
        return self._time(way, self._dobot.max_joint_speed * speed, self._dobot.joint_acceleration * speed)

    def _line_time(self, start: Tool, end: Tool, speed: float) -> float:
        way = math.dist(start[:3], end[:3])
        return self._time(way, self._dobot.max_tcp_speed * speed, self._dobot.tcp_acceleration * speed)

    @staticmethod
    def _time(way: float, speed: float, acceleration: float) -> float:
        """Give the longest time (s) that a motion may take: half as much again as it should, and two seconds."""
        return 1.5 * (way / speed + speed / acceleration) + 2.0

    @contextlib.contextmanager
    def _moving(self) -> Iterator[None]:
        self.check_if_ready_to_move()
        if not self._move_lock.acquire(blocking=False):
            raise Refused(f"{self.name} is moving already")
        try:
            yield
        finally:
            self._move_lock.release()

    def _run(
        self,
        what: str,
        speed: float,
        budget: float,
        reached: Callable[[Sample], bool],
        stops: int,
        command: Command,
        layout: str,
        *values: float,
    ) -> MoveResult:
        """Queue one motion into the empty queue, start it, and wait for its end by what is observed."""
        began = time.monotonic()
        with self._orders:
            self._check_not_stopped(what, stops)
            self._require_control()
            self._observer.set(Command.PTP_COMMON, "2f", speed * 100.0, speed * 100.0)
            index = self._observer.queue(command, layout, *values)
            self._observer.set(Command.QUEUE_START)
        try:
            self._wait_done(what, index, began + budget, time.monotonic(), reached, stops)
        except Cancelled:
            with contextlib.suppress(DeviceError):  # whoever stopped it is told
                self._wait_rest()
            self._note(speed, began, MoveEnd.STOPPED)
            raise
        return self._note(speed, began, MoveEnd.DONE)

    def _check_not_stopped(self, what: str, stops: int) -> None:
        if self._stops != stops:
            raise Cancelled(f"{what} of {self._who} was stopped")

    def _wait_done(
        self, what: str, index: int, deadline: float, since: float, reached: Callable[[Sample], bool], stops: int
    ) -> None:
        came = self._observer.came
        while True:
            self._check_not_stopped(what, stops)
            try:
                self._observer.check()
            except ConnectionLost as e:
                raise ConnectionLost(f"{e} during {what}; the arm ends it by itself", e.detail) from None
            if not self._in_control:
                raise NotInControl(f"control of {self._who} was lost during {what}; the arm ends it by itself")
            sample = self._observer.newest()
            if sample is not None and sample.monotonic > since:
                obstacles = self._obstacles(sample)
                if obstacles:
                    self._send_stop()
                    code = min(sample.alarms - {alarms.RESET})
                    raise DeviceFault(f"{what} of {self._who} failed: {obstacles[0]}", "", alarms.title(code))
                if sample.index >= index and reached(sample):
                    return
                if sample.index >= index and sample.standing > SHORT_OF_TARGET:
                    raise DeviceFault(f"{what} of {self._who} ended before its target")
            if time.monotonic() > deadline:
                self._send_stop()
                raise DeviceTimeout(f"{what} of {self._who} did not end in the time computed for it; it was stopped")
            with came:
                came.wait(WAKE)

    def _note(self, speed: float, began: float, end: MoveEnd) -> MoveResult:
        newest = self._observer.newest()
        pose = self._world(newest.tool) if newest is not None else self._pose
        self.last_move = MoveResult(pose, speed, time.monotonic() - began, end)
        return self.last_move

    # -------------------------------------------------------------------------------- stopping
    def stop(self) -> None:
        """Stop arm and belt and return when the arm stands; called past everything else. It is no safety function.

        What was left running by a loss of the connection is stopped too, once the arm is observed again.
        Raises ConnectionLost when it cannot be sent, NotInControl when the arm moves and not for us, DeviceTimeout.
        """
        self._stops += 1
        with self._observer.came:
            self._observer.came.notify_all()
        if not self._in_control and not self._left_running:
            newest = self._observer.newest()
            if newest is not None and self._observer.observing.online and newest.moving:
                raise NotInControl(f"{self._who} moves, and not for us: control is not taken")
            return
        self._observer.check()
        self._send_stop()
        self._wait_rest()
        self._left_running = False

    def _send_stop(self) -> None:
        """Stop at once: first the motion, then what waits behind it, lest the next start runs it."""
        with self._orders:
            self._empty_queue()
            if self._belt_runs:
                self._drive_belt(0.0)

    def _empty_queue(self) -> None:
        self._observer.set(Command.QUEUE_FORCE_STOP)
        self._observer.set(Command.QUEUE_CLEAR)

    def _wait_rest(self) -> None:
        deadline = time.monotonic() + REST_WITHIN
        sample = self._observer.after(time.monotonic())
        while sample.moving:
            if time.monotonic() > deadline:
                raise DeviceTimeout(f"{self._who} did not come to rest within {REST_WITHIN:g} s of a stop")
            sample = self._observer.after(sample.monotonic)

    # -------------------------------------------------------------------------------- the belt
    def _drive_belt(self, speed: float) -> None:
        """Drive the belt with a speed in m/s. Called with `_orders` held."""
        if self._dobot.conveyor_port < 0:
            raise Refused(f"{self._who} has no conveyor: conveyor_port is not set")
        pulses = round(speed * self._dobot.conveyor_pulses)
        if abs(pulses) >= 1 << 31:
            raise OutOfRange(f"speed must be less, not {speed!r}: the stepper has 32 bits of pulses per second")
        self._observer.set(Command.STEPPER, "BBi", self._dobot.conveyor_port, int(pulses != 0), pulses)
        self._belt_runs = pulses != 0
