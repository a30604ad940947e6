"""YuMi: the object type of ABB's two-arm robot, composed of observer, control, kinematics and motion."""

from typing import ClassVar, Final

import numpy as np

from arcor2_hw.actions import StrEnum, action
from arcor2_hw.data.device import Alarm, Health, Identity, LossReaction
from arcor2_hw.data.geometry import Pose
from arcor2_hw.data.project import ProjectRobotJoints
from arcor2_hw.data.robot import Control as ControlMode, Joint, MoveResult, RobotState, RobotType, Safety
from arcor2_hw.exceptions import Refused
from arcor2_hw.keep_alive import FROZEN_AFTER
from arcor2_hw.objects import MultiArmRobot
from arcor2_hw.objects.arm import (
    TCP,
    SafetyAlarm,
    check_confirmed,
    check_end_effector,
    named_joints,
    refuse_acknowledgement,
)
from arcor2_hw.objects.connected import Connected
from arcor2_hw.objects.generic import DEFAULT_CONNECT_TIMEOUT

from .arms import JOINT_LIMITS, JOINTS, Arms, other_arm
from .control import Control, log
from .hands import ArmId as ArmId, Hands
from .kinematics import Kinematics
from .motion import Motion
from .observer import Observer
from .settings import ARMS, MAX_WATCHDOG_PERIOD, YumiSettings
from .states import AUTOMATIC, REMEDIES, mode_of, power_of

BRAKING_TIME: Final = 0.2
"""Time to brake from full speed, s."""


class MoveType(StrEnum):
    """Path of the TCP to its target."""

    LINEAR = "linear"
    JOINT = "joint"


class YuMi(Hands, Connected, MultiArmRobot):
    """ABB YuMi (IRB 14000): two arms of seven axes, 0.5 kg each, 559 mm."""

    _ABSTRACT = False
    display_name = "ABB YuMi"
    robot_type = RobotType.ARTICULATED
    loss_reaction: ClassVar[LossReaction] = LossReaction.stops_within(FROZEN_AFTER + MAX_WATCHDOG_PERIOD + BRAKING_TIME)
    CANCEL_MAPPING: ClassVar[dict[str, str]] = {"move": "stop", "move_to": "stop", "move_both": "stop"}

    def __init__(self, obj_id: str, name: str, pose: Pose, settings: YumiSettings) -> None:
        super().__init__(obj_id, name, pose, settings)
        self._yumi = settings
        self._arms = Arms(self, settings)
        self._observer = Observer(name, settings)
        self._control = Control(self._arms, self._observer)
        self._kinematics = Kinematics(self._arms, self._observer)
        self._motion = Motion(self._arms, self._observer, self._control, self._kinematics)
        self._safety_alarm = SafetyAlarm(REMEDIES)
        self.keep_connection(self._observer.who, self._observer.observing)

    # -------------------------------------------------------------------------------- connection and control
    def connect(self, timeout: float = DEFAULT_CONNECT_TIMEOUT) -> None:
        """Observe the controller; a program continues to run.

        Raises:
            DeviceError: NotConnected, DeviceTimeout, ConnectionLost, or Refused for another RobotWare.
        """
        if not self._observer.observing.online:
            self._observer.connect(timeout)

    def disconnect(self) -> None:
        """Release control and close the connections."""
        self._control.disconnect()
        self._observer.disconnect()

    def condition(self) -> Health:
        """Return the condition of the robot."""
        safety = self._safety() if self._observer.observing.online else Safety.NORMAL
        if safety is Safety.FAULT:
            return Health.FAILURE
        return Health.NORMAL if safety is Safety.NORMAL else Health.CHECK_FUNCTION

    def identify(self) -> Identity:
        """Return the serial number and version of the controller."""
        self._observer.observing.check()
        states = self._observer.rws.get("/ctrl/identity")
        serial = states[0].get("ctrl-id", "") if states else ""
        return Identity("ABB", "IRB 14000 YuMi", serial, f"RobotWare {self._observer.version}")

    def take_control(self) -> None:
        """Take control of both arms, unless we have it. Raise NotInControl, SafetyStop or Refused."""
        self._control.take()

    def release_control(self) -> None:
        """Stop both arms and release control, if we have it. Motors and motion servers stay on."""
        self._control.release()

    def control_owner(self) -> str | None:
        """Return "us", "pendant", the holder of mastership, the RAPID program that runs, or None."""
        return self._control.owner()

    # -------------------------------------------------------------------------------- state
    def state(self) -> RobotState:
        """Return the state of the robot. Raise NotConnected, ConnectionLost or Stale."""
        sample, panel = self._observer.sample(), self._observer.panel()
        return RobotState(
            mode_of(panel.operation_mode),
            power_of(sample.control_state),
            self._control.safety(sample),
            self._control.program_state(sample, panel),
            ControlMode.REMOTE if panel.operation_mode == AUTOMATIC else ControlMode.LOCAL,
            sample.moving or self.move_in_progress,
            panel.speed_ratio,
            self._control.obstacles(sample, panel),
        )

    def get_arm_ids(self) -> set[str]:
        """Return left and right, as seen by the robot."""
        return set(ARMS)

    def get_end_effectors_ids(self, arm_id: str | None = None) -> set[str]:
        """Return the only end effector of each arm, its TCP."""
        self._arms.some(arm_id)
        return {TCP}

    def get_end_effector_pose(self, end_effector: str, arm_id: str | None = None) -> Pose:
        """Return the TCP of an arm in the world. Raise NotFound, NotConnected, ConnectionLost or Stale."""
        check_end_effector(self.name, end_effector)
        arm = self._arms.one(arm_id)
        return self._arms.tcp(self._observer.sample(), arm)

    def robot_joints(self, include_gripper: bool = False, arm_id: str | None = None) -> list[Joint]:
        """Return the joint values, of both arms if none is named."""
        arms, sample = self._arms.some(arm_id), self._observer.sample()
        return [joint for arm in arms for joint in named_joints(JOINTS[arm], sample.joints[arm])]

    def grippers(self, arm_id: str | None = None) -> set[str]:
        """Return `gripper` if an arm has fingers."""
        return {"gripper"} if any(getattr(self._yumi, f"{arm}_gripper") for arm in self._arms.some(arm_id)) else set()

    def suctions(self, arm_id: str | None = None) -> set[str]:
        """Return `suction` if an arm has a suction cup."""
        return {"suction"} if any(getattr(self._yumi, f"{arm}_suction") for arm in self._arms.some(arm_id)) else set()

    def joint_limits(self, arm_id: str | None = None) -> dict[str, tuple[float, float]]:
        """Return the ranges of the axes as delivered, rad; the controller's configuration may be narrower."""
        return {name: limits for arm in self._arms.some(arm_id) for name, limits in JOINT_LIMITS[arm].items()}

    def max_tcp_speed(self) -> float:
        """Return the configured maximum of the TCP speed, m/s."""
        return self._yumi.max_tcp_speed

    # -------------------------------------------------------------------------------- motion
    @property
    def move_in_progress(self) -> bool:
        """Return whether an arm executes a motion of ours."""
        return self._motion.in_progress()

    @property
    def last_moves(self) -> dict[str, MoveResult]:
        """Return the result of the last motion of each arm."""
        return self._motion.last

    def check_if_ready_to_move(self, arm_id: str | None = None) -> None:
        """Raise the reason why an arm cannot move; without an id, of either arm."""
        self._motion.check_ready(self._arms.some(arm_id))

    def move_to_pose(
        self,
        end_effector_id: str,
        target_pose: Pose,
        speed: float,
        safe: bool = True,
        linear: bool = True,
        arm_id: str | None = None,
    ) -> None:
        """Move the TCP of an arm to a pose in the world, in a line or with all axes together.

        The arm keeps clear of the other one, with and without `safe`. This driver avoids no other obstacles.

        Raises:
            KinematicsException: The pose cannot be reached.
            DeviceError: OutOfRange, Refused, NotInControl, SafetyStop, Cancelled or DeviceTimeout.
        """
        check_end_effector(self.name, end_effector_id)
        arm = self._arms.one(arm_id)
        self._motion.to_pose(arm, target_pose, linear, speed, self._control.stops[arm].guard())

    def move_to_joints(
        self, target_joints: list[Joint], speed: float, safe: bool = True, arm_id: str | None = None
    ) -> None:
        """Move an arm to joint values, all axes together; it keeps clear of the other one."""
        self._to_joints(self._arms.one(arm_id), target_joints, speed)

    def _to_joints(self, arm: str, joints: list[Joint], speed: float) -> None:
        guard = self._control.stops[arm].guard()
        self._motion.to_joints(arm, self._arms.joint_values(joints, arm), speed, guard)

    def move_path(
        self,
        waypoints: list[Pose],
        blend: float = 0.0,
        linear: bool = True,
        speed: float = 0.25,
        arm_id: str | None = None,
    ) -> MoveResult:
        """Move the TCP of an arm in lines through poses in the world; `blend` is the corner radius, m, up to 0.2."""
        arm = self._arms.one(arm_id)
        if not linear:
            raise Refused("{name} moves along paths in lines only. Set linear to true.", name=self.name)
        return self._motion.along(arm, waypoints, blend, speed, self._control.stops[arm].guard())

    def move_synchronously(self, targets: dict[str, Pose | list[Joint]], speed: float = 0.25) -> dict[str, MoveResult]:
        """Move both arms, all axes together, so that they start and arrive together; when one stops, both do.

        Args:
            targets: Pose in the world, or joints, by arm id.
            speed: Fraction of the maximum.
        """
        return self._motion.synchronously(targets, speed)

    def stop(self, arm_id: str | None = None) -> None:
        """Stop an arm, or both, and wait for standstill. This is not a safety function.

        An arm that moves together with the other one stops it, too. Raise NotInControl or DeviceTimeout.
        """
        self._motion.stop(self._arms.some(arm_id))

    def inverse_kinematics(
        self,
        end_effector_id: str,
        pose: Pose,
        start_joints: list[Joint] | None = None,
        avoid_collisions: bool = True,
        arm_id: str | None = None,
    ) -> list[Joint]:
        """Return joints of an arm for a pose in the world, near `start_joints` or the present ones. Needs control.

        With `avoid_collisions`, joints too close to the other arm are refused. Raise KinematicsException or Refused.
        """
        check_end_effector(self.name, end_effector_id)
        arm = self._arms.one(arm_id)
        seed = self._arms.joint_values(start_joints, arm) if start_joints else None
        with self._kinematics.staging[arm]:
            joints, _ = self._kinematics.solve(self._control.current(), arm, pose, seed)
        if avoid_collisions:
            other = self._kinematics.present(other_arm(arm))
            self._motion.clearance.check_joints(arm, np.array(joints), other)
        return named_joints(JOINTS[arm], joints)

    def forward_kinematics(self, end_effector_id: str, joints: list[Joint], arm_id: str | None = None) -> Pose:
        """Return the TCP of an arm in the world for joints, by the controller's calibration. Needs control."""
        check_end_effector(self.name, end_effector_id)
        arm = self._arms.one(arm_id)
        values = self._arms.joint_values(joints, arm)
        return self._kinematics.forward(self._control.current(), arm, values)

    # -------------------------------------------------------------------------------- tool, teaching, power, safety
    def set_tool(
        self,
        tcp: Pose,
        mass: float,
        cog: tuple[float, float, float],
        inertia: tuple[float, ...] | None = None,
        arm_id: str | None = None,
    ) -> None:
        """Set the tool of an arm: TCP in the flange, mass in kg, center of gravity in m; without inertia."""
        self._control.set_tool(self._arms.one(arm_id), tcp, mass, cog, inertia)

    def get_hand_teaching_mode(self, arm_id: str | None = None) -> bool:
        """Return whether an arm can be moved by hand."""
        return self._control.teaching(self._arms.one(arm_id))

    def set_hand_teaching_mode(self, enabled: bool, arm_id: str | None = None) -> None:
        """Enable or disable moving an arm by hand. Raise Refused while an arm moves, or without lead-through."""
        self._control.set_teaching(self._arms.one(arm_id), enabled, self.move_in_progress)

    def power_on(self) -> None:
        """Switch the motors on; the arms do not move. Raise NotInControl in manual mode, SafetyStop or Refused."""
        self._control.power_on()

    def _safety(self) -> Safety:
        newest = self._observer.newest()
        return self._control.safety(newest) if newest is not None else Safety.NORMAL

    def alarms(self) -> list[Alarm]:
        """Return the active safety stop, if any."""
        return self._safety_alarm.alarms(self._safety())

    def acknowledge(self, code: str) -> None:
        """Raise Refused: only a named person can acknowledge a safety stop. Raise NotFound for an inactive alarm."""
        action = "acknowledge_protective_stop" if code == Safety.PROTECTIVE_STOP.value else ""
        refuse_acknowledgement(self.name, code, self.alarms(), action)

    def acknowledge_protective_stop(self, confirmed_by: str) -> None:
        """Acknowledge a collision, so that control can be taken again; the old motion does not continue."""
        check_confirmed(confirmed_by)
        if self._control.safety(self._observer.sample()) is not Safety.PROTECTIVE_STOP:
            raise Refused("{name} has no protective stop.", name=self.name)
        self._control.collision_acknowledged = True
        log.warning("%s: collision acknowledged by %s", self.name, confirmed_by)

    # -------------------------------------------------------------------------------- actions
    @action
    def move(
        self,
        pose: Pose,
        arm: ArmId = ArmId.LEFT,
        move_type: MoveType = MoveType.LINEAR,
        speed: float = 0.25,
        *,
        an: str | None = None,
    ) -> None:
        """Move the TCP of an arm to a pose. The arm keeps clear of the other one.

        :param pose: target
        :param arm: which arm
        :param move_type: in a line, or all axes together
        :param speed: fraction of the configured maximum
        """
        assert 0.01 <= speed <= 1.0
        linear = move_type is MoveType.LINEAR
        self._motion.to_pose(arm.value, pose, linear, speed, self._control.stops[arm.value].guard())

    @action
    def move_to(
        self, joints: ProjectRobotJoints, arm: ArmId = ArmId.LEFT, speed: float = 0.25, *, an: str | None = None
    ) -> None:
        """Move an arm to stored joint values, all axes together. The arm keeps clear of the other one.

        :param joints: target
        :param arm: which arm the joints belong to
        :param speed: fraction of the configured maximum
        """
        assert 0.01 <= speed <= 1.0
        self._to_joints(arm.value, joints.joints, speed)

    @action
    def move_both(
        self, left: ProjectRobotJoints, right: ProjectRobotJoints, speed: float = 0.25, *, an: str | None = None
    ) -> None:
        """Move both arms to stored joint values. They start and arrive together.

        :param left: target of the left arm
        :param right: target of the right arm
        :param speed: fraction of the configured maximum
        """
        assert 0.01 <= speed <= 1.0
        self.move_synchronously({"left": left.joints, "right": right.joints}, speed)
