"""Converts the calls and paths of a script to a project. Existing items keep their ids and positions."""

import ast
from collections.abc import Iterable, Mapping

from msgspec import UNSET
from msgspec.structs import replace

from arcor2_hw.data.base import is_valid_name, new_id
from arcor2_hw.data.project import (
    Action,
    FunctionReturns,
    LogicItem,
    Project,
    ProjectFunction,
    ProjectParameter,
)
from arcor2_hw.data.scene import Scene
from arcor2_hw.exceptions import InvalidProject
from arcor2_server.build.frame import Frame, TypeFacts
from arcor2_server.build.functions import cycles_of
from arcor2_server.build.reading import module
from arcor2_server.build.reading.calls import ScriptCalls
from arcor2_server.build.reading.errors import NotUnderstood
from arcor2_server.build.reading.functions import FunctionReader
from arcor2_server.build.reading.module import Script
from arcor2_server.build.reading.part import Part, Variables, reached
from arcor2_server.build.reading.paths import LoopReader
from arcor2_server.build.reading.scope import Call, Scope
from arcor2_server.build.reading.values import PLAIN, Values, json_as_before, json_of, of_type, plain


def from_script(source: str, scene: Scene, project: Project, types: Mapping[str, TypeFacts]) -> Project:
    """Return the project with the actions, logic, functions and project parameters of its edited script.

    An action with the same name (`an`) keeps its id, action point and everything that is not in the script. Actions
    missing in the script are removed, except those that no path of the old logic reached. A new action is added to the
    action point that it uses, else to that of the action before it. The same applies to functions; those that the
    program did not call are unchanged.

    Args:
        source: source code of the script.
        scene: the scene of the project.
        project: the project from which the script was generated.
        types: the object types of the scene.

    Raises:
        NotUnderstood: a line cannot be converted. The error has its number.
        NotFound: `types` does not contain an object type.
    """
    return _ProjectReader(source, scene, project, types).project()


class _ProjectReader:
    """One conversion of a script to a project."""

    def __init__(self, source: str, scene: Scene, project: Project, types: Mapping[str, TypeFacts]) -> None:
        self._old = project
        frame = Frame(scene, project, types)
        self._script: Script = module.read(source)
        known = {obj.id for obj in scene.objects}
        for name, object_id in self._script.objects.items():
            if object_id not in known:
                raise NotUnderstood(
                    self._script.lines[name], "the scene has no object {object_id}", object_id=object_id
                )
        self._values = Values(frame, self._script)
        self._parameters = self._read_parameters(frame)
        variables = _variables(frame, project)
        shared = ScriptCalls()
        self._functions = self._read_functions(frame, shared, variables)
        loop = LoopReader(frame, Scope(self._script, self._values), shared, self._script.loop)
        changed = {self._values.parameters[name][0] for name in loop.scope.stored}
        self._parameters = [
            replace(one, variable=True) if one.id in changed and not one.variable else one for one in self._parameters
        ]
        variables.stored.update(
            (name, one.name)
            for one in self._parameters
            for name, (key, _) in self._values.parameters.items()
            if one.variable and key == one.id
        )
        actions = [action for point in project.action_points for action in point.actions]
        self._program = Part(loop, self._values, actions, project.logic, variables)

    # ------------------------------------------------------------------------------------------------ parameters
    def _read_parameters(self, frame: Frame) -> list[ProjectParameter]:
        by_name = {name: key for key, name in frame.parameters.items()}
        found = {parameter.id: parameter for parameter in self._old.parameters}
        for name, node in self._script.constants.items():
            value = plain(node)
            key = by_name.get(name)
            if key is None:
                if not is_valid_name(name):
                    raise NotUnderstood(node.lineno, "{name} is not a valid name of a project parameter", name=name)
                key = new_id("pco")
                variable = True if name in self._script.annotated else UNSET
                found[key] = ProjectParameter(name, PLAIN[type(value)], json_of(value), id=key, variable=variable)
            else:
                old = found[key]
                value = of_type(value, old.type)
                if PLAIN[type(value)] != old.type:
                    raise NotUnderstood(
                        node.lineno,
                        "the project parameter {name} is {type}, not {value!r}",
                        name=old.name,
                        type=old.type,
                        value=value,
                    )
                found[key] = replace(old, value=json_as_before(old.type, value, old))
            self._values.parameters[name] = (key, found[key].type)
        return list(found.values())

    # ------------------------------------------------------------------------------------------------ functions
    def _read_functions(
        self, frame: Frame, shared: ScriptCalls, variables: Variables
    ) -> dict[str, tuple[ProjectFunction, Part]]:
        """Return the functions of the script by id, in its order, without their actions, and their declarations."""
        found: dict[str, tuple[ProjectFunction, Part]] = {}
        former = self._former_functions(frame)
        for node in self._script.functions:
            old = former.get(node.name)
            key = new_id("pfu") if old is None else old.id
            names = {} if old is None else variables.parameters.get(key, {})
            given = {} if old is None else {names.get(each.name, each.name): each for each in old.parameters}
            reader = FunctionReader(frame, self._script, self._values, shared, node, given)
            self._values.define(key, reader.facts())
            shared.functions[node.name] = key
            actions, logic = ([], []) if old is None else (old.actions, old.logic)
            part = Part(reader, self._values, actions, logic, variables)
            returns = [
                FunctionReturns(
                    reader.scope.calls[source].declared.returns[output], f"{part.ids[source]}/default/{output}"
                )
                for source, output in reader.returned or ()
            ]
            name = old.name if old is not None and frame.functions[key] == node.name else node.name
            if not is_valid_name(name):
                raise NotUnderstood(node.lineno, "{name} is not a valid name of a function", name=name)
            found[key] = ProjectFunction(name, [], [], reader.parameters, returns, key), part
        return found

    def _former_functions(self, frame: Frame) -> dict[str, ProjectFunction]:
        """Return the functions of the old project by their names in the script.

        A function whose name is new is a renamed one if it contains an action of a function that is missing.
        """
        names = {node.name for node in self._script.functions}
        former: dict[str, ProjectFunction] = {}
        missing: dict[str, ProjectFunction] = {}
        for function in self._old.functions:
            if (name := frame.functions[function.id]) in names:
                former[name] = function
            else:
                missing |= {action.name: function for action in function.actions}
        for node in self._script.functions:
            called = [one.value for one in ast.walk(node) if isinstance(one, ast.keyword) and one.arg == "an"]
            texts = [one.value for one in called if isinstance(one, ast.Constant)]
            if node.name not in former and (known := [missing[text] for text in texts if text in missing]):
                former[node.name] = known[0]
                missing = {name: function for name, function in missing.items() if function is not known[0]}
        return former

    def _new_functions(self, kept: Iterable[Action]) -> list[ProjectFunction]:
        """Return the functions. `kept`: unchanged actions that are not in the script, and may call others."""
        needed = {action.type.partition("/")[0] for action in kept}
        called = _called(self._old)
        functions: list[ProjectFunction] = []
        for old in self._old.functions:
            if old.id in self._functions:
                functions.append(self._new_function(*self._functions[old.id], old.actions))
            elif old.id not in called or old.id in needed:
                functions.append(old)
        known = {function.id for function in self._old.functions}
        new = (each for key, each in self._functions.items() if key not in known)
        return [*functions, *(self._new_function(*each, []) for each in new)]

    @staticmethod
    def _new_function(function: ProjectFunction, part: Part, before: list[Action]) -> ProjectFunction:
        actions = [new for old in before if (new := part.updated(old)) is not None]
        actions += [part.action(number, None) for number, call in enumerate(part.calls) if call.name not in part.before]
        part.check_names(actions)
        return replace(function, actions=actions, logic=part.logic())

    # ------------------------------------------------------------------------------------------------ the program
    def project(self) -> Project:
        """Return the project."""
        program = self._program
        actions: dict[str, list[Action]] = {point.id: [] for point in self._old.action_points}
        point_of: dict[str, str] = {}
        for point in self._old.action_points:
            for old in point.actions:
                point_of.setdefault(old.name, point.id)
                if (new := program.updated(old)) is not None:
                    actions[point.id].append(new)
        place: str | None = None
        for number, call in enumerate(program.calls):
            if call.name in program.before:
                place = point_of[call.name]
                continue
            place = self._place(call, place)
            actions[place].append(program.action(number, None))
        program.check_names(action for of in actions.values() for action in of)
        functions = self._new_functions(program.unreachable.values())
        return replace(
            self._old,
            action_points=[replace(point, actions=actions[point.id]) for point in self._old.action_points],
            parameters=self._parameters,
            functions=functions,
            logic=program.logic(),
        )

    def _place(self, call: Call, before: str | None) -> str:
        """Return the id of the action point for a new action."""
        used = [key for node in call.arguments.values() for key in self._values.points_in(node)]
        if used:
            return used[-1]
        if before is not None:
            return before
        if not self._old.action_points:
            raise NotUnderstood(call.line, "the project has no action point for the action {name!r}", name=call.name)
        return self._old.action_points[0].id


def _variables(frame: Frame, project: Project) -> Variables:
    """Return the variables in the script of the old project."""
    found = Variables()
    try:
        program, functions = cycles_of(frame, project)
    except InvalidProject:
        return found
    for cycle in (program, *functions):
        calls = cycle.calls
        for number, action in enumerate(calls.flow.actions):
            found.results[action.id] = calls.results[number]
            found.errors[action.id] = calls.errors[number]
    for function in functions:
        found.parameters[function.function.id] = {
            name: variable for name, (variable, _) in function.calls.scope.parameters.items()
        }
    return found


def _called(project: Project) -> set[str]:
    """Return the ids of the functions in the script of the project: those that its program calls."""
    functions = {function.id: function for function in project.functions}
    found: set[str] = set()
    waiting: list[tuple[Iterable[Action], list[LogicItem]]] = [
        ([action for point in project.action_points for action in point.actions], project.logic)
    ]
    while waiting:
        actions, logic = waiting.pop()
        actions = list(actions)
        own = reached(logic, actions)
        for action in actions:
            key = action.type.partition("/")[0]
            if action.id in own and key in functions and key not in found:
                found.add(key)
                waiting.append((functions[key].actions, functions[key].logic))
    return found
