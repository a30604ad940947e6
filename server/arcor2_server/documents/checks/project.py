"""Checks of projects and their parameters."""

from collections.abc import Callable, Iterator
from typing import Any

import msgspec

from arcor2_hw.data.base import Unset, is_valid_name
from arcor2_hw.data.project import Action, Project, ProjectFunction, ProjectParameter, ProjectRobotJoints
from arcor2_hw.data.project_index import ProjectLookup
from arcor2_hw.data.scene import Scene
from arcor2_hw.exceptions import Arcor2Error, InvalidData, NotFound
from arcor2_hw.messages import Message
from arcor2_server.documents.checks.actions import check_action
from arcor2_server.documents.checks.functions import check_function
from arcor2_server.documents.checks.names import check_name, duplicate_names
from arcor2_server.documents.checks.object_types import Types
from arcor2_server.documents.checks.scene import scene_findings
from arcor2_server.documents.document import Document
from arcor2_server.documents.reparenting import check_parent


def check_project_parameter(parameter: ProjectParameter) -> None:
    """Raise InvalidData for a project parameter with an invalid name, or a value other than bool, number or string."""
    check_name(parameter.name, "project parameter")
    expected = {"boolean": bool, "integer": int, "double": float, "string": str}.get(parameter.type)
    try:
        value = msgspec.json.decode(parameter.value, type=bool | int | float | str)
    except msgspec.DecodeError:
        raise InvalidData(
            "{name}: the value {value} is not JSON of a truth value, number or text.",
            name=parameter.name,
            value=parameter.value[:80],
        ) from None
    if expected is not None and type(value) is not expected:
        raise InvalidData(
            "{name}: {value} is not of type {type}.",
            name=parameter.name,
            value=parameter.value[:80],
            type=parameter.type,
        )


def project_problems(scene: Scene, project: Project, types: Types) -> list[Message]:
    """Return the problems of a project on its scene. The cost is linear in their size."""
    return [problem for _, problem in project_findings(scene, project, types)]


def project_findings(scene: Scene, project: Project, types: Types) -> Iterator[tuple[str, Message]]:
    """Return the problems of a project on its scene, each with the faulty entry.

    An entry is a path such as `scene.objects[2]` or `project.action_points[0].actions[1]`.
    """
    if project.scene_id != scene.id:
        yield (
            "project.scene_id",
            Message.of(
                "The project {name} belongs to another scene than {scene}.", name=project.name, scene=scene.name
            ),
        )
        return
    for entry, problem in scene_findings(scene, types):
        yield f"scene.{entry}", problem
    document = Document.of(scene, project)
    for index, parameter in enumerate(project.parameters):
        for problem in _problem(check_project_parameter, parameter):
            yield f"project.parameters[{index}]", problem
    yield from _parent_problems(document, project)
    for index, point in enumerate(project.action_points):
        at = f"project.action_points[{index}]"
        if not is_valid_name(point.name):
            yield at, Message.of("{name!r} is not a valid name for an action point.", name=point.name)
        for number, joints in enumerate(point.robot_joints):
            for problem in _problem(_check_joints, point.name, joints, document, types):
                yield f"{at}.robot_joints[{number}]", problem
        for number, action in enumerate(point.actions):
            for problem in _problem(check_action, action, document, types):
                yield f"{at}.actions[{number}]", problem
    for problem in duplicate_names((point.name for point in project.action_points), "action point"):
        yield "project.action_points", problem
    yield from _function_findings(document, project, types)
    for problem in duplicate_names((action.name for action in project.all_actions()), "action"):
        yield "project.action_points", problem


def _function_findings(document: Document, project: Project, types: Types) -> Iterator[tuple[str, Message]]:
    for index, function in enumerate(project.functions):
        at = f"project.functions[{index}]"
        for problem in _problem(check_function, function, document, types):
            yield at, problem
        for number, action in enumerate(function.actions):
            for problem in _problem(check_action, action, document, types, function):
                yield f"{at}.actions[{number}]", problem
    for problem in duplicate_names((function.name for function in project.functions), "function"):
        yield "project.functions", problem


def _problem(check: Callable[..., None], *args: Any) -> list[Message]:
    try:
        check(*args)
    except Arcor2Error as error:
        # The error of a failed look-up does not name the item that refers to the missing one.
        name = next((arg.name for arg in args if isinstance(arg, Action | ProjectParameter | ProjectFunction)), "")
        named = not name or str(error).startswith(name)
        return [error.message if named else Message.of("{name}: {reason}", name=name, reason=error)]
    return []


def _check_joints(point: str, joints: ProjectRobotJoints, lookup: ProjectLookup, types: Types) -> None:
    try:
        types.robot_meta(lookup.scene_object(joints.robot_id).type)
    except NotFound:
        raise InvalidData(
            "{point}: the joints {name} belong to no robot of the scene.", point=point, name=joints.name
        ) from None


def _parent_problems(document: Document, project: Project) -> Iterator[tuple[str, Message]]:
    parents = {point.id: point for point in project.action_points}
    places = {point.id: f"project.action_points[{index}]" for index, point in enumerate(project.action_points)}
    checked: set[str] = set()
    for point in project.action_points:
        path: dict[str, None] = {}
        at = point
        while at.id not in checked:
            if at.id in path:
                yield places[at.id], Message.of("The action point {name} is its own ancestor.", name=at.name)
                break
            path[at.id] = None
            if isinstance(at.parent, Unset):
                break
            if (above := parents.get(at.parent)) is None:
                for problem in _problem(check_parent, document, at.parent, at.name):
                    yield places[at.id], problem
                break
            at = above
        checked.update(path)
