"""Object types of the Universal Robots e-series: UR3e, UR5e, UR10e."""

from .geometry import UR3E, UR5E, UR10E
from .universal_robot import UniversalRobot


class UR5e(UniversalRobot):
    """Universal Robots UR5e: six axes, 5 kg, 850 mm."""

    _ABSTRACT = False
    display_name = "Universal Robots UR5e"
    urdf_package_name = "ur5e.zip"
    model = UR5E


class UR3e(UniversalRobot):
    """Universal Robots UR3e: six axes, 3 kg, 500 mm."""

    _ABSTRACT = False
    display_name = "Universal Robots UR3e"
    urdf_package_name = "ur3e.zip"
    model = UR3E


class UR10e(UniversalRobot):
    """Universal Robots UR10e: six axes, 12.5 kg, 1300 mm."""

    _ABSTRACT = False
    display_name = "Universal Robots UR10e"
    urdf_package_name = "ur10e.zip"
    model = UR10E
