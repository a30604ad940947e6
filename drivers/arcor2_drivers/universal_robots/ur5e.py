"""The Universal Robots e-series arms: UR5e, UR3e, UR10e."""

import math
from typing import ClassVar

from arcor2_hw.data.geometry import Pose

from .geometry import UR3E, UR10E, Dimensions
from .settings import UrSettings
from .ur_tasks import UrTasks


class UR5e(UrTasks):
    """Universal Robots UR5e: six axes, 5 kg, 850 mm."""

    _ABSTRACT = False
    urdf_package_name = "ur5e.zip"

    def __init__(self, obj_id: str, name: str, pose: Pose, settings: UrSettings) -> None:
        super().__init__(obj_id, name, pose, settings)


class UR3e(UrTasks):
    """Universal Robots UR3e: six axes, 3 kg, 500 mm."""

    _ABSTRACT = False
    urdf_package_name = "ur3e.zip"
    max_payload: ClassVar[float] = 3.0
    reach: ClassVar[float] = 0.5
    dimensions: ClassVar[Dimensions] = UR3E
    joint_limit: ClassVar[float] = 2.0 * math.pi

    def __init__(self, obj_id: str, name: str, pose: Pose, settings: UrSettings) -> None:
        super().__init__(obj_id, name, pose, settings)


class UR10e(UrTasks):
    """Universal Robots UR10e: six axes, 12.5 kg, 1300 mm."""

    _ABSTRACT = False
    urdf_package_name = "ur10e.zip"
    max_payload: ClassVar[float] = 12.5
    reach: ClassVar[float] = 1.3
    dimensions: ClassVar[Dimensions] = UR10E

    def __init__(self, obj_id: str, name: str, pose: Pose, settings: UrSettings) -> None:
        super().__init__(obj_id, name, pose, settings)
