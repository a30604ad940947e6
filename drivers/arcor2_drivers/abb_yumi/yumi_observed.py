"""YumiObserved: what a YuMi tells of itself; nothing here changes anything at the controller."""

import logging
from typing import Final

from arcor2_hw.data.base import now
from arcor2_hw.data.device import Alarm, Connection, Health, Identity, Severity
from arcor2_hw.data.geometry import Pose
from arcor2_hw.data.robot import Control, Joint, ProgramState, RobotState, RobotType, Safety
from arcor2_hw.exceptions import DeviceError, InvalidData, NotFound, OutOfRange, Refused
from arcor2_hw.objects import MultiArmRobot
from arcor2_hw.objects.generic import DEFAULT_CONNECT_TIMEOUT

from .nominal import LIMITS
from .observer import UNITS, Observer, Panel, Sample, world
from .settings import ARMS, YumiSettings, within
from .states import AUTOMATIC, COLLISION, MOTORS_ON, REMEDIES, mode_of, power_of, safety_of

END_EFFECTOR: Final = "tcp"
GRIPPER: Final = "gripper"
SUCTION: Final = "suction"
JOINTS: Final = {arm: tuple(f"{unit}_{number}" for number in range(1, 8)) for arm, unit in UNITS.items()}
"""Axes 1 to 7 of each mechanical unit; 7 is the one between 2 and 3, eax_a on the wire."""
LIMIT_SLACK: Final = 1e-4
"""rad: what rounding on the wire makes of a joint at its limit."""

log = logging.getLogger(__name__)


class YumiObserved(MultiArmRobot):
    """The observed side of a YuMi."""

    _ABSTRACT = True
    robot_type = RobotType.ARTICULATED

    def __init__(self, obj_id: str, name: str, pose: Pose, settings: YumiSettings) -> None:
        super().__init__(obj_id, name, pose, settings)
        self._yumi = settings
        self._tools = {arm: settings.tcp(arm) for arm in ARMS}
        self._observer = Observer(name, settings, self._seen, self._lost)
        self._collision_acknowledged = False
        self._alarm_since: tuple[Safety, str] = (Safety.NORMAL, now())

    # -------------------------------------------------------------------------------- connection
    def connect(self, timeout: float = DEFAULT_CONNECT_TIMEOUT) -> None:
        """Begin to observe; a program that runs, runs on.

        Raises NotConnected, DeviceTimeout, ConnectionLost, each naming host and port, or Refused for another RobotWare.
        """
        if not self._observer.observing.online:
            self._observer.connect(timeout)

    def disconnect(self) -> None:
        """Close; harmless when closed."""
        self._observer.disconnect()

    @property
    def connection(self) -> Connection:
        """Tell how the observing connection is."""
        return self._observer.observing.state

    @property
    def health(self) -> Health:
        """Give the condition of the robot."""
        newest = self._observer.newest()
        if newest is None or not self._observer.observing.online:
            return Health.FAILURE if self.connection in (Connection.LOST, Connection.FAILED) else Health.NORMAL
        safety = self._safety(newest)
        if safety is Safety.FAULT:
            return Health.FAILURE
        return Health.NORMAL if safety is Safety.NORMAL else Health.CHECK_FUNCTION

    def identify(self) -> Identity:
        """Ask the controller who it is."""
        self._observer.observing.check()
        told = self._observer.rws.get("/ctrl/identity")
        serial = told[0].get("ctrl-id", "") if told else ""
        return Identity("ABB", "IRB 14000 YuMi", serial, f"RobotWare {self._observer.version}")

    def alarms(self) -> list[Alarm]:
        """Give the safety stop that stands, if one does."""
        newest = self._observer.newest()
        safety = self._safety(newest) if newest is not None else Safety.NORMAL
        if safety is not self._alarm_since[0]:
            self._alarm_since = safety, now()
        if safety is Safety.NORMAL:
            return []
        severity = Severity.CRITICAL if safety is Safety.FAULT else Severity.ERROR
        text = safety.value.replace("_", " ")
        return [Alarm(safety.value, severity, text, REMEDIES.get(safety, ""), self._alarm_since[1])]

    # -------------------------------------------------------------------------------- what is where
    def get_arm_ids(self) -> set[str]:
        """Give left and right, as seen by the robot."""
        return set(ARMS)

    def get_end_effectors_ids(self, arm_id: str | None = None) -> set[str]:
        """Give the one end effector of each arm: its TCP."""
        self._arms(arm_id)
        return {END_EFFECTOR}

    def get_end_effector_pose(self, end_effector: str, arm_id: str | None = None) -> Pose:
        """Give an arm's TCP in the world. Raises NotFound, NotConnected, ConnectionLost, Stale."""
        self._check_end_effector(end_effector)
        arm = self._arm(arm_id)
        return world(self._pose, self._observer.sample().targets[arm], self._tools[arm])

    def robot_joints(self, include_gripper: bool = False, arm_id: str | None = None) -> list[Joint]:
        """Give the present joint values, of both arms when none is named. Raises as get_end_effector_pose."""
        arms = self._arms(arm_id)
        sample = self._observer.sample()
        return [Joint(name, value) for arm in arms for name, value in zip(JOINTS[arm], sample.joints[arm], strict=True)]

    def grippers(self, arm_id: str | None = None) -> set[str]:
        """Give the fingers that are set, as `gripper`."""
        return {GRIPPER} if any(getattr(self._yumi, f"{arm}_gripper") for arm in self._arms(arm_id)) else set()

    def suctions(self, arm_id: str | None = None) -> set[str]:
        """Give the suction cups that are set, as `suction`."""
        return {SUCTION} if any(getattr(self._yumi, f"{arm}_suction") for arm in self._arms(arm_id)) else set()

    def joint_limits(self, arm_id: str | None = None) -> dict[str, tuple[float, float]]:
        """Give the ranges of the axes as delivered, rad; the controller's configuration may be narrower."""
        return {name: limits for arm in self._arms(arm_id) for name, limits in zip(JOINTS[arm], LIMITS, strict=True)}

    def max_tcp_speed(self) -> float:
        """Give the configured maximum of the TCP's speed, m/s."""
        return self._yumi.max_tcp_speed

    # -------------------------------------------------------------------------------- state
    def state(self) -> RobotState:
        """Give the whole state. Raises NotConnected, ConnectionLost, Stale."""
        sample, panel = self._observer.sample(), self._observer.panel()
        return RobotState(
            mode_of(panel.operation_mode),
            power_of(sample.control_state),
            self._safety(sample),
            self._program(sample, panel),
            Control.REMOTE if panel.operation_mode == AUTOMATIC else Control.LOCAL,
            sample.moving or self.move_in_progress,
            panel.speed_ratio,
            self._obstacles(sample, panel),
        )

    def _safety(self, sample: Sample) -> Safety:
        panel = self._observer.known_panel
        collided = panel is not None and panel.collision == COLLISION and not self._collision_acknowledged
        return safety_of(sample.control_state, collided and not sample.running)  # one that was overcome may still stand

    def _program(self, sample: Sample, panel: Panel) -> ProgramState:
        if not sample.running:
            return ProgramState.STOPPED
        return ProgramState.PLAYING if panel.ours else ProgramState.FOREIGN

    def _obstacles(self, sample: Sample, panel: Panel) -> list[str]:
        """Give what keeps the robot from taking commands."""
        found = []
        safety = self._safety(sample)
        if safety is not Safety.NORMAL:
            found.append(safety.value.replace("_", " "))
        elif sample.control_state != MOTORS_ON:
            found.append("motors off")
        if panel.operation_mode != AUTOMATIC:
            found.append(f"operating mode {panel.operation_mode}")
        if not panel.ours:
            names = " and ".join(sorted({name or "none" for name in panel.programs.values()}))
            found.append(f"the RAPID program loaded is {names}")
        if panel.speed_ratio <= 0.0:
            found.append("speed override 0 %")
        return found

    def _seen(self, sample: Sample) -> None:
        """Take note of a new sample; on the observing thread."""

    def _lost(self, error: DeviceError) -> None:
        """Take note of the loss of the controller; on the observing thread."""

    # -------------------------------------------------------------------------------- checks
    def _arm(self, arm_id: str | None) -> str:
        """Give the arm. Raises InvalidData when none is named, NotFound for one that is not there."""
        if arm_id is None:
            raise InvalidData(f"{self.name} has two arms: name one of {', '.join(ARMS)}")
        if arm_id not in ARMS:
            raise NotFound(f"{self.name} has no arm {arm_id!r}, only {', '.join(ARMS)}")
        return arm_id

    def _arms(self, arm_id: str | None) -> tuple[str, ...]:
        return ARMS if arm_id is None else (self._arm(arm_id),)

    @staticmethod
    def _check_end_effector(end_effector: str) -> None:
        if end_effector != END_EFFECTOR:
            raise NotFound(f"there is no end effector {end_effector!r}, only {END_EFFECTOR!r}")

    def _checked_joints(self, joints: list[Joint], arm: str) -> list[float]:
        """Give joint values in order of the axes. Raises InvalidData for wrong names, OutOfRange beyond limits."""
        values = {joint.name: joint.value for joint in joints}
        names = JOINTS[arm]
        if len(values) != len(joints) or values.keys() != set(names):
            raise InvalidData(
                f"the joints of the {arm} arm of {self.name} are {', '.join(names)}; given: {', '.join(values)}"
            )
        for name, (low, high) in zip(names, LIMITS, strict=True):
            if not low - LIMIT_SLACK <= values[name] <= high + LIMIT_SLACK:
                raise OutOfRange(f"{self.name}: {name} must be {low:.3f} to {high:.3f} rad, not {values[name]!r}")
        return [min(max(values[name], low), high) for name, (low, high) in zip(names, LIMITS, strict=True)]

    def _within(self, what: str, value: float, low: float, high: float) -> None:
        """Raise OutOfRange, naming robot and parameter, unless the value lies in the range."""
        try:
            within(what, value, low, high)
        except OutOfRange as e:
            raise OutOfRange(f"{self.name}: {e}") from None

    def _stated_loads(self) -> None:
        missing = [f"{arm}_mass" for arm in ARMS if self._yumi.load(arm) is None]
        if missing:
            raise Refused(
                f"{self.name}: {' and '.join(missing)} not set; state the mass at the flange before taking control"
            )
