"""Robot and MultiArmRobot: the methods of the protocol, and our optional ones."""

import abc
import threading
from collections.abc import Callable
from typing import ClassVar, Literal

from arcor2_hw.data.geometry import Pose
from arcor2_hw.data.robot import Joint, KinematicCalibration, MoveResult, RobotState, RobotType
from arcor2_hw.exceptions import Arcor2NotImplemented, DeviceError, KinematicsError, Refused
from arcor2_hw.objects.generic import GenericWithPose
from arcor2_hw.objects.settings import Settings
from arcor2_hw.objects.surroundings import EmptySurroundings, HeldPart, Surroundings


class RobotException(DeviceError):
    """An error of a robot."""

    code = "robot"


class Robot(GenericWithPose):
    """A robot with one arm.

    Poses of end effectors are in the world, joint values in rad (prismatic: m). `speed` is a fraction of the configured
    maximum. A method whose body only raises Arcor2NotImplemented counts as not implemented.
    """

    category: ClassVar[str] = "Robots"
    icon: ClassVar[str] = "robot"
    robot_type: ClassVar[RobotType] = RobotType.ARTICULATED
    urdf_package_name: ClassVar[str | None] = None

    class KinematicsException(KinematicsError):
        """No joint values reach the pose, or a value is invalid for this robot."""

    def __init__(self, obj_id: str, name: str, pose: Pose, settings: Settings | None = None) -> None:
        super().__init__(obj_id, name, pose, settings)
        self._move_lock = threading.Lock()

    def surround(self, surroundings: Surroundings) -> None:
        """Receive the surroundings of the robot; called once between `__init__` and `connect`.

        An override may load a model here, which takes time, because no device is controlled yet.
        """
        self._around = surroundings

    @property
    def surroundings(self) -> Surroundings:
        """Return the surroundings of the robot; empty if none were set."""
        return self.__dict__.get("_around") or EmptySurroundings()

    # -------------------------------------------------------------------------------- held parts
    @property
    def parts(self) -> dict[str, HeldPart]:
        """Return the parts that the robot holds, by name."""
        return dict(self.__dict__.get("_parts", {}))

    def hold_part(self, part: HeldPart) -> None:
        """Attach a part to the robot, replacing one of the same name. Safe moves keep it clear of obstacles."""
        self._parts = self.parts | {part.name: part}
        self._notify_parts()

    def drop_part(self, name: str) -> HeldPart | None:
        """Detach a part and return it, or return None if the robot does not hold it."""
        parts = self.parts
        part = parts.pop(name, None)
        if part is not None:
            self._parts = parts
            self._notify_parts()
        return part

    def on_parts_changed(self, listener: Callable[[], None]) -> None:
        """Call `listener`, on any thread, whenever the held parts change."""
        self._parts_listener = listener

    def _notify_parts(self) -> None:
        listener: Callable[[], None] | None = self.__dict__.get("_parts_listener")
        if listener is not None:
            listener()

    @property
    def move_in_progress(self) -> bool:
        """Return whether a motion commanded by this driver is in progress."""
        return self._move_lock.locked()

    def check_if_ready_to_move(self) -> None:
        """Require that the robot can move now.

        Raises:
            Refused: It is moving already.
            NotConnected: It is not connected.
        """
        if self.move_in_progress:
            raise Refused("{name} is moving already. Wait until the motion ends, or stop it.", name=self.name)

    def move_to_calibration_pose(self) -> None:
        """Move to a pose in which a camera sees most of the robot."""
        raise Arcor2NotImplemented("move_to_calibration_pose")

    # -------------------------------------------------------------------------------- mandatory
    @abc.abstractmethod
    def get_end_effectors_ids(self) -> set[str]:
        """Return the names of the end effectors."""

    @abc.abstractmethod
    def get_end_effector_pose(self, end_effector: str) -> Pose:
        """Return the pose of an end effector in the world.

        Raises:
            Stale: No recent value is known.
        """

    @abc.abstractmethod
    def robot_joints(self, include_gripper: bool = False) -> list[Joint]:
        """Return the present joint values.

        Raises:
            Stale: No recent values are known.
        """

    @abc.abstractmethod
    def grippers(self) -> set[str]:
        """Return the names of the grippers."""

    @abc.abstractmethod
    def suctions(self) -> set[str]:
        """Return the names of the suction cups."""

    # -------------------------------------------------------------------------------- optional, in the protocol
    def move_to_pose(
        self, end_effector_id: str, target_pose: Pose, speed: float, safe: bool = True, linear: bool = True
    ) -> None:
        """Move an end effector to a pose in the world."""
        raise Arcor2NotImplemented("move_to_pose")

    def move_to_joints(self, target_joints: list[Joint], speed: float, safe: bool = True) -> None:
        """Move to joint values."""
        raise Arcor2NotImplemented("move_to_joints")

    def stop(self) -> None:
        """Stop the motion at once.

        This is a functional stop, not a safety function; it may be called during any other call.
        """
        raise Arcor2NotImplemented("stop")

    def inverse_kinematics(
        self, end_effector_id: str, pose: Pose, start_joints: list[Joint] | None = None, avoid_collisions: bool = True
    ) -> list[Joint]:
        """Compute joint values that reach a pose in the world, nearest to `start_joints`.

        Raises:
            KinematicsException: The pose cannot be reached.
        """
        raise Arcor2NotImplemented("inverse_kinematics")

    def forward_kinematics(self, end_effector_id: str, joints: list[Joint]) -> Pose:
        """Compute the pose in the world for joint values."""
        raise Arcor2NotImplemented("forward_kinematics")

    def get_hand_teaching_mode(self) -> bool:
        """Return whether the arm can be moved by hand."""
        raise Arcor2NotImplemented("get_hand_teaching_mode")

    def set_hand_teaching_mode(self, enabled: bool) -> None:
        """Enable or disable moving the arm by hand."""
        raise Arcor2NotImplemented("set_hand_teaching_mode")

    # -------------------------------------------------------------------------------- optional, additional
    def state(self) -> RobotState:
        """Return the complete state of the robot."""
        raise Arcor2NotImplemented("state")

    def move_path(
        self, waypoints: list[Pose], blend: float = 0.0, linear: bool = True, speed: float = 0.25
    ) -> MoveResult:
        """Move through poses in the world.

        Args:
            waypoints: The poses.
            blend: Blend radius, m.
            linear: Whether the end effector moves in straight lines.
            speed: Fraction of the maximum speed.
        """
        raise Arcor2NotImplemented("move_path")

    def move_until_contact(
        self, direction: tuple[float, float, float], force: float, max_distance: float
    ) -> MoveResult:
        """Move along a direction of the world until contact.

        Args:
            direction: Direction.
            force: Contact force, N.
            max_distance: Maximum distance, m.
        """
        raise Arcor2NotImplemented("move_until_contact")

    def wrench(self) -> tuple[float, float, float, float, float, float]:
        """Return force (N) and torque (N m) at the tool."""
        raise Arcor2NotImplemented("wrench")

    def jog(
        self,
        twist: tuple[float, float, float, float, float, float] | None = None,
        joint_velocities: list[float] | None = None,
        frame: Literal["world", "base", "tool", "user"] = "world",
        valid_for: float = 0.2,
        end_effector_id: str | None = None,
    ) -> None:
        """Start to move with a velocity, which ends by itself after `valid_for`, and return at once.

        It is called repeatedly during the motion, each time with the velocity from then on. It is not a move in
        progress, and is not refused because of itself. The caller keeps the speed of the end effector at or below 0.25
        m/s; for joint velocities by `tcp_speed` or `forward_kinematics`. A type that has neither limits the speed
        itself.

        Args:
            twist: Velocity of the end effector in the axes of `frame`, m/s and rad/s.
            joint_velocities: Joint velocities in the order of `robot_joints()`, rad/s or m/s.
            frame: Frame of the twist; `user` is for controllers that have such a frame.
            valid_for: Duration, s.
            end_effector_id: The end effector; None: the only one.
        """
        raise Arcor2NotImplemented("jog")

    def tcp_speed(self, joint_velocities: list[float], end_effector_id: str | None = None) -> float:
        """Return the present speed of an end effector for joint velocities, m/s.

        It returns at once, also during jogging.

        Implement it if the robot can be jogged and its `forward_kinematics` queries the controller, which takes time.
        """
        raise Arcor2NotImplemented("tcp_speed")

    def joint_limits(self) -> dict[str, tuple[float, float]]:
        """Return the lower and upper limit of each joint, rad."""
        raise Arcor2NotImplemented("joint_limits")

    def max_tcp_speed(self) -> float:
        """Return the configured maximum speed of the TCP, m/s."""
        raise Arcor2NotImplemented("max_tcp_speed")

    def kinematic_calibration(self) -> KinematicCalibration:
        """Read the calibrated kinematics of this robot from its controller."""
        raise Arcor2NotImplemented("kinematic_calibration")

    def set_tool(
        self, tcp: Pose, mass: float, cog: tuple[float, float, float], inertia: tuple[float, ...] | None = None
    ) -> None:
        """Set the tool in the controller.

        Args:
            tcp: Tool centre point in the frame of the flange.
            mass: Mass, kg.
            cog: Centre of gravity, m.
            inertia: Inertia, kg m².
        """
        raise Arcor2NotImplemented("set_tool")

    def power_on(self) -> None:
        """Switch the drives on. The brakes remain closed."""
        raise Arcor2NotImplemented("power_on")

    def release_brakes(self) -> None:
        """Release the brakes without moving."""
        raise Arcor2NotImplemented("release_brakes")

    def home(self) -> None:
        """Move the axes to their references."""
        raise Arcor2NotImplemented("home")

    def is_referenced(self) -> bool:
        """Return whether the axes are referenced."""
        raise Arcor2NotImplemented("is_referenced")

    def acknowledge_protective_stop(self, confirmed_by: str) -> None:
        """Unlock a protective stop. The interrupted motion does not continue.

        Args:
            confirmed_by: The person who inspected the robot.
        """
        raise Arcor2NotImplemented("acknowledge_protective_stop")

    def restart_safety(self, confirmed_by: str) -> None:
        """Restart the safety system after a fault or violation.

        Args:
            confirmed_by: The person who inspected the robot.
        """
        raise Arcor2NotImplemented("restart_safety")


class MultiArmRobot(Robot):
    """A robot with several arms. The last argument of every method is the id of an arm."""

    @abc.abstractmethod
    def get_arm_ids(self) -> set[str]:
        """Return the ids of the arms."""

    @abc.abstractmethod
    def get_end_effectors_ids(self, arm_id: str | None = None) -> set[str]:
        """Return the names of the end effectors."""

    @abc.abstractmethod
    def get_end_effector_pose(self, end_effector: str, arm_id: str | None = None) -> Pose:
        """Return the pose of an end effector in the world."""

    @abc.abstractmethod
    def robot_joints(self, include_gripper: bool = False, arm_id: str | None = None) -> list[Joint]:
        """Return the present joint values; of all arms without `arm_id`."""

    @abc.abstractmethod
    def grippers(self, arm_id: str | None = None) -> set[str]:
        """Return the names of the grippers."""

    @abc.abstractmethod
    def suctions(self, arm_id: str | None = None) -> set[str]:
        """Return the names of the suction cups."""

    def move_to_pose(
        self,
        end_effector_id: str,
        target_pose: Pose,
        speed: float,
        safe: bool = True,
        linear: bool = True,
        arm_id: str | None = None,
    ) -> None:
        """Move an end effector to a pose in the world."""
        raise Arcor2NotImplemented("move_to_pose")

    def move_to_joints(
        self, target_joints: list[Joint], speed: float, safe: bool = True, arm_id: str | None = None
    ) -> None:
        """Move to joint values."""
        raise Arcor2NotImplemented("move_to_joints")

    def stop(self, arm_id: str | None = None) -> None:
        """Stop at once; all arms without `arm_id`."""
        raise Arcor2NotImplemented("stop")

    def inverse_kinematics(
        self,
        end_effector_id: str,
        pose: Pose,
        start_joints: list[Joint] | None = None,
        avoid_collisions: bool = True,
        arm_id: str | None = None,
    ) -> list[Joint]:
        """Compute joint values that reach a pose in the world."""
        raise Arcor2NotImplemented("inverse_kinematics")

    def forward_kinematics(self, end_effector_id: str, joints: list[Joint], arm_id: str | None = None) -> Pose:
        """Compute the pose in the world for joint values."""
        raise Arcor2NotImplemented("forward_kinematics")

    def get_hand_teaching_mode(self, arm_id: str | None = None) -> bool:
        """Return whether an arm can be moved by hand."""
        raise Arcor2NotImplemented("get_hand_teaching_mode")

    def set_hand_teaching_mode(self, enabled: bool, arm_id: str | None = None) -> None:
        """Enable or disable moving an arm by hand."""
        raise Arcor2NotImplemented("set_hand_teaching_mode")

    def jog(
        self,
        twist: tuple[float, float, float, float, float, float] | None = None,
        joint_velocities: list[float] | None = None,
        frame: Literal["world", "base", "tool", "user"] = "world",
        valid_for: float = 0.2,
        end_effector_id: str | None = None,
        arm_id: str | None = None,
    ) -> None:
        """Move one arm with a velocity that ends by itself."""
        raise Arcor2NotImplemented("jog")

    def joint_limits(self, arm_id: str | None = None) -> dict[str, tuple[float, float]]:
        """Return the lower and upper limit of each joint of an arm, rad; of all arms without `arm_id`."""
        raise Arcor2NotImplemented("joint_limits")

    def tcp_speed(
        self, joint_velocities: list[float], end_effector_id: str | None = None, arm_id: str | None = None
    ) -> float:
        """Return the present speed of an end effector for joint velocities of its arm, m/s."""
        raise Arcor2NotImplemented("tcp_speed")

    def move_synchronously(self, targets: dict[str, Pose | list[Joint]], speed: float = 0.25) -> dict[str, MoveResult]:
        """Move several arms so that they start and arrive together; keys are arm ids."""
        raise Arcor2NotImplemented("move_synchronously")
