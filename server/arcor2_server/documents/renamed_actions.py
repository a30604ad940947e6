"""Updates actions of projects whose object type has renamed a method or a parameter."""

from typing import Protocol

from msgspec.structs import replace

from arcor2_hw.data.object_type import ObjectAction
from arcor2_hw.data.project import Action, Project
from arcor2_hw.data.scene import Scene
from arcor2_hw.exceptions import NotFound


class Types(Protocol):
    """Access to the actions of object types."""

    def action(self, type_name: str, name: str) -> ObjectAction:
        """Return the action with this present or former name. Raise NotFound if there is none."""


def with_present_name(action: Action, meta: ObjectAction) -> Action:
    """Return an action with the present names of its method and parameters."""
    object_id, _, method = action.type.partition("/")
    parameters = [replace(each, name=meta.present_name(each.name)) for each in action.parameters]
    if parameters != action.parameters:
        action = replace(action, parameters=parameters)
    return action if method == meta.name else replace(action, type=f"{object_id}/{meta.name}")


def with_present_names(scene: Scene, project: Project, types: Types) -> Project:
    """Return a project with the present names of its actions; unknown actions are unchanged."""
    type_of = {placed.id: placed.type for placed in scene.objects}

    def renamed(action: Action) -> Action:
        object_id, _, method = action.type.partition("/")
        try:
            return with_present_name(action, types.action(type_of.get(object_id, ""), method))
        except NotFound:
            return action

    points, functions = (
        [replace(each, actions=[renamed(action) for action in each.actions]) for each in lists]
        for lists in (project.action_points, project.functions)
    )
    if points == project.action_points and functions == project.functions:
        return project
    return replace(project, action_points=points, functions=functions)
