"""The data of a package on disk, and its action points in world coordinates."""

import copy
import sys
from pathlib import Path
from typing import Any, TypeVar

import msgspec

from arcor2_hw.data.geometry import Pose, Position
from arcor2_hw.data.object_type import Box, Cylinder, Mesh, Models, ObjectModel, Sphere
from arcor2_hw.data.package import CollisionModels
from arcor2_hw.data.project import ActionPoint, Project, ProjectRobotJoints
from arcor2_hw.data.project_index import ProjectIndex, global_pose
from arcor2_hw.data.scene import Scene
from arcor2_hw.exceptions import NotFound
from arcor2_hw.runtime.creation import prepare_for_sources
from arcor2_hw.runtime.documents import read_document
from arcor2_hw.runtime.program import ACTION_POINT_ATTRIBUTE

T = TypeVar("T")


def package_name(directory: Path, default: str) -> str:
    """Return the name of the package from package.json, or `default` if it has none."""
    try:
        return str(msgspec.json.decode((directory / "package.json").read_bytes())["name"])
    except (OSError, msgspec.MsgspecError, KeyError, TypeError):
        return default


class PackageData:
    """Scene, project and models of a package."""

    def __init__(self, directory: Path) -> None:
        data = directory / "data"
        self.scene = read_document(data / "scene.json", Scene)
        self.project = read_document(data / "project.json", Project)
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
        index = ProjectIndex(scene, project)
        self._points: dict[str, ActionPoint] = {point.id: point for point in project.action_points}
        self._positions: dict[str, Position] = {}
        self._poses: dict[str, Pose] = {}
        self._joints: dict[str, ProjectRobotJoints] = {}
        self._parameters: dict[str, Any] = {}
        self._point_of: dict[str, str] = {}
        for point in project.action_points:
            self._positions[point.id] = global_pose(index, point).position
            for named in point.orientations:
                self._poses[named.id] = global_pose(index, point, named.orientation)
                self._point_of[named.id] = point.id
            for joints in point.robot_joints:
                self._joints[joints.id] = joints
                self._point_of[joints.id] = point.id
        for parameter in project.parameters:
            self._parameters[parameter.id] = msgspec.json.decode(parameter.value)

    def _copy_with_point(self, value: T, item: str) -> T:
        found = copy.deepcopy(value)
        setattr(found, ACTION_POINT_ATTRIBUTE, self._point_of[item])
        return found

    def bare_action_point(self, action_point_id: str) -> ActionPoint:
        """Return an action point of the project with its position in world coordinates."""
        try:
            point = self._points[action_point_id]
        except KeyError:
            raise NotFound(
                "the project has no action point {action_point_id}", action_point_id=action_point_id
            ) from None
        return msgspec.structs.replace(point, position=self.position(action_point_id), parent=msgspec.UNSET)

    def position(self, action_point_id: str) -> Position:
        """Return the position of an action point in world coordinates."""
        try:
            return copy.deepcopy(self._positions[action_point_id])
        except KeyError:
            raise NotFound(
                "the project has no action point {action_point_id}", action_point_id=action_point_id
            ) from None

    def pose(self, orientation_id: str) -> Pose:
        """Return the world pose of an action point with this orientation."""
        try:
            return self._copy_with_point(self._poses[orientation_id], orientation_id)
        except KeyError:
            raise NotFound("the project has no orientation {orientation_id}", orientation_id=orientation_id) from None

    def joints(self, joints_id: str) -> ProjectRobotJoints:
        """Return a joint configuration of an action point."""
        try:
            return self._copy_with_point(self._joints[joints_id], joints_id)
        except KeyError:
            raise NotFound("the project has no joints {joints_id}", joints_id=joints_id) from None

    def parameter(self, parameter_id: str) -> Any:
        """Return the value of a project parameter."""
        try:
            return self._parameters[parameter_id]
        except KeyError:
            raise NotFound("the project has no parameter {parameter_id}", parameter_id=parameter_id) from None


def put_on_path(directory: Path) -> None:
    """Make the modules of the package importable. They take precedence over installed modules of the same name."""
    prepare_for_sources()
    path = str(directory)
    if path in sys.path:
        sys.path.remove(path)
    sys.path.insert(0, path)
