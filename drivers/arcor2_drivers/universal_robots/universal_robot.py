"""UniversalRobot: the object type of UR arms, composed of observer, control, motion and safety."""

import time
from typing import ClassVar, Final, Literal

from arcor2_hw.data.device import Identity, LossReaction
from arcor2_hw.data.geometry import Pose
from arcor2_hw.data.robot import Joint, KinematicCalibration, MoveResult, RobotState, RobotType
from arcor2_hw.exceptions import DeviceError, OutOfRange, Refused
from arcor2_hw.messages import Message
from arcor2_hw.objects.arm import TCP, SafetyAlarm, check_end_effector, named_joints
from arcor2_hw.objects.generic import DEFAULT_CONNECT_TIMEOUT
from arcor2_hw.objects.single_arm import SingleArm

from .arm import Arm
from .control import Control
from .geometry import JOINT_LIMITS, JOINTS, UR5E, ArmModel, Vector3, flange, from_vector, tcp_speed, to_vector
from .gripping import DigitalGripper
from .jog import Jog
from .motion import Motion
from .move_actions import MoveActions
from .observer import Observer
from .paths import Paths
from .pendant import Pendant
from .primary import read_calibration
from .safe_motion import SafeMotion
from .safety import SafetySystem
from .settings import UrSettings
from .states import REMEDIES, power_of, safety_of

MAX_STOP_TIME: Final = 1.5
"""Time to standstill when this computer freezes, s: FROZEN_AFTER, one period of the watchdog, and braking."""
CONTACT_SPEED: Final = 0.05
MAX_POSITION_DIFFERENCE: Final = 0.005
MAX_ANGLE_DIFFERENCE: Final = 0.02
"""Differences between nominal model and controller with the same tool, m and rad: real ones are smaller."""


class UniversalRobot(MoveActions, DigitalGripper, SafetySystem, SingleArm):
    """A Universal Robots arm."""

    _ABSTRACT = True
    robot_type = RobotType.ARTICULATED
    loss_reaction: ClassVar[LossReaction] = LossReaction.stops_within(MAX_STOP_TIME)
    model: ClassVar[ArmModel] = UR5E
    CANCEL_MAPPING: ClassVar[dict[str, str]] = {
        "move": "stop",
        "move_to": "stop",
        "move_through": "stop",
        "move_to_contact": "stop",
        "move_carefully": "stop",
        "pick": "stop",
        "place": "stop",
        "wait_for_input": "stop",
    }

    def __init__(self, obj_id: str, name: str, pose: Pose, settings: UrSettings) -> None:
        super().__init__(obj_id, name, pose, settings)
        if settings.payload_mass > (most := self.model.max_payload):
            raise OutOfRange(
                "{name}: payload_mass must be at most {most:g} kg, not {payload_mass!r}",
                name=name,
                most=most,
                payload_mass=settings.payload_mass,
            )
        self._ur = settings
        self._arm = Arm(self, self.model, settings)
        self._observer = Observer(name, settings.host)
        self._pendant = Pendant(name, settings.host)
        self._control = Control(self._arm, self._observer, self._pendant)
        self._motion = Motion(self._arm, self._observer, self._pendant, self._control, self._move_lock)
        self._paths = Paths(self._arm, self._observer, self._control, self._motion)
        self._jog = Jog(self._arm, self._observer, self._control, self._motion)
        self._safe = SafeMotion(self, self._arm, self._observer, self._control, self._motion)
        self._safety_alarm = SafetyAlarm(REMEDIES)
        self.safe_moves, self.motions = self._safe.moves, self._motion.log
        self.keep_connection(self._observer.who, self._observer.observing)

    # -------------------------------------------------------------------------------- connection and control
    def connect(self, timeout: float = DEFAULT_CONNECT_TIMEOUT) -> None:
        """Observe the controller; a program continues to play. Raise NotConnected, DeviceTimeout or ConnectionLost."""
        if self._observer.observing.online:
            return
        deadline = time.monotonic() + timeout
        self._observer.observing.start(timeout)
        try:
            self._pendant.open(max(deadline - time.monotonic(), 0.05), self._observer.version[0])
        except DeviceError:
            self.disconnect()
            raise

    def disconnect(self) -> None:
        """Release control and close the connections."""
        self.release_control()
        self._observer.observing.stop()
        self._pendant.dashboard.close()

    def identify(self) -> Identity:
        """Return model, serial number and version; without a dashboard server, type and version."""
        self._observer.observing.check()
        return self._pendant.identify(type(self).__name__, ".".join(map(str, self._observer.version)))

    def take_control(self) -> None:
        """Take control, unless we have it. Raise NotInControl, SafetyStop, Refused or ConnectionLost."""
        if not self._control.ours:
            self.safe_moves.prepare()  # before the watchdog is armed, because nothing signals it during the setup
        self._control.take()

    def release_control(self) -> None:
        """Stop the arm and release control, if we have it."""
        self._control.release()

    def control_owner(self) -> str | None:
        """Return "us", "pendant", the name of the program that plays, or None."""
        return self._control.owner()

    # -------------------------------------------------------------------------------- state
    def state(self) -> RobotState:
        """Return the state of the robot. Raise NotConnected, ConnectionLost or Stale."""
        sample = self._observer.sample()
        control, mode = self._pendant.state()
        return RobotState(
            mode,
            power_of(sample.robot_mode),
            safety_of(sample.safety_mode),
            self._control.program_state(sample),
            control,
            sample.moving,
            sample.speed_fraction,
            self._control.obstacles(sample, control),
        )

    @property
    def shown_values(self) -> dict[str, float]:
        """Return whether the gripper on a digital output is closed."""
        sample, output = self._observer.newest(), self._ur.gripper_output
        return {} if sample is None or output < 0 else {"gripped": float(sample.outputs >> output & 1)}

    def get_end_effector_pose(self, end_effector: str) -> Pose:
        """Return the TCP of the settings in the world. Raise NotFound, NotConnected, ConnectionLost or Stale.

        Until control is taken, the controller uses the tool set at the pendant. If that differs, the pose is computed
        from the joints by the nominal model, with an error of some millimetres.
        """
        check_end_effector(self.name, end_effector)
        sample = self._observer.sample()
        if not self._control.ours:
            ours = flange(self.model, sample.q) * self._control.stated_tool.tcp
            theirs = from_vector(sample.tcp)
            away = ours.position.distance_to(theirs.position), ours.orientation.angle_to(theirs.orientation)
            if away[0] >= MAX_POSITION_DIFFERENCE or away[1] >= MAX_ANGLE_DIFFERENCE:
                return self._arm.base * ours
        return self._arm.tcp(sample)

    def robot_joints(self, include_gripper: bool = False) -> list[Joint]:
        """Return the joint values. Raise NotConnected, ConnectionLost or Stale."""
        return named_joints(JOINTS, self._observer.sample().q)

    def grippers(self) -> set[str]:
        """Return the gripper on a digital output, if one is set."""
        return {"gripper"} if self._ur.gripper_output >= 0 else set()

    def joint_limits(self) -> dict[str, tuple[float, float]]:
        """Return the limits of an arm as delivered, rad; its safety configuration may be narrower."""
        return dict(JOINT_LIMITS)

    def max_tcp_speed(self) -> float:
        """Return the configured maximum of the TCP speed, m/s."""
        return self._ur.max_tcp_speed

    def kinematic_calibration(self) -> KinematicCalibration:
        """Read the calibrated DH parameters of this robot, in the controller's base. Raise DeviceError."""
        self._observer.observing.check()
        try:
            return read_calibration(self._ur.host)
        except DeviceError as e:
            raise e.with_message(Message.of("{name}: {reason}", name=self.name, reason=e)) from e

    @property
    def samples_received(self) -> int:
        """Return the number of samples received."""
        return self._observer.samples_received

    @property
    def samples_missed(self) -> int:
        """Return the number of samples lost, by the controller's timestamps."""
        return self._observer.samples_missed

    def wrench(self) -> tuple[float, float, float, float, float, float]:
        """Return force (N) and torque (N m) at the TCP, along the axes of the world."""
        return self._paths.wrench()

    # -------------------------------------------------------------------------------- motion
    def check_if_ready_to_move(self) -> None:
        """Raise what prevents the arm from moving."""
        super().check_if_ready_to_move()
        self._control.current()
        self._motion.check_not_teaching()

    def move_to_pose(
        self, end_effector_id: str, target_pose: Pose, speed: float, safe: bool = True, linear: bool = True
    ) -> None:
        """Move the TCP to a pose in the world, in a line or by a joint move.

        With `safe`, a line that collides is refused, and a joint move leads around obstacles, to another configuration
        if necessary. An obstacle that enters the path later stops the arm.

        Raises:
            KinematicsException: The pose cannot be reached.
            PathBlocked: An obstacle is in the way.
            DeviceError: OutOfRange, Refused, NotInControl, SafetyStop, Cancelled or DeviceTimeout.
        """
        guard = self._control.stops.guard()
        check_end_effector(self.name, end_effector_id)
        if safe:
            self._safe.to_pose(target_pose, linear, speed, guard)
        else:
            self._motion.to_pose(target_pose, linear, speed, 1.0, guard)

    def move_to_joints(self, target_joints: list[Joint], speed: float, safe: bool = True) -> None:
        """Move to joint values, with `safe` around obstacles. Raise as `move_to_pose`, and InvalidData."""
        guard, q = self._control.stops.guard(), self._arm.joint_values(target_joints)
        if safe:
            self._safe.to_joints(q, speed, guard)
        else:
            self._motion.to_joints(q, speed, 1.0, guard)

    def move_path(
        self, waypoints: list[Pose], blend: float = 0.0, linear: bool = True, speed: float = 0.25
    ) -> MoveResult:
        """Move the TCP through poses in the world, in lines or by joint moves.

        Args:
            waypoints: Poses; the arm passes all but the last one.
            blend: Radius at the corners, m; 0 stops at each pose. Less than half the distance to the next pose.
            linear: In lines.
            speed: Fraction of the maximum.
        """
        return self._paths.follow(waypoints, blend, linear, speed)

    def move_until_contact(
        self, direction: Vector3, force: float, max_distance: float, speed: float = CONTACT_SPEED
    ) -> MoveResult:
        """Move along a direction of the world until a force is reached.

        Args:
            direction: Direction in the world.
            force: Force against the direction, N, as a change since the start; checked by the controller.
            max_distance: Greatest distance, m.
            speed: Fraction of the maximum.

        Raises:
            DeviceFault: `no_contact`: the arm is at the end of the path.
        """
        return self._paths.until_contact(direction, force, max_distance, speed)

    def move_force_limited(self, target: Pose, force: float, speed: float) -> MoveResult:
        """Move the TCP in a line to a pose in the world. Raise DeviceFault `force_limit` if a force (N) stops it."""
        return self._paths.force_limited(target, force, speed)

    def stop(self) -> None:
        """Stop the arm and wait for standstill. This is not a safety function. Raise NotInControl or DeviceTimeout."""
        self._motion.stop()

    def jog(
        self,
        twist: tuple[float, float, float, float, float, float] | None = None,
        joint_velocities: list[float] | None = None,
        frame: Literal["world", "base", "tool", "user"] = "world",
        valid_for: float = 0.2,
        end_effector_id: str | None = None,
    ) -> None:
        """Move with a velocity that expires `valid_for` s from now. Raise OutOfRange, or errors of moves."""
        check_end_effector(self.name, end_effector_id or TCP)
        self._jog.move(twist, joint_velocities, frame, valid_for)

    def tcp_speed(self, joint_velocities: list[float], end_effector_id: str | None = None) -> float:
        """Return the TCP speed for joint velocities (rad/s) now, m/s, by the nominal geometry."""
        check_end_effector(self.name, end_effector_id or TCP)
        tool = self._control.stated_tool
        return tcp_speed(self.model, self._observer.sample().q, joint_velocities, tool.tcp)

    def inverse_kinematics(
        self, end_effector_id: str, pose: Pose, start_joints: list[Joint] | None = None, avoid_collisions: bool = True
    ) -> list[Joint]:
        """Return joints for a pose in the world, nearest to `start_joints`, by the controller's calibration.

        Needs control. Raise KinematicsException if there are none, or, with `avoid_collisions`, if all collide.
        """
        check_end_effector(self.name, end_effector_id)
        near = self._arm.joint_values(start_joints) if start_joints else list(self._observer.sample().q)
        return self._safe.inverse(pose, near, avoid_collisions)

    def forward_kinematics(self, end_effector_id: str, joints: list[Joint]) -> Pose:
        """Return the TCP in the world for joints, by the controller's calibration. Needs control."""
        check_end_effector(self.name, end_effector_id)
        q, tcp = self._arm.joint_values(joints), to_vector(self._control.stated_tool.tcp)
        vector = self._control.current().ask("forward kinematics", "getForwardKinematics", q, tcp)
        return self._arm.base * from_vector(vector)

    # -------------------------------------------------------------------------------- tool and hand teaching
    def set_tool(self, tcp: Pose, mass: float, cog: Vector3, inertia: tuple[float, ...] | None = None) -> None:
        """Set the tool.

        Args:
            tcp: TCP in the flange.
            mass: Mass, kg.
            cog: Center of gravity in the flange, m.
            inertia: Ixx, Iyy, Izz, Ixy, Ixz, Iyz about the center of gravity, kg m²; needs controller 5.10.
        """
        with self._motion.exclusive():
            self._control.set_tool(tcp, mass, cog, inertia)

    def get_hand_teaching_mode(self) -> bool:
        """Return whether the arm can be moved by hand."""
        return self._control.teaching and self._control.ours

    def set_hand_teaching_mode(self, enabled: bool) -> None:
        """Enable or disable moving the arm by hand. Raise Refused while moving, or if the payload is not set."""
        if enabled and self.move_in_progress:
            raise Refused("{name} is moving already. Wait until the motion ends, or stop it.", name=self.name)
        self._control.set_teaching(enabled)
