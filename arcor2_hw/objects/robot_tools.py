"""Models and meshes of a robot, of other robots and of obstacles, for use by one thread.

Pinocchio and coal come with the extra `kinematics` and are imported on first use.
"""

import dataclasses
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from arcor2_hw.data.object_type import Mesh
from arcor2_hw.data.robot import KinematicCalibration
from arcor2_hw.exceptions import Arcor2Error, Refused
from arcor2_hw.objects.robot import Robot
from arcor2_hw.objects.surroundings import Obstacle, Surroundings

if TYPE_CHECKING:
    from arcor2_hw.kinematics.arm import Arm
    from arcor2_hw.kinematics.inverse import InverseKinematics
    from arcor2_hw.kinematics.model import RobotModel
    from arcor2_hw.kinematics.shapes import TriangleMesh


class RobotTools:
    """Model, arms and meshes of a robot, and models of other robots.

    Attributes:
        made_of: Settings, package and calibration. A change of these creates a new object.

    Raises:
        Refused: The robot has no package, or the extra `kinematics` is not installed.
        ModelError: The model cannot be used, or the calibration belongs to another robot.
    """

    def __init__(
        self, robot: Robot, settings: dict[str, object], package: Path | None, calibration: KinematicCalibration | None
    ) -> None:
        self.made_of = settings, package, calibration
        self._surroundings: Surroundings = robot.surroundings
        if package is None:
            raise Refused("{name} has no URDF model, so its kinematics cannot be computed", name=robot.name)
        self.model = _load(robot, settings, package, calibration)
        self.model.name = robot.name
        self._arms: dict[str, Arm] = {}
        self._inverse: dict[str, InverseKinematics] = {}
        self._others: dict[str, tuple[object, RobotModel | None]] = {}
        self._meshes: dict[tuple[Path, tuple[float, float, float]], TriangleMesh] = {}

    def arm(self, end_effector: str) -> "Arm":
        """Return the chain to an end effector.

        Raises:
            NotFound: The end effector does not exist.
        """
        if end_effector not in self._arms:
            self._arms[end_effector] = self.model.arm(end_effector)
        return self._arms[end_effector]

    def inverse(self, end_effector: str) -> "InverseKinematics":
        """Return the inverse kinematics of an end effector.

        Raises:
            NotFound: The end effector does not exist.
        """
        from arcor2_hw.kinematics.inverse import InverseKinematics

        if end_effector not in self._inverse:
            self._inverse[end_effector] = InverseKinematics(self.arm(end_effector))
        return self._inverse[end_effector]

    def other(self, robot: Robot) -> "RobotModel | None":
        """Return the model of another robot, or None if it has none."""
        settings, calibration = settings_of(robot), self._surroundings.calibration(robot.id)
        known = self._others.get(robot.name)
        if known is None or known[0] != (settings, calibration):
            package = package_of(robot)
            model = None if package is None else _load(robot, settings, package, calibration)
            known = self._others[robot.name] = (settings, calibration), model
        return known[1]

    def shape(self, obstacle: Obstacle) -> Any:
        """Return the shape of an obstacle.

        Raises:
            Refused: The file of a mesh is missing.
            BadMesh: A mesh cannot be used.
        """
        from arcor2_hw.kinematics import shapes
        from arcor2_hw.kinematics.meshes import read_mesh
        from arcor2_hw.kinematics.model_package import MAX_MESH

        model = obstacle.model
        if not isinstance(model, Mesh):
            return shapes.of_model(model)
        file, scale = obstacle.file or self._surroundings.asset(model.asset_id), obstacle.scale
        if file is None or not file.is_file():
            raise Refused(
                "the mesh of {name} is not available, so paths cannot be checked for collisions", name=obstacle.name
            )
        if (file, scale) not in self._meshes:
            with file.open("rb") as opened:
                self._meshes[file, scale] = read_mesh(opened.read(MAX_MESH + 1), model.asset_id, scale)
        return shapes.of_model(model, self._meshes[file, scale])


def _load(
    robot: Robot, settings: Mapping[str, object], package: Path, calibration: KinematicCalibration | None
) -> "RobotModel":
    try:
        from arcor2_hw.kinematics.dh import calibrated_model
        from arcor2_hw.kinematics.model import RobotModel
    except ImportError as error:
        raise Refused(
            "{name}: kinematics are not available. Install arcor2-hw[kinematics].", str(error), name=robot.name
        ) from error
    try:
        nominal = RobotModel.load(package, settings)
        return nominal if calibration is None else calibrated_model(nominal, calibration)
    except Arcor2Error as error:
        raise type(error)(
            "The model of {robot} cannot be used: {reason}", error.detail, robot=robot.name, reason=error
        ) from error


def package_of(robot: Robot) -> Path | None:
    """Return the file or folder with a robot's URDF: uploaded, or next to the module of the class that names it."""
    for base in type(robot).__mro__:
        name: str | None = base.__dict__.get("urdf_package_name")
        if name is None:
            continue
        uploaded = robot.surroundings.asset(name)
        if uploaded is not None and uploaded.is_file():
            return uploaded
        module = sys.modules.get(base.__module__)
        if module is None or not module.__file__:
            return None
        folder = Path(module.__file__).parent / "urdf"
        return next((path for path in (folder / name.removesuffix(".zip"), folder / name) if path.exists()), None)
    return None


def settings_of(robot: Robot) -> dict[str, object]:
    """Return the settings of an object by name."""
    settings = robot.__dict__.get("_settings")
    if settings is None or not dataclasses.is_dataclass(settings):
        return {}
    return {field.name: getattr(settings, field.name) for field in dataclasses.fields(settings)}
