"""Arm: identity, settings and location of one UR arm, with the conversions and checks that depend on them."""

import math

from arcor2_hw.data.geometry import Pose
from arcor2_hw.data.robot import Joint
from arcor2_hw.exceptions import OutOfRange
from arcor2_hw.objects import Robot
from arcor2_hw.objects.arm import joint_values
from arcor2_hw.objects.settings import within

from .geometry import JOINT_LIMITS, ArmModel, from_vector, to_vector, world_from_base
from .observer import Sample
from .settings import UrSettings


class Arm:
    """Data of the arm that the parts of the driver share."""

    def __init__(self, robot: Robot, model: ArmModel, settings: UrSettings) -> None:
        self._robot = robot
        self.name = robot.name
        self.model = model
        self.settings = settings

    @property
    def pose(self) -> Pose:
        """Return base_link in the world."""
        return self._robot.pose

    @property
    def base(self) -> Pose:
        """Return the controller's base in the world."""
        return world_from_base(self.pose)

    def tcp(self, sample: Sample) -> Pose:
        """Return the TCP of a sample in the world."""
        return self.base * from_vector(sample.tcp)

    def vector(self, pose: Pose) -> list[float]:
        """Return a pose in the world as the controller expects it. Raise OutOfRange unless it is finite."""
        vector = to_vector(self.base.inverted() * pose)
        if not all(map(math.isfinite, vector)):
            raise OutOfRange("{name}: the numbers of a pose must be finite.", name=self.name)
        return vector

    def joint_values(self, joints: list[Joint]) -> list[float]:
        """Return joint values in the controller's order. Raise InvalidData or OutOfRange."""
        return joint_values(self.name, joints, JOINT_LIMITS)

    def within(self, name: str, value: float, low: float, high: float) -> None:
        """Raise OutOfRange, naming arm and parameter, unless a value is in its range."""
        within(f"{self.name}: {name}", value, low, high)

    def check_speed(self, speed: float, acceleration: float = 1.0) -> None:
        """Raise OutOfRange unless speed and acceleration are fractions of the maxima."""
        self.within("speed", speed, 0.001, 1.0)
        self.within("acceleration", acceleration, 0.01, 1.0)
