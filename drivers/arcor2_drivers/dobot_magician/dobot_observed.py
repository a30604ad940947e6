"""DobotObserved: what a Dobot Magician tells of itself; nothing here writes to the arm but `acknowledge`."""

from typing import ClassVar, Final

from arcor2_hw.data.device import Alarm, Connection, Health, Identity
from arcor2_hw.data.geometry import Pose
from arcor2_hw.data.robot import Control, Joint, Mode, Power, ProgramState, RobotState, RobotType, Safety
from arcor2_hw.exceptions import InvalidData, NotFound, OutOfRange, Refused
from arcor2_hw.objects import Robot
from arcor2_hw.objects.generic import DEFAULT_CONNECT_TIMEOUT
from arcor2_hw.objects.safe_moves import SafeMoves
from arcor2_hw.objects.surroundings import Surroundings

from . import alarms, kinematics
from .frames import Command
from .kinematics import JOINTS, LIMITS, SLACK, Joints, Tool, Unreachable
from .observer import Observer, Sample
from .settings import DobotMagicianSettings

END_EFFECTOR: Final = "tcp"
SUCTION: Final = "suction"
GRIPPER: Final = "gripper"


class DobotObserved(Robot):
    """The observed side of a Dobot Magician."""

    _ABSTRACT = True
    robot_type: ClassVar[RobotType] = RobotType.ARTICULATED

    def __init__(self, obj_id: str, name: str, pose: Pose, settings: DobotMagicianSettings) -> None:
        super().__init__(obj_id, name, pose, settings)
        self._dobot = settings
        self._observer = Observer(name, settings, self._drop_control)
        self._who = self._observer.who
        self._in_control = False
        self.safe_moves = SafeMoves(self)

    def surround(self, surroundings: Surroundings) -> None:
        """Take what tells of the things around the arm, and read its model."""
        super().surround(surroundings)
        self.safe_moves.prepare()

    def _drop_control(self) -> None:
        self._in_control = False

    # -------------------------------------------------------------------------------- connection
    def connect(self, timeout: float = DEFAULT_CONNECT_TIMEOUT) -> None:
        """Begin to observe within `timeout` s; only questions are sent, what moves goes on.

        Raises NotConnected, DeviceTimeout, ConnectionLost, DeviceFault, each naming the port.
        """
        self._observer.observing.start(timeout)

    def disconnect(self) -> None:
        """Close; harmless when closed."""
        self._drop_control()
        self._observer.observing.stop()
        with self._observer.came:
            self._observer.came.notify_all()  # whoever still waits is told that it is closed

    @property
    def connection(self) -> Connection:
        """Tell how the connection is."""
        return self._observer.observing.state

    @property
    def health(self) -> Health:
        """Give the condition of the arm."""
        if self.connection in (Connection.LOST, Connection.FAILED):
            return Health.FAILURE
        newest = self._observer.newest()
        standing = newest.alarms if newest is not None else frozenset()
        if not standing:
            return Health.NORMAL
        return Health.FAILURE if any(0 < code < 0x10 for code in standing) else Health.CHECK_FUNCTION

    def identify(self) -> Identity:
        """Ask the arm who it is."""
        serial = self._observer.text(Command.SERIAL_NUMBER)
        name = self._observer.text(Command.NAME)
        version = ".".join(map(str, self._observer.raw(Command.VERSION)[:3]))
        return Identity("Dobot", name or "Magician", serial, version)

    def alarms(self) -> list[Alarm]:
        """Give the alarms that stand. Raises NotConnected, ConnectionLost, Stale."""
        found = []
        for code in sorted(self._observer.sample().alarms):
            text, remedy, severity = alarms.describe(code)
            since = self._observer.since.get(code)
            if since is not None:
                found.append(Alarm(alarms.title(code), severity, text, remedy, since))
        return found

    def acknowledge(self, code: str) -> None:
        """Clear the alarm; the arm can only clear all at once, so another that stands beside it refuses.

        Raises NotFound when it does not stand, Refused when others stand too, or while its cause does.
        """
        standing = {alarm.code for alarm in self.alarms()}
        if code not in standing:
            raise NotFound(f"{self._who} has no alarm {code}")
        others = standing - {code, alarms.title(alarms.RESET)}
        if others:
            raise Refused(
                f"{self._who}: alarm {code} cannot be acknowledged alone: {', '.join(sorted(others))} stand too",
                "acknowledge_all",
            )
        self._clear_alarms()

    def acknowledge_all(self) -> None:
        """Clear all alarms after a person has dealt with them. Raises Refused while a cause stands."""
        self._clear_alarms()

    def _clear_alarms(self) -> None:
        self._observer.set(Command.CLEAR_ALARMS)
        left = alarms.codes(self._observer.raw(Command.ALARMS))
        if left:
            raise Refused(f"{self._who}: alarm {', '.join(map(alarms.title, sorted(left)))} stands again at once")

    # -------------------------------------------------------------------------------- what is where
    def get_end_effectors_ids(self) -> set[str]:
        """Give the one end effector."""
        return {END_EFFECTOR}

    def get_end_effector_pose(self, end_effector: str) -> Pose:
        """Give the tool in the world, by the arm's own kinematics. Raises NotFound, NotConnected, Stale."""
        self._check_end_effector(end_effector)
        return self._world(self._observer.sample().tool)

    def robot_joints(self, include_gripper: bool = False) -> list[Joint]:
        """Give the present joint values. Raises NotConnected, ConnectionLost, Stale."""
        return [Joint(name, value) for name, value in zip(JOINTS, self._observer.sample().q, strict=True)]

    def grippers(self) -> set[str]:
        """Give the gripper on the arm's pump."""
        return {GRIPPER}

    def suctions(self) -> set[str]:
        """Give the suction cup on the arm's pump."""
        return {SUCTION}

    def joint_limits(self) -> dict[str, tuple[float, float]]:
        """Give the published limits, rad; the linkage narrows those of joints 2 and 3 where they depend."""
        return dict(zip(JOINTS, LIMITS, strict=True))

    def max_tcp_speed(self) -> float:
        """Give the configured maximum of the tool's speed, m/s."""
        return self._dobot.max_tcp_speed

    def state(self) -> RobotState:
        """Give the whole state. The arm knows neither modes nor safety functions. Raises NotConnected, Stale."""
        sample = self._observer.sample()
        program = ProgramState.STOPPED
        if sample.moving:
            program = ProgramState.PLAYING if self.move_in_progress else ProgramState.FOREIGN
        return RobotState(
            Mode.OTHER,
            Power.OPERATIONAL,
            Safety.NORMAL,
            program,
            Control.REMOTE,
            sample.moving,
            1.0,
            self._obstacles(sample),
        )

    @staticmethod
    def _obstacles(sample: Sample) -> list[str]:
        """Give the alarms that keep the arm from moving."""
        hindering = sorted(sample.alarms - {alarms.RESET})
        return [f"alarm {alarms.title(code)}: {alarms.describe(code)[0]}" for code in hindering]

    # -------------------------------------------------------------------------------- kinematics
    def inverse_kinematics(
        self,
        end_effector_id: str,
        pose: Pose,
        start_joints: list[Joint] | None = None,
        avoid_collisions: bool = True,
    ) -> list[Joint]:
        """Give the joints that reach a pose in the world; there is one solution at most.

        With `avoid_collisions` they are free of what stands in the scene. Raises KinematicsException saying what keeps
        it from being reached.
        """
        self._check_end_effector(end_effector_id)
        if start_joints:
            self._checked_joints(start_joints)
        _, q = self._solve(pose)
        found = [Joint(name, value) for name, value in zip(JOINTS, q, strict=True)]
        if avoid_collisions and (hit := self.safe_moves.contacts(found)):
            raise self.KinematicsException(f"{self.name} reaches the pose only in collision: {hit[0]}")
        return found

    def forward_kinematics(self, end_effector_id: str, joints: list[Joint]) -> Pose:
        """Give the tool in the world for joints. Raises InvalidData, KinematicsException beyond a limit."""
        self._check_end_effector(end_effector_id)
        try:
            q = self._checked_joints(joints)
        except OutOfRange as e:
            raise self.KinematicsException(str(e)) from None
        return self._world(kinematics.forward(q, self._dobot.tool_x, self._dobot.tool_z))

    def _solve(self, pose: Pose) -> tuple[Tool, Joints]:
        """Give tool and joints for a pose in the world. Raises KinematicsException."""
        try:
            tool = kinematics.tool_of(self._pose.inverted() * pose)
            q = kinematics.inverse(tool, self._dobot.tool_x, self._dobot.tool_z)
        except (Unreachable, ValueError) as e:
            where = ", ".join(f"{value:.3f}" for value in pose.position)
            raise self.KinematicsException(
                f"{self.name} cannot reach the pose: {e}", f"in the world: {where}"
            ) from None
        return tool._replace(r=q[0] + q[3]), q

    def _world(self, tool: Tool) -> Pose:
        return self._pose * tool.pose

    # -------------------------------------------------------------------------------- checks
    @staticmethod
    def _check_end_effector(end_effector: str) -> None:
        if end_effector != END_EFFECTOR:
            raise NotFound(f"there is no end effector {end_effector!r}, only {END_EFFECTOR!r}")

    def _checked_joints(self, joints: list[Joint]) -> Joints:
        """Give joint values in order. Raises InvalidData for wrong names, OutOfRange beyond limits."""
        values = {joint.name: joint.value for joint in joints}
        if len(values) != len(joints) or values.keys() != set(JOINTS):
            raise InvalidData(f"the joints of {self.name} are {', '.join(JOINTS)}; given: {', '.join(values)}")
        for name, (low, high) in zip(JOINTS, LIMITS, strict=True):
            if not low - SLACK <= values[name] <= high + SLACK:
                raise OutOfRange(f"{name} of {self.name} must be {low:.3f} to {high:.3f} rad, not {values[name]!r}")
        one, two, three, four = (values[name] for name in JOINTS)
        return one, two, three, four
