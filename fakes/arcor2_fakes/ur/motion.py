"""Motions of the arm: trapezoidal in joint and Cartesian space, velocity control, servoing, stopping.

`Arm.step` is one control cycle. Motions along a path (movej, movel) are functions of a path time that runs at
`Arm.rate`: the speed slider, a pause and a protective stop only slow this time down, so that the arm stays on its path
and can continue.
"""

import math
from collections.abc import Sequence
from typing import Protocol

from arcor2_fakes.ur.kinematics import Chain, Transform, to_pose
from arcor2_fakes.ur.paths import JointBlend, JointMove, Joints, LinearBlend, LinearMove, MotionRefused

MAX_JOINT_SPEED = math.pi  # rad/s, UR5e data sheet: 180 degrees per second on every joint
MAX_JOINT_ACCELERATION = 40.0  # rad/s^2, more than any program may request
MAX_TCP_SPEED = 3.0  # m/s
JOINT_RANGE = math.tau  # rad either way
PROGRAM_STOP_DECELERATION = 14.0  # rad/s^2, when a program ends or a thread is killed during a move
_PAUSE_TIME = 0.2  # s from full speed to standstill on the path
_PROTECTIVE_TIME = 0.08  # s, the same for a protective stop


class Motion(Protocol):
    """A motion; `step` returns the next joint positions."""

    along_path: bool
    """Whether a pause may slow it down on its path; if not, it ends by itself or by a halt."""

    @property
    def done(self) -> bool:
        """Return whether the motion has ended."""
        ...

    def step(self, arm: "Arm", dt: float, /) -> Joints:
        """Return positions after `dt` seconds of the motion's own time."""
        ...


class JointSpeed:
    """speedj: a joint velocity reached under an acceleration and held until the next command."""

    along_path = False
    done = False

    def __init__(self, target: Joints, acceleration: float) -> None:
        self.target, self.acceleration = tuple(target), acceleration

    def step(self, arm: "Arm", dt: float) -> Joints:
        """Return positions after `dt` seconds."""
        return _toward(arm.qd, [v * arm.rate for v in self.target], self.acceleration, arm.q, dt)


class LinearSpeed:
    """speedl: a TCP velocity reached under an acceleration and held until the next command."""

    along_path = False
    done = False

    def __init__(self, arm: "Arm", target: Sequence[float], acceleration: float) -> None:
        self.target, self.acceleration = tuple(target), acceleration
        self._twist = arm.twist()

    def step(self, arm: "Arm", dt: float) -> Joints:
        """Return positions after `dt` seconds."""
        gap = [t * arm.rate - v for t, v in zip(self.target, self._twist, strict=True)]
        most = max(math.dist((0.0, 0.0, 0.0), gap[:3]), math.dist((0.0, 0.0, 0.0), gap[3:]))
        f = min(1.0, self.acceleration * dt / most) if most > 0.0 else 0.0
        self._twist = [v + f * g for v, g in zip(self._twist, gap, strict=True)]
        rates = arm.chain.joint_rates(arm.q, self._twist)
        return [a + b * dt for a, b in zip(arm.q, rates, strict=True)]


class LinearHalt(LinearSpeed):
    """stopl: the TCP decelerates along its direction."""

    def __init__(self, arm: "Arm", deceleration: float) -> None:
        super().__init__(arm, (0.0,) * 6, deceleration)

    def step(self, arm: "Arm", dt: float) -> Joints:
        """Return positions after `dt` seconds."""
        q = super().step(arm, dt)
        self.done = max(map(abs, self._twist)) < 1e-9
        return arm.q if self.done else q


class JointHalt:
    """stopj: all joint velocities reach zero together."""

    along_path = False

    def __init__(self, arm: "Arm", deceleration: float) -> None:
        self._deceleration = deceleration
        self.done = not any(arm.qd)

    def step(self, arm: "Arm", dt: float) -> Joints:
        """Return positions after `dt` seconds."""
        q = _toward(arm.qd, (0.0,) * 6, self._deceleration, arm.q, dt)
        self.done = max(abs(a - b) for a, b in zip(q, arm.q, strict=True)) < 1e-12
        return q


class Servo:
    """servoj: follows a target that is renewed continuously, with the delay of the look-ahead time."""

    along_path = False
    done = False

    def __init__(self, target: Joints, lookahead: float) -> None:
        self.target, self.lookahead = tuple(target), min(0.2, max(0.03, lookahead))

    def step(self, arm: "Arm", dt: float) -> Joints:
        """Return positions after `dt` seconds: a critically damped follower within the joints' limits."""
        omega = 2.0 / self.lookahead
        q = []
        for a, v, target in zip(arm.q, arm.qd, self.target, strict=True):
            pull = omega * omega * (target - a) - 2.0 * omega * v
            v += max(-MAX_JOINT_ACCELERATION, min(MAX_JOINT_ACCELERATION, pull)) * dt
            q.append(a + max(-MAX_JOINT_SPEED, min(MAX_JOINT_SPEED, v)) * dt)
        return q


class GuidedMotion:
    """Freedrive: a person moves the arm by hand, slowly and straight to a configuration."""

    along_path = False

    def __init__(self, start: Joints, goal: Joints, speed: float) -> None:
        self._move = JointMove(start, goal, speed, 2.0)
        self.done = self._move.done

    def step(self, arm: "Arm", dt: float) -> Joints:
        """Return positions after `dt` seconds."""
        q = self._move.step(arm, dt)
        self.done = self._move.done
        return q


def _toward(qd: Joints, target: Joints, acceleration: float, q: Joints, dt: float) -> Joints:
    """Return joint positions after one step, the velocity vector drawn straight towards `target`."""
    gap = [t - v for t, v in zip(target, qd, strict=True)]
    most = max(map(abs, gap))
    f = min(1.0, acceleration * dt / most) if most > 0.0 else 0.0
    return [a + (v + f * g) * dt for a, v, g in zip(q, qd, gap, strict=True)]


class Arm:
    """Position and velocity of the six joints, and the current motion."""

    def __init__(self, chain: Chain, q: Joints) -> None:
        self.chain = chain
        self.q: tuple[float, ...] = tuple(q)
        self.qd: tuple[float, ...] = (0.0,) * 6
        self.period = 0.0
        """The length of the current cycle."""
        self.motion: Motion | None = None
        self.rate = 1.0
        """Return the current speed of path time: the speed slider, or a transition to or from zero in a pause."""
        self.slider = 1.0
        self.held = False
        """Whether path time is stopped, by a pause or by the safety system."""
        self.speed_limit = MAX_JOINT_SPEED
        self._ramp = _PAUSE_TIME
        self._pose: tuple[float, ...] | None = None

    @property
    def pose(self) -> tuple[float, ...]:
        """Return the pose of the TCP as x, y, z and rotation vector."""
        if self._pose is None:
            self._pose = to_pose(self.chain.forward(self.q))
        return self._pose

    @property
    def moving(self) -> bool:
        """Return whether a joint has a velocity."""
        return any(self.qd)

    @property
    def busy(self) -> bool:
        """Return whether a motion has not ended yet."""
        return self.motion is not None

    def twist(self) -> list[float]:
        """Return the TCP velocity in base axes."""
        if not self.moving:
            return [0.0] * 6
        twist: list[float] = (self.chain.jacobian(self.q) @ self.qd).tolist()
        return twist

    def set_tcp(self, offset: Sequence[float]) -> None:
        """Set the TCP."""
        self.chain.set_tcp(offset)
        self._pose = None

    def move_joints(self, goal: Joints, velocity: float, acceleration: float, blend: bool = False) -> None:
        """Start a movej. Velocity and acceleration are limited to those of the arm, as by the controller.

        With `blend`, it starts while the previous movej ends.
        """
        if max(map(abs, goal)) > JOINT_RANGE:
            raise MotionRefused("the goal is beyond the joint limits")
        velocity, acceleration = min(velocity, self.speed_limit), min(acceleration, MAX_JOINT_ACCELERATION)
        leaving = self.motion if blend else None
        if isinstance(leaving, JointMove | JointBlend):
            self.motion = JointBlend(leaving, JointMove(leaving.goal, goal, velocity, acceleration))
        else:
            self.motion = JointMove(self.q, goal, velocity, acceleration)

    def move_linear(self, goal: Transform, velocity: float, acceleration: float, blend: bool = False) -> None:
        """Start a movel; with `blend`, while the previous movel ends."""
        velocity, leaving = min(velocity, MAX_TCP_SPEED), self.motion if blend else None
        if isinstance(leaving, LinearMove | LinearBlend):
            self.motion = LinearBlend(leaving, LinearMove(leaving.goal, goal, velocity, acceleration))
        else:
            self.motion = LinearMove(self.chain.forward(self.q), goal, velocity, acceleration)

    def halt(self, deceleration: float = PROGRAM_STOP_DECELERATION, linear: bool = False) -> None:
        """End the motion and decelerate; it does not continue."""
        if not self.moving:
            self.motion = None
        else:
            self.motion = LinearHalt(self, deceleration) if linear else JointHalt(self, deceleration)

    def hold(self, protective: bool = False) -> None:
        """Decelerate on the path; `go_on` continues. A motion without a path ends."""
        self.held = True
        self._ramp = _PROTECTIVE_TIME if protective else _PAUSE_TIME
        if self.motion is not None and not self.motion.along_path:
            self.halt()

    def go_on(self) -> None:
        """Continue path time."""
        self.held, self._ramp = False, _PAUSE_TIME

    def teleport(self, q: Joints) -> None:
        """Place the arm at joint positions, at standstill."""
        self.motion, self.qd, self.q, self._pose = None, (0.0,) * 6, tuple(q), None

    def step(self, dt: float) -> None:
        """Run one control cycle. Raise `MotionRefused` if a limit would be exceeded; the arm is then unchanged."""
        wanted = 0.0 if self.held else self.slider
        if self.rate != wanted:
            change = dt / self._ramp
            self.rate = min(wanted, self.rate + change) if self.rate < wanted else max(wanted, self.rate - change)
        self.period = dt
        motion = self.motion
        if motion is None:
            return
        q = motion.step(self, dt * self.rate if motion.along_path else dt)
        qd = tuple([(a - b) / dt for a, b in zip(q, self.q, strict=True)])
        if max(map(abs, qd)) > self.speed_limit * 1.05 and not isinstance(motion, JointHalt):
            raise MotionRefused("a joint would be too fast")
        if max(map(abs, q)) > JOINT_RANGE + 1e-9:
            raise MotionRefused("a joint would leave its limits")
        if motion.done:
            self.motion, qd = None, (0.0,) * 6
        self.q, self.qd, self._pose = tuple(q), qd, None
