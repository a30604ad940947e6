"""UrObserved: what a Universal Robots arm tells of itself; nothing here writes to the controller."""

import logging
import time
from typing import ClassVar, Final

from arcor2_hw.data.base import now
from arcor2_hw.data.device import Alarm, Connection, Health, Identity, Severity
from arcor2_hw.data.geometry import Pose
from arcor2_hw.data.robot import Control, Joint, KinematicCalibration, Mode, ProgramState, RobotState, RobotType, Safety
from arcor2_hw.exceptions import DeviceError, DeviceFault, InvalidData, NotConnected, NotFound, OutOfRange
from arcor2_hw.objects import Robot
from arcor2_hw.objects.generic import DEFAULT_CONNECT_TIMEOUT

from . import dashboard as answers
from .dashboard import Dashboard
from .frames import from_vector, world_from_base
from .geometry import UR5E, Dimensions
from .observer import Observer, Sample
from .primary import read_calibration
from .settings import UrSettings
from .states import MAY_MOVE, MODE_NAMES, MODE_RUNNING, REMEDIES, Runtime, power_of, program_plays, safety_of

END_EFFECTOR: Final = "tcp"
GRIPPER: Final = "gripper"
JOINTS: Final = (
    "shoulder_pan_joint",
    "shoulder_lift_joint",
    "elbow_joint",
    "wrist_1_joint",
    "wrist_2_joint",
    "wrist_3_joint",
)
PENDANT_AGE: Final = 0.5
"""Seconds for which an answer of the dashboard is used again: a person turns a key no faster."""
PENDANT_TIMEOUT: Final = 0.3
POLYSCOPE_X: Final = 10

log = logging.getLogger(__name__)


class UrObserved(Robot):
    """The observed side of a Universal Robots arm."""

    _ABSTRACT = True
    robot_type = RobotType.ARTICULATED
    max_payload: ClassVar[float] = 5.0
    reach: ClassVar[float] = 0.85
    dimensions: ClassVar[Dimensions] = UR5E
    joint_limit: ClassVar[float] = 6.283185307179586

    def __init__(self, obj_id: str, name: str, pose: Pose, settings: UrSettings) -> None:
        super().__init__(obj_id, name, pose, settings)
        if settings.payload_mass > self.max_payload:
            raise OutOfRange(
                f"{name}: payload_mass must be at most {self.max_payload:g} kg, not {settings.payload_mass!r}"
            )
        self._ur = settings
        self._observer = Observer(name, settings.host)
        self._dashboard = Dashboard(settings.host)
        self._has_dashboard = True
        self._pendant: tuple[float, Control, Mode] = (-1e9, Control.LOCAL, Mode.OTHER)
        self._alarm_since: tuple[Safety, str] = (Safety.NORMAL, now())

    # -------------------------------------------------------------------------------- connection
    def connect(self, timeout: float = DEFAULT_CONNECT_TIMEOUT) -> None:
        """Begin to observe; a program that plays, plays on.

        Raises NotConnected, DeviceTimeout, ConnectionLost, each naming host and port.
        """
        if self._observer.observing.online:
            return
        deadline = time.monotonic() + timeout
        self._observer.connect(timeout)
        try:
            self._dashboard.open(max(deadline - time.monotonic(), 0.05))
            self._has_dashboard = True
        except NotConnected:
            if self._observer.version[0] < POLYSCOPE_X:
                self.disconnect()
                raise
            self._has_dashboard = False  # as PolyScope X is delivered
        except DeviceError:
            self.disconnect()
            raise

    def disconnect(self) -> None:
        """Close; harmless when closed."""
        self._observer.disconnect()
        self._dashboard.close()

    @property
    def connection(self) -> Connection:
        """Tell how the observing connection is."""
        return self._observer.observing.state

    @property
    def health(self) -> Health:
        """Give the condition of the arm."""
        newest = self._observer.newest()
        if newest is None or not self._observer.observing.online:
            return Health.FAILURE if self.connection in (Connection.LOST, Connection.FAILED) else Health.NORMAL
        safety = safety_of(newest.safety_mode)
        if safety in (Safety.FAULT, Safety.VIOLATION):
            return Health.FAILURE
        return Health.NORMAL if safety in MAY_MOVE else Health.CHECK_FUNCTION

    def identify(self) -> Identity:
        """Ask the controller who it is; without a dashboard server only its version is known."""
        self._observer.observing.check()
        firmware = ".".join(map(str, self._observer.version))
        if not self._has_dashboard:
            return Identity("Universal Robots", type(self).__name__, "", firmware)
        serial = self._dashboard.ask("get serial number").strip()
        model = self._dashboard.ask("get robot model").strip()
        software = answers.version(self._dashboard.ask("PolyscopeVersion"))
        return Identity("Universal Robots", model, serial, software or firmware)

    def alarms(self) -> list[Alarm]:
        """Give the safety stop that stands, if one does."""
        newest = self._observer.newest()
        safety = safety_of(newest.safety_mode) if newest is not None else Safety.NORMAL
        if safety is not self._alarm_since[0]:
            self._alarm_since = safety, now()
        if safety in MAY_MOVE:
            return []
        severity = Severity.CRITICAL if safety in (Safety.FAULT, Safety.VIOLATION) else Severity.ERROR
        text = safety.value.replace("_", " ")
        return [Alarm(safety.value, severity, text, REMEDIES.get(safety, ""), self._alarm_since[1])]

    # -------------------------------------------------------------------------------- what is where
    def get_end_effectors_ids(self) -> set[str]:
        """Give the one end effector: the TCP that is active in the controller."""
        return {END_EFFECTOR}

    def get_end_effector_pose(self, end_effector: str) -> Pose:
        """Give the TCP in the world. Raises NotFound, NotConnected, ConnectionLost, Stale."""
        self._check_end_effector(end_effector)
        return self._world(self._observer.sample())

    def robot_joints(self, include_gripper: bool = False) -> list[Joint]:
        """Give the present joint values. Raises NotConnected, ConnectionLost, Stale."""
        sample = self._observer.sample()
        return [Joint(name, value) for name, value in zip(JOINTS, sample.q, strict=True)]

    def grippers(self) -> set[str]:
        """Give the gripper that hangs on an output, if one is set."""
        return {GRIPPER} if self._ur.gripper_output >= 0 else set()

    def suctions(self) -> set[str]:
        """Give none."""
        return set()

    def joint_limits(self) -> dict[str, tuple[float, float]]:
        """Give the limits of the arm as delivered, rad; the safety configuration may be narrower."""
        return dict.fromkeys(JOINTS, (-self.joint_limit, self.joint_limit))

    def max_tcp_speed(self) -> float:
        """Give the configured maximum of the TCP's speed, m/s."""
        return self._ur.max_tcp_speed

    def kinematic_calibration(self) -> KinematicCalibration:
        """Read the DH parameters of the very arm, in the controller's base, from the primary port; nothing is sent.

        Raises NotConnected, DeviceTimeout, ConnectionLost, each naming host and port.
        """
        self._observer.observing.check()
        try:
            return read_calibration(self._ur.host)
        except DeviceError as e:
            raise type(e)(f"{self.name}: {e}", e.detail) from e

    @property
    def base_from_controller(self) -> Pose:
        """Give the controller's base in base_link."""
        return world_from_base(Pose())

    @property
    def samples_received(self) -> int:
        """Count the samples received."""
        return self._observer.samples_received

    @property
    def samples_missed(self) -> int:
        """Count the samples that never came, by the controller's timestamps."""
        return self._observer.samples_missed

    # -------------------------------------------------------------------------------- state
    def state(self) -> RobotState:
        """Give the whole state. Raises NotConnected, ConnectionLost, Stale."""
        sample = self._observer.sample()
        control, mode = self._at_pendant()
        return RobotState(
            mode,
            power_of(sample.robot_mode),
            safety_of(sample.safety_mode),
            self._program(sample),
            control,
            sample.moving,
            sample.speed_fraction,
            self._obstacles(sample, control),
        )

    def _program(self, sample: Sample) -> ProgramState:
        if not program_plays(sample.runtime):
            return ProgramState.STOPPED
        if not self._is_ours():
            return ProgramState.FOREIGN
        return ProgramState.PAUSED if sample.runtime in (Runtime.PAUSED, Runtime.PAUSING) else ProgramState.PLAYING

    def _is_ours(self) -> bool:
        """Tell whether the program that plays is ours."""
        return False

    def _obstacles(self, sample: Sample, control: Control) -> list[str]:
        """Give what keeps the arm from taking commands."""
        found = []
        if sample.robot_mode != MODE_RUNNING:
            found.append(f"not switched on ({MODE_NAMES.get(sample.robot_mode, sample.robot_mode)})")
        safety = safety_of(sample.safety_mode)
        if safety not in MAY_MOVE:
            found.append(safety.value.replace("_", " "))
        if control is Control.LOCAL:
            found.append("local control")
        return found

    def _at_pendant(self, max_age: float = PENDANT_AGE) -> tuple[Control, Mode]:
        """Ask for remote or local control and the operating mode; an older answer stands when none comes in time."""
        asked, control, mode = self._pendant
        if not self._has_dashboard:
            return Control.REMOTE, Mode.OTHER
        if time.monotonic() - asked > max_age:
            try:
                remote = answers.is_remote(self._dashboard.ask("is in remote control", PENDANT_TIMEOUT))
                control = Control.REMOTE if remote else Control.LOCAL
                mode = answers.operational_mode(self._dashboard.ask("get operational mode", PENDANT_TIMEOUT), remote)
            except DeviceError as e:
                log.warning("%s: the dashboard server does not tell who has control: %s", self.name, e)
                if asked < 0.0:
                    raise
            self._pendant = time.monotonic(), control, mode
        return control, mode

    def _foreign_name(self) -> str:
        """Give the name of the program that plays, as well as it is known."""
        try:
            return answers.program(self._dashboard.ask("programState"))[1] if self._has_dashboard else ""
        except (DeviceError, DeviceFault):
            return ""

    # -------------------------------------------------------------------------------- checks
    def _world(self, sample: Sample) -> Pose:
        return world_from_base(self._pose) * from_vector(sample.tcp)

    @staticmethod
    def _check_end_effector(end_effector: str) -> None:
        if end_effector != END_EFFECTOR:
            raise NotFound(f"there is no end effector {end_effector!r}, only {END_EFFECTOR!r}")

    def _checked_joints(self, joints: list[Joint]) -> list[float]:
        """Give joint values in the controller's order. Raises InvalidData for wrong names, OutOfRange beyond limits."""
        values = {joint.name: joint.value for joint in joints}
        if len(values) != len(joints) or values.keys() != set(JOINTS):
            raise InvalidData(f"the joints of {self.name} are {', '.join(JOINTS)}; given: {', '.join(values)}")
        for name, value in values.items():
            if not -self.joint_limit <= value <= self.joint_limit:
                raise OutOfRange(
                    f"{self.name}: {name} must be {-self.joint_limit:.3f} to {self.joint_limit:.3f} rad, not {value!r}"
                )
        return [values[name] for name in JOINTS]
