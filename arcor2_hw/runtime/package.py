"""The data of a package on disk, and its action points in world coordinates."""

import copy
import sys
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any, TypeVar

import msgspec
from msgspec.structs import replace

from arcor2_hw.data.cell import Cell as CellFile, overlay
from arcor2_hw.data.geometry import Pose, Position
from arcor2_hw.data.object_type import Box, Cylinder, Mesh, Models, ObjectModel, Sphere
from arcor2_hw.data.package import CollisionModels
from arcor2_hw.data.project import ActionPoint, BareActionPoint, Project, ProjectRobotJoints
from arcor2_hw.data.project_index import ProjectIndex, global_pose
from arcor2_hw.data.scene import Scene, SceneObject
from arcor2_hw.data.secret import ObjectSecrets
from arcor2_hw.runtime.cell import recipes
from arcor2_hw.runtime.creation import Recipe, find_type, prepare_for_sources
from arcor2_hw.runtime.documents import read_document
from arcor2_hw.runtime.program import ACTION_POINT_ATTRIBUTE
from arcor2_hw.runtime.program_values import with_values
from arcor2_hw.runtime.remote_objects import RemoteObjects

T = TypeVar("T")


def package_name(directory: Path, default: str) -> str:
    """Return the name of the package from package.json, or `default` if it has none."""
    try:
        return str(msgspec.json.decode((directory / "package.json").read_bytes())["name"])
    except (OSError, msgspec.MsgspecError, KeyError, TypeError):
        return default


class PackageData:
    """Scene, project and models of a package. `values`: values that replace those of the project, by id."""

    def __init__(self, directory: Path, values: Mapping[str, str] = MappingProxyType({})) -> None:
        data = directory / "data"
        self.scene = read_document(data / "scene.json", Scene)
        self.project = with_values(read_document(data / "project.json", Project), values)
        self.models: dict[str, ObjectModel] = {}
        for path in sorted((data / "models").glob("*.json")):
            model = read_document(path, ObjectModel)
            if model.type.value != "None":
                self.models[model.model().id] = model

    def collision_models(self) -> CollisionModels:
        """Return the models by kind."""
        found: list[Models] = [model.model() for model in self.models.values()]
        return CollisionModels(
            [m for m in found if isinstance(m, Box)],
            [m for m in found if isinstance(m, Sphere)],
            [m for m in found if isinstance(m, Cylinder)],
            [m for m in found if isinstance(m, Mesh)],
        )


class WorldPoints:
    """Action points in world coordinates, computed once. Methods return copies, which the script may change."""

    def __init__(self, scene: Scene, project: Project) -> None:
        index = self._index = ProjectIndex(scene, project)
        points = project.action_points
        self._positions = {point.id: global_pose(index, point).position for point in points}
        self._poses = {o.id: global_pose(index, point, o.orientation) for point in points for o in point.orientations}
        self._parameters = {each.id: msgspec.json.decode(each.value) for each in project.parameters}

    def bare_action_point(self, action_point_id: str) -> ActionPoint:
        """Return an action point of the project with its position in world coordinates."""
        point = self._index.action_point(action_point_id)
        assert isinstance(point, ActionPoint)
        return msgspec.structs.replace(point, position=self.position(action_point_id), parent=msgspec.UNSET)

    def position(self, action_point_id: str) -> Position:
        """Return the position of an action point in world coordinates."""
        return copy.deepcopy(self._positions[self._index.action_point(action_point_id).id])

    def pose(self, orientation_id: str) -> Pose:
        """Return the world pose of an action point with this orientation."""
        point, _ = self._index.orientation(orientation_id)
        return _copy_with_point(self._poses[orientation_id], point)

    def joints(self, joints_id: str) -> ProjectRobotJoints:
        """Return a joint configuration of an action point."""
        point, joints = self._index.joints(joints_id)
        return _copy_with_point(joints, point)

    def parameter(self, parameter_id: str) -> Any:
        """Return the value of a project parameter."""
        return self._parameters[self._index.parameter(parameter_id).id]


def _copy_with_point(value: T, point: BareActionPoint) -> T:
    found = copy.deepcopy(value)
    setattr(found, ACTION_POINT_ATTRIBUTE, point.id)
    return found


def put_on_path(directory: Path) -> None:
    """Make the modules of the package importable. They take precedence over installed modules of the same name."""
    prepare_for_sources()
    path = str(directory)
    if path in sys.path:
        sys.path.remove(path)
    sys.path.insert(0, path)


def package_recipes(
    directory: Path,
    data: PackageData,
    cell_file: CellFile | None,
    secrets: Mapping[str, ObjectSecrets],
    objects: list[SceneObject],
    remotes: RemoteObjects | None,
) -> list[Recipe]:
    """Load the object types of a package and return the recipes of objects of its scene.

    Args:
        directory: The package.
        data: Its documents.
        cell_file: Settings of devices in this cell.
        secrets: Values of secret settings by object id.
        objects: The objects.
        remotes: The objects of other hosts; None without them.

    Raises:
        SceneFault: The first object without a recipe.
        NotFound: A type does not exist.
        InvalidData: A type cannot be imported, or an object has another type in the cell file.
    """
    put_on_path(directory)
    classes = {name: find_type(name) for name in dict.fromkeys(each.type for each in objects)}
    local = [] if cell_file is None else overlay(cell_file, data.scene)
    overridden = [*data.project.object_overrides, *local]
    scene = replace(data.scene, objects=objects)
    return recipes(scene, classes, data.models, overridden, secrets=secrets, remotes=remotes)
