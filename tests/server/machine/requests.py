"""Random edits. Each builds a request for the open documents from a few numbers, and names the id to lock."""

import json
from collections.abc import Callable
from typing import Any

from arcor2_hw.data.project import Project
from tests.server.session.work import URL

NAMES = ("a", "b", "c", "d", "e")
DEFAULT = "default"

Request = tuple[str, dict[str, Any], str, bool]
"""A request with its arguments, the id to lock for it (empty: none), and whether to lock the tree."""


class Draw:
    """The open documents, and the numbers that choose from them."""

    def __init__(self, session: Any, numbers: tuple[int, int, int]) -> None:
        self.session = session
        self.x, self.y, self.z = numbers

    @property
    def project(self) -> Project:
        project: Project = self.session.require_project()
        return project

    @property
    def name(self) -> str:
        return NAMES[self.y % len(NAMES)]

    @staticmethod
    def one(things: list[Any], number: int) -> str:
        """Return the id of one of the items, or an id that does not exist if there are none."""
        return str(things[number % len(things)].id) if things else "nothing_0"

    def object(self, name: str) -> str:
        return next((obj.id for obj in self.session.require_scene().objects if obj.name == name), "nothing_0")

    def point(self, number: int) -> str:
        return self.one(self.project.action_points, number)

    def parent(self, number: int) -> str:
        """Return a point, an object with a pose, or nothing."""
        candidates = ["", self.object("scale"), *(point.id for point in self.project.action_points)]
        return candidates[number % len(candidates)]

    def of_points(self, field: str, number: int) -> str:
        return self.one([thing for point in self.project.action_points for thing in getattr(point, field)], number)

    def action(self, number: int) -> str:
        return self.of_points("actions", number)

    def place(self, number: int, border: str) -> str:
        actions = [action.id for point in self.project.action_points for action in point.actions]
        return [border, *actions][number % (len(actions) + 1)]

    def condition(self) -> dict[str, Any]:
        dice = [a for p in self.project.action_points for a in p.actions if a.outputs()]
        if not dice or self.z % 3 == 0:
            return {}
        link = f"{dice[self.z % len(dice)].id}/default/0"
        return {"condition": {"what": link, "value": json.dumps(self.z % 2 == 0)}}

    def position(self) -> dict[str, float]:
        return {"x": self.x / 7, "y": self.y / 7, "z": self.z / 7}

    def orientation(self) -> dict[str, float]:
        return {"x": 0.1 + self.x, "y": float(self.y), "z": float(self.z), "w": 1.0}


def _add_point(draw: Draw) -> Request:
    parent = draw.parent(draw.x)
    args = {"name": draw.name, "position": draw.position()} | ({"parent": parent} if parent else {})
    return "AddActionPoint", args, "", False


def _add_action(draw: Draw) -> Request:
    point = draw.point(draw.x)
    args: dict[str, Any] = {"action_point_id": point, "name": draw.name}
    if draw.z % 2:
        probability = {"name": "probability", "type": "double", "value": "0.5"}
        flows = [{"type": DEFAULT, "outputs": [f"out_{draw.name}"]}]
        return (
            "AddAction",
            args | {"type": f"{draw.object('rnd')}/random_bool", "parameters": [probability], "flows": flows},
            "",
            False,
        )
    parameter = {"name": "seconds", "type": "double", "value": "0.5"}
    if draw.project.parameters and draw.z % 4 == 0:
        parameter = {
            "name": "seconds",
            "type": "project_parameter",
            "value": json.dumps(draw.one(draw.project.parameters, draw.z)),
        }
    return (
        "AddAction",
        args
        | {
            "type": f"{draw.object('time')}/sleep",
            "parameters": [parameter],
            "flows": [{"type": DEFAULT, "outputs": []}],
        },
        "",
        False,
    )


def _add_move(draw: Draw) -> Request:
    """Build an action that refers to an orientation."""
    pose = {"name": "pose", "type": "pose", "value": json.dumps(draw.of_points("orientations", draw.z))}
    args = {"action_point_id": draw.point(draw.x), "name": draw.name, "type": f"{draw.object('robot')}/move"}
    return "AddAction", args | {"parameters": [pose], "flows": [{"type": DEFAULT, "outputs": []}]}, "", False


def _update_action(draw: Draw) -> Request:
    action = draw.action(draw.x)
    outputs = [f"out_{draw.name}"] if draw.z % 2 else []
    return "UpdateAction", {"action_id": action, "flows": [{"type": DEFAULT, "outputs": outputs}]}, action, False


def _logic(draw: Draw) -> dict[str, Any]:
    return {"start": draw.place(draw.x, "START"), "end": draw.place(draw.y, "END")} | draw.condition()


def _override(draw: Draw) -> dict[str, Any]:
    return {"id": draw.object("robot"), "override": URL | {"value": json.dumps(draw.name)}}


def _on(
    request: str, key: str, pick: str, tree: bool = False, **more: Callable[[Draw], Any]
) -> Callable[[Draw], Request]:
    """Return a request about one item, which is locked for it."""

    def build(draw: Draw) -> Request:
        found = draw.point(draw.x) if pick == "points" else draw.of_points(pick, draw.x)
        return request, {key: found} | {name: value(draw) for name, value in more.items()}, found, tree

    return build


def _free(request: str, **args: Callable[[Draw], Any]) -> Callable[[Draw], Request]:
    """Return a request that acquires its locks itself."""
    return lambda draw: (request, {name: value(draw) for name, value in args.items()}, "", False)


def _locked(request: str, lock: Callable[[Draw], str], **args: Callable[[Draw], Any]) -> Callable[[Draw], Request]:
    return lambda draw: (request, {name: value(draw) for name, value in args.items()}, lock(draw), False)


def _objects(draw: Draw) -> str:
    return draw.one(draw.session.require_scene().objects, draw.x)


def _parameter(draw: Draw) -> str:
    return draw.one(draw.project.parameters, draw.x)


def _project(draw: Draw) -> str:
    return draw.project.id


def _update_step(draw: Draw) -> Request:
    return "UpdateLogicItem", _logic(draw) | {"logic_item_id": draw.one(draw.project.logic, draw.z)}, "", False


def _name(draw: Draw) -> str:
    return draw.name


EDITS: dict[str, Callable[[Draw], Request]] = {
    "add point": _add_point,
    "add point again": _add_point,
    "rename point": _on("RenameActionPoint", "action_point_id", "points", new_name=_name),
    "move point": _on("UpdateActionPointPosition", "action_point_id", "points", True, new_position=Draw.position),
    "reparent point": _on(
        "UpdateActionPointParent", "action_point_id", "points", new_parent_id=lambda d: d.parent(d.y)
    ),
    "copy point": _free("CopyActionPoint", id=lambda d: d.point(d.x)),
    "remove point": _free("RemoveActionPoint", id=lambda d: d.point(d.x)),
    "add orientation": _on(
        "AddActionPointOrientation", "action_point_id", "points", name=_name, orientation=Draw.orientation
    ),
    "turn orientation": _on(
        "UpdateActionPointOrientation", "orientation_id", "orientations", orientation=Draw.orientation
    ),
    "rename orientation": _on("RenameActionPointOrientation", "orientation_id", "orientations", new_name=_name),
    "remove orientation": _free(
        "RemoveActionPointOrientation", orientation_id=lambda d: d.of_points("orientations", d.x)
    ),
    "add action": _add_action,
    "add action again": _add_action,
    "add move": _add_move,
    "update action": _update_action,
    "rename action": _on("RenameAction", "action_id", "actions", new_name=_name),
    "remove action": _free("RemoveAction", id=lambda d: d.action(d.x)),
    "remove action and steps": _free("RemoveAction", id=lambda d: d.action(d.x), with_steps=lambda _: True),
    "add step": lambda draw: ("AddLogicItem", _logic(draw), "", False),
    "add step again": lambda draw: ("AddLogicItem", _logic(draw), "", False),
    "update step": _update_step,
    "remove step": _free("RemoveLogicItem", logic_item_id=lambda d: d.one(d.project.logic, d.x)),
    "add parameter": _free("AddProjectParameter", name=_name, type=lambda d: "double", value=lambda d: f"{d.x}.5"),
    "update parameter": _locked(
        "UpdateProjectParameter",
        _parameter,
        id=_parameter,
        name=_name,
        value=lambda d: f"{d.z}.5",
    ),
    "remove parameter": _free("RemoveProjectParameter", id=_parameter),
    "add override": lambda draw: ("AddOverride", _override(draw), draw.object("robot"), False),
    "update override": lambda draw: ("UpdateOverride", _override(draw), draw.object("robot"), False),
    "delete override": lambda draw: ("DeleteOverride", _override(draw), draw.object("robot"), False),
    "describe": _free("UpdateProjectDescription", project_id=_project, new_description=_name),
    "rename project": _locked("RenameProject", _project, project_id=_project, new_name=_name),
    "logic on or off": _free("UpdateProjectHasLogic", project_id=_project, new_has_logic=lambda d: d.x % 3 > 0),
}

SCENE_EDITS: dict[str, Callable[[Draw], Request]] = {
    "add object": _free("AddObjectToScene", name=_name, type=lambda d: "TimeActions"),
    "remove object": _free(
        "RemoveFromScene",
        id=_objects,
        force=lambda d: d.z % 2 == 0,
    ),
    "rename object": _locked(
        "RenameObject",
        _objects,
        id=_objects,
        new_name=_name,
    ),
    "move object": _locked(
        "UpdateObjectPose",
        lambda d: d.object("scale"),
        object_id=lambda d: d.object("scale"),
        pose=lambda d: {"position": d.position(), "orientation": d.orientation()},
    ),
    "describe scene": _free(
        "UpdateSceneDescription", scene_id=lambda d: d.session.require_scene().id, new_description=_name
    ),
}
