"""Reads parallel work: `found, _ = res.parallel(lambda: find(an="find"), lambda: press(an="press"), an="both")`."""

import ast

from arcor2_hw.data.project import CALL
from arcor2_server.build.calls import NO_RESULT
from arcor2_server.build.frame import PARALLEL_CALL
from arcor2_server.build.reading.calls import CallReader
from arcor2_server.build.reading.errors import NotUnderstood, excerpt
from arcor2_server.build.reading.scope import Scope
from arcor2_server.documents.logic_graph import branches_problem


def parallel_call(node: ast.stmt, resources: str) -> ast.Call | None:
    """Return the call of a statement that runs several calls concurrently, None for another statement.

    Args:
        node: the statement.
        resources: the variable of the resources.
    """
    match node:
        case ast.Expr(ast.Call() as call) | ast.Assign(_, ast.Call() as call) | ast.AnnAssign(_, _, ast.Call() as call):
            match call.func:
                case ast.Attribute(ast.Name(name), "parallel") if name == resources:
                    return call
    return None


def read_parallel(calls: CallReader, scope: Scope, node: ast.stmt, call: ast.Call) -> list[int]:
    """Read parallel work. Return the number of its action, then those of its branches.

    Args:
        calls: reads the calls.
        scope: contains the calls so far.
        node: the statement.
        call: its call.
    """
    for keyword in call.keywords:
        if keyword.arg != "an":
            raise NotUnderstood(
                call.lineno, "{func} has no parameter {name}", func=excerpt(call.func), name=str(keyword.arg)
            )
    if (problem := branches_problem([str(number) for number in range(len(call.args))])) is not None:
        raise NotUnderstood(call.lineno, "{problem}", problem=problem)
    numbers = [calls.add_parallel(call, PARALLEL_CALL)]
    for argument, names in zip(call.args, _outputs(node, len(call.args)), strict=True):
        match argument:
            case ast.Lambda(ast.arguments([], [], None, [], [], None, []), ast.Call() as inner):
                number = calls.read_call(node, inner, names)
            case _:
                raise NotUnderstood(
                    argument.lineno,
                    'a branch is `lambda: function(..., an="...")`, but this is {argument}',
                    argument=excerpt(argument),
                )
        branch = scope.calls[number]
        if branch.declared.name != CALL:
            raise NotUnderstood(
                argument.lineno, "a branch calls a function, but this is {argument}", argument=excerpt(argument)
            )
        for source, _, _ in branch.results.values():
            if source in numbers:
                raise NotUnderstood(
                    argument.lineno,
                    "{name!r} uses a result of {other!r}, which runs at the same time",
                    name=branch.name,
                    other=scope.calls[source].name,
                )
        numbers.append(number)
    return numbers


def _outputs(node: ast.stmt, count: int) -> list[list[str]]:
    """Return the variables for the results of each branch."""
    match node:
        case ast.Expr():
            return [[] for _ in range(count)]
        case ast.Assign([ast.Tuple(parts)]) if len(parts) == count:
            return [_names(part) for part in parts]
    raise NotUnderstood(
        node.lineno,
        "the results of parallel work are assigned to {count} variables, one for each branch, or `_`",
        count=count,
    )


def _names(part: ast.expr) -> list[str]:
    match part:
        case ast.Name(name):
            return [] if name == NO_RESULT else [name]
        case ast.Tuple(parts) if parts and all(isinstance(one, ast.Name) for one in parts):
            return [one.id for one in parts if isinstance(one, ast.Name)]
    raise NotUnderstood(part.lineno, "results must be assigned to variables, not to {target}", target=excerpt(part))
