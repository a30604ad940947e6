"""Checks of scenes, their objects and the settings of objects."""

from collections.abc import Iterable, Iterator

from arcor2_hw.actions.parameter_types import PARAMETER_TYPES
from arcor2_hw.data.base import Unset, is_valid_name
from arcor2_hw.data.object_type import ObjectTypeMeta, ParameterMeta
from arcor2_hw.data.parameter import Parameter
from arcor2_hw.data.scene import Scene, SceneObject
from arcor2_hw.exceptions import InvalidData, NotFound
from arcor2_hw.messages import Message
from arcor2_server.documents.checks.names import duplicate_names
from arcor2_server.documents.checks.object_types import Types


def object_problems(obj: SceneObject, types: Types) -> list[Message]:
    """Return the problems of an object of a scene."""
    problems = []
    if not is_valid_name(obj.name):
        problems.append(Message.of("{name!r} is not a valid name for an object.", name=obj.name))
    try:
        meta = types.meta(obj.type)
    except NotFound:
        problems.append(Message.of("{name}: the object type {type} does not exist.", name=obj.name, type=obj.type))
        return problems
    if meta.disabled:
        text = "{name}: the object type {type} cannot be used ({problem})."
        problems.append(Message.of(text, name=obj.name, type=meta.shown_name, problem=meta.why_disabled))
        return problems
    if meta.abstract:
        problems.append(
            Message.of("{name}: {type} is abstract; use a type derived from it.", name=obj.name, type=meta.shown_name)
        )
    if meta.has_pose and isinstance(obj.pose, Unset):
        problems.append(Message.of("{name}: {type} needs a pose.", name=obj.name, type=meta.shown_name))
    if not meta.has_pose and not isinstance(obj.pose, Unset):
        problems.append(Message.of("{name}: {type} has no pose.", name=obj.name, type=meta.shown_name))
    return problems + settings_problems(obj.name, obj.parameters, meta)


def settings_problems(name: str, given: Iterable[Parameter], meta: ObjectTypeMeta) -> list[Message]:
    """Return the problems of the settings of the object `name`."""
    known = {setting.name: setting for setting in meta.settings}
    problems = []
    seen = set()
    for parameter in given:
        if parameter.name in seen:
            problems.append(
                Message.of("{name}: the setting {setting} is given twice.", name=name, setting=parameter.name)
            )
        seen.add(parameter.name)
        if (setting := known.get(parameter.name)) is None:
            problems.append(
                Message.of(
                    "{name}: {type} has no setting {setting}.", name=name, type=meta.shown_name, setting=parameter.name
                )
            )
            continue
        try:
            check_setting(parameter, setting)
        except InvalidData as error:
            problems.append(Message.of("{name}: {reason}", name=name, reason=error))
    missing = [s.name for s in meta.settings if s.name not in seen and isinstance(s.default_value, Unset)]
    return problems + [
        Message.of("{name}: the setting {setting} is missing.", name=name, setting=setting) for setting in missing
    ]


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


def scene_problems(scene: Scene, types: Types) -> list[Message]:
    """Return the problems of a scene."""
    return [problem for _, problem in scene_findings(scene, types)]


def scene_findings(scene: Scene, types: Types) -> Iterator[tuple[str, Message]]:
    """Return the problems of a scene, each with the faulty entry, such as `objects[2]`."""
    for index, obj in enumerate(scene.objects):
        for problem in object_problems(obj, types):
            yield f"objects[{index}]", problem
    for problem in duplicate_names((obj.name for obj in scene.objects), "object"):
        yield "objects", problem
