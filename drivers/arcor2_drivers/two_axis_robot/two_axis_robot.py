"""TwoAxisRobot: the object type of a planar arm, composed of observer, control and motion."""

from typing import ClassVar, Final, Literal

from arcor2_hw.actions import action
from arcor2_hw.data.device import Alarm, Health, Identity, LossReaction
from arcor2_hw.data.geometry import Pose
from arcor2_hw.data.maintenance import DeviceParameter, ParameterFailure
from arcor2_hw.data.project import ProjectRobotJoints
from arcor2_hw.data.robot import Control as ControlMode, Joint, Mode, Power, ProgramState, RobotState, RobotType, Safety
from arcor2_hw.exceptions import DeviceError, Refused
from arcor2_hw.keep_alive import FROZEN_AFTER
from arcor2_hw.objects.arm import TCP, check_end_effector, named_joints, refuse_acknowledgement
from arcor2_hw.objects.generic import DEFAULT_CONNECT_TIMEOUT
from arcor2_hw.objects.single_arm import SingleArm

from .control import Control
from .motion import JOINTS, Motion
from .observer import Observer
from .parameters import Parameters
from .settings import MAX_WATCHDOG_TIMEOUT, TwoAxisRobotSettings

MODELS: Final = {1020: "XM430-W350", 1030: "XM430-W210", 1120: "XM540-W270", 1130: "XM540-W150"}


class TwoAxisRobot(SingleArm):
    """A planar arm of two Dynamixel servos for fine manipulation."""

    _ABSTRACT = False
    display_name = "Two-axis robot"
    robot_type = RobotType.SCARA
    urdf_package_name = "two_axis_robot.zip"
    loss_reaction: ClassVar[LossReaction] = LossReaction.stops_within(FROZEN_AFTER + MAX_WATCHDOG_TIMEOUT + 0.1)
    CANCEL_MAPPING: ClassVar[dict[str, str]] = {"move": "stop", "move_to": "stop"}

    def __init__(self, obj_id: str, name: str, pose: Pose, settings: TwoAxisRobotSettings) -> None:
        super().__init__(obj_id, name, pose, settings)
        self._axes = settings
        self._observer = Observer(name, settings)
        self._control = Control(name, self._observer, settings)
        self._parameters = Parameters(name, self._observer, settings.ids)
        self._motion = Motion(self, self._observer, self._control, settings, self._move_lock)
        self._observer.on_lost = self.on_lost  # type: ignore[method-assign]
        self.safe_moves, self.motions = self._motion.safe, self._motion.log
        self.keep_connection(self._observer.who, self._observer.observing)

    # -------------------------------------------------------------------------------- connection and control
    def on_lost(self, error: DeviceError) -> None:
        """End control."""
        self._control.drop(f"the connection was lost: {error}")

    def connect(self, timeout: float = DEFAULT_CONNECT_TIMEOUT) -> None:
        """Observe the servos; torque is unchanged. Raise NotConnected, DeviceTimeout or ConnectionLost."""
        self._observer.connect(timeout)

    def disconnect(self) -> None:
        """Release control and close the port."""
        self._control.leave()
        self._observer.disconnect()

    def condition(self) -> Health:
        """Return failure while a servo has a hardware error."""
        newest = self._observer.newest()
        failed = newest is not None and any(servo.hardware_error for servo in newest.servos)
        return Health.FAILURE if failed else Health.NORMAL

    def identify(self) -> Identity:
        """Return models and firmware of the servos; they have no serial number."""
        self._observer.observing.check()
        setups = self._observer.setups
        model = " + ".join(MODELS.get(setup.model, f"model {setup.model}") for setup in setups)
        return Identity("ROBOTIS", model, "", " + ".join(str(setup.firmware) for setup in setups))

    def parameters_dump(self) -> list[DeviceParameter]:
        """Read the setup of both servos in their EEPROM areas, in the units of the servos."""
        return self._parameters.dump()

    def parameters_restore(self, parameters: list[DeviceParameter]) -> list[ParameterFailure]:
        """Write to the EEPROM areas of the servos. Raise Refused under torque, which locks them."""
        return self._parameters.restore(parameters)

    def alarms(self) -> list[Alarm]:
        """Return the active hardware errors, by servo and bit."""
        return self._control.alarms()

    def acknowledge(self, code: str) -> None:
        """Raise Refused: only a named person can acknowledge a hardware error. Raise NotFound for an inactive alarm."""
        refuse_acknowledgement(self.name, code, self.alarms(), "restart_safety")

    def take_control(self) -> None:
        """Take control, unless we have it; the arm does not move. Raise DeviceFault, NotInControl or Refused."""
        if not self._control.ours:
            self.safe_moves.prepare()  # before the watchdog is armed, because nothing signals it during the setup
        self._control.take()

    def release_control(self) -> None:
        """Stop and release control, if we have it. The joints hold, without a watchdog."""
        self._control.release()

    def control_owner(self) -> str | None:
        """Return "us" or None: no other client can use the port while we are connected."""
        return "us" if self._control.ours else None

    # -------------------------------------------------------------------------------- state
    def state(self) -> RobotState:
        """Return the state of the robot. Raise NotConnected, ConnectionLost or Stale."""
        state = self._observer.current().value
        missing = [alarm.text for alarm in self.alarms()]
        powered = all(servo.torque for servo in state.servos)
        if not self._control.ours:
            missing.append("control is not taken")
        elif not powered:
            missing.append("torque is off")
        return RobotState(
            mode=Mode.AUTOMATIC,
            power=Power.OPERATIONAL if powered else Power.OFF,
            safety=Safety.FAULT if any(servo.hardware_error for servo in state.servos) else Safety.NORMAL,
            program=ProgramState.STOPPED,
            control=ControlMode.REMOTE,
            moving=not state.standing,
            speed_override=1.0,
            not_ready_because=missing,
        )

    def robot_joints(self, include_gripper: bool = False) -> list[Joint]:
        """Return the angles, rad. Raise Stale."""
        return named_joints(JOINTS, self._motion.present())

    def get_end_effector_pose(self, end_effector: str) -> Pose:
        """Return the pose of the tool center point in the world. Raise Stale."""
        check_end_effector(self.name, end_effector)
        return self._motion.world(self._motion.present())

    def joint_limits(self) -> dict[str, tuple[float, float]]:
        """Return the limits of the settings, rad."""
        return dict(self._motion.limits)

    def max_tcp_speed(self) -> float:
        """Return the speed of the stretched arm with both joints at their maximum, m/s."""
        return self._axes.max_joint_speed * (self._axes.link_1 + 2.0 * self._axes.link_2)

    def forward_kinematics(self, end_effector_id: str, joints: list[Joint]) -> Pose:
        """Return the pose in the world for joints."""
        check_end_effector(self.name, end_effector_id)
        return self._motion.world(self._motion.values(joints))

    def inverse_kinematics(
        self, end_effector_id: str, pose: Pose, start_joints: list[Joint] | None = None, avoid_collisions: bool = True
    ) -> list[Joint]:
        """Return the joints for a position, with the elbow on the side nearest to `start_joints`.

        Two joints cannot set the heading; it results from the position. With `avoid_collisions`, the elbow is on a
        side that is free of collisions. Raise KinematicsException if there are none.
        """
        check_end_effector(self.name, end_effector_id)
        seed = self._motion.values(start_joints) if start_joints else self._motion.present()
        return named_joints(JOINTS, (self._motion.solve_free if avoid_collisions else self._motion.solve)(pose, seed))

    # -------------------------------------------------------------------------------- motion
    def check_if_ready_to_move(self) -> None:
        """Raise what prevents the arm from moving."""
        super().check_if_ready_to_move()
        self._control.require_motion()

    def move_to_pose(
        self, end_effector_id: str, target_pose: Pose, speed: float, safe: bool = True, linear: bool = True
    ) -> None:
        """Move to a position in the world by a joint move; a line is refused.

        With `safe`, the arm moves around obstacles. An obstacle that enters the path later stops it.

        Raises:
            KinematicsException: The position cannot be reached.
            PathBlocked: An obstacle is in the way.
            DeviceError: OutOfRange, Refused, NotInControl, DeviceFault, Cancelled or DeviceTimeout.
        """
        guard = self._control.stops.guard()
        check_end_effector(self.name, end_effector_id)
        if linear:
            raise Refused("{name} cannot move in a straight line. Use a joint move (linear=false).", name=self.name)
        present = self._motion.present()
        if safe:
            self._motion.go_around(self._motion.solve_free(target_pose, present), speed, guard)
        else:
            self._motion.to_joints(self._motion.solve(target_pose, present), speed, 1.0, guard)

    def move_to_joints(self, target_joints: list[Joint], speed: float, safe: bool = True) -> None:
        """Move to joint values, with `safe` around obstacles. Raise as `move_to_pose`."""
        guard, q = self._control.stops.guard(), self._motion.values(target_joints)
        if safe:
            self._motion.go_around(q, speed, guard)
        else:
            self._motion.to_joints(q, speed, 1.0, guard)

    def jog(
        self,
        twist: tuple[float, float, float, float, float, float] | None = None,
        joint_velocities: list[float] | None = None,
        frame: Literal["world", "base", "tool", "user"] = "world",
        valid_for: float = 0.2,
        end_effector_id: str | None = None,
    ) -> None:
        """Move with a velocity that expires `valid_for` s from now. A twist must be in the plane, without rotation.

        Raise OutOfRange, Refused (also for a stretched arm), NotInControl or DeviceFault.
        """
        check_end_effector(self.name, end_effector_id or TCP)
        self._motion.jog(twist, joint_velocities, frame, valid_for)

    def stop(self) -> None:
        """Stop and wait for standstill. This is not a safety function. Raise ConnectionLost or DeviceTimeout."""
        self._control.stop()

    def get_hand_teaching_mode(self) -> bool:
        """Return whether torque is off so that the arm can be moved by hand."""
        return self._control.teaching

    def set_hand_teaching_mode(self, enabled: bool) -> None:
        """Switch torque off, or on again at the present position. Raise Refused while the arm moves."""
        if enabled != self._control.teaching:
            with self._motion.exclusive():
                self._control.set_teaching(enabled)

    def restart_safety(self, confirmed_by: str) -> None:
        """Reboot the servos with a hardware error; control ends.

        Raises:
            InvalidData: No person is named.
            Refused: No servo has a hardware error.
            DeviceTimeout: A servo does not answer after the reboot.
            DeviceFault: The error is active again.
        """
        self._control.reboot(confirmed_by)

    @action
    def move(self, pose: Pose, speed: float = 0.25, acceleration: float = 0.5, *, an: str | None = None) -> None:
        """Move the tool center point to a position. The heading cannot be set.

        :param pose: target
        :param speed: fraction of the configured maximum
        :param acceleration: fraction of the configured maximum
        """
        assert 0.01 <= speed <= 1.0
        assert 0.01 <= acceleration <= 1.0
        guard = self._control.stops.guard()
        self._motion.to_joints(self._motion.solve(pose, self._motion.present()), speed, acceleration, guard)

    @action
    def move_to(
        self, joints: ProjectRobotJoints, speed: float = 0.25, acceleration: float = 0.5, *, an: str | None = None
    ) -> None:
        """Move to stored joint values; both joints arrive together.

        :param joints: target
        :param speed: fraction of the configured maximum
        :param acceleration: fraction of the configured maximum
        """
        assert 0.01 <= speed <= 1.0
        assert 0.01 <= acceleration <= 1.0
        guard = self._control.stops.guard()
        self._motion.to_joints(self._motion.values(joints.joints), speed, acceleration, guard)
