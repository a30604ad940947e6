"""TwoAxisObserved: what a two-axis robot tells of itself, and its kinematics; nothing here writes to a servo."""

import math
from typing import Final

from arcor2_hw.data.base import now
from arcor2_hw.data.device import Alarm, Connection, Health, Identity, Severity
from arcor2_hw.data.geometry import Orientation, Pose, Position
from arcor2_hw.data.robot import Control, Joint, Mode, Power, ProgramState, RobotState, RobotType, Safety
from arcor2_hw.exceptions import DeviceError, NotFound, OutOfRange, Refused
from arcor2_hw.objects import Robot
from arcor2_hw.objects.generic import DEFAULT_CONNECT_TIMEOUT
from arcor2_hw.objects.safe_moves import SafeMoves
from arcor2_hw.objects.surroundings import Surroundings

from . import kinematics
from .observer import Observer, Snapshot
from .registers import HARDWARE_ERRORS, to_angle, to_ticks
from .settings import TwoAxisRobotSettings

END_EFFECTOR: Final = "tcp"
JOINTS: Final = ("joint_1", "joint_2")
OUT_OF_PLANE: Final = 0.001
"""m by which a pose may lie beside the plane in which the arm moves."""
TILTED: Final = 0.02
"""rad by which the z axis of a pose may lean from the axes of the joints."""
MODELS: Final = {1020: "XM430-W350", 1030: "XM430-W210", 1120: "XM540-W270", 1130: "XM540-W150"}


class TwoAxisObserved(Robot):
    """The observed side of a two-axis robot."""

    _ABSTRACT = True
    robot_type = RobotType.SCARA

    def __init__(self, obj_id: str, name: str, pose: Pose, settings: TwoAxisRobotSettings) -> None:
        super().__init__(obj_id, name, pose, settings)
        self._axes = settings
        self._links = settings.link_1, settings.link_2
        self._directions = settings.direction_1, settings.direction_2
        self._limits = (settings.lower_1, settings.upper_1), (settings.lower_2, settings.upper_2)
        self._observer = Observer(name, settings, self._on_loss)
        self._since: dict[str, str] = {}
        self.safe_moves = SafeMoves(self)

    def surround(self, surroundings: Surroundings) -> None:
        """Take what tells of the things around the arm, and read its model."""
        super().surround(surroundings)
        self.safe_moves.prepare()

    def _on_loss(self, error: DeviceError) -> None:
        """Note a loss; told on the observing thread."""

    # -------------------------------------------------------------------------------- connection
    def connect(self, timeout: float = DEFAULT_CONNECT_TIMEOUT) -> None:
        """Begin to observe; nothing is written, torque stays as it is.

        Raises NotConnected naming the port, DeviceTimeout naming the servo, ConnectionLost.
        """
        self._observer.observing.start(timeout)

    def disconnect(self) -> None:
        """Close; harmless when closed."""
        self._observer.observing.stop()

    @property
    def connection(self) -> Connection:
        """Tell how the line is."""
        return self._observer.observing.state

    @property
    def health(self) -> Health:
        """Give the condition of the servos; failure when they do not tell any more."""
        if self.connection in (Connection.LOST, Connection.FAILED):
            return Health.FAILURE
        newest = self._observer.newest()
        failed = newest is not None and any(servo.hardware_error for servo in newest.servos)
        return Health.FAILURE if failed else Health.NORMAL

    def identify(self) -> Identity:
        """Give model and firmware as the servos told when the line was opened; they have no serial number."""
        self._observer.observing.check()
        setups = self._observer.setups
        model = " + ".join(MODELS.get(setup.model, f"model {setup.model}") for setup in setups)
        return Identity("ROBOTIS", model, "", " + ".join(str(setup.firmware) for setup in setups))

    def alarms(self) -> list[Alarm]:
        """Give the hardware errors that stand, by servo and bit."""
        newest = self._observer.newest()
        found = {}
        for number, servo in zip(self._axes.ids, newest.servos if newest else (), strict=False):
            for bit in range(8):
                if servo.hardware_error >> bit & 1:
                    text, remedy = HARDWARE_ERRORS.get(bit, (f"hardware error bit {bit}", "see the servo's manual"))
                    code = f"{number}:{bit}"
                    since = self._since.get(code, now())
                    remedy = f"{remedy}, then restart_safety"
                    found[code] = Alarm(code, Severity.ERROR, f"servo {number}: {text}", remedy, since)
        self._since = {code: alarm.since for code, alarm in found.items()}
        return list(found.values())

    def acknowledge(self, code: str) -> None:
        """Refuse: a servo is rebooted on a person's word only; NotFound when `code` does not stand."""
        if code not in {alarm.code for alarm in self.alarms()}:
            raise NotFound(f"{self.name} has no alarm {code}")
        raise Refused(f"alarm {code} of {self.name} needs the person who looked: restart_safety(confirmed_by)")

    # -------------------------------------------------------------------------------- state
    def state(self) -> RobotState:
        """Give the whole state. Raises NotConnected, ConnectionLost, Stale."""
        snapshot = self._observer.current()
        missing = [alarm.text for alarm in self.alarms()]
        powered = all(servo.torque for servo in snapshot.servos)
        if self.control_owner() != "us":
            missing.append("control is not taken")
        elif not powered:
            missing.append("torque is off")
        return RobotState(
            mode=Mode.AUTOMATIC,
            power=Power.OPERATIONAL if powered else Power.OFF,
            safety=Safety.FAULT if any(servo.hardware_error for servo in snapshot.servos) else Safety.NORMAL,
            program=ProgramState.STOPPED,
            control=Control.REMOTE,
            moving=not snapshot.standing,
            speed_override=1.0,
            not_ready_because=missing,
        )

    def get_end_effectors_ids(self) -> set[str]:
        """Give the name of the tool centre point."""
        return {END_EFFECTOR}

    def grippers(self) -> set[str]:
        """Give none."""
        return set()

    def suctions(self) -> set[str]:
        """Give none."""
        return set()

    def robot_joints(self, include_gripper: bool = False) -> list[Joint]:
        """Give the angles, rad. Raises Stale."""
        return self._joints(self._angles(self._observer.current()))

    def get_end_effector_pose(self, end_effector: str) -> Pose:
        """Give the pose of the tool centre point in the world. Raises Stale."""
        self._check_end_effector(end_effector)
        return self._world(self._angles(self._observer.current()))

    def joint_limits(self) -> dict[str, tuple[float, float]]:
        """Give the limits of the settings, rad."""
        return dict(zip(JOINTS, self._limits, strict=True))

    def max_tcp_speed(self) -> float:
        """Give the speed of the stretched arm with both joints at their maximum, m/s."""
        return self._axes.max_joint_speed * (self._links[0] + 2.0 * self._links[1])

    # -------------------------------------------------------------------------------- kinematics
    def forward_kinematics(self, end_effector_id: str, joints: list[Joint]) -> Pose:
        """Give the pose in the world for joints."""
        self._check_end_effector(end_effector_id)
        return self._world(self._checked(joints))

    def inverse_kinematics(
        self,
        end_effector_id: str,
        pose: Pose,
        start_joints: list[Joint] | None = None,
        avoid_collisions: bool = True,
    ) -> list[Joint]:
        """Give the joints that reach a position, with the elbow on the side nearest to `start_joints`.

        Two joints cannot choose the heading: it is what comes of the position. With `avoid_collisions` the elbow is on
        the side on which the arm is free of what stands in the scene.
        Raises KinematicsException out of reach, out of the plane, beyond the limits, or in collision on both sides.
        """
        self._check_end_effector(end_effector_id)
        seed = self._checked(start_joints) if start_joints else self._angles(self._observer.current())
        return self._joints(self._free(pose, seed) if avoid_collisions else self._solve(pose, seed))

    def _free(self, pose: Pose, seed: tuple[float, float]) -> tuple[float, float]:
        """Give the joints for a position that are free, nearest to the seed."""
        q = self._solve(pose, seed)
        if not self.safe_moves.contacts(self._joints(q)):
            return q
        return self._checked(self.safe_moves.inverse(END_EFFECTOR, pose, self._joints(seed)))

    def _solve(self, pose: Pose, seed: tuple[float, float]) -> tuple[float, float]:
        local = self._pose.inverted() * pose
        x, y, z = local.position
        where = f"in its base: {x:.4f}, {y:.4f}, {z:.4f}"
        if not all(map(math.isfinite, (x, y, z))):
            raise OutOfRange(f"{self.name}: the numbers of a pose must be finite")
        upright = Position(0.0, 0.0, 1.0).rotated(local.orientation)
        if abs(z) > OUT_OF_PLANE or math.hypot(upright.x, upright.y) > math.sin(TILTED) or upright.z < 0.0:
            raise self.KinematicsException(f"{self.name} moves in a plane; the pose lies out of it", where)
        solutions = kinematics.inverse(self._links, x, y)
        if not solutions:
            raise self.KinematicsException(f"{self.name} cannot reach the pose", where)
        q = kinematics.nearest(solutions, seed, self._limits)
        if q is None:
            raise self.KinematicsException(f"{self.name} reaches the pose only beyond the limits of its joints", where)
        return q

    def _world(self, q: tuple[float, float]) -> Pose:
        x, y, heading = kinematics.forward(self._links, q)
        return self._pose * Pose(Position(x, y, 0.0), Orientation.from_rotation_vector(0.0, 0.0, heading))

    def _angles(self, snapshot: Snapshot) -> tuple[float, float]:
        first, second = snapshot.servos
        return to_angle(first.position, self._directions[0]), to_angle(second.position, self._directions[1])

    def _ticks(self, q: tuple[float, float]) -> tuple[int, int]:
        return to_ticks(q[0], self._directions[0]), to_ticks(q[1], self._directions[1])

    def _joints(self, q: tuple[float, float]) -> list[Joint]:
        return [Joint(name, value) for name, value in zip(JOINTS, q, strict=True)]

    def _checked(self, joints: list[Joint]) -> tuple[float, float]:
        values = {joint.name: joint.value for joint in joints}
        if set(values) != set(JOINTS) or len(joints) != len(JOINTS):
            raise self.KinematicsException(f"{self.name} has the joints {', '.join(JOINTS)}, not {sorted(values)}")
        for (low, high), name in zip(self._limits, JOINTS, strict=True):
            if not low <= values[name] <= high:
                raise OutOfRange(f"{name} of {self.name} must be {low:g} to {high:g} rad, not {values[name]!r}")
        return values[JOINTS[0]], values[JOINTS[1]]

    def _check_end_effector(self, end_effector: str) -> None:
        if end_effector != END_EFFECTOR:
            raise NotFound(f"{self.name} has no end effector {end_effector!r}, only {END_EFFECTOR}")
