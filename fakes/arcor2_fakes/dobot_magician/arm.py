"""The simulated arm: queue, motion, alarms, end effector, stepper; independent of frames."""

from __future__ import annotations

import dataclasses
import math
from collections import deque
from collections.abc import Callable
from typing import Any

from arcor2_fakes.dobot_magician.geometry import Four, joints_for, limit_alarm, tool_at
from arcor2_fakes.dobot_magician.motion import Motion, Part, between
from arcor2_fakes.trapezoid import Trapezoid

QUEUE = 32
HOMING = 5.0  # s: duration of each half at speed 1, to the switches and back
SWITCHES: Four = (-85.0, 5.0, -5.0, 0.0)
FOLDED: Four = (0.0, 45.0, 45.0, 0.0)
RESET, PLANNING_UNREACHABLE, PLANNING_LIMIT = 0x00, 0x11, 0x12
MOVING_UNREACHABLE, MOVING_LIMIT = 0x21, 0x22


@dataclasses.dataclass
class Settings:
    """Settings; mm, degrees and seconds, ratios in percent."""

    home: Four = (259.1, 0.0, -8.5, 0.0)
    bias: tuple[float, float, float] = (59.7, 0.0, 0.0)
    joint_speed: Four = (100.0, 100.0, 100.0, 100.0)
    joint_acceleration: Four = (100.0, 100.0, 100.0, 100.0)
    speed: float = 100.0
    turning: float = 100.0
    acceleration: float = 100.0
    turning_acceleration: float = 100.0
    jump_height: float = 20.0
    highest: float = 200.0
    speed_ratio: float = 50.0
    acceleration_ratio: float = 50.0


class Arm:
    """A Dobot Magician."""

    def __init__(self, pace: float = 1.0) -> None:
        self.pace = pace
        self.as_delivered()

    def as_delivered(self) -> None:
        """Reset to the factory state: folded, not homed, default parameters."""
        self.homed = False
        self.joints: Four = FOLDED
        self.alarms: set[int] = set()
        self.suction = (0, 0)
        self.gripper = (0, 0)
        self.steppers: dict[int, tuple[bool, int]] = {0: (False, 0), 1: (False, 0)}
        self.longest_queue = 0
        self.motions = 0
        self._boot()

    def _boot(self) -> None:
        self.settings = Settings()
        self.queue: deque[tuple[int, Callable[[], Motion | None]]] = deque()
        self.running = False
        self.done_index = 0
        self._last_index = 0
        self._motion: Motion | None = None
        self._homing = False

    def power_cycle(self) -> None:
        """Reset everything that is not mechanical; this raises the reset alarm."""
        self._boot()
        self.homed = False
        self.alarms = {RESET}
        self.suction = self.gripper = (0, 0)
        self.steppers = {0: (False, 0), 1: (False, 0)}

    @property
    def tool(self) -> Four:
        """Return x, y, z in mm and r in degrees."""
        return tool_at(self.joints, self.settings.bias)

    @property
    def moving(self) -> bool:
        """Return whether a motion runs."""
        return self._motion is not None

    # ---------------------------------------------------------------------------------------------------- the queue

    def enqueue(self, begin: Callable[[], Motion | None]) -> int:
        """Append a command to the queue and return its index. Raise `BufferError` if the queue is full."""
        if len(self.queue) >= QUEUE:
            raise BufferError
        self._last_index += 1
        self.queue.append((self._last_index, begin))
        self.longest_queue = max(self.longest_queue, len(self.queue))
        return self._last_index

    @property
    def space(self) -> int:
        """Return the free space of the queue, commands."""
        return QUEUE - len(self.queue)

    def force_stop(self) -> None:
        """Stop at once. The rest of the queue stays."""
        self.running = False
        if self._motion is not None:
            self._motion = None
            self._homing = False
            self.queue.popleft()

    def clear(self) -> None:
        """Clear the queue; a running command continues."""
        while len(self.queue) > (1 if self._motion is not None else 0):
            self.queue.pop()

    def advance(self, seconds: float) -> None:
        """Advance the simulation."""
        if self._motion is None:
            if not self.running or not self.queue or self.alarms - {RESET}:
                return
            self._motion = self.queue[0][1]()
            if self._motion is None:
                self._finish()
                return
            self.motions += 1
        joints, ended = self._motion.advance(seconds * self.pace)
        if joints is None or (not self._homing and (limit_alarm(joints) is not None)):
            self.raise_alarm(MOVING_UNREACHABLE if joints is None else MOVING_LIMIT)
            return
        self.joints = joints
        if ended:
            self.homed = self.homed or self._homing
            self._motion, self._homing = None, False
            self._finish()

    def _finish(self) -> None:
        if self.queue and not self.alarms - {RESET}:
            self.done_index = self.queue.popleft()[0]

    def raise_alarm(self, code: int) -> None:
        """Raise an alarm, which stops the running command; its index is never reached."""
        self.alarms.add(code)
        self.force_stop()

    # ---------------------------------------------------------------------------------------------------- motions

    def home(self) -> Motion:
        """Move to the switches and back to the home position."""
        self._homing = True
        start, end = self.joints, joints_for(self.settings.home, self.settings.bias) or FOLDED
        whole = Trapezoid(1.0, 1.0 / (HOMING - 1.0), 1.0 / (HOMING - 1.0))
        return Motion(
            [
                Part(whole, lambda share: between(start, SWITCHES, share)),
                Part(whole, lambda share: between(SWITCHES, end, share)),
            ]
        )

    def point_to_point(self, mode: int, target: Four) -> Motion | None:
        """Plan a motion to a point; return None and raise an alarm if it cannot be planned."""
        if mode in (6,):  # steps of the joints
            target = _sum(self.joints, target)
        elif mode in (7, 8):  # steps of the tool
            target = _sum(self.tool, target)
        by_angles = mode in (3, 4, 5, 6)
        end = target if by_angles else joints_for(target, self.settings.bias)
        if end is None or not all(map(math.isfinite, end)):
            self._refuse(PLANNING_UNREACHABLE)
            return None
        code = limit_alarm(end)
        if code is not None:
            self._refuse(code if by_angles else PLANNING_LIMIT)
            return None
        if mode in (1, 4, 6, 8):
            return Motion([self._joint_part(self.joints, end)])
        goal = tool_at(end, self.settings.bias)
        if mode in (2, 5, 7):
            return Motion([self._straight_part(self.tool, goal)])
        return self._jump(goal, straight=mode == 9)

    def _refuse(self, code: int) -> None:
        self.alarms.add(code)
        self.running = False
        self.queue.popleft()

    def _jump(self, goal: Four, *, straight: bool) -> Motion | None:
        here = self.tool
        top = min(max(here[2], goal[2]) + self.settings.jump_height, self.settings.highest)
        over, above = (*here[:2], top, here[3]), (*goal[:2], top, goal[3])
        first, last = joints_for(over, self.settings.bias), joints_for(above, self.settings.bias)
        if first is None or last is None:
            self._refuse(PLANNING_UNREACHABLE)
            return None
        across = self._straight_part(over, above) if straight else self._joint_part(first, last)
        return Motion([self._straight_part(here, over), across, self._straight_part(above, goal)])

    def _joint_part(self, start: Four, end: Four) -> Part:
        """Return the part in which all joints arrive together. The slowest joint determines its duration."""
        fast, quick = self.settings.speed_ratio / 100.0, self.settings.acceleration_ratio / 100.0
        shares = [
            Trapezoid(abs(b - a), speed * fast, acceleration * quick)
            for a, b, speed, acceleration in zip(
                start, end, self.settings.joint_speed, self.settings.joint_acceleration, strict=True
            )
        ]
        return Part(max(shares, key=lambda one: one.duration), lambda share: between(start, end, share))

    def _straight_part(self, start: Four, end: Four) -> Part:
        fast, quick = self.settings.speed_ratio / 100.0, self.settings.acceleration_ratio / 100.0
        way = Trapezoid(math.dist(start[:3], end[:3]), self.settings.speed * fast, self.settings.acceleration * quick)
        turn = Trapezoid(
            abs(end[3] - start[3]), self.settings.turning * fast, self.settings.turning_acceleration * quick
        )
        return Part(
            max(way, turn, key=lambda one: one.duration),
            lambda share: joints_for(between(start, end, share), self.settings.bias),
        )

    def truth(self) -> dict[str, Any]:
        """Return the true state."""
        return {
            "joints": self.joints,
            "tool": self.tool,
            "homed": self.homed,
            "moving": self.moving,
            "motions": self.motions,
            "running": self.running,
            "queued": len(self.queue),
            "longest_queue": self.longest_queue,
            "index": self.done_index,
            "alarms": sorted(self.alarms),
            "suction": self.suction,
            "gripper": self.gripper,
            "steppers": {str(number): state for number, state in self.steppers.items()},
            "speed_ratio": self.settings.speed_ratio,
        }


def _sum(a: Four, b: Four) -> Four:
    return a[0] + b[0], a[1] + b[1], a[2] + b[2], a[3] + b[3]
