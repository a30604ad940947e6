"""Reads the calls of actions in a script."""

import ast
from dataclasses import dataclass, field

from arcor2_hw.data.base import UNSET, Unset
from arcor2_hw.data.object_type import Again, ObjectAction, ParameterMeta, find_action
from arcor2_hw.data.project import CALL, ERROR_FLOW, ERROR_PARTS, MAX_RETRIES, MAX_RETRY_PAUSE, FlowTypes, Retry
from arcor2_server.build.frame import ActionCall, Frame
from arcor2_server.build.reading.errors import NotUnderstood, excerpt
from arcor2_server.build.reading.scope import Call, Scope, Use


@dataclass(frozen=True, slots=True)
class ScriptCalls:
    """State shared by the loop and the functions of a script.

    Args:
        functions: ids of the functions that are already read, by name.
        lines: lines of the calls, by name of the action.
    """

    functions: dict[str, str] = field(default_factory=dict)
    lines: dict[str, int] = field(default_factory=dict)


class CallReader:
    """Reads the calls of a loop or function into its scope."""

    def __init__(self, frame: Frame, scope: Scope, shared: ScriptCalls) -> None:
        self._frame, self._scope, self._shared = frame, scope, shared

    @staticmethod
    def _targets(target: ast.expr) -> list[str]:
        match target:
            case ast.Name(name):
                return [name]
            case ast.Tuple(parts) if parts and all(isinstance(part, ast.Name) for part in parts):
                return [part.id for part in parts if isinstance(part, ast.Name)]
        raise NotUnderstood(
            target.lineno, "results must be assigned to variables, not to {target}", target=excerpt(target)
        )

    def read(self, node: ast.stmt) -> int:
        """Read a statement that calls an action. Return the number of the call."""
        match node:
            case ast.Expr(ast.Call() as call):
                return self.read_call(node, call, [])
            case ast.Assign([target], ast.Call() as call) | ast.AnnAssign(target, _, ast.Call() as call):
                return self.read_call(node, call, self._targets(target))
        raise NotUnderstood(node.lineno, "{node} is not a call of an action", node=excerpt(node))

    def add_parallel(self, call: ast.Call, what: ActionCall) -> int:
        """Add an action that runs calls concurrently. Return its number."""
        number = len(self._scope.calls)
        name = self._name(call)
        self._scope.calls.append(Call(call.lineno, name, what.object_id, what.type_name, what.meta, {}, []))
        return number

    def read_call(self, node: ast.stmt, call: ast.Call, outputs: list[str]) -> int:
        """Read the call of an action or function in a statement. Return its number."""
        retry: Retry | Unset = UNSET
        match call.func:
            case ast.Attribute(ast.Name(variable), method) if variable in self._scope.script.objects:
                object_id = self._scope.script.objects[variable]
                type_name = self._frame.index.scene_object(object_id).type
            case ast.Attribute(
                ast.Call(ast.Attribute(ast.Name(resources), "retry"), [ast.Name(variable), *_]) as repeated, method
            ) if resources == self._scope.script.resources and variable in self._scope.script.objects:
                object_id = self._scope.script.objects[variable]
                type_name = self._frame.index.scene_object(object_id).type
                retry = self._retry(repeated)
            case ast.Name(variable) if variable in self._shared.functions:
                object_id = type_name = self._shared.functions[variable]
                method = CALL
            case ast.Name(variable) if any(variable == function.name for function in self._scope.script.functions):
                raise NotUnderstood(call.lineno, "the function {name} must be defined above its calls", name=variable)
            case _:
                raise NotUnderstood(
                    call.lineno, "{func} is not an action of an object in the scene", func=excerpt(call.func)
                )
        facts = self._scope.values.types_of(type_name)
        declared = find_action(facts.actions.values(), method)
        if declared is None:
            raise NotUnderstood(call.lineno, "{type} has no action {method}", type=facts.shown_name, method=method)
        if declared.disabled:
            raise NotUnderstood(
                call.lineno,
                "{method} of {type} cannot be used: {problem}",
                method=method,
                type=facts.shown_name,
                problem=declared.why_disabled,
            )
        name = self._name(call)
        if outputs and len(outputs) != len(declared.returns):
            raise NotUnderstood(
                node.lineno,
                "{method} returns {count} results, not {other_count}",
                method=method,
                count=len(declared.returns),
                other_count=len(outputs),
            )
        arguments = self._scope.values.arguments(call, declared, type_name)
        number = len(self._scope.calls)
        links = self._links(number, arguments, declared)
        passed = self._passed(arguments, declared)
        self._scope.calls.append(
            Call(call.lineno, name, object_id, type_name, declared, arguments, outputs, links, passed, retry=retry)
        )
        if retry and declared.meta.again != Again.SAFE:
            raise NotUnderstood(
                call.lineno, "{method} cannot be retried, because repeating it may do harm", method=method
            )
        for place, output in enumerate(outputs):
            if output in self._scope.values.parameters and self._scope.stores:
                self._store(node, output, declared.returns[place])
                continue
            self._scope.claim(output, node.lineno)
            self._scope.results[output] = (number, place)
        return number

    @staticmethod
    def _retry(call: ast.Call) -> Retry:
        """Read `res.retry(device, count, pause=seconds)`."""
        pause: object = 0.0
        match call.keywords:
            case []:
                pass
            case [ast.keyword("pause", ast.Constant(int() | float() as pause))] if not isinstance(pause, bool):
                pass
            case _:
                pause = None
        match call.args:
            case [_, ast.Constant(int() as count)] if isinstance(pause, int | float) and not isinstance(count, bool):
                if 1 <= count <= MAX_RETRIES and 0.0 <= pause <= MAX_RETRY_PAUSE:
                    return Retry(count, float(pause))
        raise NotUnderstood(
            call.lineno,
            "a retry has a count from 1 to {count} and a pause of 0 to {pause} s, but this is {call}",
            count=MAX_RETRIES,
            pause=f"{MAX_RETRY_PAUSE:g}",
            call=excerpt(call),
        )

    def _store(self, node: ast.stmt, variable: str, returned: str) -> None:
        """Store that an action changes a variable."""
        _, kind = self._scope.values.parameters[variable]
        if kind != returned:
            raise NotUnderstood(
                node.lineno,
                "the variable {name} is {type}, the result is {return_value}",
                name=variable,
                type=kind,
                return_value=returned,
            )
        self._scope.stored.add(variable)

    def _name(self, call: ast.Call) -> str:
        for keyword in call.keywords:
            if keyword.arg == "an":
                match keyword.value:
                    case ast.Constant(str(name)) if name:
                        break
                raise NotUnderstood(
                    call.lineno, "the name of an action must be a string, not {value}", value=excerpt(keyword.value)
                )
        else:
            raise NotUnderstood(call.lineno, '{call} has no name: add an="..."', call=excerpt(call))
        lines = self._shared.lines
        if name in lines:
            raise NotUnderstood(call.lineno, "line {row} already has an action {name!r}", name=name, row=lines[name])
        lines[name] = call.lineno
        return name

    def _passed(self, arguments: dict[str, ast.expr], declared: ObjectAction) -> dict[str, str]:
        """Return the parameters of the function that the arguments of a call pass on, by parameter."""
        passed: dict[str, str] = {}
        for meta in declared.parameters:
            node = arguments.get(meta.name)
            if not isinstance(node, ast.Name) or (parameter := self._scope.parameter(node.id)) is None:
                continue
            if parameter.type != meta.type:
                raise NotUnderstood(
                    node.lineno,
                    "{name} is {type}, but {id} is {other_type}",
                    name=meta.name,
                    type=meta.type,
                    id=node.id,
                    other_type=parameter.type,
                )
            passed[meta.name] = parameter.name
        return passed

    def _links(
        self, number: int, arguments: dict[str, ast.expr], declared: ObjectAction
    ) -> dict[str, tuple[int, str, int]]:
        links: dict[str, tuple[int, str, int]] = {}
        for meta in declared.parameters:
            node = arguments.get(meta.name)
            match node:
                case ast.Attribute(ast.Name(variable), part) if variable in self._scope.errors:
                    links[meta.name] = self._part_of_error(number, node, variable, part, meta)
                    continue
            if not isinstance(node, ast.Name) or node.id not in self._scope.results:
                continue
            source, output = self._scope.results[node.id]
            links[meta.name] = source, FlowTypes.DEFAULT, output
            kind = self._scope.calls[source].declared.returns[output]
            if kind != meta.type:
                raise NotUnderstood(
                    node.lineno,
                    "{name} is {type}, but {id} is {other_type}",
                    name=meta.name,
                    type=meta.type,
                    id=node.id,
                    other_type=kind,
                )
            self._scope.uses.append(Use(number, source, node.lineno, node.id))
        return links

    def _part_of_error(
        self, number: int, node: ast.Attribute, variable: str, part: str, meta: ParameterMeta
    ) -> tuple[int, str, int]:
        if part not in ERROR_PARTS:
            known = ", ".join(ERROR_PARTS)
            raise NotUnderstood(
                node.lineno, "{name} has no {part}; it has {known}", name=variable, part=part, known=known
            )
        if meta.type != "string":
            raise NotUnderstood(
                node.lineno, "{name} is {type}, but {part} is string", name=meta.name, type=meta.type, part=part
            )
        source = self._scope.errors[variable]
        self._scope.uses.append(Use(number, source, node.lineno, variable, of_error=True))
        return source, ERROR_FLOW, ERROR_PARTS.index(part)
