"""Converts the logic of a project to the statements of the script's loop."""

import ast
import json
from collections.abc import Sequence
from typing import ClassVar, Final

from arcor2_hw.actions.parameter_types import PARAMETER_TYPES, read_reference
from arcor2_hw.data.base import Unset
from arcor2_hw.data.object_type import ParameterMeta
from arcor2_hw.data.project import (
    CALL,
    ERROR_FLOW,
    ERROR_PARTS,
    Action,
    ActionParameter,
    ActionParameterType,
    FlowTypes,
    Retry,
    parse_link,
)
from arcor2_hw.exceptions import ERROR_KINDS, Arcor2Error, InvalidData, InvalidProject
from arcor2_hw.messages import Message
from arcor2_server.build import expressions
from arcor2_server.build.error_exits import nodes_of
from arcor2_server.build.frame import ERROR, NEXT_ACTION, REFERENCES, ActionCall, Frame, References
from arcor2_server.build.layout import arrange
from arcor2_server.build.naming import Names
from arcor2_server.documents.checks.actions import check_retry
from arcor2_server.documents.comparisons import Comparisons, Reference, cases_of, comparison_problem, pair_problem
from arcor2_server.documents.logic_graph import (
    BRANCHABLE,
    END_NODE,
    Condition,
    Edge,
    Flow,
    Test,
    as_comparisons,
    never_taken,
)

CAUGHT: Final = expressions.dotted("res", ("caught",))
"""The method that returns what happened, for an error exit."""

RETRY: Final = expressions.dotted("res", ("retry",))
"""The method that returns a device whose actions are repeated after they have failed."""

PARALLEL: Final = expressions.dotted("res", ("parallel",))
"""The method that runs several calls at once."""
NO_RESULT: Final = "_"
"""The variable for the result of a branch that is not stored."""

Block = list[ast.stmt]
Stack = list[tuple[int, Block]]


class Cycle:
    """One cycle of the logic, which the script repeats, or the body of a function.

    Actions are numbered in the order of `flow`.
    """

    stores: ClassVar = True
    """Whether actions store results in the variables of the project. Those of functions do not."""

    def __init__(self, frame: Frame, flow: Flow) -> None:
        self.frame, self.flow = frame, flow
        self.names = Names(outer=frame.names)
        """The variables of the cycle or function."""
        self._claim_parameters()
        self.nodes = nodes_of(flow.edges, flow.exits)
        self.layout, self.natural = arrange(self.nodes.edges)
        self.numbers = {action.id: number for number, action in enumerate(flow.actions)}
        self._branches = {branch: one for one, branches in flow.parallel.items() for branch in branches}
        """The parallel action of each of its branches."""
        self.calls = [frame.resolve(action) for action in flow.actions]
        self.results = [self._name_results(number) for number in range(len(flow.actions))]
        """The variables for the results of each action."""
        self.errors = [self.names.claim(action.error_output) if action.error_output else "" for action in flow.actions]
        """The variable for the error of each action; empty if it is not stored."""

    def _claim_parameters(self) -> None:
        """Reserve names that precede those of results."""

    def _name_results(self, number: int) -> list[str]:
        action, returns = self.flow.actions[number], self.calls[number].meta.returns
        outputs = action.outputs()
        if outputs and len(outputs) != len(returns):
            method = self.calls[number].method
            raise InvalidProject(
                "action {name!r} names {count} results, but {method} returns {other_count}",
                name=action.name,
                count=len(outputs),
                method=method,
                other_count=len(returns),
            )
        return [self._variable(action, output, kind) for output, kind in zip(outputs, returns, strict=False)]

    def _variable(self, action: Action, output: str, kind: str) -> str:
        """Return the Python variable for a result: that of the project's variable with its name, or a new one."""
        stored = self.frame.variables.get(output) if self.stores else None
        if stored is None:
            return self.names.claim(output)
        if stored.type != kind:
            raise InvalidProject(
                "action {name!r} stores {type} in the variable {variable}, which is {stored_type}",
                name=action.name,
                type=kind,
                variable=stored.name,
                stored_type=stored.type,
            )
        return self.frame.parameters[stored.id]

    # ------------------------------------------------------------------------------------------------ blocks
    def _name(self, node: int) -> str:
        """Return the name of a node in the variable with the next action."""
        return self.flow.actions[self.nodes.actions[node]].name + self.nodes.names[node]

    def statements(self) -> Block:
        """Return the body of the loop."""
        body: Block = []
        guards: list[ast.If] = []
        stack: Stack = [(0, body)]
        nodes = self.nodes
        while stack:
            node, block = stack.pop()
            placed = self.layout.placed[node]
            if placed.guarded:
                guard = ast.If(expressions.equals(NEXT_ACTION, self._name(node)), [], [])
                guards.append(guard)
                block.append(guard)
                block = guard.body
            action = nodes.actions[node]
            attempt: ast.Try | None = None
            if node == nodes.call[action] and action not in self._branches:
                call = self._parallel(action) if action in self.flow.parallel else self._call(action)
                if nodes.exits[action]:
                    attempt = ast.Try([call], [], [], [])
                block.append(attempt or call)
            stack.extend((join, block) for join in reversed(placed.joins))
            if placed.last != END_NODE:
                stack.append((placed.last, block))
            if attempt is not None:
                self._catch(node, attempt, stack)
            elif len(edges := nodes.edges[node]) == 1:
                self._continue_at(node, edges[0].target, block, stack, placed.follow)
            else:
                self._branch(node, block, stack)
        for guard in guards:
            guard.body = guard.body or [ast.Pass()]
        return body

    def _continue_at(self, node: int, target: int, block: Block, stack: Stack, follow: int) -> None:
        """Let the program continue at `target` after a block, if `follow` is the next action in the text."""
        if target == END_NODE:
            if follow != END_NODE:
                block.append(self._leaving())
        elif not self.layout.is_join[target]:
            stack.append((target, block))
        elif self.layout.sets_next_action(node, target):
            block.append(expressions.assign(NEXT_ACTION, ast.Constant(self._name(target))))

    def _leaving(self) -> ast.stmt:
        """Return the statement that ends the cycle early."""
        return ast.Continue()

    def _catch(self, node: int, attempt: ast.Try, stack: Stack) -> None:
        """Write the error exits of an action as `except` blocks, and its success as `else` block."""
        placed = self.layout.placed[node]
        action = self.nodes.actions[node]
        follow = placed.follow if placed.last == END_NODE else placed.last
        for target, leaving in zip(self.nodes.exits[action], self.flow.exits[action], strict=True):
            kinds: list[ast.expr] = [
                expressions.name(self.frame.imported(ERROR_KINDS[kind].__module__, ERROR_KINDS[kind].__name__))
                for kind in leaving.kinds
            ]
            caught = ast.Call(CAUGHT, [expressions.name(ERROR)], [])
            variable = self.errors[action]
            inside: Block = [expressions.assign(variable, caught) if variable else ast.Expr(caught)]
            kind = kinds[0] if len(kinds) == 1 else ast.Tuple(kinds, ast.Load())
            attempt.handlers.append(ast.ExceptHandler(kind, ERROR, inside))
            if target != placed.last:
                self._continue_at(node, target, inside, stack, follow)
        if self.nodes.success[action] != placed.last:
            self._continue_at(node, self.nodes.success[action], attempt.orelse, stack, follow)

    def _branch(self, node: int, block: Block, stack: Stack) -> None:
        """Write the edges of an action as branches of an `if` statement."""
        placed = self.layout.placed[node]
        edges = self.nodes.edges[node]
        targets = {edge.target for edge in edges}
        if len(targets) == 1:
            self._continue_at(node, targets.pop(), block, stack, placed.follow)
            return
        follow = placed.follow if placed.last == END_NODE else placed.last
        if any(isinstance(edge.condition, Comparisons) for edge in edges):
            self._check_complete(node, edges)
        branches: list[tuple[Test | None, Block, bool]] = []
        for edge in edges:
            inside: Block = []
            waiting = len(stack)
            if edge.target == END_NODE or edge.target != placed.last:
                self._continue_at(node, edge.target, inside, stack, follow)
            branches.append((edge.condition, inside, bool(inside) or len(stack) > waiting))
        while branches and not branches[-1][2]:
            branches.pop()  # an empty last branch continues with the next statement anyway
        if not branches:
            return
        if len(edges) == 2 and not branches[0][2]:
            (first, _, _), (condition, inside, _) = branches
            # An edge without a condition is followed if the condition of the other edge does not hold. Comparisons may
            # overlap, so that the first one decides.
            simple = isinstance(first, Condition) and isinstance(condition, Condition)
            test = self._test(node, condition) if simple else self._test(node, first, negated=True)
            block.append(ast.If(test, inside, []))
            return
        above: ast.If | None = None
        for number, (condition, inside, filled) in enumerate(branches):
            if not filled:
                inside.append(ast.Pass())
            if above is not None and number == len(edges) - 1:
                above.orelse = inside
                break
            step = ast.If(self._test(node, condition), inside, [])
            if above is None:
                block.append(step)
            else:
                above.orelse = [step]
            above = step

    # ------------------------------------------------------------------------------------------------ expressions
    def _result(self, user: int, source: int, output: int, kind: str) -> str:
        """Return the variable with a result of action number `source` that action number `user` uses."""
        consumer, producer = self.flow.actions[user], self.flow.actions[source]
        names, returns = self.results[source], self.calls[source].meta.returns
        if output >= len(names):
            raise InvalidProject(
                "action {name!r} uses a result that {producer_name!r} does not name",
                name=consumer.name,
                producer_name=producer.name,
            )
        if self.stores and producer.outputs()[output] in self.frame.variables:
            raise InvalidProject(
                "action {name!r} uses a result that {producer_name!r} stores in a variable; use the variable",
                name=consumer.name,
                producer_name=producer.name,
            )
        if returns[output] != kind:
            name = producer.outputs()[output]
            raise InvalidProject(
                "action {name!r} needs {type}, but {other_name} of {producer_name!r} is {return_value}",
                name=consumer.name,
                type=kind,
                other_name=name,
                producer_name=producer.name,
                return_value=returns[output],
            )
        return names[output]

    def _test(self, node: int, condition: Test | None, *, negated: bool = False) -> ast.expr:
        assert condition is not None, "only the last of several edges has no condition"
        if isinstance(condition, Comparisons):
            variables = [[self._compared(node, what)[0] for what in one.compared()] for one in condition.comparisons]
            return expressions.compares(variables, condition, negated=negated)
        source, number = condition.action, self.nodes.actions[node]
        if not self.nodes.has_results(self.natural, source, node):
            raise self._too_early(number, source)
        user, returns = self.flow.actions[number].name, self.calls[source].meta.returns
        kind = returns[condition.output] if condition.output < len(returns) else ""
        if kind not in BRANCHABLE:
            name = self.flow.actions[source].outputs()[condition.output]
            raise InvalidProject(
                "action {user!r}: {name} is {type}, which a condition cannot use",
                user=user,
                name=name,
                type=kind or Message.of("nothing"),
            )
        variable = self._result(number, source, condition.output, kind)
        if type(condition.value) is not BRANCHABLE[kind]:
            text = "true and false" if kind == "boolean" else "strings" if kind == "string_enum" else "integers"
            allowed = Message.of(text)
            raise InvalidProject(
                "action {user!r}: {variable} is {type}; a condition can compare it with {allowed}, not with {value!r}",
                user=user,
                variable=variable,
                type=kind,
                allowed=allowed,
                value=condition.value,
            )
        return (expressions.differs if negated else expressions.equals)(variable, condition.value)

    def _compared(self, node: int, what: Reference) -> tuple[str, str]:
        """Return the variable and the type of a compared value."""
        if what.parameter:
            return self.frame.parameters[what.parameter], self.frame.index.parameter(what.parameter).type
        number = self.nodes.actions[node]
        if not self.nodes.has_results(self.natural, what.action, node):
            raise self._too_early(number, what.action)
        returns = self.calls[what.action].meta.returns
        kind = returns[what.output] if what.output < len(returns) else ""
        return self._result(number, what.action, what.output, kind), kind

    def _check_complete(self, node: int, edges: Sequence[Edge]) -> None:
        """Raise InvalidProject unless exactly one of several edges applies for any values."""
        user = self.flow.actions[self.nodes.actions[node]]
        kinds: dict[Reference, str] = {}
        conditions = [as_comparisons(edge.condition) for edge in edges if edge.condition is not None]
        for condition in conditions:
            for one in condition.comparisons:
                compared = {what: self._compared(node, what) for what in one.compared()}
                if one.other is None:
                    problem = comparison_problem(*compared[one.what], one.operator, one.value, one.upper)
                else:
                    problem = pair_problem(*compared[one.what], one.operator, *compared[one.other])
                if problem is not None:
                    raise InvalidProject("action {name!r}: {reason}", name=user.name, reason=problem)
                kinds |= {what: kind for what, (_, kind) in compared.items()}
        cases = cases_of(conditions, kinds)
        if cases.unused:
            raise never_taken(user, edges[cases.unused[0]], [self.flow.actions[one] for one in self.nodes.actions])
        otherwise = edges[-1].condition is None
        if otherwise and cases.known and cases.gap is None:
            raise never_taken(user, edges[-1], [self.flow.actions[one] for one in self.nodes.actions])
        if otherwise:
            return
        if not cases.known:
            raise InvalidProject(
                "action {name!r}: its conditions are too many to prove that one of them always holds; add a connection"
                " without a condition",
                name=user.name,
            )
        if cases.gap is not None:
            values = ", ".join(
                f"{self._compared(node, what)[0]} = {json.dumps(value, ensure_ascii=False)}"
                for what, value in cases.gap.items()
            )
            raise InvalidProject(
                "action {name!r}: no action follows it when {when}; add a connection without a condition",
                name=user.name,
                when=values,
            )

    def _too_early(self, user: int, source: int) -> InvalidProject:
        consumer, producer = self.flow.actions[user].name, self.flow.actions[source].name
        return InvalidProject(
            "action {consumer!r} uses a result of {producer!r}, which does not run before it on all paths",
            consumer=consumer,
            producer=producer,
        )

    def _linked(self, user: int, parameter: ActionParameter, meta: ParameterMeta) -> ast.expr:
        action_id, flow, output = parse_link(read_reference(parameter))
        source = self.numbers.get(action_id)
        if source is None or flow not in (FlowTypes.DEFAULT, ERROR_FLOW):
            producer = self.frame.index.action(action_id)
            raise InvalidData(
                "parameter {name}: {producer_name!r} never runs and has no result",
                name=parameter.name,
                producer_name=producer.name,
            )
        node = self.nodes.call[user]
        if flow == ERROR_FLOW:
            return self._part_of_error(user, source, output, meta)
        if source in self._branches and self._branches[source] == self._branches.get(user):
            raise InvalidProject(
                "action {name!r} uses a result of {producer_name!r}, which runs at the same time",
                name=self.flow.actions[user].name,
                producer_name=self.flow.actions[source].name,
            )
        if source == user or not self.nodes.has_results(self.natural, source, node):
            raise self._too_early(user, source)
        return expressions.name(self._result(user, source, output, meta.type))

    def _part_of_error(self, user: int, source: int, part: int, meta: ParameterMeta) -> ast.expr:
        consumer, producer = self.flow.actions[user].name, self.flow.actions[source].name
        if not self.errors[source] or part >= len(ERROR_PARTS) or meta.type != "string":
            raise InvalidProject(
                "action {name!r}: {parameter} cannot be the error of {producer_name!r}",
                name=consumer,
                parameter=meta.name,
                producer_name=producer,
            )
        if not self.nodes.has_error(self.natural, source, self.nodes.call[user]):
            raise InvalidProject(
                "action {consumer!r} uses the error of {producer!r}, which has not failed on all paths to it",
                consumer=consumer,
                producer=producer,
            )
        return expressions.dotted(self.errors[source], (ERROR_PARTS[part],))

    def _constant(self, parameter: ActionParameter, meta: ParameterMeta) -> ast.expr:
        constant = self.frame.index.parameter(read_reference(parameter))
        if constant.type != meta.type:
            raise InvalidData(
                "parameter {name} must be {type}, but {constant_name} is {constant_type}",
                name=parameter.name,
                type=meta.type,
                constant_name=constant.name,
                constant_type=constant.type,
            )
        return expressions.name(self.frame.parameters[constant.id])

    def _parameter(self, parameter: ActionParameter, meta: ParameterMeta) -> ast.expr:  # noqa: ARG002 - see functions
        """Return the variable of a parameter of the function that contains the action."""
        raise InvalidData("parameter {name}: only actions of a function have its parameters", name=parameter.name)

    def _literal(self, user: int, parameter: ActionParameter, meta: ParameterMeta) -> ast.expr:
        object_id, type_name, method, _ = self.calls[user]
        kind = PARAMETER_TYPES.get(meta.type)
        if kind is None or parameter.type != meta.type:
            raise InvalidData(
                "parameter {name} must be of type {type}, not {parameter_type}",
                name=parameter.name,
                type=meta.type,
                parameter_type=parameter.type,
            )
        if meta.type not in REFERENCES:  # `expression` looks up references
            kind.check(parameter, meta)
        enumerations = self.frame.types_of(type_name).enumerations
        return kind.expression(parameter, References(self.frame, object_id, enumerations, method))

    def _arguments(self, user: int) -> tuple[list[ast.expr], list[ast.keyword]]:
        """Return positional arguments, and keyword arguments if required or after a default value."""
        action, (_, type_name, method, declared) = self.flow.actions[user], self.calls[user]
        keyword_only = self.frame.types_of(type_name).keyword_only
        given = {parameter.name: parameter for parameter in action.parameters}
        positional: list[ast.expr] = []
        keywords: list[ast.keyword] = []
        gap = False
        for meta in declared.parameters:
            parameter = given.pop(meta.name, None)
            if parameter is None:
                if isinstance(meta.default_value, Unset):
                    raise InvalidProject(
                        "action {name!r}: parameter {meta_name} is missing", name=action.name, meta_name=meta.name
                    )
                gap = True
                continue
            match parameter.type:
                case ActionParameterType.LINK:
                    value = self._linked(user, parameter, meta)
                case ActionParameterType.PROJECT_PARAMETER:
                    value = self._constant(parameter, meta)
                case ActionParameterType.FUNCTION_PARAMETER:
                    value = self._parameter(parameter, meta)
                case _:
                    value = self._literal(user, parameter, meta)
            if gap or (method, meta.name) in keyword_only:
                keywords.append(ast.keyword(meta.name, value))
            else:
                positional.append(value)
        if given:
            raise InvalidProject(
                "action {name!r}: {declared_name} has no parameter {given}",
                name=action.name,
                declared_name=declared.name,
                given=", ".join(given),
            )
        return positional, keywords

    def _retried(self, action: Action, retry: Retry, call: ActionCall) -> ast.expr:
        """Return the method of an action that is repeated after it has failed, as in `res.retry(reader, 3).scan`."""
        try:
            check_retry(action, call.meta)
        except InvalidData as error:
            raise InvalidProject("action {name!r}: {reason}", name=action.name, reason=error) from error
        pause = [ast.keyword("pause", ast.Constant(retry.pause))] if retry.pause else []
        device = expressions.name(self.frame.objects[call.object_id])
        return ast.Attribute(ast.Call(RETRY, [device, ast.Constant(retry.count)], pause), call.method, ast.Load())

    def _call(self, number: int) -> ast.stmt:
        """Return the statement that runs an action and stores its results."""
        call = self._expression(number)
        match self.results[number]:
            case []:
                return ast.Expr(call)
            case [name]:
                return expressions.assign(name, call)
            case names:
                return ast.Assign([_targets(names)], call, lineno=0)

    def _parallel(self, number: int) -> ast.stmt:
        """Return the statement that runs calls at once, `found, _ = res.parallel(lambda: find(an="find"), ...)`."""
        branches = self.flow.parallel[number]
        action = self.flow.actions[number]
        if action.parameters:
            raise InvalidProject("action {name!r}: parallel work has no parameters", name=action.name)
        none = ast.arguments([], [], None, [], [], None, [])
        calls: list[ast.expr] = [ast.Lambda(none, self._expression(one)) for one in branches]
        call = ast.Call(PARALLEL, calls, [ast.keyword("an", ast.Constant(action.name))])
        results = [self.results[one] for one in branches]
        if not any(results):
            return ast.Expr(call)
        parts = [
            expressions.target(names[0] if names else NO_RESULT) if len(names) < 2 else _targets(names)
            for names in results
        ]
        return ast.Assign([ast.Tuple(parts, ast.Store())], call, lineno=0)

    def _expression(self, number: int) -> ast.expr:
        """Return the call of an action."""
        action = self.flow.actions[number]
        object_id, _, method, _ = self.calls[number]
        try:
            positional, keywords = self._arguments(number)
        except InvalidProject:
            raise
        except (Arcor2Error, ValueError) as error:
            raise InvalidProject("action {name!r}: {reason}", name=action.name, reason=error) from error
        keywords.append(ast.keyword("an", ast.Constant(action.name)))
        if method == CALL and object_id in self.frame.functions:
            called: ast.expr = expressions.name(self.frame.functions[object_id])
        else:
            called = expressions.dotted(self.frame.objects[object_id], (method,))
        if not isinstance(action.retry, Unset):
            called = self._retried(action, action.retry, self.calls[number])
        return ast.Call(called, positional, keywords)


def _targets(names: Sequence[str]) -> ast.expr:
    """Return several names to which results are assigned."""
    return ast.Tuple([expressions.target(name) for name in names], ast.Store())
