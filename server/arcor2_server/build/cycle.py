"""Converts the logic of a project to the statements of the script's loop."""

import ast
from typing import Final

from arcor2_hw.exceptions import ERROR_KINDS
from arcor2_server.build import expressions
from arcor2_server.build.calls import Calls
from arcor2_server.build.conditions import Conditions
from arcor2_server.build.frame import ERROR, NEXT_ACTION
from arcor2_server.documents.comparisons import Comparisons
from arcor2_server.documents.logic_graph import END_NODE, Condition, Test

CAUGHT: Final = expressions.dotted("res", ("caught",))
"""The method that returns the error for an error exit."""

Block = list[ast.stmt]
Stack = list[tuple[int, Block]]


class Cycle:
    """One cycle of the logic, which the script repeats, or the body of a function."""

    def __init__(self, calls: Calls) -> None:
        self.calls = calls
        self._conditions = Conditions(calls)

    def _name(self, node: int) -> str:
        """Return the name of a node in the variable with the next action."""
        return self.calls.flow.actions[self.calls.nodes.actions[node]].name + self.calls.nodes.names[node]

    def statements(self) -> Block:
        """Return the body of the loop."""
        body: Block = []
        guards: list[ast.If] = []
        stack: Stack = [(0, body)]
        calls, nodes = self.calls, self.calls.nodes
        while stack:
            node, block = stack.pop()
            placed = calls.layout.placed[node]
            if placed.guarded:
                guard = ast.If(expressions.equals(NEXT_ACTION, self._name(node)), [], [])
                guards.append(guard)
                block.append(guard)
                block = guard.body
            action = nodes.actions[node]
            attempt: ast.Try | None = None
            if node == nodes.call[action] and action not in calls.branches:
                call = calls.statement(action)
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
        elif not self.calls.layout.is_join[target]:
            stack.append((target, block))
        elif self.calls.layout.sets_next_action(node, target):
            block.append(expressions.assign(NEXT_ACTION, ast.Constant(self._name(target))))

    def _leaving(self) -> ast.stmt:
        """Return the statement that ends the cycle early."""
        return ast.Continue()

    def _catch(self, node: int, attempt: ast.Try, stack: Stack) -> None:
        """Write the error exits of an action as `except` blocks, and its success as `else` block."""
        placed = self.calls.layout.placed[node]
        action = self.calls.nodes.actions[node]
        follow = placed.follow if placed.last == END_NODE else placed.last
        for target, leaving in zip(self.calls.nodes.exits[action], self.calls.flow.exits[action], strict=True):
            kinds: list[ast.expr] = [
                expressions.name(self.calls.frame.imported(ERROR_KINDS[kind].__module__, ERROR_KINDS[kind].__name__))
                for kind in leaving.kinds
            ]
            caught = ast.Call(CAUGHT, [expressions.name(ERROR)], [])
            variable = self.calls.errors[action]
            inside: Block = [expressions.assign(variable, caught) if variable else ast.Expr(caught)]
            kind = kinds[0] if len(kinds) == 1 else ast.Tuple(kinds, ast.Load())
            attempt.handlers.append(ast.ExceptHandler(kind, ERROR, inside))
            if target != placed.last:
                self._continue_at(node, target, inside, stack, follow)
        if self.calls.nodes.success[action] != placed.last:
            self._continue_at(node, self.calls.nodes.success[action], attempt.orelse, stack, follow)

    def _branch(self, node: int, block: Block, stack: Stack) -> None:
        """Write the edges of an action as branches of an `if` statement."""
        placed = self.calls.layout.placed[node]
        edges = self.calls.nodes.edges[node]
        targets = {edge.target for edge in edges}
        if len(targets) == 1:
            self._continue_at(node, targets.pop(), block, stack, placed.follow)
            return
        follow = placed.follow if placed.last == END_NODE else placed.last
        if any(isinstance(edge.condition, Comparisons) for edge in edges):
            self._conditions.check_complete(node, edges)
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
            test = (
                self._conditions.test(node, condition) if simple else self._conditions.test(node, first, negated=True)
            )
            block.append(ast.If(test, inside, []))
            return
        above: ast.If | None = None
        for number, (condition, inside, filled) in enumerate(branches):
            if not filled:
                inside.append(ast.Pass())
            if above is not None and number == len(edges) - 1:
                above.orelse = inside
                break
            step = ast.If(self._conditions.test(node, condition), inside, [])
            if above is None:
                block.append(step)
            else:
                above.orelse = [step]
            above = step
