"""Converts a script to a project whose actions have all parameters."""

from collections.abc import Mapping

from msgspec.structs import replace

from arcor2_hw.data.project import Action, Project
from arcor2_hw.data.scene import Scene
from arcor2_server.build.frame import TypeFacts
from arcor2_server.build.reading.project import from_script
from arcor2_server.documents.checks.actions import complete_parameters


def completed_from_script(source: str, scene: Scene, project: Project, facts: Mapping[str, TypeFacts]) -> Project:
    """Return the project updated from its script (see `from_script`), with default values added, as editors do."""
    return completed(from_script(source, scene, project, facts), scene, facts)


def completed(project: Project, scene: Scene, facts: Mapping[str, TypeFacts]) -> Project:
    """Return the project with default values for missing parameters."""
    functions = {function.id for function in project.functions}
    type_of = {obj.id: obj.type for obj in scene.objects}

    def with_defaults(action: Action) -> Action:
        object_id, method = action.parse_type()
        if action.is_parallel or object_id in functions:
            return action  # parallel work has no parameters, and a call states all of them
        return complete_parameters(action, facts[type_of[object_id]].actions[method])

    points, changed = (
        [replace(each, actions=[with_defaults(action) for action in each.actions]) for each in lists]
        for lists in (project.action_points, project.functions)
    )
    return replace(project, action_points=points, functions=changed)
