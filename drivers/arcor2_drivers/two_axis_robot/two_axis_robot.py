"""The two-axis robot as an object type: its motions."""

import contextlib
import math
import time
from typing import ClassVar, Final, Literal

from arcor2_hw.actions import action
from arcor2_hw.data.geometry import Orientation, Pose, Position
from arcor2_hw.data.project import ProjectRobotJoints
from arcor2_hw.data.robot import Joint, MoveEnd, MoveResult
from arcor2_hw.exceptions import Cancelled, DeviceError, DeviceFault, DeviceTimeout, NotInControl, OutOfRange, Refused

from . import kinematics
from . import registers as reg
from .bus import Bus
from .controlled import GOALS, POLL, REST_WITHIN, TwoAxisControlled
from .observed import JOINTS
from .observer import Snapshot
from .registers import to_ticks
from .settings import TwoAxisRobotSettings, within

REACHED: Final = 12
"""Ticks (1°) from the goal at which a joint that stands has arrived: a loaded servo rests short of its goal."""
STILL: Final = 1e-6
"""m/s, rad/s below which a part of a twist counts as none."""
STANDING: Final = 0.5
"""s both joints may stand, short of the goal, before the move counts as failed."""


class TwoAxisRobot(TwoAxisControlled):
    """A planar arm of two Dynamixel servos for fine manipulation."""

    _ABSTRACT = False
    urdf_package_name = "two_axis_robot.zip"
    CANCEL_MAPPING: ClassVar[dict[str, str]] = {"move": "stop", "move_to": "stop"}

    def __init__(self, obj_id: str, name: str, pose: Pose, settings: TwoAxisRobotSettings) -> None:
        super().__init__(obj_id, name, pose, settings)
        self.last_move: MoveResult | None = None

    # -------------------------------------------------------------------------------- moving
    def check_if_ready_to_move(self) -> None:
        """Raise what keeps the arm from moving now; return when nothing does."""
        super().check_if_ready_to_move()
        self._check_takes_goals()

    def move_to_pose(
        self, end_effector_id: str, target_pose: Pose, speed: float, safe: bool = True, linear: bool = True
    ) -> None:
        """Move to a position in the world, joint by joint; a straight line is refused.

        With `safe` around what stands in the scene, standing at each waypoint, or not at all; an obstacle that comes
        into the path meanwhile stops the arm.
        Raises KinematicsException, PathBlocked, OutOfRange, Refused, NotInControl, DeviceFault, Cancelled,
        DeviceTimeout.
        """
        stops = self._stops
        self._check_end_effector(end_effector_id)
        if linear:
            raise Refused(f"{self.name} does not move in a straight line; ask for a joint move (linear=false)")
        if safe:
            self._go_around(self._free(target_pose, self._angles(self._observer.current())), speed, stops)
        else:
            self._move_pose(target_pose, speed, 1.0, stops)

    def move_to_joints(self, target_joints: list[Joint], speed: float, safe: bool = True) -> None:
        """Move to joint values, both joints arriving together; with `safe` around what stands in the way."""
        stops, q = self._stops, self._checked(target_joints)
        if safe:
            self._go_around(q, speed, stops)
        else:
            self._move(q, speed, 1.0, stops)

    def _go_around(self, q: tuple[float, float], speed: float, stops: int) -> None:
        """Plan a way and drive it, standing at each waypoint: as the checked way is straight in joint space."""
        within(f"{self.name}: speed", speed, 0.001, 1.0)
        with self._moving():
            self._check_takes_goals()
            now = self.robot_joints()
            way = self.safe_moves.to_joints(now, self._joints(q), speed, stopped=lambda: self._stops != stops)
            way.require_begin(self.name, self.robot_joints())
            with self.safe_moves.monitored(way):
                for waypoint in way.waypoints[1:]:
                    self._drive(self._checked(waypoint), speed, 1.0, stops)

    def jog(
        self,
        twist: tuple[float, float, float, float, float, float] | None = None,
        joint_velocities: list[float] | None = None,
        frame: Literal["world", "base", "tool", "user"] = "world",
        valid_for: float = 0.2,
        end_effector_id: str | None = None,
    ) -> None:
        """Move with a velocity that runs out by itself: the goals are where the servos come to rest after that.

        Of a twist, what lies in the plane; two joints cannot choose how the tool turns.
        Raises OutOfRange, Refused for a turn, a way out of the plane and a stretched arm, NotInControl, DeviceFault.
        """
        within(f"{self.name}: valid_for", valid_for, 0.01, 1.0)
        if end_effector_id is not None:
            self._check_end_effector(end_effector_id)
        if (twist is None) == (joint_velocities is None):
            raise OutOfRange(f"{self.name}: jog needs either twist or joint_velocities")
        stops, until = self._stops, time.monotonic() + valid_for
        with self._moving():
            self._check_takes_goals()
            snapshot = self._observer.current()
            rates = self._rates(twist, frame, self._angles(snapshot)) if twist is not None else joint_velocities or []
            if len(rates) != len(JOINTS):
                raise OutOfRange(f"{self.name}: joint_velocities must have {len(JOINTS)} numbers")
            top, blocks = self._axes.max_joint_speed, {}
            for joint, rate in enumerate(rates):
                within(f"{self.name}: velocity of {JOINTS[joint]}", rate, -top, top)
                blocks[self._axes.ids[joint]] = self._running_out(joint, rate, valid_for, snapshot)

            def command(bus: Bus) -> None:
                if self._stops != stops or not self._ours or time.monotonic() >= until:
                    raise Cancelled(f"a jog of {self.name} was stopped, or came too late")
                bus.sync_write(GOALS, blocks)

            self._observer.do(command)

    def _running_out(self, joint: int, rate: float, valid_for: float, snapshot: Snapshot) -> bytes:
        """Give profile and goal of a joint that goes at a rate (rad/s) for a time and then comes to rest."""
        servo, setup, ramp = snapshot.servos[joint], self._observer.setups[joint], self._axes.joint_acceleration
        # A servo that shall stand is still brought to rest.
        turning = rate * self._directions[joint] or servo.velocity * reg.VELOCITY
        way = rate * self._directions[joint] * valid_for + math.copysign(turning**2 / (2.0 * ramp), turning)
        lower, upper = sorted(to_ticks(limit, self._directions[joint]) for limit in self._limits[joint])
        goal = servo.position + round(way / reg.TICK)
        goal = max(lower, setup.min_position, min(upper, setup.max_position, goal))
        return b"".join(value.to_bytes(4, "little", signed=True) for value in (*reg.profile(abs(turning), ramp), goal))

    def _rates(self, twist: tuple[float, ...], frame: str, q: tuple[float, float]) -> list[float]:
        """Give the joints' rates for a velocity of the tool centre point."""
        heading = kinematics.forward(self._links, q)[2]
        axes = {
            "world": self._pose.orientation.inverted(),
            "base": Orientation(),
            "tool": Orientation.from_rotation_vector(0.0, 0.0, heading),
        }.get(frame)
        if axes is None:
            raise Refused(f"{self.name} has no frame {frame!r} to jog in")
        x, y, z = Position(*twist[:3]).rotated(axes)
        if abs(z) > STILL or any(abs(part) > STILL for part in twist[3:]):
            raise Refused(f"{self.name} moves in a plane, and its tool does not turn by itself")
        rates = kinematics.rates(self._links, q, x, y)
        if rates is None:
            raise Refused(f"{self.name} is stretched or folded: jog its joints")
        return list(rates)

    def _check_takes_goals(self) -> None:
        self._require_control()
        if self._teaching:
            raise Refused(f"{self.name} is in hand teaching mode")

    @action
    def move(self, pose: Pose, speed: float = 0.25, acceleration: float = 0.5, *, an: str | None = None) -> None:
        """Move the tool centre point to a position; the heading is what comes of it.

        :param pose: where to
        :param speed: fraction of the configured maximum
        :param acceleration: fraction of the configured maximum
        """
        assert 0.01 <= speed <= 1.0
        assert 0.01 <= acceleration <= 1.0
        self._move_pose(pose, speed, acceleration, self._stops)

    @action
    def move_to(
        self, joints: ProjectRobotJoints, speed: float = 0.25, acceleration: float = 0.5, *, an: str | None = None
    ) -> None:
        """Move to stored joint values, both joints arriving together.

        :param joints: where to
        :param speed: fraction of the configured maximum
        :param acceleration: fraction of the configured maximum
        """
        assert 0.01 <= speed <= 1.0
        assert 0.01 <= acceleration <= 1.0
        self._move(self._checked(joints.joints), speed, acceleration, self._stops)

    def _move_pose(self, pose: Pose, speed: float, acceleration: float, stops: int) -> MoveResult:
        return self._move(self._solve(pose, self._angles(self._observer.current())), speed, acceleration, stops)

    def _move(self, q: tuple[float, float], speed: float, acceleration: float, stops: int) -> MoveResult:
        """Move; `stops` is the count of stops when the caller was called: one more since then, and nothing starts."""
        within(f"{self.name}: speed", speed, 0.001, 1.0)
        within(f"{self.name}: acceleration", acceleration, 0.01, 1.0)
        with self._moving():
            return self._drive(q, speed, acceleration, stops)

    def _drive(self, q: tuple[float, float], speed: float, acceleration: float, stops: int) -> MoveResult:
        self._check_takes_goals()
        goals = self._ticks(q)
        self._check_servo_limits(goals)
        start = self._observer.fresh()
        began = time.monotonic()
        top, ramp = speed * self._axes.max_joint_speed, acceleration * self._axes.joint_acceleration
        distances = [abs(goal - servo.position) * reg.TICK for goal, servo in zip(goals, start.servos, strict=True)]
        longest = max(distances)
        blocks, slowest = {}, 0.0
        for number, goal, distance in zip(self._axes.ids, goals, distances, strict=True):
            part = distance / longest if longest else 1.0
            a, v = reg.profile(top * part, ramp * part)  # one shape for both, so that they arrive together
            slowest = max(slowest, distance / (v * reg.VELOCITY) + v * reg.VELOCITY / (a * reg.ACCELERATION))
            blocks[number] = b"".join(value.to_bytes(4, "little", signed=True) for value in (a, v, goal))

        def command(bus: Bus) -> None:
            if self._stops != stops or not self._ours:
                raise Cancelled(f"a move of {self.name} was stopped")
            bus.sync_write(GOALS, blocks)

        try:
            self._observer.do(command)
            self._check_taken(goals, stops)
            self._wait_done(goals, 1.5 * slowest + 1.0, stops)
        except Cancelled:
            self._wait_rest(REST_WITHIN)
            self._note(speed, began, MoveEnd.STOPPED)
            raise
        except (DeviceFault, NotInControl):
            with contextlib.suppress(DeviceError):  # the servo that is well must not go on alone
                self._observer.do(self._brake, urgent=True)
            self._note(speed, began, MoveEnd.SAFETY)
            raise
        return self._note(speed, began, MoveEnd.DONE)

    def _check_servo_limits(self, goals: tuple[int, int]) -> None:
        for number, goal, setup in zip(self._axes.ids, goals, self._observer.setups, strict=True):
            if not setup.min_position <= goal <= setup.max_position:
                raise OutOfRange(
                    f"{self._observer.bus.servo(number)} allows positions {setup.min_position} to "
                    f"{setup.max_position}, not {goal}"
                )

    def _check_taken(self, goals: tuple[int, int], stops: int) -> None:
        """Look whether both servos have the goal: nobody acknowledges a sync write."""
        for number, goal, servo in zip(self._axes.ids, goals, self._observer.fresh().servos, strict=True):
            if servo.goal != goal:
                self._require_control()
                if self._stops != stops:
                    raise Cancelled(f"a move of {self.name} was stopped")
                self.stop()
                raise DeviceFault(f"{self._observer.bus.servo(number)} did not take the goal {goal}", fault_code="goal")

    def _wait_done(self, goals: tuple[int, int], budget: float, stops: int) -> None:
        began = standing = time.monotonic()
        while True:
            if self._stops != stops:
                raise Cancelled(f"a move of {self.name} was stopped")
            snapshot = self._observer.fresh()
            self._require_control()
            now = time.monotonic()
            if not snapshot.standing:
                standing = now
            elif all(abs(s.position - g) <= REACHED for s, g in zip(snapshot.servos, goals, strict=True)):
                if self._stops == stops:
                    return
            elif now - standing > STANDING:
                short = " and ".join(
                    name
                    for name, s, g in zip(JOINTS, snapshot.servos, goals, strict=True)
                    if abs(s.position - g) > REACHED
                )
                raise DeviceFault(f"{short} of {self.name} stands short of its goal", fault_code="short_of_goal")
            if now - began > budget:
                self.stop()
                raise DeviceTimeout(f"a move of {self.name} did not end within {budget:.1f} s; it was stopped")
            time.sleep(POLL)

    def _note(self, speed: float, began: float, end: MoveEnd) -> MoveResult:
        newest = self._observer.newest()
        assert newest is not None
        self.last_move = MoveResult(self._world(self._angles(newest)), speed, time.monotonic() - began, end)
        return self.last_move
