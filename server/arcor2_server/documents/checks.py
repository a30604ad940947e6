"""Checks of objects, actions, scenes and projects: pure functions over data and object types."""

from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from typing import Any, Protocol

import msgspec
from msgspec import UNSET
from msgspec.structs import replace

from arcor2_hw.actions.parameter_types import PARAMETER_TYPES
from arcor2_hw.data.base import Unset, is_valid_name
from arcor2_hw.data.object_type import ObjectAction, ObjectTypeMeta, ParameterMeta
from arcor2_hw.data.parameter import Parameter
from arcor2_hw.data.project import (
    Action,
    ActionParameter,
    ActionParameterType,
    BareActionPoint,
    Flow,
    FlowTypes,
    NamedOrientation,
    Project,
    ProjectParameter,
    ProjectRobotJoints,
    parse_link,
)
from arcor2_hw.data.project_index import ProjectLookup
from arcor2_hw.data.robot import RobotMeta
from arcor2_hw.data.scene import Scene, SceneObject
from arcor2_hw.exceptions import Arcor2Error, InvalidData, NotFound
from arcor2_server.documents.document import Document
from arcor2_server.documents.renamed_actions import with_present_name
from arcor2_server.documents.reparenting import check_parent


class Types(Protocol):
    """Access to the object types (arcor2_server.object_types.registry.ObjectTypes)."""

    def meta(self, name: str) -> ObjectTypeMeta:
        """Return one type. Raise NotFound if there is none."""

    def action(self, type_name: str, name: str) -> ObjectAction:
        """Return one action. Raise NotFound if there is none."""

    def robot_meta(self, name: str) -> RobotMeta:
        """Return the features of a robot type. Raise NotFound if the type is not a robot."""


def check_name(name: str, what: str) -> None:
    """Raise InvalidData for a name that is not valid in a program; `what` is what it names ("action point")."""
    if not is_valid_name(name):
        raise InvalidData(
            "{name!r} cannot name {item}: use letters, digits and _, no digit first, no Python keyword.",
            name=name,
            item=f"an {what}" if what[0] in "aeiou" else f"a {what}",
        )


# ---------------------------------------------------------------------------------------------- scene
def object_problems(obj: SceneObject, types: Types) -> list[str]:
    """Return the problems of an object of a scene."""
    problems = []
    if not is_valid_name(obj.name):
        problems.append(f"{obj.name!r} is not a valid name for an object.")
    try:
        meta = types.meta(obj.type)
    except NotFound:
        return [*problems, f"{obj.name}: the object type {obj.type} does not exist."]
    if meta.disabled:
        why = "" if isinstance(meta.problem, Unset) else f" ({meta.problem})"
        return [*problems, f"{obj.name}: the object type {obj.type} cannot be used{why}."]
    if meta.abstract:
        problems.append(f"{obj.name}: {obj.type} is abstract; use a type derived from it.")
    if meta.has_pose and isinstance(obj.pose, Unset):
        problems.append(f"{obj.name}: {obj.type} needs a pose.")
    if not meta.has_pose and not isinstance(obj.pose, Unset):
        problems.append(f"{obj.name}: {obj.type} has no pose.")
    return problems + settings_problems(obj.name, obj.parameters, meta)


def settings_problems(name: str, given: Iterable[Parameter], meta: ObjectTypeMeta) -> list[str]:
    """Return the problems of the settings of the object `name`."""
    known = {setting.name: setting for setting in meta.settings}
    problems = []
    seen = set()
    for parameter in given:
        if parameter.name in seen:
            problems.append(f"{name}: the setting {parameter.name} is given twice.")
        seen.add(parameter.name)
        if (setting := known.get(parameter.name)) is None:
            problems.append(f"{name}: {meta.type} has no setting {parameter.name}.")
            continue
        try:
            check_setting(parameter, setting)
        except InvalidData as error:
            problems.append(f"{name}: {error}")
    missing = [s.name for s in meta.settings if s.name not in seen and isinstance(s.default_value, Unset)]
    return problems + [f"{name}: the setting {setting} is missing." for setting in missing]


def check_setting(parameter: Parameter, meta: ParameterMeta) -> None:
    """Raise InvalidData for a setting with a wrong type or value."""
    if (kind := PARAMETER_TYPES.get(meta.type)) is not None:
        kind.check(parameter, meta)
    elif parameter.type != meta.type:
        raise InvalidData(
            "setting {name} must be of type {type}, not {parameter_type}",
            name=parameter.name,
            type=meta.type,
            parameter_type=parameter.type,
        )


def scene_problems(scene: Scene, types: Types) -> list[str]:
    """Return the problems of a scene."""
    return [problem for _, problem in scene_findings(scene, types)]


def scene_findings(scene: Scene, types: Types) -> Iterator[tuple[str, str]]:
    """Return the problems of a scene, each with the faulty entry, such as `objects[2]`."""
    for index, obj in enumerate(scene.objects):
        for problem in object_problems(obj, types):
            yield f"objects[{index}]", problem
    for problem in _duplicates((obj.name for obj in scene.objects), "object"):
        yield "objects", problem


def _duplicates(names: Iterable[str], what: str) -> list[str]:
    return [f"More than one {what} is named {name}." for name, count in Counter(names).items() if count > 1]


# ---------------------------------------------------------------------------------------------- actions
class _Unparented:
    """A lookup without the parents of action points, which are not needed to check references."""

    def __init__(self, lookup: ProjectLookup) -> None:
        self._lookup = lookup
        self.scene_object = lookup.scene_object
        self.action = lookup.action
        self.parameter = lookup.parameter

    def action_point(self, action_point_id: str) -> BareActionPoint:
        return replace(self._lookup.action_point(action_point_id), parent=UNSET)

    def orientation(self, orientation_id: str) -> tuple[BareActionPoint, NamedOrientation]:
        point, orientation = self._lookup.orientation(orientation_id)
        return replace(point, parent=UNSET), orientation

    def joints(self, joints_id: str) -> tuple[BareActionPoint, ProjectRobotJoints]:
        point, joints = self._lookup.joints(joints_id)
        return replace(point, parent=UNSET), joints


def action_meta(action: Action, lookup: ProjectLookup, types: Types) -> ObjectAction:
    """Return the metadata of an action.

    Raises:
        InvalidData: The action is malformed or disabled.
        NotFound: Its object or method does not exist.
    """
    try:
        object_id, method = action.parse_type()
    except ValueError as error:
        raise InvalidData("{reason}.", reason=error) from None
    obj = lookup.scene_object(object_id)
    meta = types.action(obj.type, method)
    if meta.disabled:
        why = "" if isinstance(meta.problem, Unset) else f" ({meta.problem})"
        raise InvalidData("{type}.{method} cannot be used{reason}.", type=obj.type, method=method, reason=why)
    return meta


def check_flows(action: Action, meta: ObjectAction) -> None:
    """Raise InvalidData for flows that do not fit the results of the action."""
    flows: list[Flow] = action.flows
    if [flow.type for flow in flows] != [FlowTypes.DEFAULT]:
        raise InvalidData("{name}: exactly one flow is needed, of type default.", name=action.name)
    outputs = flows[0].outputs
    for output in outputs:
        check_name(output, "result")
    if outputs and len(outputs) != len(meta.returns):
        raise InvalidData(
            "{name}: {meta_name} returns {count} values, {other_count} names are given.",
            name=action.name,
            meta_name=meta.name,
            count=len(meta.returns),
            other_count=len(outputs),
        )


def check_outputs_unique(document: Document, action: Action) -> None:
    """Raise InvalidData for a result name that another action uses, since results become variables of one program."""
    for output in action.outputs():
        other = document.named("output", output)
        if other is not None and other != action.id:
            raise InvalidData(
                "{name} names a result {output} already: choose another name.",
                name=document.action(other)[1].name,
                output=output,
            )


def complete_parameters(action: Action, meta: ObjectAction) -> Action:
    """Return the action with present names, and with default values for missing parameters.

    Raises:
        InvalidData: A parameter is unknown, duplicate, or missing without a default.
    """
    action = with_present_name(action, meta)
    given = {parameter.name: parameter for parameter in action.parameters}
    if len(given) != len(action.parameters):
        raise InvalidData("{name}: a parameter is given twice.", name=action.name)
    if unknown := given.keys() - {parameter.name for parameter in meta.parameters}:
        raise InvalidData(
            "{name}: {meta_name} has no parameter {unknown}.",
            name=action.name,
            meta_name=meta.name,
            unknown=", ".join(sorted(unknown)),
        )
    filled = list(action.parameters)
    for parameter in meta.parameters:
        if parameter.name in given:
            continue
        if isinstance(parameter.default_value, Unset):
            raise InvalidData(
                "{name}: the parameter {parameter_name} is missing.", name=action.name, parameter_name=parameter.name
            )
        filled.append(ActionParameter(parameter.name, parameter.type, parameter.default_value))
    return action if len(filled) == len(action.parameters) else replace(action, parameters=filled)


def check_parameters(action: Action, meta: ObjectAction, lookup: ProjectLookup, types: Types) -> None:
    """Raise InvalidData for parameters that do not fit the method. None may be missing (see complete_parameters)."""
    declared = {parameter.name: parameter for parameter in meta.parameters}
    robot_id = action.parse_type()[0]
    unparented = _Unparented(lookup)
    for parameter in action.parameters:
        wanted = declared[parameter.name]
        try:
            match parameter.type:
                case ActionParameterType.PROJECT_PARAMETER:
                    _check_project_parameter(parameter, wanted, lookup)
                case ActionParameterType.LINK:
                    _check_link(action, parameter, wanted, lookup, types)
                case _ if wanted.type in PARAMETER_TYPES:
                    PARAMETER_TYPES[wanted.type].check(parameter, wanted, unparented, robot_id)
                case _:
                    raise InvalidData(
                        "parameter {name} is of the unknown type {type}", name=wanted.name, type=wanted.type
                    )
        except Arcor2Error as error:
            raise InvalidData("{name}: {reason}", name=action.name, reason=error) from error


def _text(parameter: Parameter) -> str:
    try:
        return msgspec.json.decode(parameter.value, type=str)
    except msgspec.DecodeError:
        raise InvalidData(
            "parameter {name}: {value} is not a JSON string.", name=parameter.name, value=parameter.value[:80]
        ) from None


def _check_project_parameter(parameter: Parameter, wanted: ParameterMeta, lookup: ProjectLookup) -> None:
    source = lookup.parameter(_text(parameter))
    if source.type != wanted.type:
        raise InvalidData(
            "parameter {name} is {type}, the project parameter {source_name} is {source_type}.",
            name=wanted.name,
            type=wanted.type,
            source_name=source.name,
            source_type=source.type,
        )


def _check_link(
    action: Action, parameter: Parameter, wanted: ParameterMeta, lookup: ProjectLookup, types: Types
) -> None:
    try:
        source_id, flow, index = parse_link(_text(parameter))
    except ValueError as error:
        raise InvalidData("parameter {name}: {reason}.", name=wanted.name, reason=error) from None
    if source_id == action.id:
        raise InvalidData("parameter {name} cannot be linked to a result of the same action.", name=wanted.name)
    _, source = lookup.action(source_id)
    returns, outputs = action_meta(source, lookup, types).returns, source.outputs()
    if flow != FlowTypes.DEFAULT or len(outputs) != len(returns) or index >= len(returns):
        raise InvalidData(
            "parameter {name}: {source_name} has no named result number {index}. Name its results.",
            name=wanted.name,
            source_name=source.name,
            index=index,
        )
    if returns[index] != wanted.type:
        raise InvalidData(
            "parameter {name} is {type}, the result {output} is {return_value}.",
            name=wanted.name,
            type=wanted.type,
            output=outputs[index],
            return_value=returns[index],
        )


# ---------------------------------------------------------------------------------------------- project
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


def project_problems(scene: Scene, project: Project, types: Types) -> list[str]:
    """Return the problems of a project on its scene. The cost is linear in their size."""
    return [problem for _, problem in project_findings(scene, project, types)]


def project_findings(scene: Scene, project: Project, types: Types) -> Iterator[tuple[str, str]]:
    """Return the problems of a project on its scene, each with the faulty entry.

    An entry is a path such as `scene.objects[2]` or `project.action_points[0].actions[1]`.
    """
    if project.scene_id != scene.id:
        yield "project.scene_id", f"The project {project.name} belongs to another scene than {scene.name}."
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
            yield at, f"{point.name!r} is not a valid name for an action point."
        for number, joints in enumerate(point.robot_joints):
            for problem in _problem(_check_joints, point.name, joints, document, types):
                yield f"{at}.robot_joints[{number}]", problem
        for number, action in enumerate(point.actions):
            for problem in _problem(check_action, action, document, types):
                yield f"{at}.actions[{number}]", problem
    for problem in _duplicates((point.name for point in project.action_points), "action point"):
        yield "project.action_points", problem
    for problem in _duplicates((a.name for point in project.action_points for a in point.actions), "action"):
        yield "project.action_points", problem


def check_action(action: Action, lookup: ProjectLookup, types: Types) -> None:
    """Raise InvalidData or NotFound for an invalid action. Whether its names are free is not checked."""
    meta = action_meta(action, lookup, types)
    check_flows(action, meta)
    complete = complete_parameters(action, meta)
    check_parameters(complete, meta, lookup, types)


def _problem(check: Callable[..., None], *args: Any) -> list[str]:
    try:
        check(*args)
    except Arcor2Error as error:
        # The error of a failed look-up does not name the item that refers to the missing one.
        name = next((arg.name for arg in args if isinstance(arg, Action | ProjectParameter)), "")
        text = str(error)
        return [text if not name or text.startswith(name) else f"{name}: {text}"]
    return []


def _check_joints(point: str, joints: ProjectRobotJoints, lookup: ProjectLookup, types: Types) -> None:
    try:
        types.robot_meta(lookup.scene_object(joints.robot_id).type)
    except NotFound:
        raise InvalidData(
            "{point}: the joints {name} belong to no robot of the scene.", point=point, name=joints.name
        ) from None


def _parent_problems(document: Document, project: Project) -> Iterator[tuple[str, str]]:
    parents = {point.id: point for point in project.action_points}
    places = {point.id: f"project.action_points[{index}]" for index, point in enumerate(project.action_points)}
    checked: set[str] = set()
    for point in project.action_points:
        path: dict[str, None] = {}
        at = point
        while at.id not in checked:
            if at.id in path:
                yield places[at.id], f"The action point {at.name} is its own ancestor."
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
