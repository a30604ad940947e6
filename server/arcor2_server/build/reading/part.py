"""Converts the calls and paths of the program, or of one function, to actions and logic."""

from collections.abc import Iterable, Sequence
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
    LogicComparison,
    LogicItem,
    LogicWhen,
    ProjectLogicIf,
)
from arcor2_hw.exceptions import InvalidProject
from arcor2_server.build import layout
from arcor2_server.build.error_exits import nodes_of
from arcor2_server.build.reading.errors import NotUnderstood
from arcor2_server.build.reading.paths import START_NODE, LogicPath, LoopReader
from arcor2_server.build.reading.scope import Call
from arcor2_server.build.reading.values import Values, json_of
from arcor2_server.documents import logic_graph
from arcor2_server.documents.comparisons import Comparisons, Reference, cases_of, condition_key, inverse
from arcor2_server.documents.logic_graph import (
    END_NODE,
    Condition,
    Edge,
    ErrorExit,
    Test,
    as_comparisons,
    is_boolean,
)


@dataclass(frozen=True, slots=True)
class Variables:
    """The variables of results and errors by action, and of parameters by function and name."""

    results: dict[str, list[str]] = field(default_factory=dict)
    errors: dict[str, str] = field(default_factory=dict)
    parameters: dict[str, dict[str, str]] = field(default_factory=dict)
    stored: dict[str, str] = field(default_factory=dict)
    """The variables of the project by their names in the script."""


class Part:
    """The program or a function, as in the script and as in the old project.

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
        variables: Variables,
    ) -> None:
        self.calls = reader.scope.calls
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
        self._parallel = reader.parallel
        self._kinds = reader.scope.kinds
        self._stored = variables.stored if reader.scope.stores else {}
        self._number_of = {call.name: number for number, call in enumerate(self.calls)}
        self._reached = reached(logic, actions)
        self._check_uses(reader)

    def _check_uses(self, loop: LoopReader) -> None:
        """Raise NotUnderstood for uses of results that are not set on all paths."""
        count = range(len(self.calls))
        edges = [tuple(Edge(path.target, None) for path in loop.paths[number]) for number in count]
        nodes = nodes_of(edges, [loop.exits.get(number, ()) for number in count])
        _, natural = layout.arrange(nodes.edges)
        for use in loop.scope.uses:
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
        """Return an action of the old project updated from the script, None if it was removed."""
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
                if output in self._stored.values() and output in action.outputs():
                    continue
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
            call.retry,
            [self.ids[branch] for branch in self._parallel[number]] if number in self._parallel else UNSET,
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
            if variable in self._stored:
                outputs.append(self._stored[variable])
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
        inner = {one for number, branches in self._parallel.items() for one in (number, *branches[:-1])}
        last = {branches[-1]: number for number, branches in self._parallel.items()}
        for after, paths in self._paths.items():
            if after in inner:
                continue  # the chain of an action and the calls that it runs concurrently
            number = last.get(after, after)
            start = START if number == START_NODE else self.ids[number]
            old = old_items.get(start, [])
            wanted = self._steps(paths, old)
            wanted += [self._exit(one) for one in self._exits.get(number, ())]
            same = {_key(item): item for item in old}
            keys = [_key(item) for item in wanted]
            # The order of conditions matters, except of two opposite ones; the edge without one is always the last.
            opposite = len(paths) <= 2 and not any(item.has_comparisons for item in wanted)
            ordered = opposite or [key for key in same if key[1]] == [key for key in keys if key[1]]
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
        unchanged = self._known_steps(paths, [item for item in old if not item.is_error_exit])
        if unchanged is not None:
            return unchanged
        before = {_key(item) for item in old}
        steps: list[LogicItem] = []
        for path in paths:
            end = self._end(path.target)
            if path.taken is not None:
                steps.append(self._step(end, path.taken))
                continue
            opposites = [self._logic_if(one._replace(value=not one.value)) for one in path.tried if is_boolean(one)]
            known = [one for one in opposites if _key(LogicItem("", end, one)) in before]
            chosen = [*known, *reversed(opposites)]
            steps.append(LogicItem("", end, chosen[0] if chosen else UNSET))
        return steps

    def _known_steps(self, paths: list[LogicPath], old: list[LogicItem]) -> list[LogicItem] | None:
        """Return the steps with the old conditions if these mean the same, else None.

        The last of several conditions that are complete is not in the script, and a comparison by `!=` may be in the
        script as `==` with the branches exchanged.
        """
        compared = [path.taken for path in paths if isinstance(path.taken, Comparisons)]
        if len(paths) != len(old) or not (compared or any(item.has_comparisons for item in old)):
            return None
        ordered = [*(item for item in old if item.has_condition), *(item for item in old if not item.has_condition)]
        found = [(path.taken, path.target) for path in paths]
        candidates = [found]
        if len(found) > 1 and found[-2][0] is not None and found[-1][0] is None:
            exchanged = inverse(as_comparisons(found[-2][0]))
            if exchanged is not None:
                candidates.append([*found[:-2], (exchanged, found[-1][1]), (None, found[-2][1])])
        *former, last = ordered
        for candidate in candidates:
            steps = [
                LogicItem("", self._end(target)) if test is None else self._step("", test) for test, target in candidate
            ]
            if list(map(condition_key, steps[:-1])) != list(map(condition_key, former)):
                continue
            tests = [as_comparisons(test) for test, _ in candidate if test is not None]
            same = condition_key(steps[-1]) == condition_key(last)
            if same or (candidate[-1][0] is None and self._completes(tests, last)):
                return [
                    replace(item, start="", id="", end=self._end(target))
                    for item, (_, target) in zip(ordered, candidate, strict=True)
                ]
        return None

    def _completes(self, tests: list[Comparisons], last: LogicItem) -> bool:
        """Return whether the condition of an old step is true whenever the conditions of the other steps are false."""
        numbers = {action_id: number for number, action_id in enumerate(self.ids)}
        parameters = {key for key, _ in self._values.parameters.values()}
        try:
            test = logic_graph.test_of(last, "", numbers, parameters)
        except InvalidProject:
            return False
        if test is None:
            return False
        conditions = [*tests, as_comparisons(test)]
        try:
            cases = cases_of(conditions, self._kinds(conditions))
        except (LookupError, StopIteration):
            return False
        return cases.known and cases.gap is None

    def _step(self, end: str, test: Test) -> LogicItem:
        if isinstance(test, Condition):
            return LogicItem("", end, self._logic_if(test))
        comparisons = [
            LogicComparison(
                self._link(one.what),
                one.operator,
                json_of(one.value) if one.other is None else "",
                UNSET if one.upper is None else json_of(one.upper),
                UNSET if one.other is None else self._link(one.other),
            )
            for one in test.comparisons
        ]
        return LogicItem("", end, when=LogicWhen(comparisons, test.match))

    def _link(self, reference: Reference) -> str:
        return reference.parameter or f"{self.ids[reference.action]}/default/{reference.output}"

    def _logic_if(self, condition: Condition) -> ProjectLogicIf:
        return ProjectLogicIf(f"{self.ids[condition.action]}/default/{condition.output}", json_of(condition.value))


def _merged(paths: list[LogicPath]) -> list[LogicPath]:
    """Remove conditions without effect: those of the last edges if these lead to the same action."""
    *others, last = paths
    while others and others[-1].target == last.target:
        others.pop()
    return [*others, last._replace(tried=tuple(path.taken for path in others if path.taken is not None))]


def _key(item: LogicItem) -> tuple[str, object, frozenset[str]]:
    return item.end.partition("/")[0], condition_key(item), frozenset(item.error_kinds or ())


def reached(logic: Iterable[LogicItem], actions: Iterable[Action]) -> set[str]:
    """Return the ids of the actions reachable from START, which are those in the script of the project."""
    following: dict[str, list[str]] = {action.id: list(action.branches) for action in actions if action.branches}
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
