"""Converts the conditions of a program or function to expressions, and checks that they decide every case."""

import ast
import json
from collections.abc import Sequence

from arcor2_hw.exceptions import InvalidProject
from arcor2_hw.messages import Message
from arcor2_server.build import expressions
from arcor2_server.build.calls import Calls
from arcor2_server.documents.comparisons import Comparisons, Reference, cases_of, comparison_problem, pair_problem
from arcor2_server.documents.logic_graph import BRANCHABLE, Edge, Test, as_comparisons, never_taken


class Conditions:
    """The conditions at the nodes of a flow."""

    def __init__(self, calls: Calls) -> None:
        self._calls = calls

    def test(self, node: int, condition: Test | None, *, negated: bool = False) -> ast.expr:
        """Return the expression that is true if a condition of a node holds, or if it does not hold.

        Raises:
            InvalidProject: The condition is invalid.
        """
        assert condition is not None, "only the last of several edges has no condition"
        if isinstance(condition, Comparisons):
            variables = [[self._compared(node, what)[0] for what in one.compared()] for one in condition.comparisons]
            return expressions.compares(variables, condition, negated=negated)
        source, number = condition.action, self._calls.nodes.actions[node]
        if not self._calls.nodes.has_results(self._calls.natural, source, node):
            raise self._calls.too_early(number, source)
        user, returns = self._calls.flow.actions[number].name, self._calls.returns(source)
        kind = returns[condition.output] if condition.output < len(returns) else ""
        if kind not in BRANCHABLE:
            name = self._calls.flow.actions[source].outputs()[condition.output]
            raise InvalidProject(
                "action {user!r}: {name} is {type}, which a condition cannot use",
                user=user,
                name=name,
                type=kind or Message.of("nothing"),
            )
        variable = self._calls.result(number, source, condition.output, kind)
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

    def check_complete(self, node: int, edges: Sequence[Edge]) -> None:
        """Raise InvalidProject unless exactly one of several edges applies for any values."""
        user = self._calls.flow.actions[self._calls.nodes.actions[node]]
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
        actions = [self._calls.flow.actions[one] for one in self._calls.nodes.actions]
        if cases.unused:
            raise never_taken(
                user, edges[cases.unused[0]], [self._calls.flow.actions[one] for one in self._calls.nodes.actions]
            )
        otherwise = edges[-1].condition is None
        if otherwise and cases.known and cases.gap is None:
            raise never_taken(user, edges[-1], actions)
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

    def _compared(self, node: int, reference: Reference) -> tuple[str, str]:
        """Return the variable and the type of a compared value."""
        if reference.parameter:
            return self._calls.frame.parameters[reference.parameter], self._calls.frame.index.parameter(
                reference.parameter
            ).type
        number = self._calls.nodes.actions[node]
        if not self._calls.nodes.has_results(self._calls.natural, reference.action, node):
            raise self._calls.too_early(number, reference.action)
        returns = self._calls.returns(reference.action)
        kind = returns[reference.output] if reference.output < len(returns) else ""
        return self._calls.result(number, reference.action, reference.output, kind), kind
