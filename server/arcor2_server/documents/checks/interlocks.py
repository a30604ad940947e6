"""Checks of interlocks."""

from collections.abc import Callable, Iterable
from typing import Final

from msgspec.structs import replace

from arcor2_hw.data.base import UNSET, Unset
from arcor2_hw.data.interlocks import Interlock, InterlockTarget, Need
from arcor2_hw.data.object_type import Model3dType, ObjectTypeMeta
from arcor2_hw.data.project import LogicComparison
from arcor2_hw.data.scene import Scene, SceneObject
from arcor2_hw.exceptions import Arcor2Error, InvalidData
from arcor2_hw.messages import Message
from arcor2_hw.runtime.retreat import ends_outside
from arcor2_server.documents.checks.object_types import Types
from arcor2_server.documents.comparisons import comparison_problem, decoded

_BODY: Final = "VirtualCollisionObject"
"""Base of the types of collision bodies without a device."""

FindObject = Callable[[str], SceneObject]
"""Returns an object of the scene by its id. Raises NotFound."""


def check_interlock(interlock: Interlock, find: FindObject, types: Types) -> None:
    """Raise NotFound if an interlock refers to a missing item, or InvalidData if it compares unsuitable values."""
    if not interlock.name.strip():
        raise InvalidData("The interlock needs a name.")
    target = find(interlock.object_id)
    meta = types.meta(target.type)
    if interlock.on is InterlockTarget.ZONE:
        model = meta.object_model
        # A device must remain an obstacle.
        if meta.base != _BODY or isinstance(model, Unset) or model.type in (Model3dType.NONE, Model3dType.MESH):
            raise InvalidData("{name} cannot be a zone. Use a box, a cylinder or a sphere.", name=target.name)
        if interlock.actions:
            raise InvalidData("{interlock}: an interlock of a zone has no actions.", interlock=interlock.name)
        if interlock.retract and not ends_outside(interlock.retract, model.model()):
            raise InvalidData("{interlock}: the retract path must end outside of {name}.", interlock=interlock.name,
                              name=target.name)  # fmt: skip
    else:
        if interlock.retract:
            raise InvalidData("{interlock}: only an interlock of a zone has a retract path.", interlock=interlock.name)
        if not interlock.needs:
            raise InvalidData("{interlock}: add at least one condition.", interlock=interlock.name)
        for action in interlock.actions:
            types.action(target.type, action)
    for need in interlock.needs:
        observed = find(need.object_id)
        _check_need(need, observed.name, types.meta(observed.type))


def _check_need(need: Need, name: str, meta: ObjectTypeMeta) -> None:
    observations = [] if isinstance(meta.observations, Unset) else meta.observations
    found = next((one for one in observations if one.name == need.observation), None)
    if found is None:
        raise InvalidData("{name} ({type}) has no observation {observation}.", name=name, type=meta.shown_name,
                          observation=need.observation)  # fmt: skip
    if bool(need.point) != (found.of_point is True):
        raise InvalidData(
            "{name}: the observation {observation} needs the name of a point."
            if found.of_point is True
            else "{name}: the observation {observation} has no points.",
            name=name,
            observation=need.observation,
        )
    value, upper = decoded(LogicComparison("", need.operator, need.value, need.upper))
    shown = Message.of("{name}: {observation}", name=name, observation=need.point or need.observation)
    if (problem := comparison_problem(str(shown), found.type, need.operator, value, upper)) is not None:
        raise InvalidData("{problem}.", problem=problem)
    if not isinstance(found.members, Unset) and need.value not in found.members:
        raise InvalidData("{name}: {value} is not a value of {observation}.", name=name, value=need.value,
                          observation=need.observation)  # fmt: skip


def interlock_problems(scene: Scene, types: Types) -> list[Message]:
    """Return the problems of the interlocks of a scene."""
    objects = {obj.id: obj for obj in scene.objects}

    def find(object_id: str) -> SceneObject:
        if object_id not in objects:
            raise InvalidData("The scene has no object {id}.", id=object_id)
        return objects[object_id]

    problems = []
    for interlock in interlocks_of(scene):
        try:
            check_interlock(interlock, find, types)
        except Arcor2Error as error:
            problems.append(Message.of("Interlock {interlock}: {reason}", interlock=interlock.name, reason=error))
    return problems


def interlocks_of(scene: Scene) -> list[Interlock]:
    """Return the interlocks of a scene."""
    return [] if isinstance(scene.interlocks, Unset) else scene.interlocks


def using(object_id: str, interlocks: Iterable[Interlock]) -> list[Interlock]:
    """Return the interlocks that refer to an object."""
    return [one for one in interlocks if one.object_id == object_id or any(n.object_id == object_id for n in one.needs)]


def keep_interlocks(sent: Scene, stored: Scene) -> Scene:
    """Return a sent scene with the stored interlocks added that it lacks because its client does not support them.

    Raises:
        InvalidData: an interlock uses an object that the sent scene does not contain.
    """
    if not isinstance(sent.interlocks, Unset):
        return sent if sent.interlocks else replace(sent, interlocks=UNSET)
    present = {obj.id for obj in sent.objects}
    for one in interlocks_of(stored):
        missing = {one.object_id, *(need.object_id for need in one.needs)} - present
        for obj in stored.objects:
            if obj.id in missing:
                raise InvalidData("{name} is used by the interlock {interlock}. Delete it first.", name=obj.name,
                                  interlock=one.name)  # fmt: skip
    return replace(sent, interlocks=stored.interlocks)
