"""One simulated arm: motion along a joint path under speed and acceleration limits, and its hand."""

from collections.abc import Callable
from typing import Final

import numpy as np

from arcor2_fakes.abb_yumi.kinematics import LIMITS, MAX_SPEED, Array, Kinematics, turn, turned

RAMP: Final = 0.2
"""Time from standstill to full speed, s."""
STOP_TIME: Final = 0.1
"""Time from full speed to standstill on a stop, s."""
HAND_STROKE: Final = 0.025
"""Width of the open hand, m."""
HAND_SPEED: Final = 0.025
"""Speed of the fingers, m/s."""
PART_WIDTH: Final = 0.01
"""Width of a part, unless another is given, m."""


class Motion:
    """A joint path, shape (n, 7), from standstill to standstill.

    It takes `duration` s, or longer if an axis is too slow.
    """

    def __init__(self, path: Array, duration: float) -> None:
        self.path = path
        steps = np.abs(np.diff(path, axis=0)) * (len(path) - 1)
        ramp = min(RAMP, duration / 3.0)
        self.cruise = 1.0 / max(duration - ramp, 1e-3)
        if steps.size:
            fastest = float((steps / MAX_SPEED).max()) * self.cruise
            self.cruise /= max(fastest, 1.0)
        self.acceleration = self.cruise / ramp
        self.s = self.v = 0.0
        self.stopping = False

    def at(self) -> Array:
        """Return the joints at the current point of the path."""
        place = self.s * (len(self.path) - 1)
        low = min(int(place), max(len(self.path) - 2, 0))
        part = place - low
        q: Array = self.path[low] * (1.0 - part) + self.path[min(low + 1, len(self.path) - 1)] * part
        return q

    def advance(self, dt: float, ratio: float) -> bool:
        """Advance by `dt` s at a fraction of the speed; return whether the motion has ended."""
        if self.stopping:
            self.v -= self.cruise / STOP_TIME * dt
            if self.v <= 0.0:
                self.v = 0.0
                return True
        else:
            allowed = min(self.cruise * ratio, (2.0 * self.acceleration * max(1.0 - self.s, 0.0)) ** 0.5)
            self.v = min(self.v + self.acceleration * dt, max(allowed, self.cruise * 1e-3))
        self.s = min(self.s + self.v * dt, 1.0)
        return self.s >= 1.0 - 1e-6


class Hand:
    """The SmartGripper: fingers that close on a part, if there is one, and a suction cup."""

    def __init__(self) -> None:
        self.width, self.goal = HAND_STROKE, HAND_STROKE
        self.calibrated = False
        self.part = 0.0  # width of the part between the fingers, m
        self.vacuum = False
        self.blowing = False
        self.force = 0.0

    @property
    def moving(self) -> bool:
        """Return whether the fingers move."""
        return abs(self.goal - self.width) > 1e-6

    def grip(self, force: float) -> None:
        """Close the fingers with a force, N."""
        self.force, self.goal = force, self.part

    def advance(self, dt: float) -> None:
        """Move the fingers for `dt` s."""
        step = HAND_SPEED * dt
        self.width += min(max(self.goal - self.width, -step), step)


class Arm:
    """An arm: joints, motion, hand and tool."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.kinematics = Kinematics(name)
        self.q: Array = self.kinematics.home.copy()
        self.qd: Array = np.zeros(7)
        self.motion: Motion | None = None
        self.ended: Callable[[], None] = lambda: None
        self.hand = Hand()
        self.tool: Array = np.eye(4)
        self.load = (0.0, 0.0, 0.0, 0.0)
        self.lead_through = False
        self.moves_begun = 0

    @property
    def moving(self) -> bool:
        """Return whether the arm moves."""
        return self.motion is not None

    def begin(self, path: Array, duration: float, ended: Callable[[], None]) -> None:
        """Run a path; call `ended` when it has ended or was stopped."""
        self.motion, self.ended = Motion(path, duration), ended
        self.moves_begun += 1

    def stop(self) -> None:
        """Brake along the path."""
        if self.motion is not None:
            self.motion.stopping = True

    def halt(self) -> None:
        """Stop at once by the brakes."""
        self.motion, self.qd = None, np.zeros(7)

    def place(self, q: Array) -> None:
        """Place the arm at joint values."""
        if ((q < LIMITS[:, 0]) | (q > LIMITS[:, 1])).any():
            raise ValueError("joints are beyond the limits of the axes")
        self.halt()
        self.q = q.copy()

    def advance(self, dt: float, ratio: float) -> None:
        """Advance by `dt` s at a fraction of the programmed speed."""
        self.hand.advance(dt)
        motion = self.motion
        if motion is None:
            return
        over = motion.advance(dt, ratio)
        now = motion.at()
        self.q, self.qd = now, (now - self.q) / dt
        if over:
            self.halt()
            self.ended()

    def line(self, target: Array, angle: float) -> Array:
        """Return joints along a straight line of the flange to a pose. Raise NotReachable."""
        start = self.kinematics.describe(self.q)
        distance = float(np.linalg.norm(target[:3, 3] - start.pose[:3, 3]))
        whole = turn(target[:3, :3] @ start.pose[:3, :3].T)
        swing = float(np.arctan2(np.sin(angle - start.angle), np.cos(angle - start.angle)))
        size = max(distance / 0.02, float(np.linalg.norm(whole)) / 0.05, abs(swing) / 0.05)
        count = int(np.clip(size, 2, 80))
        path = [self.q]
        for part in np.linspace(0.0, 1.0, count + 1)[1:]:
            pose = np.eye(4)
            pose[:3, :3] = turned(whole * part) @ start.pose[:3, :3]
            pose[:3, 3] = start.pose[:3, 3] + part * (target[:3, 3] - start.pose[:3, 3])
            path.append(self.kinematics.solve(pose, start.angle + part * swing, path[-1], rounds=20))
        return np.array(path)
