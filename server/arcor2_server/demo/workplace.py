"""The demo cell: its description in workplace.toml, and its creation through the protocol as a client."""

import contextlib
import dataclasses
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import Any, Final

import msgspec
from msgspec import UNSET, Struct, field

from arcor2_hw.client import Client, RequestFailed
from arcor2_hw.data import rpc
from arcor2_hw.data.base import Unset
from arcor2_hw.data.editor import ViewScope
from arcor2_hw.data.geometry import Orientation, Pose, Position
from arcor2_hw.data.object_type import Box, Model3dType, ObjectAction, ObjectModel
from arcor2_hw.data.operator import Operator
from arcor2_hw.data.parameter import Parameter
from arcor2_hw.data.parts import ConfirmedPart
from arcor2_hw.data.project import (
    ERROR_FLOW,
    ERROR_PARTS,
    ActionParameter,
    Flow,
    LogicComparison,
    LogicWhen,
    Project,
    ProjectLogicIf,
)
from arcor2_hw.data.scene import Scene
from arcor2_hw.exceptions import InvalidData

Vector3 = tuple[float, float, float]
Scalar = bool | int | float | str


class Object(Struct, frozen=True, forbid_unknown_fields=True):
    """An object of the scene. `rotation` is a rotation vector, rad. A setting "$name" is replaced at the start."""

    name: str
    type: str
    position: Vector3 | None = None
    rotation: Vector3 = (0.0, 0.0, 0.0)
    settings: dict[str, Scalar] = field(default_factory=dict)


class Place(Struct, frozen=True, forbid_unknown_fields=True):
    """The place at which the editor draws a device whose type has no pose."""

    object: str
    position: Vector3
    rotation: Vector3 = (0.0, 0.0, 0.0)


class PartSensor(Struct, frozen=True, forbid_unknown_fields=True):
    """A digital input that is on while a part is at a place, where the editor draws it; m, in the frame of `on`."""

    object: str
    input: str
    on: str
    position: Vector3
    size: Vector3


class Obstacle(Struct, frozen=True, forbid_unknown_fields=True):
    """A box-shaped collision object; position and size in m."""

    name: str
    position: Vector3
    size: Vector3


class Point(Struct, frozen=True, forbid_unknown_fields=True):
    """An action point with one orientation named default."""

    name: str
    position: Vector3
    rotation: Vector3
    parent: str = ""


class Step(Struct, frozen=True, forbid_unknown_fields=True):
    """An action.

    If the object is the name of a function, the action calls it. A parameter "@point" is the pose of an action
    point, "$name" a project parameter or a variable, "#result" the result of an earlier step, "#error.text" a part of
    the error named `error`. A result with the name of a variable is stored in it.
    """

    name: str
    point: str
    object: str
    action: str
    parameters: dict[str, Scalar] = field(default_factory=dict)
    results: list[str] = field(default_factory=list)
    error: str = ""


class Link(Struct, frozen=True, forbid_unknown_fields=True):
    """A connection of the logic.

    With `result`, it is followed if the result has the value; with `variable`, if the variable has another one; with
    `errors`, if `start` fails with one of these kinds.
    """

    start: str
    end: str
    result: str = ""
    variable: str = ""
    value: Scalar = True
    errors: list[str] = field(default_factory=list)


class Function(Struct, frozen=True, forbid_unknown_fields=True):
    """A function made of connected steps. call: name of the action that replaces these steps."""

    name: str
    steps: list[str]
    call: str


class Parallel(Struct, frozen=True, forbid_unknown_fields=True):
    """An action that calls functions concurrently."""

    name: str
    calls: list[str]


class Workplace(Struct, frozen=True, forbid_unknown_fields=True):
    """Scene and project of the demo."""

    scene: str
    project: str
    description: str
    objects: list[Object]
    obstacles: list[Obstacle]
    points: list[Point]
    steps: list[Step]
    logic: list[Link]
    constants: dict[str, Scalar]
    variables: dict[str, Scalar] = field(default_factory=dict)
    places: list[Place] = field(default_factory=list)
    part_sensors: list[PartSensor] = field(default_factory=list)
    functions: list[Function] = field(default_factory=list)
    parallel: list[Parallel] = field(default_factory=list)


def load(file: Path | None = None) -> Workplace:
    """Read the description of a cell; the default is the demo cell."""
    source = files(__package__) / "workplace.toml" if file is None else file
    return msgspec.toml.decode(source.read_bytes(), type=Workplace)


def markers_file() -> Any:
    """Return the file with the poses of the markers in the view of the camera."""
    return files(__package__) / "markers.yaml"


def layout_file() -> Any:
    """Return the file with the positions in the simulated world."""
    return files(__package__) / "layout.json"


_KINDS: Final = {bool: "boolean", int: "integer", float: "double", str: "string"}


def _json(value: object) -> str:
    return msgspec.json.encode(value).decode()


def _pose(position: Vector3, rotation: Vector3) -> Pose:
    return Pose(Position(*position), Orientation.from_rotation_vector(*rotation))


class Creation:
    """Creates scene and project if they are missing, and updates addresses and project parameters."""

    def __init__(self, client: Client, workplace: Workplace, addresses: dict[str, Scalar]) -> None:
        self._client = client
        self._workplace = workplace
        self._addresses = addresses

    async def close_all(self) -> None:
        """Close the document that the server opened after an interrupted run. Unsaved changes are lost."""
        with contextlib.suppress(RequestFailed):  # no project is open
            await self._client.close_project(force=True)
            await self._client.next_event("ProjectClosed")  # discards earlier events of the document
        with contextlib.suppress(RequestFailed):
            await self._client.close_scene(force=True)
            await self._client.next_event("SceneClosed")

    # ------------------------------------------------------------------------------------------------ scene
    def _settings(self, obj: Object, kinds: dict[str, str]) -> list[Parameter]:
        """Return the settings of an object. `kinds` are the parameter types declared by its object type."""
        settings = []
        for name, value in obj.settings.items():
            if isinstance(value, str) and value.startswith("$"):
                value = self._addresses[value[1:]]
            settings.append(Parameter(name, kinds.get(name, _KINDS[type(value)]), _json(value)))
        return settings

    async def open_scene(self) -> Scene:
        """Open or create the scene, set the addresses of the devices, and save it."""
        known = {entry.name: entry.id for entry in await self._client.list_scenes()}
        if self._workplace.scene in known:
            await self._client.open_scene(known[self._workplace.scene])
        else:
            await self._client.call("NewScene", rpc.NewSceneArgs(self._workplace.scene, self._workplace.description))
        event = await self._client.next_event("OpenScene")
        scene: Scene = event.data.scene
        present = {obj.name: obj for obj in scene.objects}
        declared = {
            meta.type: {setting.name: setting.type for setting in meta.settings}
            for meta in await self._client.get_object_types()
        }
        for obj in self._workplace.objects:
            settings = self._settings(obj, declared.get(obj.type, {}))
            found = present.get(obj.name)
            if found is None:
                pose = UNSET if obj.position is None else _pose(obj.position, obj.rotation)
                await self._client.call(
                    "AddObjectToScene", rpc.AddObjectToSceneArgs(obj.name, obj.type, pose, settings)
                )
            elif found.parameters != settings:
                await self._client.write_lock(found.id)
                await self._client.call("UpdateObjectParameters", rpc.UpdateObjectParametersArgs(found.id, settings))
                await self._client.write_unlock(found.id)
        for box in self._workplace.obstacles:
            if box.name not in present:
                model = ObjectModel(Model3dType.BOX, box=Box(box.name, *box.size))
                await self._client.call(
                    "AddVirtualCollisionObjectToScene",
                    rpc.AddVirtualCollisionObjectToSceneArgs(box.name, _pose(box.position, (0.0, 0.0, 0.0)), model),
                )
        await self._client.save_scene()
        created = await self._client.get_scene(scene.id)
        if self._workplace.scene not in known:
            await self._place(created)
        return created

    async def _place(self, scene: Scene) -> None:
        """Store where the editor draws the devices without a pose."""
        ids = {obj.name: obj.id for obj in scene.objects}
        values: dict[str, Any] = {
            f"place/{ids[place.object]}": msgspec.to_builtins(_pose(place.position, place.rotation))
            for place in self._workplace.places
        }
        for sensor in self._workplace.part_sensors:
            values[f"part/{ids[sensor.object]}/{sensor.input}"] = {
                "on": ids[sensor.on],
                "position": dict(zip("xyz", sensor.position, strict=True)),
                "size": dict(zip("xyz", sensor.size, strict=True)),
            }
        if values:
            await self._client.call("SetViewState", rpc.SetViewStateArgs(ViewScope.SHARED, values, scene.id))

    # ------------------------------------------------------------------------------------------------ project
    async def open_project(self, scene: Scene, constants: dict[str, Scalar]) -> Project:
        """Open or create the project of the open scene, set its project parameters, and save it."""
        known = {entry.name: entry.id for entry in await self._client.list_projects()}
        if self._workplace.project in known:
            await self._client.open_project(known[self._workplace.project])
        else:
            await self._client.call(
                "NewProject", rpc.NewProjectArgs(scene.id, self._workplace.project, self._workplace.description)
            )
        event = await self._client.next_event("OpenProject")
        project: Project = event.data.project
        if self._workplace.project not in known:
            await self._fill(scene, constants)
            changed = True
        else:
            changed = await self._set_constants(project, constants)
        if changed:
            await self._client.save_project()
        return await self._client.get_project(project.id)

    async def _set_constants(self, project: Project, constants: dict[str, Scalar]) -> bool:
        changed = False
        for parameter in project.parameters:
            wanted = constants.get(parameter.name)
            if wanted is None or parameter.value == _json(wanted):
                continue
            await self._client.write_lock(parameter.id)
            await self._client.call(
                "UpdateProjectParameter", rpc.UpdateProjectParameterArgs(parameter.id, value=_json(wanted))
            )
            changed = True
        return changed

    async def _fill(self, scene: Scene, constants: dict[str, Scalar]) -> None:
        objects = {obj.name: obj for obj in scene.objects}
        parameters: dict[str, str] = {}
        variables = self._workplace.variables
        for name, value in (self._workplace.constants | constants | variables).items():
            added = rpc.AddProjectParameterArgs(name, _KINDS[type(value)], _json(value), name in variables or UNSET)
            await self._client.call("AddProjectParameter", added)
            parameters[name] = (await self._client.next_event("ProjectParameterChanged")).data.id
        points: dict[str, str] = {}
        orientations: dict[str, str] = {}
        for point in self._workplace.points:
            parent = objects[point.parent].id if point.parent else UNSET
            await self._client.call(
                "AddActionPoint", rpc.AddActionPointArgs(point.name, Position(*point.position), parent)
            )
            points[point.name] = (await self._client.next_event("ActionPointChanged")).data.id
            await self._client.write_lock(points[point.name])
            await self._client.call(
                "AddActionPointOrientation",
                rpc.AddActionPointOrientationArgs(
                    points[point.name], Orientation.from_rotation_vector(*point.rotation)
                ),
            )
            orientations[point.name] = (await self._client.next_event("OrientationChanged")).data.id
            await self._client.write_unlock(points[point.name])
        places = _Places(points, orientations, parameters)
        for step in self._workplace.steps:
            if step.object in objects:
                await self._add_step(step, objects[step.object].id, places)
        waiting = await self._connect(self._workplace.logic, places)
        for function in self._workplace.functions:
            ids = [places.actions[name] for name in function.steps]
            args = rpc.MakeFunctionArgs(function.name, ids, function.call)
            made: rpc.MakeFunctionData = await self._client.call("MakeFunction", args)
            places.actions[function.call] = made.action_id
            for step in self._workplace.steps:
                if step.object == function.name:
                    await self._add_step(step, made.function_id, places)
            waiting = await self._connect(waiting, places)
            for parallel in self._workplace.parallel:
                if parallel.name not in places.actions and places.actions.keys() >= {*parallel.calls}:
                    calls = [places.actions[name] for name in parallel.calls]
                    args_of = rpc.MakeParallelArgs(parallel.name, calls)
                    joined: rpc.MakeParallelData = await self._client.call("MakeParallel", args_of)
                    places.actions[parallel.name] = joined.action_id

    async def _add_step(self, step: Step, object_id: str, places: "_Places") -> None:
        kind = next((obj.type for obj in self._workplace.objects if obj.name == step.object), "")
        declared = {action.name: action for action in await self._client.get_actions(kind)} if kind else {}
        action = declared.get(step.action)
        given = [self._parameter(step, name, value, action, places) for name, value in step.parameters.items()]
        flows = [Flow(outputs=step.results)]
        args = rpc.AddActionArgs(
            places.points[step.point], step.name, f"{object_id}/{step.action}", given, flows, step.error or UNSET
        )
        await self._client.call("AddAction", args)
        while (added := (await self._client.next_event("ActionChanged")).data).name != step.name:
            pass  # the actions of a function that was created before
        places.actions[step.name] = added.id
        places.results |= {result: f"{added.id}/default/{number}" for number, result in enumerate(step.results)}
        if step.error:
            parts = enumerate(ERROR_PARTS)
            places.results |= {f"{step.error}.{part}": f"{added.id}/{ERROR_FLOW}/{number}" for number, part in parts}

    async def _connect(self, links: list[Link], places: "_Places") -> list[Link]:
        """Add connections. Return those to or from calls that do not exist yet."""
        ids = {"START": "START", "END": "END"} | places.actions
        for link in links:
            if link.start not in ids or link.end not in ids:
                continue
            condition: ProjectLogicIf | Unset = UNSET
            when: LogicWhen | Unset = UNSET
            if link.result:
                condition = ProjectLogicIf(places.results[link.result], _json(link.value))
            elif link.variable:
                variable = places.parameters[link.variable]
                when = LogicWhen([LogicComparison(variable, Operator.DIFFERENT, _json(link.value))])
            args = rpc.AddLogicItemArgs(ids[link.start], ids[link.end], condition, link.errors or UNSET, when)
            await self._client.call("AddLogicItem", args)
        return [link for link in links if link.start not in ids or link.end not in ids]

    @staticmethod
    def _parameter(
        step: Step,
        name: str,
        value: Scalar,
        action: ObjectAction | None,
        places: "_Places",
    ) -> ActionParameter:
        references = {"$": ("project_parameter", places.parameters), "#": ("link", places.results)}
        if isinstance(value, str) and value[:1] in references:
            kind, ids = references[value[0]]
            return ActionParameter(name, kind, _json(ids[value[1:]]))
        meta = next((meta for meta in action.parameters if meta.name == name), None) if action else None
        if meta is None:
            raise InvalidData(
                "Step {name}: {action} has no parameter {other_name}.",
                name=step.name,
                action=step.action,
                other_name=name,
            )
        if isinstance(value, str) and value.startswith("@"):
            return ActionParameter(name, meta.type, _json(places.orientations[value[1:]]))
        return ActionParameter(name, meta.type, _json(value))


async def confirm_emptied(client: Client) -> None:
    """Confirm that all parts were taken out of the cell, so that the next program starts without parts."""
    for inventory in await client.get_parts():
        removed = [ConfirmedPart(part.number, "") for part in inventory.parts]
        if removed or not isinstance(inventory.run, Unset):
            await client.confirm_parts(scene_id=inventory.scene_id, parts=removed)


@dataclass(slots=True)
class _Places:
    """The ids of the created items, by name."""

    points: dict[str, str]
    orientations: dict[str, str]
    parameters: dict[str, str]
    actions: dict[str, str] = dataclasses.field(default_factory=dict)
    results: dict[str, str] = dataclasses.field(default_factory=dict)
    """Links to results and parts of errors."""
