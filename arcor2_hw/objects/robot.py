"""Robot and MultiArmRobot: the methods of the protocol, and ours beside them."""

import abc
import threading
from collections.abc import Callable
from typing import ClassVar, Literal

from arcor2_hw.data.geometry import Pose
from arcor2_hw.data.robot import Joint, KinematicCalibration, MoveResult, RobotState, RobotType
from arcor2_hw.exceptions import Arcor2NotImplemented, DeviceError, KinematicsError, Refused
from arcor2_hw.objects.generic import GenericWithPose
from arcor2_hw.objects.settings import Settings
from arcor2_hw.objects.surroundings import HeldPart, Nothing, Surroundings


class RobotException(DeviceError):
    """Something is wrong with a robot."""

    code = "robot"


class Robot(GenericWithPose):
    """A robot with one arm.

    Poses of end effectors are in the world, joint values in rad (m where prismatic), `speed` is 0..1 of the configured
    maxima. A method whose body only raises Arcor2NotImplemented counts as not there.
    """

    category: ClassVar[str] = "Robots"
    icon: ClassVar[str] = "robot"
    robot_type: ClassVar[RobotType] = RobotType.ARTICULATED
    urdf_package_name: ClassVar[str | None] = None

    class KinematicsException(KinematicsError):
        """There are no joints for the pose, or the numbers make no sense for this robot."""

    def __init__(self, obj_id: str, name: str, pose: Pose, settings: Settings | None = None) -> None:
        super().__init__(obj_id, name, pose, settings)
        self._move_lock = threading.Lock()

    def surround(self, surroundings: Surroundings) -> None:
        """Take what tells of the things around the robot; called once, between `__init__` and `connect`.

        Control of nothing is taken then: what takes time to be read, such as a model, is read here.
        """
        self._around = surroundings

    @property
    def surroundings(self) -> Surroundings:
        """Give what tells of the things around the robot: of nothing, where nobody told of any."""
        return self.__dict__.get("_around") or Nothing()

    # -------------------------------------------------------------------------------- held parts
    @property
    def parts(self) -> dict[str, HeldPart]:
        """Return the parts that the robot holds, by name."""
        return dict(self.__dict__.get("_parts", {}))

    def hold_part(self, part: HeldPart) -> None:
        """Attach a part to the robot, in place of one of that name; safe moves keep it clear of obstacles."""
        self._parts = self.parts | {part.name: part}
        self._notify_parts()

    def drop_part(self, name: str) -> HeldPart | None:
        """Detach a part and return it; None when the robot does not hold it."""
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
        """Tell whether a motion that we commanded is under way."""
        return self._move_lock.locked()

    def check_if_ready_to_move(self) -> None:
        """Raise what keeps the robot from moving now; return when nothing does."""
        if self.move_in_progress:
            raise Refused(f"{self.name} is moving already")

    def move_to_calibration_pose(self) -> None:
        """Go where a camera sees the robot well."""
        raise Arcor2NotImplemented("move_to_calibration_pose")

    # -------------------------------------------------------------------------------- mandatory
    @abc.abstractmethod
    def get_end_effectors_ids(self) -> set[str]:
        """Give the names of the end effectors."""

    @abc.abstractmethod
    def get_end_effector_pose(self, end_effector: str) -> Pose:
        """Give the pose of an end effector in the world; Stale when none is fresh."""

    @abc.abstractmethod
    def robot_joints(self, include_gripper: bool = False) -> list[Joint]:
        """Give the present joint values; Stale when none are fresh."""

    @abc.abstractmethod
    def grippers(self) -> set[str]:
        """Give the names of the grippers."""

    @abc.abstractmethod
    def suctions(self) -> set[str]:
        """Give the names of the suction cups."""

    # -------------------------------------------------------------------------------- optional, of the protocol
    def move_to_pose(
        self, end_effector_id: str, target_pose: Pose, speed: float, safe: bool = True, linear: bool = True
    ) -> None:
        """Move an end effector to a pose in the world."""
        raise Arcor2NotImplemented("move_to_pose")

    def move_to_joints(self, target_joints: list[Joint], speed: float, safe: bool = True) -> None:
        """Move to joint values."""
        raise Arcor2NotImplemented("move_to_joints")

    def stop(self) -> None:
        """Stop at once, functionally: no safety function. Called past whatever else is going on."""
        raise Arcor2NotImplemented("stop")

    def inverse_kinematics(
        self,
        end_effector_id: str,
        pose: Pose,
        start_joints: list[Joint] | None = None,
        avoid_collisions: bool = True,
    ) -> list[Joint]:
        """Give joints that reach a pose in the world, nearest to `start_joints`; KinematicsException if none do."""
        raise Arcor2NotImplemented("inverse_kinematics")

    def forward_kinematics(self, end_effector_id: str, joints: list[Joint]) -> Pose:
        """Give the pose in the world that joints lead to."""
        raise Arcor2NotImplemented("forward_kinematics")

    def get_hand_teaching_mode(self) -> bool:
        """Tell whether the arm can be moved by hand."""
        raise Arcor2NotImplemented("get_hand_teaching_mode")

    def set_hand_teaching_mode(self, enabled: bool) -> None:
        """Make the arm movable by hand, or stiff again."""
        raise Arcor2NotImplemented("set_hand_teaching_mode")

    # -------------------------------------------------------------------------------- optional, ours
    def state(self) -> RobotState:
        """Give the whole state of the robot."""
        raise Arcor2NotImplemented("state")

    def move_path(
        self, waypoints: list[Pose], blend: float = 0.0, linear: bool = True, speed: float = 0.25
    ) -> MoveResult:
        """Move through poses in the world; `blend` is the radius in m."""
        raise Arcor2NotImplemented("move_path")

    def move_until_contact(
        self, direction: tuple[float, float, float], force: float, max_distance: float
    ) -> MoveResult:
        """Move along a direction of the world until the force (N) is met, at most `max_distance` m."""
        raise Arcor2NotImplemented("move_until_contact")

    def wrench(self) -> tuple[float, float, float, float, float, float]:
        """Give force (N) and torque (N m) at the tool."""
        raise Arcor2NotImplemented("wrench")

    def jog(
        self,
        twist: tuple[float, float, float, float, float, float] | None = None,
        joint_velocities: list[float] | None = None,
        frame: Literal["world", "base", "tool", "user"] = "world",
        valid_for: float = 0.2,
        end_effector_id: str | None = None,
    ) -> None:
        """Move with a velocity (m/s and rad/s, or rad/s per joint) that runs out by itself after `valid_for` s.

        Called again and again while it shall last, each time with what shall be from then on; gives back at once, and
        is neither a move in progress nor refused as one beside itself. `joint_velocities` are in the order of
        `robot_joints()`. `twist` is that of the end effector (None: the robot's only one), in the axes of `frame`;
        `user` is for drivers whose controller has such a frame. Who calls keeps the speed of the end effector at or
        below 0.25 m/s; where joints are given, by `tcp_speed`, or else by `forward_kinematics`. A type that has neither
        keeps it itself.
        """
        raise Arcor2NotImplemented("jog")

    def tcp_speed(self, joint_velocities: list[float], end_effector_id: str | None = None) -> float:
        """Give the speed of an end effector, m/s, that joint rates would give it now, at once and while it is jogged.

        For types that can be jogged and whose `forward_kinematics` asks the controller, which takes time.
        """
        raise Arcor2NotImplemented("tcp_speed")

    def joint_limits(self) -> dict[str, tuple[float, float]]:
        """Give lower and upper limit of each joint, rad."""
        raise Arcor2NotImplemented("joint_limits")

    def max_tcp_speed(self) -> float:
        """Give the configured maximum speed of the TCP, m/s."""
        raise Arcor2NotImplemented("max_tcp_speed")

    def kinematic_calibration(self) -> KinematicCalibration:
        """Ask the controller for the measured kinematics of the very arm at it."""
        raise Arcor2NotImplemented("kinematic_calibration")

    def set_tool(
        self, tcp: Pose, mass: float, cog: tuple[float, float, float], inertia: tuple[float, ...] | None = None
    ) -> None:
        """Tell the controller of its tool: TCP in the flange, mass kg, centre of gravity m, inertia kg m²."""
        raise Arcor2NotImplemented("set_tool")

    def power_on(self) -> None:
        """Switch drive power on; brakes stay closed."""
        raise Arcor2NotImplemented("power_on")

    def release_brakes(self) -> None:
        """Release the brakes; nothing moves."""
        raise Arcor2NotImplemented("release_brakes")

    def home(self) -> None:
        """Reference the axes."""
        raise Arcor2NotImplemented("home")

    def is_referenced(self) -> bool:
        """Tell whether the axes are referenced."""
        raise Arcor2NotImplemented("is_referenced")

    def acknowledge_protective_stop(self, confirmed_by: str) -> None:
        """Unlock a protective stop; `confirmed_by` is the person who looked. The old motion does not continue."""
        raise Arcor2NotImplemented("acknowledge_protective_stop")

    def restart_safety(self, confirmed_by: str) -> None:
        """Restart the safety system after a fault or violation; `confirmed_by` is the person who looked."""
        raise Arcor2NotImplemented("restart_safety")


class MultiArmRobot(Robot):
    """A robot with several arms: every method takes the arm's id as its last argument."""

    @abc.abstractmethod
    def get_arm_ids(self) -> set[str]:
        """Give the names of the arms."""

    @abc.abstractmethod
    def get_end_effectors_ids(self, arm_id: str | None = None) -> set[str]:
        """Give the names of the end effectors."""

    @abc.abstractmethod
    def get_end_effector_pose(self, end_effector: str, arm_id: str | None = None) -> Pose:
        """Give the pose of an end effector in the world."""

    @abc.abstractmethod
    def robot_joints(self, include_gripper: bool = False, arm_id: str | None = None) -> list[Joint]:
        """Give the present joint values, of all arms when none is named."""

    @abc.abstractmethod
    def grippers(self, arm_id: str | None = None) -> set[str]:
        """Give the names of the grippers."""

    @abc.abstractmethod
    def suctions(self, arm_id: str | None = None) -> set[str]:
        """Give the names of the suction cups."""

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
        """Stop at once: all arms when none is named."""
        raise Arcor2NotImplemented("stop")

    def inverse_kinematics(
        self,
        end_effector_id: str,
        pose: Pose,
        start_joints: list[Joint] | None = None,
        avoid_collisions: bool = True,
        arm_id: str | None = None,
    ) -> list[Joint]:
        """Give joints that reach a pose in the world."""
        raise Arcor2NotImplemented("inverse_kinematics")

    def forward_kinematics(self, end_effector_id: str, joints: list[Joint], arm_id: str | None = None) -> Pose:
        """Give the pose in the world that joints lead to."""
        raise Arcor2NotImplemented("forward_kinematics")

    def get_hand_teaching_mode(self, arm_id: str | None = None) -> bool:
        """Tell whether an arm can be moved by hand."""
        raise Arcor2NotImplemented("get_hand_teaching_mode")

    def set_hand_teaching_mode(self, enabled: bool, arm_id: str | None = None) -> None:
        """Make an arm movable by hand, or stiff again."""
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
        """Move one arm with a velocity that runs out by itself."""
        raise Arcor2NotImplemented("jog")

    def joint_limits(self, arm_id: str | None = None) -> dict[str, tuple[float, float]]:
        """Give lower and upper limit of each joint of an arm, rad; of all arms when none is named."""
        raise Arcor2NotImplemented("joint_limits")

    def tcp_speed(
        self, joint_velocities: list[float], end_effector_id: str | None = None, arm_id: str | None = None
    ) -> float:
        """Give the speed of an end effector, m/s, that joint rates of its arm would give it now."""
        raise Arcor2NotImplemented("tcp_speed")

    def move_synchronously(self, targets: dict[str, Pose | list[Joint]], speed: float = 0.25) -> dict[str, MoveResult]:
        """Move several arms so that they start and arrive together; keys are arm ids."""
        raise Arcor2NotImplemented("move_synchronously")
