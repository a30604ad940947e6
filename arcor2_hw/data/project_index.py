"""Lookup of the parts of a project by id, and the geometry of its action points (protocol, section 10.1)."""

import copy
from collections.abc import Iterable
from typing import Protocol

from arcor2_hw.data.base import Unset
from arcor2_hw.data.geometry import Orientation, Pose
from arcor2_hw.data.project import (
    Action,
    BareActionPoint,
    NamedOrientation,
    Project,
    ProjectFunction,
    ProjectParameter,
    ProjectRobotJoints,
)
from arcor2_hw.data.scene import Scene, SceneObject
from arcor2_hw.exceptions import InvalidProject, NotFound


class ProjectLookup(Protocol):
    """Lookup of the parts of a project. Each method raises NotFound for an unknown id."""

    def scene_object(self, object_id: str) -> SceneObject:
        """Return an object of the scene."""

    def action_point(self, action_point_id: str) -> BareActionPoint:
        """Return an action point."""

    def orientation(self, orientation_id: str) -> tuple[BareActionPoint, NamedOrientation]:
        """Return an orientation with its action point."""

    def joints(self, joints_id: str) -> tuple[BareActionPoint, ProjectRobotJoints]:
        """Return joints with their action point."""

    def action(self, action_id: str) -> Action:
        """Return an action."""

    def parameter(self, parameter_id: str) -> ProjectParameter:
        """Return a project parameter."""

    def find_function(self, function_id: str) -> ProjectFunction | None:
        """Return a function, None if there is none."""

    def function_of(self, action_id: str) -> str:
        """Return the id of the function that contains an action; empty for an action of the program."""


def _chain(lookup: ProjectLookup, point: BareActionPoint) -> Iterable[Pose]:
    """Yield the parent frames of a point, nearest first. A parent action point only translates."""
    seen = {point.id}
    parent = point.parent
    while not isinstance(parent, Unset):
        try:
            above = lookup.action_point(parent)
        except NotFound:
            obj = lookup.scene_object(parent)
            if isinstance(obj.pose, Unset):
                raise InvalidProject(
                    "{name} has no pose and cannot be the parent of {point_name}", name=obj.name, point_name=point.name
                ) from None
            yield obj.pose
            return
        if above.id in seen:
            raise InvalidProject("action point {name} is its own ancestor", name=point.name)
        seen.add(above.id)
        yield Pose(above.position)
        parent = above.parent


def global_pose(lookup: ProjectLookup, point: BareActionPoint, orientation: Orientation | None = None) -> Pose:
    """Return the pose in the world of an action point with one of its orientations."""
    pose = Pose(copy.copy(point.position), orientation if orientation is not None else Orientation())
    for frame in _chain(lookup, point):
        pose = frame * pose
    return pose


def relative_pose(lookup: ProjectLookup, point: BareActionPoint, pose: Pose) -> Pose:
    """Convert a pose in the world to the frame of the point's position."""
    for frame in reversed(list(_chain(lookup, point))):
        pose = frame.inverted() * pose
    return pose


class ProjectIndex:
    """Lookup in a project and a scene that do not change."""

    def __init__(self, scene: Scene, project: Project) -> None:
        self.scene = scene
        self.project = project
        self._objects = {obj.id: obj for obj in scene.objects}
        self._points = {point.id: point for point in project.action_points}
        self._orientations = {o.id: (p, o) for p in project.action_points for o in p.orientations}
        self._joints = {j.id: (p, j) for p in project.action_points for j in p.robot_joints}
        self._actions = {action.id: action for action in project.all_actions()}
        self._functions = {function.id: function for function in project.functions}
        self._function_of = {action.id: function.id for function in project.functions for action in function.actions}
        self._parameters = {parameter.id: parameter for parameter in project.parameters}

    def scene_object(self, object_id: str) -> SceneObject:
        """Return an object of the scene."""
        try:
            return self._objects[object_id]
        except KeyError:
            raise NotFound("the scene has no object {object_id}", object_id=object_id) from None

    def action_point(self, action_point_id: str) -> BareActionPoint:
        """Return an action point."""
        try:
            return self._points[action_point_id]
        except KeyError:
            raise NotFound(
                "the project has no action point {action_point_id}", action_point_id=action_point_id
            ) from None

    def orientation(self, orientation_id: str) -> tuple[BareActionPoint, NamedOrientation]:
        """Return an orientation with its action point."""
        try:
            return self._orientations[orientation_id]
        except KeyError:
            raise NotFound("the project has no orientation {orientation_id}", orientation_id=orientation_id) from None

    def joints(self, joints_id: str) -> tuple[BareActionPoint, ProjectRobotJoints]:
        """Return joints with their action point."""
        try:
            return self._joints[joints_id]
        except KeyError:
            raise NotFound("the project has no joints {joints_id}", joints_id=joints_id) from None

    def action(self, action_id: str) -> Action:
        """Return an action."""
        try:
            return self._actions[action_id]
        except KeyError:
            raise NotFound("the project has no action {action_id}", action_id=action_id) from None

    def parameter(self, parameter_id: str) -> ProjectParameter:
        """Return a project parameter."""
        try:
            return self._parameters[parameter_id]
        except KeyError:
            raise NotFound("the project has no parameter {parameter_id}", parameter_id=parameter_id) from None

    def find_function(self, function_id: str) -> ProjectFunction | None:
        """Return a function, None if there is none."""
        return self._functions.get(function_id)

    def function_of(self, action_id: str) -> str:
        """Return the id of the function that contains an action; empty for an action of the program."""
        return self._function_of.get(action_id, "")
