"""DobotMagician: the object type of the Dobot Magician, composed of observer, control and motion."""

from typing import ClassVar, Final

from arcor2_hw.actions import StrEnum, action
from arcor2_hw.data.device import Alarm, Health, Identity, LossReaction
from arcor2_hw.data.geometry import Pose, Position
from arcor2_hw.data.project import ProjectRobotJoints
from arcor2_hw.data.robot import Control as ControlMode, Joint, Mode, Power, ProgramState, RobotState, RobotType, Safety
from arcor2_hw.exceptions import DeviceError, DeviceFault, NotFound, OutOfRange, Refused
from arcor2_hw.keep_alive import once_within
from arcor2_hw.objects import HoldsParts
from arcor2_hw.objects.arm import StopGuard, check_end_effector, named_joints
from arcor2_hw.objects.generic import DEFAULT_CONNECT_TIMEOUT
from arcor2_hw.objects.single_arm import SingleArm

from . import alarms
from .control import Control
from .frames import Command
from .kinematics import JOINTS, LIMITS, values
from .motion import JOINT_TO_POSE, JUMP, LINE_TO_POSE, Motion
from .observer import Observer
from .settings import DobotMagicianSettings

MAX_HOMING_TIME: Final = 320.0
"""Deadline of homing, s: the longest home_timeout, and time for communication and the stop."""
POLL: Final = 0.01


class DobotMoveType(StrEnum):
    """Path of the tool to its target."""

    LINEAR = "linear"
    JOINT = "joint"
    JUMP = "jump"


_MODES: Final = {DobotMoveType.LINEAR: LINE_TO_POSE, DobotMoveType.JOINT: JOINT_TO_POSE, DobotMoveType.JUMP: JUMP}


class DobotMagician(HoldsParts, SingleArm):
    """Dobot Magician: four axes, 0.5 kg, 320 mm, with suction cup or gripper."""

    _ABSTRACT = False
    display_name = "Dobot Magician"
    robot_type: ClassVar[RobotType] = RobotType.ARTICULATED
    urdf_package_name = "dobot_magician.zip"
    # The arm has no watchdog: it completes a motion that was started. There is never a second one in its queue.
    loss_reaction: ClassVar[LossReaction] = LossReaction.continues()
    CANCEL_MAPPING: ClassVar[dict[str, str]] = {
        "home": "stop",
        "move": "stop",
        "move_to": "stop",
        "pick": "stop",
        "place": "stop",
    }

    def __init__(self, obj_id: str, name: str, pose: Pose, settings: DobotMagicianSettings) -> None:
        super().__init__(obj_id, name, pose, settings)
        self._dobot = settings
        self._observer = Observer(name, settings)
        self._control = Control(self._observer, settings, self._move_lock)
        self._motion = Motion(self, self._observer, self._control, settings, self._move_lock)
        self._observer.on_lost = self.on_lost  # type: ignore[method-assign]
        self.safe_moves, self.motions = self._motion.safe, self._motion.log
        self.keep_connection(self._observer.who, self._observer.observing)

    # -------------------------------------------------------------------------------- connection and control
    def on_lost(self, error: DeviceError) -> None:
        """End control."""
        self._control.drop()

    def connect(self, timeout: float = DEFAULT_CONNECT_TIMEOUT) -> None:
        """Observe the arm; a motion continues. Raise NotConnected, DeviceTimeout, ConnectionLost or DeviceFault."""
        self._observer.connect(timeout)

    def disconnect(self) -> None:
        """Stop arm and belt, release control and close the port."""
        self._control.leave()
        self._observer.disconnect()

    def condition(self) -> Health:
        """Return the condition of the arm."""
        newest = self._observer.newest()
        active = newest.alarms if newest is not None else frozenset[int]()
        if not active:
            return Health.NORMAL
        return Health.FAILURE if any(0 < code < 0x10 for code in active) else Health.CHECK_FUNCTION

    def identify(self) -> Identity:
        """Read serial number, name and version."""
        serial = self._observer.text(Command.SERIAL_NUMBER)
        name = self._observer.text(Command.NAME)
        version = ".".join(map(str, self._observer.raw(Command.VERSION)[:3]))
        return Identity("Dobot", name or "Magician", serial, version)

    def alarms(self) -> list[Alarm]:
        """Return the active alarms. Raise NotConnected, ConnectionLost or Stale."""
        found = []
        for code in sorted(self._observer.sample().alarms):
            text, remedy, severity = alarms.describe(code)
            if (since := self._observer.since.get(code)) is not None:
                found.append(Alarm.of(alarms.title(code), severity, text, remedy, since))
        return found

    def acknowledge(self, code: str) -> None:
        """Clear an alarm. Raise Refused while its cause persists, or if others are active: all are cleared together."""
        active = {alarm.code for alarm in self.alarms()}
        if code not in active:
            raise NotFound("{device} has no alarm {code}.", device=self.who, code=code)
        if others := active - {code, alarms.title(alarms.RESET)}:
            raise Refused(
                "{device}: alarm {code} cannot be acknowledged alone; also active: {others}.",
                "acknowledge_all",
                device=self.who,
                code=code,
                others=", ".join(sorted(others)),
            )
        self.acknowledge_all()

    def acknowledge_all(self) -> None:
        """Clear all alarms, after a person has dealt with them. Raise Refused while a cause persists."""
        self._observer.set(Command.ALARMS)
        if left := alarms.codes(self._observer.raw(Command.ALARMS)):
            names = ", ".join(map(alarms.title, sorted(left)))
            raise Refused(
                "{device}: alarm {names} is active again. Remove its cause first.", device=self.who, names=names
            )

    def take_control(self) -> None:
        """Take control of an arm at standstill, unless we have it. Raise NotInControl or Refused."""
        self._control.take()

    def release_control(self) -> None:
        """Stop arm and belt, and release control, if we have it."""
        self._control.release()

    def control_owner(self) -> str | None:
        """Return "us", "another client" while the arm moves without us, or None."""
        return self._control.owner()

    # -------------------------------------------------------------------------------- state
    def state(self) -> RobotState:
        """Return the state of the robot; the arm has neither modes nor safety functions. Raise NotConnected, Stale."""
        sample = self._observer.sample()
        program = ProgramState.STOPPED
        if sample.moving:
            program = ProgramState.PLAYING if self.move_in_progress else ProgramState.FOREIGN
        return RobotState(
            Mode.OTHER,
            Power.OPERATIONAL,
            Safety.NORMAL,
            program,
            ControlMode.REMOTE,
            sample.moving,
            1.0,
            self._motion.obstacles(sample),
        )

    def get_end_effector_pose(self, end_effector: str) -> Pose:
        """Return the tool in the world, by the arm's own kinematics. Raise NotFound, NotConnected or Stale."""
        check_end_effector(self.name, end_effector)
        return self._motion.world(self._observer.sample().tool)

    def robot_joints(self, include_gripper: bool = False) -> list[Joint]:
        """Return the joint values. Raise NotConnected, ConnectionLost or Stale."""
        return named_joints(JOINTS, self._observer.sample().q)

    def grippers(self) -> set[str]:
        """Return the gripper on the arm's pump."""
        return {"gripper"}

    def suctions(self) -> set[str]:
        """Return the suction cup on the arm's pump."""
        return {"suction"}

    def joint_limits(self) -> dict[str, tuple[float, float]]:
        """Return the published limits, rad; the linkage narrows those of joints 2 and 3."""
        return dict(LIMITS)

    def max_tcp_speed(self) -> float:
        """Return the configured maximum of the tool speed, m/s."""
        return self._dobot.max_tcp_speed

    # -------------------------------------------------------------------------------- motion
    def check_if_ready_to_move(self) -> None:
        """Raise what prevents the arm from moving."""
        self._motion.check_ready()

    def move_to_pose(
        self, end_effector_id: str, target_pose: Pose, speed: float, safe: bool = True, linear: bool = True
    ) -> None:
        """Move the tool to a pose in the world, in a line or with all joints together.

        With `safe`, a line that collides is refused, and a joint move leads around obstacles. An obstacle that enters
        the path later stops the arm.

        Raises:
            KinematicsException: The pose cannot be reached.
            PathBlocked: An obstacle is in the way.
            DeviceError: OutOfRange, Refused, NotInControl, DeviceFault, Cancelled or DeviceTimeout.
        """
        guard = self._control.stops.guard()
        check_end_effector(self.name, end_effector_id)
        if not safe:
            self._motion.to_pose(target_pose, LINE_TO_POSE if linear else JOINT_TO_POSE, speed, guard)
        elif linear:
            self._motion.line_safely(target_pose, speed, guard)
        else:
            self._motion.go_around(self._motion.solve(target_pose)[1], speed, guard)

    def move_to_joints(self, target_joints: list[Joint], speed: float, safe: bool = True) -> None:
        """Move to joint values, with `safe` around obstacles. Raise as `move_to_pose`, and InvalidData."""
        guard, q = self._control.stops.guard(), values(self.name, target_joints)
        (self._motion.go_around if safe else self._motion.to_joints)(q, speed, guard)

    def stop(self) -> None:
        """Stop arm and belt, even if they still run since a connection loss. This is not a safety function.

        Raise ConnectionLost, NotInControl while another client moves the arm, or DeviceTimeout.
        """
        self._control.stop()

    def inverse_kinematics(
        self, end_effector_id: str, pose: Pose, start_joints: list[Joint] | None = None, avoid_collisions: bool = True
    ) -> list[Joint]:
        """Return the joints for a pose in the world; there is at most one solution.

        Raise KinematicsException if it cannot be reached, or, with `avoid_collisions`, if it collides.
        """
        check_end_effector(self.name, end_effector_id)
        if start_joints:
            values(self.name, start_joints)
        found = named_joints(JOINTS, self._motion.solve(pose)[1])
        if avoid_collisions and (hit := self.safe_moves.contacts(found)):
            raise self.KinematicsException(
                "{name} reaches the pose only in collision: {hit}", name=self.name, hit=hit[0]
            )
        return found

    def forward_kinematics(self, end_effector_id: str, joints: list[Joint]) -> Pose:
        """Return the tool in the world for joints. Raise InvalidData, or KinematicsException beyond a limit."""
        check_end_effector(self.name, end_effector_id)
        try:
            return self._motion.forward(values(self.name, joints))
        except OutOfRange as e:
            raise self.KinematicsException(e.message, e.detail) from None

    # -------------------------------------------------------------------------------- actions
    @action(deadline=MAX_HOMING_TIME)
    def home(self, *, an: str | None = None) -> None:
        """Home the arm: move to its switches, then to the home position stored in the arm. Keep clear of it."""
        self._motion.home(self._control.stops.guard())

    @action
    def move(
        self, pose: Pose, move_type: DobotMoveType = DobotMoveType.LINEAR, speed: float = 0.25, *, an: str | None = None
    ) -> None:
        """Move the tool to a pose.

        :param pose: target; the tool points down
        :param move_type: in a line, all joints together, or up, across and down
        :param speed: fraction of the configured maximum
        """
        assert 0.01 <= speed <= 1.0
        self._motion.to_pose(pose, _MODES[move_type], speed, self._control.stops.guard())

    @action
    def move_to(self, joints: ProjectRobotJoints, speed: float = 0.25, *, an: str | None = None) -> None:
        """Move to stored joint values; all joints arrive together.

        :param joints: target
        :param speed: fraction of the configured maximum
        """
        assert 0.01 <= speed <= 1.0
        self._motion.to_joints(values(self.name, joints.joints), speed, self._control.stops.guard())

    @action(takes_from="pose")
    def pick(
        self, pose: Pose, approach: float = 0.05, speed: float = 0.5, slow_speed: float = 0.1, *, an: str | None = None
    ) -> None:
        """Pick a part with the suction cup: approach from above, switch suction on, retreat. No sensor checks the part.

        :param pose: where the cup touches the part
        :param approach: height of the approach, m
        :param speed: fraction of the maximum before the approach
        :param slow_speed: fraction of the maximum at the part
        """
        assert 0.0 <= approach <= 0.2
        assert 0.01 <= speed <= 1.0
        assert 0.01 <= slow_speed <= 1.0
        self._pick_or_place("pick", pose, approach, speed, slow_speed, suck=True)

    @action(puts_to="pose")
    def place(
        self, pose: Pose, approach: float = 0.05, speed: float = 0.5, slow_speed: float = 0.1, *, an: str | None = None
    ) -> None:
        """Place the part on the suction cup: approach from above, switch suction off, retreat.

        :param pose: where the part is released
        :param approach: height of the approach, m
        :param speed: fraction of the maximum before the approach
        :param slow_speed: fraction of the maximum at the place
        """
        assert 0.0 <= approach <= 0.2
        assert 0.01 <= speed <= 1.0
        assert 0.01 <= slow_speed <= 1.0
        self._pick_or_place("place", pose, approach, speed, slow_speed, suck=False)

    @action
    def suck(self, on: bool, *, an: str | None = None) -> None:
        """Switch suction on or off, and wait until it has taken effect. It keeps its state on connection loss.

        :param on: on or off
        """
        self._switch("suck", Command.SUCTION_CUP, on, self._dobot.suction_time, self._control.stops.guard())

    @action
    def gripper(self, closed: bool, *, an: str | None = None) -> None:
        """Close or open the gripper, and wait until it has moved. It keeps its state on connection loss.

        :param closed: closed or open
        """
        self._switch("gripper", Command.GRIPPER, closed, self._dobot.gripper_time, self._control.stops.guard())

    @action
    def conveyor(self, speed: float, *, an: str | None = None) -> None:
        """Drive the conveyor belt. It keeps running on connection loss: the arm has no watchdog.

        :param speed: speed, m/s; negative: backwards; 0: stop
        """
        assert -0.2 <= speed <= 0.2
        guard = self._control.stops.guard()
        with self._control.commands:
            guard.check(f"conveyor of {self.who}")
            self._control.require()
            self._control.drive_belt(speed)

    def _pick_or_place(
        self, operation: str, pose: Pose, approach: float, speed: float, slow_speed: float, *, suck: bool
    ) -> None:
        # The tool points down, so the approach is from above.
        guard, above = self._control.stops.guard(), pose * Pose(Position(0.0, 0.0, -approach))
        self._motion.solve(pose)  # before the arm moves
        self._motion.to_pose(above, JOINT_TO_POSE, speed, guard)
        self._motion.to_pose(pose, LINE_TO_POSE, slow_speed, guard)
        self._switch(operation, Command.SUCTION_CUP, suck, self._dobot.suction_time, guard)
        self._motion.to_pose(above, LINE_TO_POSE, slow_speed, guard)

    def _switch(self, operation: str, command: Command, on: bool, seconds: float, guard: StopGuard) -> None:
        """Switch the valve of the pump, read it back, and wait until it has taken effect. Raise DeviceFault."""
        wanted, operation = (1, int(on)), f"{operation} of {self.who}"
        with self._control.commands:
            guard.check(operation)
            self._control.require()
            self._observer.set(command, "2B", *wanted)
            actual = self._observer.get(command, "2B")
        if actual != wanted:
            raise DeviceFault("{what} did not switch.", f"sent {wanted}, read {actual}", what=operation)
        once_within(lambda: guard.check(operation), seconds, POLL)
        if on:
            self.attach_part(hanging=command is Command.SUCTION_CUP)
        else:
            self.detach_part()
