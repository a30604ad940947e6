"""Converts the calls and paths of a script to a project. Existing items keep their ids and positions."""

import ast
import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

from msgspec import UNSET
from msgspec.structs import replace

from arcor2_hw.data.base import Unset, is_valid_name, new_id
from arcor2_hw.data.project import (
    END,
    START,
    Action,
    ActionParameter,
    ActionParameterType,
    Flow,
    FunctionReturns,
    LogicItem,
    Project,
    ProjectFunction,
    ProjectLogicIf,
    ProjectParameter,
)
from arcor2_hw.data.scene import Scene
from arcor2_hw.exceptions import InvalidProject
from arcor2_server.build import layout
from arcor2_server.build.error_exits import nodes_of
from arcor2_server.build.frame import Frame, TypeFacts
from arcor2_server.build.functions import cycles_of
from arcor2_server.build.reading import module
from arcor2_server.build.reading.errors import NotUnderstood
from arcor2_server.build.reading.functions import FunctionReader
from arcor2_server.build.reading.module import Script
from arcor2_server.build.reading.paths import START_NODE, Call, LogicPath, LoopReader, ScriptCalls
from arcor2_server.build.reading.values import PLAIN, Values, json_as_before, json_of, of_type, plain
from arcor2_server.documents.logic_graph import END_NODE, Condition, Edge, ErrorExit

_ConditionKey = tuple[str, object] | None
"""A condition in comparable form: the result and its value."""


@dataclass(frozen=True, slots=True)
class _Variables:
    """The variables of results and errors by action, and of parameters by function and name."""

    results: dict[str, list[str]] = field(default_factory=dict)
    errors: dict[str, str] = field(default_factory=dict)
    parameters: dict[str, dict[str, str]] = field(default_factory=dict)


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
    return _Reading(source, scene, project, types).project()


class _Part:
    """The program or a function, as the script states it and as it was before.

    Args:
        reader: the calls and paths in the script.
        values: reads arguments.
        actions: the actions before.
        logic: the logic before.
        variables: the variables in the script of the old project.
    """

    def __init__(
        self,
        reader: LoopReader,
        values: Values,
        actions: Sequence[Action],
        logic: list[LogicItem],
        variables: _Variables,
    ) -> None:
        self.calls = reader.calls
        self.before = {action.name: action for action in reversed(actions)}
        """The actions before by name."""
        self.ids = [self.before[call.name].id if call.name in self.before else new_id("act") for call in self.calls]
        self.unreachable: dict[str, Action] = {}
        """The actions that no path of the old logic reached and that are not in the script."""
        self._values = values
        self._old_logic = logic
        self._variables = variables
        self._paths = {number: _merged(found) for number, found in reader.paths.items()}
        self._exits = reader.exits
        self._number_of = {call.name: number for number, call in enumerate(self.calls)}
        self._reached = _reached(logic)
        self._check_uses(reader)

    def _check_uses(self, loop: LoopReader) -> None:
        """Raise NotUnderstood for uses of results that are not set on all paths."""
        count = range(len(self.calls))
        edges = [tuple(Edge(path.target, None) for path in loop.paths[number]) for number in count]
        nodes = nodes_of(edges, [loop.exits.get(number, ()) for number in count])
        _, natural = layout.arrange(nodes.edges)
        for use in loop.uses:
            producer = self.calls[use.source].name
            node = (nodes.success if use.in_condition else nodes.call)[use.user]
            if use.of_error:
                if not nodes.has_error(natural, use.source, node):
                    raise NotUnderstood(
                        use.line,
                        "{name} is not always set: {producer!r} has not failed on all paths to this line",
                        name=use.name,
                        producer=producer,
                    )
            elif not nodes.has_results(natural, use.source, node):
                raise NotUnderstood(
                    use.line,
                    "{name} is not always set: {producer!r} does not run on all paths to this line",
                    name=use.name,
                    producer=producer,
                )

    # ------------------------------------------------------------------------------------------------ actions
    def updated(self, old: Action) -> Action | None:
        """Return an action of the old project as the script states it, None if it is removed."""
        number = self._number_of.get(old.name)
        if number is not None and self.ids[number] == old.id:
            return self.action(number, old)
        if old.id not in self._reached and number is None:
            self.unreachable[old.id] = old
            return old
        return None

    def check_names(self, actions: Iterable[Action]) -> None:
        """Raise NotUnderstood if two actions of the program or function name the same result."""
        named = {name: old.name for old in self.unreachable.values() for name in old.names()}
        for action in actions:
            if action.id in self.unreachable:
                continue
            for output in action.names():
                if output in named:
                    raise NotUnderstood(
                        self.calls[self._number_of[action.name]].line,
                        "{output} is already a result of the action {named!r}",
                        output=output,
                        named=named[output],
                    )
                named[output] = action.name

    def action(self, number: int, old: Action | None) -> Action:
        """Return the action of a call. `old`: the same action in the old project."""
        call = self.calls[number]
        given = {} if old is None else {parameter.name: parameter for parameter in old.parameters}
        found: dict[str, ActionParameter] = {}
        for meta in call.declared.parameters:
            if (node := call.arguments.get(meta.name)) is None:
                continue
            if meta.name in call.results:
                source, flow, output = call.results[meta.name]
                link = f"{self.ids[source]}/{flow}/{output}"
                found[meta.name] = ActionParameter(meta.name, ActionParameterType.LINK, json_of(link))
            elif meta.name in call.passed:
                passed = json_of(call.passed[meta.name])
                found[meta.name] = ActionParameter(meta.name, ActionParameterType.FUNCTION_PARAMETER, passed)
            else:
                found[meta.name] = self._values.constant(
                    node, meta, call.object_id, call.type_name, call.declared.name, given.get(meta.name)
                )
        order = [*(name for name in given if name in found), *(name for name in found if name not in given)]
        return Action(
            call.name,
            f"{call.object_id}/{call.declared.name}",
            self.ids[number],
            [found[name] for name in order],
            self._flows(call, old),
            self._error_output(call, old),
        )

    def _error_output(self, call: Call, old: Action | None) -> str | Unset:
        if not call.error:
            return UNSET
        if old is not None and self._variables.errors.get(old.id) == call.error:
            return old.error_output
        if not is_valid_name(call.error):
            raise NotUnderstood(call.line, "{variable} is not a valid name of an error", variable=call.error)
        return call.error

    def _flows(self, call: Call, old: Action | None) -> list[Flow]:
        before = [] if old is None else self._variables.results.get(old.id, [])
        outputs = []
        for place, variable in enumerate(call.outputs):
            if old is not None and place < len(before) and before[place] == variable:
                outputs.append(old.outputs()[place])
                continue
            if not is_valid_name(variable):
                raise NotUnderstood(call.line, "{variable} is not a valid name of a result", variable=variable)
            outputs.append(variable)
        if old is not None and old.outputs() == outputs:
            return old.flows
        return [Flow(outputs=outputs)]

    # ------------------------------------------------------------------------------------------------ logic
    def logic(self) -> list[LogicItem]:
        """Return the logic. Unchanged items are the old ones, in their order."""
        old_items: dict[str, list[LogicItem]] = {}
        for item in self._old_logic:
            old_items.setdefault(item.start.partition("/")[0], []).append(item)
        unchanged: dict[int, LogicItem] = {}
        changed: list[LogicItem] = []
        for number, paths in self._paths.items():
            start = START if number == START_NODE else self.ids[number]
            old = old_items.get(start, [])
            wanted = self._steps(paths, old)
            wanted += [self._exit(one) for one in self._exits.get(number, ())]
            same = {_key(item): item for item in old}
            keys = [_key(item) for item in wanted]
            # The order of conditions matters; the edge without a condition is always the last.
            ordered = len(paths) <= 2 or [key for key in same if key[1]] == [key for key in keys if key[1]]
            if len(same) == len(old) == len(keys) and set(same) == set(keys) and ordered:
                unchanged |= {id(item): item for item in old}
                continue
            spare = {(item.end.partition("/")[0], item.is_error_exit): item for item in old}
            for item in wanted:
                former = spare.pop((item.end, item.is_error_exit), None)
                changed.append(replace(item, start=start, id=former.id if former else new_id("lit")))
        known = {*self.ids, *self.unreachable, END}
        for item in self._old_logic:
            if item.start.partition("/")[0] in self.unreachable and item.end.partition("/")[0] in known:
                unchanged[id(item)] = item
        return [*(item for item in self._old_logic if id(item) in unchanged), *changed]

    def _end(self, target: int) -> str:
        return END if target == END_NODE else self.ids[target]

    def _exit(self, found: ErrorExit) -> LogicItem:
        return LogicItem("", self._end(found.target), error_kinds=list(found.kinds))

    def _steps(self, paths: list[LogicPath], old: list[LogicItem]) -> list[LogicItem]:
        """Return the ordinary steps of an action, without start and id."""
        before = {_key(item) for item in old}
        steps: list[LogicItem] = []
        for path in paths:
            end = self._end(path.target)
            if path.taken is not None:
                steps.append(LogicItem("", end, self._logic_if(path.taken)))
                continue
            opposites = [
                self._logic_if(one._replace(value=not one.value)) for one in path.tried if isinstance(one.value, bool)
            ]
            known = [one for one in opposites if _key(LogicItem("", end, one)) in before]
            chosen = [*known, *reversed(opposites)]
            steps.append(LogicItem("", end, chosen[0] if chosen else UNSET))
        return steps

    def _logic_if(self, condition: Condition) -> ProjectLogicIf:
        return ProjectLogicIf(f"{self.ids[condition.action]}/default/{condition.output}", json_of(condition.value))


class _Reading:
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
        loop = LoopReader(frame, self._script, self._values, shared, self._script.loop)
        actions = [action for point in project.action_points for action in point.actions]
        self._program = _Part(loop, self._values, actions, project.logic, variables)

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
                found[key] = ProjectParameter(name, PLAIN[type(value)], json_of(value), id=key)
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
        self, frame: Frame, shared: ScriptCalls, variables: _Variables
    ) -> dict[str, tuple[ProjectFunction, _Part]]:
        """Return the functions of the script by id, in its order, without their actions, and what it states of them."""
        found: dict[str, tuple[ProjectFunction, _Part]] = {}
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
            part = _Part(reader, self._values, actions, logic, variables)
            returns = [
                FunctionReturns(reader.calls[source].declared.returns[output], f"{part.ids[source]}/default/{output}")
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
    def _new_function(function: ProjectFunction, part: _Part, before: list[Action]) -> ProjectFunction:
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


def _merged(paths: list[LogicPath]) -> list[LogicPath]:
    """Remove conditions without effect: those of the last edges if these lead to the same action."""
    *others, last = paths
    while others and others[-1].target == last.target:
        others.pop()
    return [*others, last._replace(tried=tuple(path.taken for path in others if path.taken is not None))]


def _condition_key(condition: ProjectLogicIf | Unset) -> _ConditionKey:
    if isinstance(condition, Unset):
        return None
    try:
        value = json.loads(condition.value)
    except ValueError:
        return condition.what, condition.value
    return condition.what, (type(value).__name__, value)


def _key(item: LogicItem) -> tuple[str, _ConditionKey, frozenset[str]]:
    kinds = frozenset(item.error_kinds or ())
    return item.end.partition("/")[0], _condition_key(item.condition), kinds


def _variables(frame: Frame, project: Project) -> _Variables:
    """Return the variables in the script of the old project."""
    found = _Variables()
    try:
        program, functions = cycles_of(frame, project)
    except InvalidProject:
        return found
    for cycle in (program, *functions):
        for number, action in enumerate(cycle.flow.actions):
            found.results[action.id] = cycle.results[number]
            found.errors[action.id] = cycle.errors[number]
    for function in functions:
        found.parameters[function.function.id] = function.parameters
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
        reached = _reached(logic)
        for action in actions:
            key = action.type.partition("/")[0]
            if action.id in reached and key in functions and key not in found:
                found.add(key)
                waiting.append((functions[key].actions, functions[key].logic))
    return found


def _reached(logic: Iterable[LogicItem]) -> set[str]:
    """Return the ids of the actions reachable from START, which are those in the script of the project."""
    following: dict[str, list[str]] = {}
    for item in logic:
        following.setdefault(item.start.partition("/")[0], []).append(item.end.partition("/")[0])
    seen: set[str] = set()
    waiting = [START]
    while waiting:
        for action_id in following.get(waiting.pop(), ()):
            if action_id != END and action_id not in seen:
                seen.add(action_id)
                waiting.append(action_id)
    return seen
