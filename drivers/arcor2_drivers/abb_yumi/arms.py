"""Arms: identity, settings, tools and location of both arms, with the checks that depend on them."""

from typing import Final

from arcor2_hw.data.geometry import Pose
from arcor2_hw.data.robot import Joint
from arcor2_hw.exceptions import InvalidData, NotFound, Refused
from arcor2_hw.objects import MultiArmRobot
from arcor2_hw.objects.arm import joint_values
from arcor2_hw.objects.settings import within

from .nominal import LIMITS
from .observer import UNITS, Sample
from .settings import ARMS, YumiSettings

JOINTS: Final = {arm: tuple(f"{unit}_{number}" for number in range(1, 8)) for arm, unit in UNITS.items()}
"""Axes 1 to 7 of each mechanical unit. Axis 7, eax_a on the wire, is between axes 2 and 3."""
JOINT_LIMITS: Final = {arm: dict(zip(names, LIMITS, strict=True)) for arm, names in JOINTS.items()}
LIMIT_TOLERANCE: Final = 1e-4
"""Rounding error of a transmitted joint value at its limit, rad."""


def other_arm(arm: str) -> str:
    """Return the other arm."""
    return ARMS[1 - ARMS.index(arm)]


class Arms:
    """Data of both arms that the parts of the driver share."""

    def __init__(self, robot: MultiArmRobot, settings: YumiSettings) -> None:
        self._robot = robot
        self.name = robot.name
        self.settings = settings
        self.tools = {arm: settings.tcp(arm) for arm in ARMS}
        self.loads = {arm: settings.load(arm) for arm in ARMS}

    @property
    def pose(self) -> Pose:
        """Return the robot in the world."""
        return self._robot.pose

    def tcp(self, sample: Sample, arm: str) -> Pose:
        """Return the TCP of an arm in the world."""
        return self.pose * sample.targets[arm].pose * self.tools[arm]

    def one(self, arm_id: str | None) -> str:
        """Return the id of the arm. Raise InvalidData without an id, NotFound for an unknown one."""
        if arm_id is None:
            raise InvalidData("{name} has two arms. Specify one of {arms}.", name=self.name, arms=", ".join(ARMS))
        if arm_id not in ARMS:
            raise NotFound(
                "{name} has no arm {arm_id!r}, only {arms}.", name=self.name, arm_id=arm_id, arms=", ".join(ARMS)
            )
        return arm_id

    def some(self, arm_id: str | None) -> tuple[str, ...]:
        """Return the arm, or both if none is named."""
        return ARMS if arm_id is None else (self.one(arm_id),)

    def joint_values(self, joints: list[Joint], arm: str) -> list[float]:
        """Return joint values in the order of the axes. Raise InvalidData or OutOfRange."""
        return joint_values(f"the {arm} arm of {self.name}", joints, JOINT_LIMITS[arm], LIMIT_TOLERANCE)

    def within(self, name: str, value: float, low: float, high: float) -> None:
        """Raise OutOfRange, naming robot and parameter, unless a value is in its range."""
        within(f"{self.name}: {name}", value, low, high)

    def check_loads(self) -> None:
        """Raise Refused unless the load of both arms is set."""
        if missing := [f"{arm}_mass" for arm in ARMS if self.settings.load(arm) is None]:
            names = " and ".join(missing)
            raise Refused(
                "{name}: {names} not set. Enter the mass at the flange before taking control.",
                name=self.name,
                names=names,
            )
