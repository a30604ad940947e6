"""Motion: kinematics, moves and jogging of the arm."""

import contextlib
import math
import threading
import time
from collections.abc import Sequence
from typing import Final

from arcor2_hw.data.geometry import Orientation, Pose, Position
from arcor2_hw.data.robot import Joint, MoveEnd
from arcor2_hw.exceptions import Cancelled, DeviceError, DeviceFault, DeviceTimeout, NotInControl, OutOfRange, Refused
from arcor2_hw.keep_alive import RunningTime
from arcor2_hw.objects import Robot
from arcor2_hw.objects.arm import TCP, StopGuard, check_jog, exclusive_motion, jog_axes, joint_values, named_joints
from arcor2_hw.objects.safe_moves import SafeMoves
from arcor2_hw.objects.settings import within
from arcor2_hw.objects.single_arm import MotionLog, move_around_obstacles

from . import kinematics, registers as reg
from .bus import Bus
from .control import GOALS, POLL, STANDSTILL_TIMEOUT, Control, goal_block
from .observer import Observer, State
from .registers import to_angle, to_ticks
from .settings import TwoAxisRobotSettings

Angles = tuple[float, float]

JOINTS: Final = ("joint_1", "joint_2")
OUT_OF_PLANE: Final = 0.001
"""Maximum distance of a pose from the plane in which the arm moves, m."""
TILTED: Final = 0.02
"""Maximum angle between the z axis of a pose and the axes of the joints, rad."""
REACHED: Final = 12
"""Ticks (1°) from the goal within which a joint at standstill has arrived: a loaded servo stops short of its goal."""
ZERO_VELOCITY: Final = 1e-6
"""Velocity below which a component of a twist is zero, m/s or rad/s."""
STALL_TIME: Final = 0.5
"""Time after which joints that do not move, short of the goal, count as a failed move, s."""
POSITION_NOISE: Final = 2
"""Ticks by which the position of a joint at standstill may vary. The slowest profile covers 8 ticks in STALL_TIME s."""


class Motion:
    """Moves the arm, one motion at a time."""

    def __init__(
        self, robot: Robot, observer: Observer, control: Control, settings: TwoAxisRobotSettings, lock: threading.Lock
    ) -> None:
        self._robot, self._observer, self._control = robot, observer, control
        self._settings, self._lock, self._name = settings, lock, robot.name
        self._links = settings.link_1, settings.link_2
        self._directions = settings.direction_1, settings.direction_2
        self.limits = {"joint_1": (settings.lower_1, settings.upper_1), "joint_2": (settings.lower_2, settings.upper_2)}
        self.safe = SafeMoves(robot)
        self.log = MotionLog(self._tcp)

    # -------------------------------------------------------------------------------- kinematics
    def present(self) -> Angles:
        """Return the present angles, rad."""
        return self._angles(self._observer.current().value)

    def world(self, q: Angles) -> Pose:
        """Return the pose of the tool center point in the world for angles."""
        x, y, heading = kinematics.forward(self._links, q)
        return self._robot.pose * Pose(Position(x, y, 0.0), Orientation.from_rotation_vector(0.0, 0.0, heading))

    def values(self, joints: list[Joint]) -> Angles:
        """Return the angles of joints. Raise KinematicsException for wrong names, OutOfRange beyond limits."""
        first, second = joint_values(self._name, joints, self.limits, wrong=Robot.KinematicsException)
        return first, second

    def solve(self, pose: Pose, seed: Angles) -> Angles:
        """Return the angles for a position, nearest to the seed. Raise KinematicsException."""
        local = self._robot.pose.inverted() * pose
        x, y, z = local.position
        where = f"in its base: {x:.4f}, {y:.4f}, {z:.4f}"
        if not all(map(math.isfinite, (x, y, z))):
            raise OutOfRange("{name}: the numbers of a pose must be finite.", name=self._name)
        upright = Position(0.0, 0.0, 1.0).rotated(local.orientation)
        if abs(z) > OUT_OF_PLANE or math.hypot(upright.x, upright.y) > math.sin(TILTED) or upright.z < 0.0:
            raise Robot.KinematicsException(
                "{name} moves in a plane; the pose is outside of it.", where, name=self._name
            )
        solutions = kinematics.inverse(self._links, x, y)
        if not solutions:
            raise Robot.KinematicsException("{name} cannot reach the pose.", where, name=self._name)
        q = kinematics.nearest(solutions, seed, tuple(self.limits.values()))
        if q is None:
            raise Robot.KinematicsException(
                "{name} reaches the pose only beyond its joint limits.", where, name=self._name
            )
        return q

    def solve_free(self, pose: Pose, seed: Angles) -> Angles:
        """Return the angles for a position that are free of collisions, nearest to the seed."""
        q = self.solve(pose, seed)
        if not self.safe.contacts(named_joints(JOINTS, q)):
            return q
        return self.values(self.safe.inverse(TCP, pose, named_joints(JOINTS, seed)))

    def _angles(self, state: State) -> Angles:
        first, second = state.servos
        return to_angle(first.position, self._directions[0]), to_angle(second.position, self._directions[1])

    # -------------------------------------------------------------------------------- moving
    def exclusive(self) -> contextlib.AbstractContextManager[None]:
        """Reserve the arm for one motion. Raise Refused while it moves."""
        return exclusive_motion(self._lock, self._name)

    def to_joints(self, q: Angles, speed: float, acceleration: float, guard: StopGuard) -> None:
        """Move to angles; both joints arrive together."""
        within(f"{self._name}: speed", speed, 0.001, 1.0)
        within(f"{self._name}: acceleration", acceleration, 0.01, 1.0)
        with self.exclusive():
            self._drive(q, speed, acceleration, guard)

    def go_around(self, q: Angles, speed: float, guard: StopGuard) -> None:
        """Move to angles around obstacles, stopping at each waypoint: the path is straight in joint space."""
        within(f"{self._name}: speed", speed, 0.001, 1.0)
        with self.exclusive():
            self._control.require_motion()
            move_around_obstacles(
                self._robot,
                self.safe,
                named_joints(JOINTS, q),
                speed,
                guard,
                lambda waypoint: self._drive(self.values(waypoint), speed, 1.0, guard),
            )

    def _drive(self, q: Angles, speed: float, acceleration: float, guard: StopGuard) -> None:
        self._control.require_motion()
        goals = to_ticks(q[0], self._directions[0]), to_ticks(q[1], self._directions[1])
        self._check_servo_limits(goals)
        start = self._observer.fresh().value
        top, ramp = speed * self._settings.max_joint_speed, acceleration * self._settings.joint_acceleration
        distances = [abs(goal - servo.position) * reg.TICK for goal, servo in zip(goals, start.servos, strict=True)]
        longest = max(distances)
        blocks, slowest = {}, 0.0
        for number, goal, distance in zip(self._settings.ids, goals, distances, strict=True):
            part = distance / longest if longest else 1.0
            a, v = reg.profile(
                top * part, ramp * part
            )  # profiles of the same shape, so that both joints arrive together
            slowest = max(slowest, distance / (v * reg.VELOCITY) + v * reg.VELOCITY / (a * reg.ACCELERATION))
            blocks[number] = goal_block(a, v, goal)

        def command(bus: Bus) -> None:
            self._check_valid("A move", guard)
            bus.sync_write(GOALS, blocks)

        with self.log.recorded(speed, lambda: self._control.wait_rest(STANDSTILL_TIMEOUT)) as recording:
            try:
                self._observer.do(command)
                self._check_accepted(goals, guard)
                self._wait_done(goals, 1.5 * slowest + 1.0, guard)
            except (DeviceFault, NotInControl):
                with contextlib.suppress(DeviceError):  # the other servo must not continue alone
                    self._observer.do(self._control.brake, urgent=True)
                recording.end = MoveEnd.SAFETY
                raise

    def _check_valid(self, operation: str, guard: StopGuard) -> None:
        guard.check(f"{operation} of {self._name}")
        if not self._control.ours:
            raise Cancelled("{what} of {name} was stopped: control was lost.", what=operation, name=self._name)

    def _check_servo_limits(self, goals: tuple[int, int]) -> None:
        for number, goal, setup in zip(self._settings.ids, goals, self._observer.setups, strict=True):
            if not setup.min_position <= goal <= setup.max_position:
                raise OutOfRange(
                    "{servo} allows positions {min_position} to {max_position}, not {goal}.",
                    servo=self._observer.bus.servo(number),
                    min_position=setup.min_position,
                    max_position=setup.max_position,
                    goal=goal,
                )

    def _check_accepted(self, goals: tuple[int, int], guard: StopGuard) -> None:
        """Raise DeviceFault unless both servos have the goal: a sync write is not acknowledged."""
        servos = self._observer.fresh().value.servos
        for number, goal, servo in zip(self._settings.ids, goals, servos, strict=True):
            if servo.goal != goal:
                self._control.require()
                guard.check(f"A move of {self._name}")
                self._control.stop()
                servo_name = self._observer.bus.servo(number)
                raise DeviceFault(
                    "{servo} did not accept the goal {goal}.", fault_code="goal", servo=servo_name, goal=goal
                )

    def _wait_done(self, goals: tuple[int, int], budget: float, guard: StopGuard) -> None:
        clock = RunningTime()  # while this computer is busy, neither the joints nor their states are observed
        since, positions = clock(), (math.inf, math.inf)
        while True:
            guard.check(f"A move of {self._name}")
            state = self._observer.fresh().value
            self._control.require()
            now, servos = clock(), state.servos
            short = [name for name, s, g in zip(JOINTS, servos, goals, strict=True) if abs(s.position - g) > REACHED]
            if state.standing and not short:
                if not guard.stopped():
                    return
            elif not state.standing or any(
                abs(s.position - p) > POSITION_NOISE for s, p in zip(servos, positions, strict=True)
            ):
                since, positions = now, (servos[0].position, servos[1].position)
            elif now - since > STALL_TIME:
                raise DeviceFault(
                    "{joints} of {robot} stopped short of the goal. Remove what blocks the arm.",
                    fault_code="short_of_goal",
                    joints=" and ".join(short),
                    robot=self._name,
                )
            if now > budget:
                self._control.stop()
                raise DeviceTimeout(
                    "A move of {name} did not end within {budget:.1f} s. It was stopped.",
                    name=self._name,
                    budget=budget,
                )
            time.sleep(POLL)

    def _tcp(self) -> Pose:
        newest = self._observer.newest()
        return self.world(self._angles(newest)) if newest is not None else self._robot.pose  # None: disconnected

    # -------------------------------------------------------------------------------- jogging
    def jog(
        self, twist: Sequence[float] | None, velocities: Sequence[float] | None, frame: str, valid_for: float
    ) -> None:
        """Move with a velocity that expires. The goals are the positions where the servos stop afterwards."""
        check_jog(self._name, twist, velocities, JOINTS, valid_for)
        guard, until = self._control.stops.guard(), time.monotonic() + valid_for
        with self.exclusive():
            self._control.require_motion()
            state = self._observer.current().value
            rates = self._rates(twist, frame, self._angles(state)) if twist is not None else list(velocities or ())
            top, blocks = self._settings.max_joint_speed, {}
            for joint, rate in enumerate(rates):
                within(f"{self._name}: velocity of {JOINTS[joint]}", rate, -top, top)
                blocks[self._settings.ids[joint]] = self._expiring(joint, rate, valid_for, state)

            def command(bus: Bus) -> None:
                self._check_valid("A jog", guard)
                if time.monotonic() >= until:
                    raise Cancelled(
                        "A jog of {name} was sent too late; it was valid for {valid_for:g} s.",
                        name=self._name,
                        valid_for=valid_for,
                    )
                bus.sync_write(GOALS, blocks)

            self._observer.do(command)

    def _expiring(self, joint: int, rate: float, valid_for: float, state: State) -> bytes:
        """Return profile and goal of a joint that moves at a rate (rad/s) for a time and then stops."""
        servo, setup, ramp = state.servos[joint], self._observer.setups[joint], self._settings.joint_acceleration
        direction = self._directions[joint]
        # A joint with rate 0 may still have to be stopped.
        turning = rate * direction or servo.velocity * reg.VELOCITY
        way = rate * direction * valid_for + math.copysign(turning**2 / (2.0 * ramp), turning)
        lower, upper = sorted(to_ticks(limit, direction) for limit in self.limits[JOINTS[joint]])
        goal = servo.position + round(way / reg.TICK)
        goal = max(lower, setup.min_position, min(upper, setup.max_position, goal))
        return goal_block(*reg.profile(abs(turning), ramp), goal)

    def _rates(self, twist: Sequence[float], frame: str, q: Angles) -> list[float]:
        """Return the joint rates for a velocity of the tool center point."""
        heading = kinematics.forward(self._links, q)[2]
        axes = {
            "world": self._robot.pose.orientation.inverted(),
            "base": Orientation(),
            "tool": Orientation.from_rotation_vector(0.0, 0.0, heading),
        }
        x, y, z = Position(*twist[:3]).rotated(jog_axes(self._name, frame, axes))
        if abs(z) > ZERO_VELOCITY or any(abs(part) > ZERO_VELOCITY for part in twist[3:]):
            raise Refused("{name} moves in a plane, and cannot rotate its tool separately.", name=self._name)
        rates = kinematics.rates(self._links, q, x, y)
        if rates is None:
            raise Refused("{name} is stretched or folded. Jog its joints instead.", name=self._name)
        return list(rates)
