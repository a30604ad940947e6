"""Converts the calls and paths of a script to a project. Existing items keep their ids and positions."""

import json
from collections.abc import Mapping

from msgspec import UNSET
from msgspec.structs import replace

from arcor2_hw.data.base import Unset, is_valid_name, new_id
from arcor2_hw.data.project import (
    END,
    START,
    Action,
    ActionParameter,
    ActionParameterType,
    ActionPoint,
    Flow,
    LogicItem,
    Project,
    ProjectLogicIf,
    ProjectParameter,
)
from arcor2_hw.data.scene import Scene
from arcor2_hw.exceptions import InvalidProject
from arcor2_server.build import layout
from arcor2_server.build.cycle import Cycle
from arcor2_server.build.error_exits import nodes_of
from arcor2_server.build.frame import Frame, TypeFacts
from arcor2_server.build.reading import module
from arcor2_server.build.reading.errors import NotUnderstood
from arcor2_server.build.reading.module import Script
from arcor2_server.build.reading.paths import START_NODE, Call, LogicPath, LoopReader
from arcor2_server.build.reading.values import PLAIN, Values, json_as_before, json_of, of_type, plain
from arcor2_server.documents import logic_graph
from arcor2_server.documents.logic_graph import END_NODE, Condition, Edge, ErrorExit

_ConditionKey = tuple[str, object] | None
"""A condition in comparable form: the result and its value."""


def from_script(source: str, scene: Scene, project: Project, types: Mapping[str, TypeFacts]) -> Project:
    """Return the project with the actions, logic and project parameters of its edited script.

    An action with the same name (`an`) keeps its id, action point and everything that is not in the script. Actions
    missing in the script are removed, except those that no path of the old logic reached. A new action is added to the
    action point that it uses, else to that of the action before it.

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
        loop = LoopReader(frame, self._script, self._values)
        self._calls = loop.calls
        self._paths = {number: _merged(found) for number, found in loop.paths.items()}
        self._exits = loop.exits
        self._check_uses(loop)

        points = [(point, action) for point in project.action_points for action in point.actions]
        self._before: dict[str, tuple[ActionPoint, Action]] = {}
        for point, action in points:
            self._before.setdefault(action.name, (point, action))
        self._variables, self._error_variables = _variables(frame, project)
        self._ids = [
            self._before[call.name][1].id if call.name in self._before else new_id("act") for call in self._calls
        ]

    def _check_uses(self, loop: LoopReader) -> None:
        """Raise NotUnderstood for uses of results that are not set on all paths."""
        count = range(len(self._calls))
        edges = [tuple(Edge(path.target, None) for path in loop.paths[number]) for number in count]
        nodes = nodes_of(edges, [loop.exits.get(number, ()) for number in count])
        _, natural = layout.arrange(nodes.edges)
        for use in loop.uses:
            producer = self._calls[use.source].name
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

    # ------------------------------------------------------------------------------------------------ actions
    def project(self) -> Project:
        """Return the project."""
        reached = _reached(self._old)
        number_of = {call.name: number for number, call in enumerate(self._calls)}
        named: dict[str, str] = {}
        actions: dict[str, list[Action]] = {point.id: [] for point in self._old.action_points}
        unreachable: set[str] = set()
        for point in self._old.action_points:
            for old in point.actions:
                number = number_of.get(old.name)
                if number is not None and self._ids[number] == old.id:
                    actions[point.id].append(self._action(number, old))
                elif old.id not in reached and number is None:
                    actions[point.id].append(old)
                    unreachable.add(old.id)
                    named |= dict.fromkeys(old.names(), old.name)
        place: str | None = None
        for number, call in enumerate(self._calls):
            if call.name in self._before:
                place = self._before[call.name][0].id
                continue
            place = self._place(call, place)
            actions[place].append(self._action(number, None))
        for action in (action for of in actions.values() for action in of if action.id not in unreachable):
            for output in action.names():
                if output in named:
                    line = self._calls[number_of[action.name]].line
                    raise NotUnderstood(
                        line, "{output} is already a result of the action {named!r}", output=output, named=named[output]
                    )
                named[output] = action.name
        return replace(
            self._old,
            action_points=[replace(point, actions=actions[point.id]) for point in self._old.action_points],
            parameters=self._parameters,
            logic=self._logic(unreachable),
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

    def _action(self, number: int, old: Action | None) -> Action:
        call = self._calls[number]
        given = {} if old is None else {parameter.name: parameter for parameter in old.parameters}
        found: dict[str, ActionParameter] = {}
        for meta in call.declared.parameters:
            if (node := call.arguments.get(meta.name)) is None:
                continue
            if meta.name in call.results:
                source, flow, output = call.results[meta.name]
                link = f"{self._ids[source]}/{flow}/{output}"
                found[meta.name] = ActionParameter(meta.name, ActionParameterType.LINK, json_of(link))
            else:
                found[meta.name] = self._values.constant(
                    node, meta, call.object_id, call.type_name, call.declared.name, given.get(meta.name)
                )
        order = [*(name for name in given if name in found), *(name for name in found if name not in given)]
        return Action(
            call.name,
            f"{call.object_id}/{call.declared.name}",
            self._ids[number],
            [found[name] for name in order],
            self._flows(call, old),
            self._error_output(call, old),
        )

    def _error_output(self, call: Call, old: Action | None) -> str | Unset:
        if not call.error:
            return UNSET
        if old is not None and self._error_variables.get(old.id) == call.error:
            return old.error_output
        if not is_valid_name(call.error):
            raise NotUnderstood(call.line, "{variable} is not a valid name of an error", variable=call.error)
        return call.error

    def _flows(self, call: Call, old: Action | None) -> list[Flow]:
        before = [] if old is None else self._variables.get(old.id, [])
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
    def _logic(self, unreachable: set[str]) -> list[LogicItem]:
        old_items: dict[str, list[LogicItem]] = {}
        for item in self._old.logic:
            old_items.setdefault(item.start.partition("/")[0], []).append(item)
        unchanged: dict[int, LogicItem] = {}
        changed: list[LogicItem] = []
        for number, paths in self._paths.items():
            start = START if number == START_NODE else self._ids[number]
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
        known = {*self._ids, *unreachable, END}
        for item in self._old.logic:
            if item.start.partition("/")[0] in unreachable and item.end.partition("/")[0] in known:
                unchanged[id(item)] = item
        return [*(item for item in self._old.logic if id(item) in unchanged), *changed]

    def _end(self, target: int) -> str:
        return END if target == END_NODE else self._ids[target]

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
        return ProjectLogicIf(f"{self._ids[condition.action]}/default/{condition.output}", json_of(condition.value))


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


def _variables(frame: Frame, project: Project) -> tuple[dict[str, list[str]], dict[str, str]]:
    """Return the variables for results and errors in the script of the old project, by id of the action."""
    try:
        cycle = Cycle(frame, logic_graph.read(project))
    except InvalidProject:
        return {}, {}
    ids = [action.id for action in cycle.flow.actions]
    return dict(zip(ids, cycle.results, strict=True)), dict(zip(ids, cycle.errors, strict=True))


def _reached(project: Project) -> set[str]:
    """Return the ids of the actions reachable from START, which are those in the script of the project."""
    following: dict[str, list[str]] = {}
    for item in project.logic:
        following.setdefault(item.start.partition("/")[0], []).append(item.end.partition("/")[0])
    seen: set[str] = set()
    waiting = [START]
    while waiting:
        for action_id in following.get(waiting.pop(), ()):
            if action_id != END and action_id not in seen:
                seen.add(action_id)
                waiting.append(action_id)
    return seen
