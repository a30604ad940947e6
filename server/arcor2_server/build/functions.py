"""Converts the functions of a project to functions of the script, nested in `main`."""

import ast
from collections.abc import Collection, Iterable, Iterator
from typing import Final

from arcor2_hw.data.project import CALL, ActionParameterType, Project, ProjectFunction, parse_link
from arcor2_hw.exceptions import InvalidProject
from arcor2_server.build import expressions
from arcor2_server.build.calls import Calls, Scope
from arcor2_server.build.cycle import Block, Cycle
from arcor2_server.build.frame import Frame
from arcor2_server.build.naming import Names
from arcor2_server.build.parallel_work import check_parallel_work
from arcor2_server.documents import logic_graph
from arcor2_server.documents.item_indexes import reference
from arcor2_server.documents.logic_graph import END_NODE, Flow

NAME: Final = "an"
"""The parameter of functions, as of actions, with the name of the action that calls."""
HINTS: Final = {
    "boolean": ("builtins", "bool"),
    "integer": ("builtins", "int"),
    "double": ("builtins", "float"),
    "string": ("builtins", "str"),
    "pose": ("arcor2_hw.data.geometry", "Pose"),
    "position": ("arcor2_hw.data.geometry", "Position"),
    "joints": ("arcor2_hw.data.project", "ProjectRobotJoints"),
    "string_enum": ("builtins", "str"),
    "integer_enum": ("builtins", "int"),
}
"""Module and name of the type hint of each type. Enumerations use their own class."""
_DECORATOR: Final = expressions.dotted("res", ("function",))


class FunctionCycle(Cycle):
    """The body of a function."""

    def __init__(self, frame: Frame, flow: Flow, function: ProjectFunction) -> None:
        self.function = function
        super().__init__(Calls(frame, flow, _scope(frame, flow, function)))
        self._returned = [self._result_variable(result.link, result.type) for result in function.returns]

    def _result_variable(self, link: str, kind: str) -> str:
        """Return the variable of a result of the function. Raise InvalidProject unless it is set on all paths."""
        name, calls = self.function.name, self.calls
        try:
            action_id, _, output = parse_link(link)
        except ValueError as error:
            raise InvalidProject("function {name!r}: {reason}", name=name, reason=error) from None
        source = calls.numbers.get(action_id)
        if source is None or output >= len(calls.results[source]):
            raise InvalidProject("function {name!r}: its result {link} does not exist", name=name, link=link)
        action, returns = calls.flow.actions[source], calls.returns(source)
        if returns[output] != kind:
            raise InvalidProject(
                "function {name!r}: its result {link} is {type}, not {other}",
                name=name,
                link=action.outputs()[output],
                type=returns[output],
                other=kind,
            )
        for node, edges in enumerate(calls.nodes.edges):
            ends = any(edge.target == END_NODE for edge in edges)
            if ends and not calls.nodes.has_results(calls.natural, source, node):
                raise InvalidProject(
                    "function {name!r} returns a result of {action!r}, which does not run on all paths to its end",
                    name=name,
                    action=action.name,
                )
        return calls.results[source][output]

    def _leaving(self) -> ast.stmt:
        returned: list[ast.expr] = [expressions.name(variable) for variable in self._returned]
        match returned:
            case []:
                return ast.Return()
            case [name]:
                return ast.Return(name)
            case names:
                return ast.Return(ast.Tuple(names, ast.Load()))

    def definition(self) -> ast.FunctionDef:
        """Return the function."""
        body: Block = self.statements()
        if self._returned:
            body.append(self._leaving())
        parameters = [
            ast.arg(variable, self._hint(name, kind)) for name, (variable, kind) in self.calls.scope.parameters.items()
        ]
        arguments = ast.arguments([], parameters, None, [ast.arg(NAME, expressions.name("str"))], [None], None, [])
        name = self.calls.frame.functions[self.function.id]
        return ast.FunctionDef(name, arguments, body, [_DECORATOR], self._returns(), lineno=0)

    def _hint(self, name: str, kind: str) -> ast.expr:
        """Return the type hint of a parameter."""
        enumeration = self.calls.frame.facts_of(self.function).enumerations.get((CALL, name))
        if enumeration is not None:
            first, *inner = enumeration.name.split(".")
            return expressions.dotted(self.calls.frame.imported(enumeration.module, first), tuple(inner))
        if kind not in HINTS:
            raise InvalidProject(
                "function {name!r}: {type} cannot be the type of the parameter {parameter}",
                name=self.function.name,
                type=kind,
                parameter=name,
            )
        return self._class(kind)

    def _class(self, kind: str) -> ast.expr:
        module, name = HINTS.get(kind, ("builtins", "object"))
        return expressions.name(name if module == "builtins" else self.calls.frame.imported(module, name))

    def _returns(self) -> ast.expr:
        match [self._class(result.type) for result in self.function.returns]:
            case []:
                return ast.Constant(None)
            case [hint]:
                return hint
            case hints:
                return ast.Subscript(expressions.name("tuple"), ast.Tuple(hints, ast.Load()), ast.Load())


def _scope(frame: Frame, flow: Flow, function: ProjectFunction) -> Scope:
    """Choose the variables of a function's parameters, which precede those of results."""
    names = Names(outer=frame.names)
    names.claim(NAME)
    # A parameter may have the name of a project parameter, whose value the calls often pass.
    used = {
        reference(parameter.type, parameter.value)
        for action in flow.actions
        for parameter in action.parameters
        if parameter.type == ActionParameterType.PROJECT_PARAMETER
    }
    used |= {target for item in function.logic for target in item.used()}
    hidden = {variable for key, variable in frame.parameters.items() if key not in used}
    parameters: dict[str, tuple[str, str]] = {}
    for each in function.parameters:
        claim = names.shadow if each.name in hidden else names.claim
        parameters[each.name] = claim(each.name), each.type
    return Scope(names, function.name, parameters)


def called_functions(project: Project, program: Flow) -> list[tuple[ProjectFunction, Flow]]:
    """Return the functions that a program calls, also through functions, each before its callers.

    Raises:
        InvalidProject: a function is invalid, or calls itself.
    """
    known = {function.id: function for function in project.functions}
    parameters = {parameter.id for parameter in project.parameters}

    def callees(flow: Flow) -> Iterator[ProjectFunction]:
        for action in flow.actions:
            key, _, method = action.type.partition("/")
            if method == CALL and key in known:
                yield known[key]

    found: dict[str, tuple[ProjectFunction, Flow]] = {}
    open_: dict[str, tuple[ProjectFunction, Flow]] = {}
    stack = [callees(program)]
    while stack:
        function = next(stack[-1], None)
        if function is None:
            stack.pop()
            if open_:
                key, value = open_.popitem()
                found[key] = value
        elif function.id in open_:
            raise InvalidProject("function {name!r} calls itself", name=function.name)
        elif function.id not in found:
            open_[function.id] = (function, flow_of(function, parameters))
            stack.append(callees(open_[function.id][1]))
    _check_names([program, *(flow for _, flow in found.values())])
    return list(found.values())


def flow_of(function: ProjectFunction, parameters: Collection[str]) -> Flow:
    """Return the logic of a function, whose conditions may compare project parameters.

    Raises:
        InvalidProject: the logic is invalid.
    """
    try:
        return logic_graph.read(function, parameters)
    except InvalidProject as error:
        raise InvalidProject("function {name!r}: {reason}", name=function.name, reason=error) from error


def _check_names(flows: Iterable[Flow]) -> None:
    names: set[str] = set()
    for action in (action for flow in flows for action in flow.actions):
        if action.name in names:
            raise InvalidProject("two actions have the name {name!r}; rename one of them", name=action.name)
        names.add(action.name)


def cycles_of(frame: Frame, project: Project) -> tuple[Cycle, list[FunctionCycle]]:
    """Return the cycle of a program, and the functions that it calls, each before its callers.

    All names of variables are chosen here, so that they do not depend on what the statements import.

    Raises:
        InvalidProject: an action or the logic is invalid.
        NotFound: an object type is unknown.
    """
    program = logic_graph.read(project, frame.parameters)
    functions = called_functions(project, program)
    check_parallel_work(program, functions, frame.index)
    cycle = Cycle(Calls(frame, program, Scope(Names(outer=frame.names))))
    return cycle, [FunctionCycle(frame, flow, function) for function, flow in functions]
