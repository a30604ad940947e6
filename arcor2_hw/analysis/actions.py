"""Actions of object types (protocol, sections 9.3 and 9.4)."""

import ast
import functools
from collections.abc import Mapping
from typing import Any, Final

from msgspec.structs import replace

from arcor2_hw.actions.json_values import encode
from arcor2_hw.actions.parameter_types import Extra, ParameterType
from arcor2_hw.analysis.constants import EnumMember, constant, enum_members
from arcor2_hw.analysis.hierarchy import Hierarchy
from arcor2_hw.analysis.hints import parameter_type_of, results, without_none
from arcor2_hw.analysis.module import ClassInfo, FunctionNode, Value
from arcor2_hw.analysis.presentation import of_action, of_type
from arcor2_hw.analysis.source import AnalysisStopped, sendable
from arcor2_hw.analysis.symbols import External, framework_name
from arcor2_hw.analysis.units import unit_in
from arcor2_hw.data.base import UNSET, Unset
from arcor2_hw.data.object_type import ActionMetadata, Again, ObjectAction, ParameterMeta
from arcor2_hw.exceptions import InvalidData

_LITERALS: Final = {"boolean": bool, "integer": int, "double": float, "string": str}
NUMBERS: Final = ("integer", "double")
_METADATA: Final = ("composite", "hidden", "verdict", "again")
_NOT_ORDINARY: Final = ("builtins.staticmethod", "builtins.classmethod", "builtins.property")


class ActionReader:
    """Reads the actions of classes."""

    def __init__(self, hierarchy: Hierarchy) -> None:
        self._hierarchy = hierarchy
        self._resolver = hierarchy.resolver
        self._known_marks: dict[ClassInfo, list[tuple[FunctionNode, ActionMetadata | AnalysisStopped]]] = {}

    # -------------------------------------------------------------------------------- detection of actions
    def mark(self, owner: ClassInfo, name: str, node: FunctionNode) -> ActionMetadata | None:
        """Return the metadata of an action, which the decorator or `method.__action__ = ActionMetadata()` marks."""
        expression = owner.marks.get((name, "__action__"))
        if expression is not None:
            if not isinstance(expression, ast.Call):
                raise owner.problem("{name}.__action__ must be ActionMetadata(...)", expression, name=name)
            return self._metadata(owner, expression)
        for decorator in node.decorator_list:
            plain = decorator.func if isinstance(decorator, ast.Call) else decorator
            symbol = self._resolver.expression(plain, owner.module, owner)
            if framework_name(symbol) == "action":
                return self._metadata(owner, decorator) if isinstance(decorator, ast.Call) else ActionMetadata()
        return None

    def _metadata(self, owner: ClassInfo, call: ast.Call) -> ActionMetadata:
        given: dict[str, Any] = dict(zip(("composite", "hidden"), call.args, strict=False))
        given |= {keyword.arg: keyword.value for keyword in call.keywords if keyword.arg in _METADATA}
        values = {name: constant(value, owner.module, owner, self._resolver) for name, value in given.items()}
        again = values.pop("again", Again.ASK)
        if again not in list(Again):
            known = ", ".join(Again)
            raise owner.problem("again must be one of {known}, not {value!r}", call, known=known, value=again)
        flags: dict[str, bool] = {name: bool(value) for name, value in values.items()}
        return ActionMetadata(**flags, again=UNSET if again == Again.ASK else Again(again))

    def actions(self, info: ClassInfo, seen_from: ClassInfo) -> dict[str, ObjectAction]:
        """Return the actions that `info` itself defines, by name, with attributes as seen from `seen_from`.

        Hidden actions, abstract methods and optional methods that are not implemented are excluded.
        """
        result: dict[str, ObjectAction] = {}
        shown = of_type(seen_from, self._hierarchy)
        for node, metadata in self._marked(info):
            try:
                if isinstance(metadata, AnalysisStopped):
                    raise metadata
                category, icon = of_action(node, info, shown, self._hierarchy)
            except AnalysisStopped as error:
                result[node.name] = ObjectAction(node.name).disabled_because(error.problem.message)
                continue
            found = self._action(info, node, metadata, seen_from)
            result[node.name] = replace(
                found, category=category, icon=icon, former_names=_former_names(info, node.name) or UNSET
            )
        return result

    def _renamed(self, owner: ClassInfo, node: FunctionNode) -> dict[str, list[str]]:
        """Return the former names of parameters declared by `@action(renamed=...)`, by their present names."""
        found: dict[str, list[str]] = {}
        for decorator in node.decorator_list:
            if not isinstance(decorator, ast.Call):
                continue
            if framework_name(self._resolver.expression(decorator.func, owner.module, owner)) != "action":
                continue
            for keyword in decorator.keywords:
                if keyword.arg == "renamed":
                    renamed = constant(keyword.value, owner.module, owner, self._resolver)
                    arguments = [*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs]
                    names = {argument.arg for argument in arguments}
                    if not isinstance(renamed, dict) or not names.issuperset(renamed.values()) or names & set(renamed):
                        text = "{action}: `renamed` is {{former name: name of a parameter}}"
                        raise owner.problem(text, keyword.value, action=node.name)
                    for former, present in renamed.items():
                        found.setdefault(present, []).append(str(former))
        return found

    def _marked(self, info: ClassInfo) -> list[tuple[FunctionNode, ActionMetadata | AnalysisStopped]]:
        """Return the methods of a class that are visible actions, by name, with their metadata or the error in it."""
        if info in self._known_marks:
            return self._known_marks[info]
        marked: list[tuple[FunctionNode, ActionMetadata | AnalysisStopped]] = []
        for name in sorted(info.members):
            node = info.function(name)
            if node is None:
                continue
            try:
                metadata = self.mark(info, name, node)
            except AnalysisStopped as error:
                marked.append((node, error))
                continue
            if metadata is not None and not metadata.hidden and not self._is_offer(info, node):
                marked.append((node, metadata))
        self._known_marks[info] = marked
        return marked

    def _is_offer(self, info: ClassInfo, node: FunctionNode) -> bool:
        if self._hierarchy.is_hook_only(node, info):
            return True
        return framework_name(info) is not None and self._hierarchy.is_abstract(node, info)

    # -------------------------------------------------------------------------------- one action
    def _action(
        self, info: ClassInfo, node: FunctionNode, metadata: ActionMetadata, seen_from: ClassInfo
    ) -> ObjectAction:
        text = ast.get_docstring(node, clean=False)
        description: str | Unset = sendable(text.strip().partition("\n")[0]) if text and text.strip() else UNSET
        parameters: list[ParameterMeta] = []
        returns: list[str] = []
        try:
            cancelled = self._hierarchy.attribute(seen_from, "CANCEL_MAPPING", {})
            if isinstance(cancelled, dict) and node.name in cancelled:
                metadata = replace(metadata, cancellable=True)
            self._check_form(info, node)
            returns = self._returns(info, node)
            parameters = self._parameters(info, node, seen_from, text)
        except AnalysisStopped as error:
            action = ObjectAction(node.name, description, parameters, metadata, UNSET, returns)
            return action.disabled_because(error.problem.message)
        return ObjectAction(node.name, description, parameters, metadata, UNSET, returns)

    def _check_form(self, info: ClassInfo, node: FunctionNode) -> None:
        if isinstance(node, ast.AsyncFunctionDef):
            raise info.problem("{action}: an action must be synchronous", node, action=node.name)
        if self._hierarchy.decorated(node, info, *_NOT_ORDINARY):
            raise info.problem("{action}: an action must be an ordinary method", node, action=node.name)
        arguments = node.args
        if arguments.vararg or arguments.kwarg:
            raise info.problem("{action}: the parameters of an action need names (no * and **)", node, action=node.name)
        if not (arguments.posonlyargs or arguments.args):
            raise info.problem("{action}: the first parameter of an action must be self", node, action=node.name)
        every = [*arguments.posonlyargs, *arguments.args, *arguments.kwonlyargs][1:]
        if not every or every[-1].arg != "an":
            text = "{action}: the last parameter of an action must be `an: str | None = None`"
            raise info.problem(text, node, action=node.name)
        hint = every[-1].annotation
        if hint is None:
            raise info.problem("{action}: `an` must be annotated `str | None`", node, action=node.name)
        inner, optional = without_none(hint, info.module, self._resolver)
        if not optional or self._resolver.expression(inner, info.module, info) != External("builtins.str"):
            raise info.problem("{action}: `an` must be annotated `str | None`", hint, action=node.name)
        if node.returns is None:
            raise info.problem("{action}: the return annotation is missing", node, action=node.name)

    def _returns(self, info: ClassInfo, node: FunctionNode) -> list[str]:
        if node.returns is None:
            return []
        try:
            return [
                parameter_type_of(hint, info.module, info, self._resolver)[0].name
                for hint in results(node.returns, info.module, self._resolver)
            ]
        except AnalysisStopped as error:
            raise info.problem("{action}: result: {reason}", node.returns, action=node.name, reason=error) from None

    def _parameters(
        self, info: ClassInfo, node: FunctionNode, seen_from: ClassInfo, text: str | None
    ) -> list[ParameterMeta]:
        arguments = node.args
        positional = [*arguments.posonlyargs, *arguments.args]
        defaults: dict[str, ast.expr] = {
            argument.arg: default
            for argument, default in zip(reversed(positional), reversed(arguments.defaults), strict=False)
        }
        defaults |= {
            argument.arg: default
            for argument, default in zip(arguments.kwonlyargs, arguments.kw_defaults, strict=True)
            if default is not None
        }
        descriptions = described_parameters(text)
        dynamic = self._dynamic(seen_from)
        ranges = _ranges(node)
        renamed = self._renamed(info, node)
        result = []
        for argument in [*positional, *arguments.kwonlyargs][1:-1]:
            name = argument.arg
            if argument.annotation is None:
                raise info.problem("{action}: parameter {name} is not annotated", argument, action=node.name, name=name)
            try:
                kind, enumeration = parameter_type_of(argument.annotation, info.module, info, self._resolver)
                extra = self._extra(info, kind, enumeration, ranges.get(name), descriptions.get(name, ""))
                default = self.default(info, kind, enumeration, defaults.get(name))
            except AnalysisStopped as error:
                raise error.within("{action}: parameter {name}: {reason}", action=node.name, name=name) from None
            parents = dynamic.get(name)
            result.append(
                ParameterMeta(
                    name,
                    kind.name,
                    parents is not None,
                    parents or UNSET,
                    descriptions.get(name, UNSET),
                    default,
                    extra,
                    renamed.get(name, UNSET),
                )
            )
        return result

    def _dynamic(self, seen_from: ClassInfo) -> dict[str, set[str]]:
        declared = self._hierarchy.attribute(seen_from, "DYNAMIC_PARAMS", {})
        try:
            return {str(name): {str(parent) for parent in parents} for name, (_, parents) in declared.items()}
        except (AttributeError, TypeError, ValueError):
            raise seen_from.problem(
                "DYNAMIC_PARAMS must be {parameter: (name of a method, set of parameters it needs)}"
            ) from None

    def _extra(
        self,
        info: ClassInfo,
        kind: ParameterType,
        enumeration: ClassInfo | None,
        limits: "_Limits | None",
        description: str,
    ) -> str | Unset:
        try:
            if enumeration is not None:
                members = enum_members(enumeration, self._resolver)
                if not members:
                    raise enumeration.problem("the enumeration {name} has no members", name=enumeration.name)
                return encode(Extra(allowed_values=list(dict.fromkeys(members.values()))))
            if kind.name not in NUMBERS:
                return UNSET
            if limits is None:
                return unit_extra(description)
            if {type(limits.low), type(limits.high)} != {_LITERALS[kind.name]}:
                raise info.problem("the range in `assert` must be of type {type} too", limits.node, type=kind.name)
            return encode(Extra(minimum=limits.low, maximum=limits.high, unit=unit_in(description) or UNSET))
        except InvalidData as error:
            raise info.problem(error.message, enumeration.node if enumeration else None) from None

    def default(
        self, info: ClassInfo, kind: ParameterType, enumeration: ClassInfo | None, expression: ast.expr | None
    ) -> str | Unset:
        """Return a default as JSON. Poses, positions, joints and images have none, because they belong to a project.

        Raises:
            AnalysisStopped: It has another type, or cannot be determined from the source.
        """
        if expression is None or (enumeration is None and kind.name not in _LITERALS):
            return UNSET
        value = constant(expression, info.module, info, self._resolver)
        if enumeration is not None:
            if isinstance(value, EnumMember) and value.owner is enumeration:
                value = value.value
            elif value not in (enum_members(enumeration, self._resolver) or {}).values():
                raise info.problem("the default is not a member of {name}", expression, name=enumeration.name)
        try:
            return kind.encode(value)
        except InvalidData as error:
            raise info.problem("default: {reason}", expression, reason=error) from None


def _former_names(owner: ClassInfo, action: str) -> list[str]:
    """Return further names that a class body gives to an action: `random_integer = random_int`."""
    return [
        name
        for name, member in owner.members.items()
        if isinstance(member, Value) and isinstance(member.expression, ast.Name) and member.expression.id == action
    ]


def unit_extra(description: str) -> str | Unset:
    """Return the extra of a number without a range: its unit, if its description states one."""
    unit = unit_in(description)
    return UNSET if unit is None else encode(Extra(unit=unit))


class _Limits:
    """A range declared by `assert a <= p <= b`."""

    def __init__(self, node: ast.AST, low: Any, high: Any) -> None:
        self.node = node
        self.low = low
        self.high = high


def _ranges(node: FunctionNode) -> dict[str, _Limits]:
    """Return the ranges that a body asserts for its parameters: the first one for each parameter.

    As in the protocol, only plain literals count. A negative bound (an operator and a literal) is not a range.
    """
    result: dict[str, _Limits] = {}
    for statement in node.body:
        match statement:
            case ast.Assert(
                test=ast.Compare(
                    left=ast.Constant(value=low),
                    ops=[ast.LtE(), ast.LtE()],
                    comparators=[ast.Name(id=name), ast.Constant(value=high)],
                )
            ):
                result.setdefault(name, _Limits(statement, low, high))
            case _:
                pass
    return result


@functools.lru_cache(maxsize=1024)
def described_parameters(docstring: str | None) -> Mapping[str, str]:
    """Return the description of each parameter in a docstring, in any of the usual styles."""
    # Imported here, because a server start with a stored analysis does not need it.
    from docstring_parser import DocstringStyle, ParseError, parse as parse_docstring

    if not docstring:
        return {}
    if ":param" in docstring:
        style = DocstringStyle.REST
    elif "Args:" in docstring or "Arguments:" in docstring:
        style = DocstringStyle.GOOGLE
    elif "Parameters\n" in docstring:
        style = DocstringStyle.NUMPYDOC
    else:
        return {}
    try:
        parsed = parse_docstring(docstring, style)
    except ParseError:
        return {}
    return {p.arg_name: sendable(p.description) for p in parsed.params if p.description}
