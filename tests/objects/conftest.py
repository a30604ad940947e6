"""A simple robot arm with a URDF, and obstacles placed by the test."""

import importlib
import shutil
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import arcor2_drivers
from arcor2_hw.data import object_type
from arcor2_hw.data.geometry import Orientation, Pose, Position
from arcor2_hw.data.robot import Joint, KinematicCalibration
from arcor2_hw.exceptions import Refused
from arcor2_hw.objects import Robot
from arcor2_hw.objects.surroundings import Obstacle

URDF = Path(next(iter(arcor2_drivers.__path__))) / "universal_robots" / "urdf" / "ur5e" / "ur5e.urdf"
NAMES = ("shoulder_pan", "shoulder_lift", "elbow", "wrist_1", "wrist_2", "wrist_3")
READY = (0.0, -1.57, 1.57, -1.57, -1.57, 0.0)
ACROSS = (np.pi - 0.4, -1.57, 1.57, -1.57, -1.57, 0.0)
BASE = Pose(Position(0.5, -0.2, 0.1), Orientation.from_rotation_vector(0.0, 0.0, 0.7))
SOURCE = '''"""A robot arm that goes from joint values to joint values."""

from arcor2_hw.data.robot import Joint, KinematicCalibration
from arcor2_hw.exceptions import Cancelled
from arcor2_hw.objects.motion_path import MotionPath
from arcor2_hw.objects.urdf_robot import UrdfRobot


class PlainArm(UrdfRobot):
    """A plain arm."""

    _ABSTRACT = False
    urdf_package_name = "plain_arm.zip"

    def robot_joints(self, include_gripper: bool = False) -> list[Joint]:
        """Return the present joint values."""
        gripper = [Joint("finger", 0.01)] if include_gripper else []
        return [*self.now, *gripper]

    def follow(self, path: MotionPath) -> None:
        """Go from waypoint to waypoint."""
        self.paths.append(path)
        for waypoint in path.waypoints[1:]:
            self.now = waypoint

    def stop(self) -> None:
        """Stop."""
        super().stop()
'''


class FixedSurroundings:
    """Surroundings defined by the test."""

    def __init__(self) -> None:
        self.things: list[Obstacle] = []
        self.others: list[tuple[Robot, list[Joint]]] = []
        self.unknown = ""
        self.files: dict[str, Path] = {}

    def obstacles(self) -> list[Obstacle]:
        return self.things

    def robots(self) -> list[tuple[Robot, list[Joint]]]:
        if self.unknown:
            raise Refused(f"The position of {self.unknown} is unknown.")
        return self.others

    def asset(self, asset_id: str) -> Path | None:
        return self.files.get(asset_id)

    def calibration(self, robot_id: str) -> KinematicCalibration | None:
        return None

    def box(self, name: str, at: Position, *sizes: float) -> None:
        self.things.append(Obstacle(name, object_type.Box(name, *sizes), BASE * Pose(at)))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """Driver folder, as in an installed distribution."""
    root = tmp_path_factory.mktemp("plain")
    package = root / "plain_driver"
    (package / "urdf" / "plain_arm").mkdir(parents=True)
    shutil.copy(URDF, package / "urdf" / "plain_arm" / "arm.urdf")
    (package / "__init__.py").write_text("")
    (package / "plain_arm.py").write_text(SOURCE)
    sys.path.insert(0, str(root))
    yield package
    sys.path.remove(str(root))
    for name in [name for name in sys.modules if name.startswith("plain_driver")]:
        del sys.modules[name]


@pytest.fixture
def surroundings() -> FixedSurroundings:
    return FixedSurroundings()


@pytest.fixture
def arm(folder: Path, surroundings: FixedSurroundings) -> Any:
    return new_arm(folder, surroundings, "plain")


def new_arm(folder: Path, surroundings: FixedSurroundings, name: str, pose: Pose = BASE) -> Any:
    cls = importlib.import_module("plain_driver.plain_arm").PlainArm
    device = cls("id", name, pose)
    device.now, device.paths = joints(READY), []
    device.surround(surroundings)
    return device


def joints(values: tuple[float, ...]) -> list[Joint]:
    return [Joint(f"{name}_joint", float(value)) for name, value in zip(NAMES, values, strict=True)]


def values(found: list[Joint]) -> Any:
    return np.array([joint.value for joint in found])


def moved(pose: Pose, x: float, y: float, z: float) -> Pose:
    """Return a position in the frame of the robot's base."""
    return Pose(pose.position + Position(x, y, z).rotated(BASE.orientation), pose.orientation)


WALL = (Position(0.0, 0.55, 0.5), 0.04, 0.5, 1.0)
