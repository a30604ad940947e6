"""Reads the arguments of calls: literals, enumeration members, action points and project parameters."""

import ast
from collections.abc import Mapping
from typing import Any, Final

import msgspec

from arcor2_hw.actions.parameter_types import PARAMETER_TYPES
from arcor2_hw.analysis import Enumeration
from arcor2_hw.data.base import Unset
from arcor2_hw.data.object_type import ObjectAction, ParameterMeta
from arcor2_hw.data.parameter import Parameter
from arcor2_hw.data.project import ActionParameter, ActionParameterType
from arcor2_hw.exceptions import InvalidData, message_of
from arcor2_hw.messages import Message
from arcor2_server.build.frame import REFERENCES, Frame, TypeFacts
from arcor2_server.build.reading.errors import NotUnderstood, excerpt
from arcor2_server.build.reading.module import Script
from arcor2_server.documents.comparisons import Value

ENUMERATIONS: Final = ("string_enum", "integer_enum")
PLAIN: Final[dict[type, str]] = {bool: "boolean", int: "integer", float: "double", str: "string"}
"""Parameter types of literals."""


def json_of(value: Any) -> str:
    """Return a value as JSON."""
    return msgspec.json.encode(value).decode()


def plain(node: ast.expr) -> Any:
    """Return the value of a bool, number or string literal. Raise NotUnderstood for anything else."""
    match node:
        case ast.Constant(bool() | int() | float() | str() as value):
            return value
        case ast.UnaryOp(ast.USub(), ast.Constant(int() | float() as value)) if not isinstance(value, bool):
            return -value
    raise NotUnderstood(node.lineno, "{node} is not a bool, number or string literal", node=excerpt(node))


def of_type(value: Any, kind: str) -> Any:
    """Convert a value to a parameter type: an integer may be used as a double."""
    if kind == "double" and type(value) is int:
        return float(value)
    return value


def json_as_before(kind: str, value: Any, old: Parameter | None) -> str:
    """Return a value as JSON. The old text is returned if the value has not changed."""
    if old is not None and old.type == kind:
        try:
            before = msgspec.json.decode(old.value)
        except msgspec.DecodeError:
            before = None
        if type(before) is type(value) and repr(before) == repr(value):
            return old.value
    return json_of(value)


class Values:
    """Reads the arguments of calls.

    Args:
        frame: the names in the generated script of the old project.
        script: the script.
    """

    def __init__(self, frame: Frame, script: Script) -> None:
        self._frame = frame
        self._script = script
        self.parameters: dict[str, tuple[str, str]] = {}
        """Ids and types of project parameters, by their names in the script."""
        self._functions: dict[str, TypeFacts] = {}
        """The functions of the script by id, as types with one action."""
        self._poses = {path: key for key, path in frame.points.poses.items()}
        self._joints = {path: key for key, path in frame.points.joints.items()}
        self._positions = {path: key for key, path in frame.points.positions.items()}
        self._point_of = {key: frame.points.poses[key][0] for key in frame.points.poses}
        self._point_of |= {key: frame.points.joints[key][0] for key in frame.points.joints}
        self._points = {path[0]: key for key, path in frame.points.positions.items()}
        self._members = {
            (kind.name, member): value
            for facts in frame.types.values()
            for kind in facts.enumerations.values()
            for value, member in kind.members.items()
        }

    def define(self, function_id: str, facts: TypeFacts) -> None:
        """Add a function, which can be called from here on."""
        self._functions[function_id] = facts

    def types_of(self, type_name: str) -> TypeFacts:
        """Return the facts of an object type, or of a function by its id."""
        return self._functions.get(type_name) or self._frame.types[type_name]

    def enumeration_of(self, hint: ast.expr) -> Enumeration | None:
        """Return the enumeration that a type hint names, None for other hints."""
        match hint:
            case ast.Name(name) if name in self._script.imports:
                wanted = self._script.imports[name]
            case ast.Attribute(ast.Name(name), inner) if name in self._script.imports:
                wanted = f"{self._script.imports[name]}.{inner}"
            case _:
                return None
        kinds = (kind for facts in self._frame.types.values() for kind in facts.enumerations.values())
        return next((kind for kind in kinds if kind.name == wanted), None)

    # ------------------------------------------------------------------------------------------------ calls
    def arguments(self, call: ast.Call, declared: ObjectAction, type_name: str) -> dict[str, ast.expr]:
        """Return the arguments by parameter, without `an`. Raise NotUnderstood if they do not fit the parameters."""
        given: dict[str, ast.expr] = {}
        names = [meta.name for meta in declared.parameters]
        by_name = self.types_of(type_name).keyword_only
        by_place = [name for name in names if (declared.name, name) not in by_name]
        for name, node in zip(by_place, call.args, strict=False):
            if isinstance(node, ast.Starred):
                raise NotUnderstood(node.lineno, "arguments must be written one by one, without * or **")
            given[name] = node
        if len(call.args) > len(by_place):
            node, count = call.args[len(by_place)], len(by_place)
            raise NotUnderstood(
                node.lineno,
                "{name} has {count} positional parameters; {node} is too many",
                name=declared.name,
                count=count,
                node=excerpt(node),
            )
        for keyword in call.keywords:
            if keyword.arg is None:
                raise NotUnderstood(keyword.value.lineno, "arguments must be written one by one, without * or **")
            if keyword.arg == "an":
                continue
            name = declared.present_name(keyword.arg)
            if name not in names:
                raise NotUnderstood(
                    keyword.value.lineno, "{name} has no parameter {other_name}", name=declared.name, other_name=name
                )
            if name in given:
                raise NotUnderstood(keyword.value.lineno, "the parameter {name} is given twice", name=name)
            given[name] = keyword.value
        for meta in declared.parameters:
            if meta.name not in given and isinstance(meta.default_value, Unset):
                raise NotUnderstood(
                    call.lineno,
                    "the parameter {name} of {declared_name} is missing",
                    name=meta.name,
                    declared_name=declared.name,
                )
        return given

    def points_in(self, node: ast.expr) -> list[str]:
        """Return the id of the action point that an argument refers to, in a list; empty if there is none."""
        path = self._path(node)
        return [self._points[path[0]]] if path and path[0] in self._points else []

    def constant(
        self, node: ast.expr, meta: ParameterMeta, object_id: str, type_name: str, method: str, old: Parameter | None
    ) -> ActionParameter:
        """Return the parameter for an argument that is not a result of an action."""
        if isinstance(node, ast.Name):
            return self._project_parameter(node, meta)
        path = self._path(node)
        if path is not None:
            return self._reference(node, path, meta, object_id)
        if meta.type in ENUMERATIONS:
            value = self._member(node, meta, type_name, method)
        elif meta.type in REFERENCES or meta.type == "image":
            raise NotUnderstood(
                node.lineno, "{name} is {type}, not {node}", name=meta.name, type=meta.type, node=excerpt(node)
            )
        else:
            value = of_type(plain(node), meta.type)
        text = json_as_before(meta.type, value, old)
        parameter = ActionParameter(meta.name, meta.type, text)
        try:
            PARAMETER_TYPES[meta.type].check(parameter, meta)
        except (KeyError, InvalidData) as error:
            raise NotUnderstood(node.lineno, "{reason}", reason=message_of(error)) from error
        return parameter

    def _project_parameter(self, node: ast.Name, meta: ParameterMeta) -> ActionParameter:
        if node.id not in self.parameters:
            raise NotUnderstood(node.lineno, "unknown name {id}", id=node.id)
        key, kind = self.parameters[node.id]
        if kind != meta.type:
            raise NotUnderstood(
                node.lineno,
                "{name} is {type}, but {id} is {other_type}",
                name=meta.name,
                type=meta.type,
                id=node.id,
                other_type=kind,
            )
        return ActionParameter(meta.name, ActionParameterType.PROJECT_PARAMETER, json_of(key))

    # ------------------------------------------------------------------------------------------------ references
    def _path(self, node: ast.expr) -> tuple[str, ...] | None:
        """Return the parts of a dotted name after the action points variable, None for other expressions."""
        parts: list[str] = []
        while isinstance(node, ast.Attribute):
            parts.append(node.attr)
            node = node.value
        if isinstance(node, ast.Name) and node.id == self._script.points and parts:
            return tuple(reversed(parts))
        return None

    def _reference(self, node: ast.expr, path: tuple[str, ...], meta: ParameterMeta, object_id: str) -> ActionParameter:
        tables: Mapping[str, Mapping[tuple[str, ...], str]] = {
            "pose": self._poses,
            "joints": self._joints,
            "position": self._positions,
        }
        kind = next((kind for kind, table in tables.items() if path in table), None)
        if kind is None:
            raise NotUnderstood(node.lineno, "the project has no {node}", node=excerpt(node))
        if kind != meta.type:
            raise NotUnderstood(
                node.lineno,
                "{name} is {type}, but {node} is {other_type}",
                name=meta.name,
                type=meta.type,
                node=excerpt(node),
                other_type=kind,
            )
        key = tables[kind][path]
        of_robot = kind == "joints" and object_id not in self._functions
        if of_robot and self._frame.index.joints(key)[1].robot_id != object_id:
            raise NotUnderstood(node.lineno, "{node} belong to another robot", node=excerpt(node))
        return ActionParameter(meta.name, kind, json_of(key))

    # ------------------------------------------------------------------------------------------------ enumerations
    def _named_member(self, node: ast.expr) -> tuple[str, str] | None:
        """Return the enumeration, by its name where it is defined, and the member that an expression names."""
        match node:
            case ast.Attribute(ast.Name(name), member) if name in self._script.imports:
                return self._script.imports[name], member
            case ast.Attribute(ast.Attribute(ast.Name(name), inner), member) if name in self._script.imports:
                return f"{self._script.imports[name]}.{inner}", member
        return None

    def _member(self, node: ast.expr, meta: ParameterMeta, type_name: str, method: str) -> str | int:
        facts = self.types_of(type_name)
        kind = facts.enumerations.get((method, meta.name))
        named = self._named_member(node)
        if kind is None or named is None or named[0] != kind.name:
            wanted = Message.of("an enumeration") if kind is None else Message.of("one of {name}", name=kind.name)
            raise NotUnderstood(
                node.lineno, "{name} takes {wanted}, not {node}", name=meta.name, wanted=wanted, node=excerpt(node)
            )
        for value, member in kind.members.items():
            if member == named[1]:
                return value
        raise NotUnderstood(node.lineno, "{name} has no member {named}", name=kind.name, named=named[1])

    def compared(self, node: ast.expr) -> Value:
        """Return the value that a condition compares a result with: a literal, or a member of an enumeration."""
        named = self._named_member(node)
        if named is not None:
            if named not in self._members:
                raise NotUnderstood(node.lineno, "unknown enumeration member {node}", node=excerpt(node))
            return self._members[named]
        value: Value = plain(node)
        return value
