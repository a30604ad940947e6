"""Converts the actions of a program or function to the statements that run them."""

import ast
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final

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
from arcor2_hw.exceptions import Arcor2Error, InvalidData, InvalidProject
from arcor2_server.build import expressions
from arcor2_server.build.error_exits import nodes_of
from arcor2_server.build.frame import REFERENCES, ActionCall, Frame, References
from arcor2_server.build.layout import arrange
from arcor2_server.build.naming import Names
from arcor2_server.documents.checks.actions import check_retry, text_of
from arcor2_server.documents.logic_graph import Flow

RETRY: Final = expressions.dotted("res", ("retry",))
"""The method that returns a device whose actions are repeated after they have failed."""

PARALLEL: Final = expressions.dotted("res", ("parallel",))
"""The method that runs several calls concurrently."""

NO_RESULT: Final = "_"
"""The variable for the result of a branch that is not stored."""


@dataclass(frozen=True)
class Scope:
    """The variables that the actions of a program or function can use.

    Attributes:
        names: The names in use.
        function: Name of the function; empty for the program, whose actions store results in project variables.
        parameters: Variable and type of the function's parameters by their names.
    """

    names: Names
    function: str = ""
    parameters: Mapping[str, tuple[str, str]] = field(default_factory=dict)


class Calls:
    """The calls of the actions in a flow. Actions are numbered in the order of `flow`.

    Raises:
        InvalidProject: An action is invalid.
    """

    def __init__(self, frame: Frame, flow: Flow, scope: Scope) -> None:
        self.frame, self.flow, self.scope = frame, flow, scope
        self.nodes = nodes_of(flow.edges, flow.exits)
        self.layout, self.natural = arrange(self.nodes.edges)
        self.numbers = {action.id: number for number, action in enumerate(flow.actions)}
        self.branches = {branch: one for one, branches in flow.parallel.items() for branch in branches}
        """Parallel action by the number of its branch."""
        self._calls = [frame.resolve(action) for action in flow.actions]
        self.results = [self._name_results(number) for number in range(len(flow.actions))]
        """The variables for the results of each action."""
        self.errors = [scope.names.claim(action.error_output) if action.error_output else "" for action in flow.actions]
        """The variable for the error of each action; empty if it is not stored."""

    def returns(self, number: int) -> list[str]:
        """Return the types of an action's results."""
        return self._calls[number].meta.returns

    def _name_results(self, number: int) -> list[str]:
        action, returns = self.flow.actions[number], self.returns(number)
        outputs = action.outputs()
        if outputs and len(outputs) != len(returns):
            method = self._calls[number].method
            raise InvalidProject(
                "action {name!r} names {count} results, but {method} returns {other_count}",
                name=action.name,
                count=len(outputs),
                method=method,
                other_count=len(returns),
            )
        return [self._variable(action, output, kind) for output, kind in zip(outputs, returns, strict=False)]

    def _variable(self, action: Action, output: str, kind: str) -> str:
        """Return the Python variable for a result: the one of the project variable with its name, or a new one."""
        stored = self.frame.variables.get(output) if not self.scope.function else None
        if stored is None:
            return self.scope.names.claim(output)
        if stored.type != kind:
            raise InvalidProject(
                "action {name!r} stores {type} in the variable {variable}, which is {stored_type}",
                name=action.name,
                type=kind,
                variable=stored.name,
                stored_type=stored.type,
            )
        return self.frame.parameters[stored.id]

    def result(self, user: int, source: int, output: int, kind: str) -> str:
        """Return the variable with a result of type `kind` of action `source` that action `user` uses.

        Raises:
            InvalidProject: The action has no such result.
        """
        consumer, producer = self.flow.actions[user], self.flow.actions[source]
        names, returns = self.results[source], self.returns(source)
        if output >= len(names):
            raise InvalidProject(
                "action {name!r} uses a result that {producer_name!r} does not name",
                name=consumer.name,
                producer_name=producer.name,
            )
        if not self.scope.function and producer.outputs()[output] in self.frame.variables:
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

    def too_early(self, user: int, source: int) -> InvalidProject:
        """Return the error for a result of `source` that action `user` uses before it is known on all paths."""
        consumer, producer = self.flow.actions[user].name, self.flow.actions[source].name
        return InvalidProject(
            "action {consumer!r} uses a result of {producer!r}, which does not run before it on all paths",
            consumer=consumer,
            producer=producer,
        )

    # ------------------------------------------------------------------------------------------------ statements
    def statement(self, number: int) -> ast.stmt:
        """Return the statement that runs an action and stores its results.

        Raises:
            InvalidProject: The action is invalid.
        """
        if number in self.flow.parallel:
            return self._parallel(number)
        call = self._expression(number)
        match self.results[number]:
            case []:
                return ast.Expr(call)
            case [name]:
                return expressions.assign(name, call)
            case names:
                return ast.Assign([_targets(names)], call, lineno=0)

    def _parallel(self, number: int) -> ast.stmt:
        """Return the statement of concurrent calls, `found, _ = res.parallel(lambda: find(an="find"), ...)`."""
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
        object_id, _, method, _ = self._calls[number]
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
            called = self._retried(action, action.retry, self._calls[number])
        return ast.Call(called, positional, keywords)

    def _retried(self, action: Action, retry: Retry, call: ActionCall) -> ast.expr:
        """Return the method of an action that is repeated after it has failed, as in `res.retry(reader, 3).scan`."""
        try:
            check_retry(action, call.meta)
        except InvalidData as error:
            raise InvalidProject("action {name!r}: {reason}", name=action.name, reason=error) from error
        pause = [ast.keyword("pause", ast.Constant(retry.pause))] if retry.pause else []
        device = expressions.name(self.frame.objects[call.object_id])
        return ast.Attribute(ast.Call(RETRY, [device, ast.Constant(retry.count)], pause), call.method, ast.Load())

    # ------------------------------------------------------------------------------------------------ arguments
    def _arguments(self, user: int) -> tuple[list[ast.expr], list[ast.keyword]]:
        """Return positional arguments, and keyword arguments if required or after a default value."""
        action, (_, type_name, method, declared) = self.flow.actions[user], self._calls[user]
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
        if source in self.branches and self.branches[source] == self.branches.get(user):
            raise InvalidProject(
                "action {name!r} uses a result of {producer_name!r}, which runs at the same time",
                name=self.flow.actions[user].name,
                producer_name=self.flow.actions[source].name,
            )
        if source == user or not self.nodes.has_results(self.natural, source, node):
            raise self.too_early(user, source)
        return expressions.name(self.result(user, source, output, meta.type))

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

    def _parameter(self, parameter: ActionParameter, meta: ParameterMeta) -> ast.expr:
        """Return the variable of a parameter of the function that contains the action."""
        if not self.scope.function:
            raise InvalidData("parameter {name}: only actions of a function have its parameters", name=parameter.name)
        name = text_of(parameter)
        variable, kind = self.scope.parameters.get(name, ("", ""))
        if kind != meta.type:
            raise InvalidData(
                "parameter {name} must be {type}; {source} is not such a parameter of the function {function}",
                name=parameter.name,
                type=meta.type,
                source=name,
                function=self.scope.function,
            )
        return expressions.name(variable)

    def _literal(self, user: int, parameter: ActionParameter, meta: ParameterMeta) -> ast.expr:
        object_id, type_name, method, _ = self._calls[user]
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


def _targets(names: Sequence[str]) -> ast.expr:
    """Return several names to which results are assigned."""
    return ast.Tuple([expressions.target(name) for name in names], ast.Store())
