"""Robot models that several benchmarks use."""

from pathlib import Path
from typing import Final

import arcor2_drivers

UR5E: Final = Path(next(iter(arcor2_drivers.__path__))) / "universal_robots" / "urdf" / "ur5e"
"""Folder of the UR5e's model."""
