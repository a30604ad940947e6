"""Object types of the Universal Robots e-series: UR3e, UR5e, UR10e."""

from arcor2_hw.data.geometry import Pose

from .geometry import UR3E, UR5E, UR10E
from .settings import UrSettings
from .universal_robot import UniversalRobot


class UR5e(UniversalRobot):
    """Universal Robots UR5e: six axes, 5 kg, 850 mm."""

    _ABSTRACT = False
    urdf_package_name = "ur5e.zip"
    model = UR5E

    def __init__(self, obj_id: str, name: str, pose: Pose, settings: UrSettings) -> None:
        super().__init__(obj_id, name, pose, settings)


class UR3e(UniversalRobot):
    """Universal Robots UR3e: six axes, 3 kg, 500 mm."""

    _ABSTRACT = False
    urdf_package_name = "ur3e.zip"
    model = UR3E

    def __init__(self, obj_id: str, name: str, pose: Pose, settings: UrSettings) -> None:
        super().__init__(obj_id, name, pose, settings)


class UR10e(UniversalRobot):
    """Universal Robots UR10e: six axes, 12.5 kg, 1300 mm."""

    _ABSTRACT = False
    urdf_package_name = "ur10e.zip"
    model = UR10E

    def __init__(self, obj_id: str, name: str, pose: Pose, settings: UrSettings) -> None:
        super().__init__(obj_id, name, pose, settings)
