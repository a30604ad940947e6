"""Reads the functions of a script."""

import ast

from arcor2_hw.actions.parameter_types import by_annotation
from arcor2_hw.analysis import Enumeration
from arcor2_hw.data.object_type import ObjectAction, ParameterMeta
from arcor2_hw.data.project import CALL, ActionParameter
from arcor2_server.build.frame import Frame, TypeFacts
from arcor2_server.build.functions import HINTS
from arcor2_server.build.reading.calls import ScriptCalls
from arcor2_server.build.reading.errors import NotUnderstood, excerpt
from arcor2_server.build.reading.module import Script
from arcor2_server.build.reading.paths import LoopReader, _OpenPath
from arcor2_server.build.reading.scope import Scope, Use
from arcor2_server.build.reading.values import Values
from arcor2_server.documents.checks.functions import PASSED


class FunctionReader(LoopReader):
    """The calls of a function, and the paths between them.

    Args:
        frame: the names in the generated script of the old project.
        script: the script.
        values: reads arguments.
        shared: the calls of the script, and the functions above this one.
        node: the function.
        old: its parameters in the old project, by variable.
    """

    def __init__(
        self,
        frame: Frame,
        script: Script,
        values: Values,
        shared: ScriptCalls,
        node: ast.FunctionDef,
        old: dict[str, ActionParameter],
    ) -> None:
        self.node = node
        self.parameters: list[ActionParameter] = []
        self.enumerations: dict[tuple[str, str], Enumeration] = {}
        self.returned: list[tuple[int, int]] | None = None
        """Number of the call and of its result for each result of the function; None if no line states it."""
        variables: dict[str, ActionParameter] = {}
        for each in node.args.args:
            if each.arg in script.lines and each.arg not in script.constants:
                row = script.lines[each.arg]
                raise NotUnderstood(each.lineno, "{name} is already defined in line {row}", name=each.arg, row=row)
            variables[each.arg] = self._parameter(each, old.get(each.arg), values)
        self.parameters = list(variables.values())
        body = node.body
        match body:
            case [ast.Expr(ast.Constant(str())), *rest] if rest:
                body = rest
        super().__init__(frame, Scope(script, values, variables), shared, body)

    def _parameter(self, given: ast.arg, old: ActionParameter | None, values: Values) -> ActionParameter:
        name = given.arg if old is None else old.name
        value = "" if old is None else old.value
        hint = given.annotation
        if hint is None:
            raise NotUnderstood(given.lineno, "the parameter {name} needs a type hint", name=given.arg)
        enumeration = values.enumeration_of(hint)
        if enumeration is not None:
            self.enumerations[CALL, name] = enumeration
            texts = all(isinstance(member, str) for member in enumeration.members)
            return ActionParameter(name, "string_enum" if texts else "integer_enum", value)
        kind = by_annotation(excerpt(hint))
        if kind is None or kind.name not in PASSED:
            raise NotUnderstood(
                given.lineno, "{hint} cannot be the type of the parameter {name}", hint=excerpt(hint), name=given.arg
            )
        if old is not None and HINTS.get(old.type) == HINTS.get(kind.name):
            return old  # an enumeration that no action of the function uses has the type hint of its values
        return ActionParameter(name, kind.name, value)

    def facts(self) -> TypeFacts:
        """Return the metadata of the calls of the function."""
        returns = [self.scope.calls[source].declared.returns[output] for source, output in self.returned or ()]
        parameters = [ParameterMeta(each.name, each.type) for each in self.parameters]
        meta = ObjectAction(CALL, parameters=parameters, returns=returns)
        return TypeFacts("", self.node.name, {CALL: meta}, self.enumerations)

    # ------------------------------------------------------------------------------------------------ statements
    def _refusal(self, node: ast.stmt) -> NotUnderstood:
        return NotUnderstood(
            node.lineno,
            "a function contains only calls of actions, conditions, `try` and `return`, but this is {node}",
            node=excerpt(node),
        )

    def _leave(self, node: ast.Continue | ast.Return, open_paths: list[_OpenPath]) -> None:
        if isinstance(node, ast.Continue):
            raise self._refusal(node)
        match node.value:
            case None | ast.Constant(None):
                names: list[ast.expr] = []
            case ast.Tuple(parts):
                names = parts
            case value:
                names = [value]
        returned: list[tuple[int, int]] = []
        for name in names:
            if not isinstance(name, ast.Name) or name.id not in self.scope.results:
                raise NotUnderstood(node.lineno, "{name} is not a result of an action above", name=excerpt(name))
            source, output = self.scope.results[name.id]
            returned.append((source, output))
            for path in open_paths:
                after_error = bool(path.kinds)
                if path.source >= 0:
                    self.scope.uses.append(Use(path.source, source, node.lineno, name.id, in_condition=not after_error))
        if self.returned is not None and self.returned != returned:
            raise NotUnderstood(node.lineno, "every `return` of a function must return the same results")
        self.returned = returned
        super()._end(open_paths, node.lineno)

    def _end(self, open_paths: list[_OpenPath], line: int) -> None:
        if open_paths and self.returned:
            raise NotUnderstood(line, "the function {name} must end with `return`", name=self.node.name)
        if open_paths:
            self.returned = []
        super()._end(open_paths, line)
