"""Settings of an object type: the dataclass in the signature of its constructor."""

import ast
from typing import Any, Final, NamedTuple

from arcor2_hw.actions.json_values import encode
from arcor2_hw.actions.parameter_types import Extra
from arcor2_hw.analysis.actions import NUMBERS, ActionReader, described_parameters, unit_extra
from arcor2_hw.analysis.constants import enum_members
from arcor2_hw.analysis.hierarchy import Hierarchy
from arcor2_hw.analysis.hints import meaning, parameter_type_of, plain, unannotated, without_none
from arcor2_hw.analysis.module import ClassInfo, Value
from arcor2_hw.analysis.source import AnalysisStopped
from arcor2_hw.analysis.symbols import External, is_framework
from arcor2_hw.data.base import UNSET, Unset
from arcor2_hw.data.discovery import Search
from arcor2_hw.data.object_type import ParameterMeta
from arcor2_hw.data.secret import HIDDEN, is_secret_name
from arcor2_hw.exceptions import InvalidData

_KINDS: Final = frozenset({"boolean", "integer", "double", "string", "string_enum", "integer_enum"})


class _Field(NamedTuple):
    """A field of a dataclass. `secret`, `address`, `for_control`, `found_by` are None where its metadata lacks them."""

    default: ast.expr | None
    in_constructor: bool = True
    keyword_only: bool = False
    secret: bool | None = None
    address: bool | None = None
    for_control: bool | None = None
    found_by: str | None = None


class SettingsReader:
    """Reads the settings of object types."""

    def __init__(self, hierarchy: Hierarchy, actions: ActionReader) -> None:
        self._hierarchy = hierarchy
        self._resolver = hierarchy.resolver
        self._actions = actions

    def settings(self, info: ClassInfo) -> list[ParameterMeta]:
        """Return the settings in the order of the constructor.

        Raises:
            AnalysisStopped: They cannot be determined.
        """
        found = self._class(info)
        return [] if found is None else self._fields(found)

    def _class(self, info: ClassInfo) -> ClassInfo | None:
        """Return the dataclass that annotates `settings` of `__init__`, or None if the type has no settings."""
        constructor = self._hierarchy.method(info, "__init__")
        if constructor is None or is_framework(constructor[0]):
            return None
        owner, node = constructor
        for argument in [*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs]:
            if argument.arg != "settings":
                continue
            if argument.annotation is None:
                raise owner.problem("{cls}: settings is not annotated", argument, cls=owner.name)
            hint, _ = without_none(argument.annotation, owner.module, self._resolver)
            symbol = meaning(hint, owner.module, owner, self._resolver)
            if not isinstance(symbol, ClassInfo) or not self._hierarchy.derives_from(symbol, "Settings"):
                raise owner.problem(
                    "{cls}: settings must be a dataclass derived from Settings", argument, cls=owner.name
                )
            return symbol
        return None

    def _fields(self, info: ClassInfo) -> list[ParameterMeta]:
        """Return the fields in the order of dataclasses: ancestors first, a repeated field at its first place."""
        ordinary: dict[str, ParameterMeta] = {}
        keyword_only: set[str] = set()
        for each in reversed(list(self._hierarchy.ancestors(info))):
            decorator = self._decorator(each)
            if decorator is None:
                continue
            after = _keyword(decorator, "kw_only")
            descriptions = described_parameters(ast.get_docstring(each.node, clean=False))
            for name, member in each.members.items():
                if not isinstance(member, Value) or member.annotation is None:
                    continue
                hint = plain(member.annotation, each.module)
                symbol = self._resolver.expression(
                    hint.value if isinstance(hint, ast.Subscript) else hint, each.module, each
                )
                if symbol == External("typing.ClassVar"):
                    continue
                if symbol == External("dataclasses.KW_ONLY"):
                    after = True
                    continue
                field = self._field(member, each)
                if not field.in_constructor:
                    continue
                ordinary[name] = self._setting(each, name, member.annotation, field, descriptions.get(name, UNSET))
                keyword_only.discard(name)
                if after or field.keyword_only:
                    keyword_only.add(name)
        return [
            *(meta for name, meta in ordinary.items() if name not in keyword_only),
            *(meta for name, meta in ordinary.items() if name in keyword_only),
        ]

    def _decorator(self, info: ClassInfo) -> ast.expr | None:
        for decorator in info.node.decorator_list:
            function = decorator.func if isinstance(decorator, ast.Call) else decorator
            if self._resolver.expression(function, info.module) == External("dataclasses.dataclass"):
                return decorator
        return None

    def _field(self, member: Value, info: ClassInfo) -> _Field:
        expression = member.expression
        if isinstance(expression, ast.Call) and self._resolver.expression(
            expression.func, info.module, info
        ) == External("dataclasses.field"):
            given = {keyword.arg: keyword.value for keyword in expression.keywords}
            if "default_factory" in given:
                raise info.problem("the default of a setting must be a constant in the source", expression)
            in_constructor = not _is(given.get("init"), False)
            metadata = given.get("metadata")
            search = _declared(metadata, "found_by")
            if search is not None and search not in tuple(Search):
                raise info.problem(
                    "found_by must be {searches}, not {search!r}", expression, searches=", ".join(Search), search=search
                )
            secret, address, for_control = (_flag(metadata, key) for key in ("secret", "address", "for_control"))
            keyword_only = _is(given.get("kw_only"), True)
            return _Field(given.get("default"), in_constructor, keyword_only, secret, address, for_control, search)
        return _Field(expression)

    def _setting(
        self, info: ClassInfo, name: str, hint: ast.expr, field: _Field, description: str | Unset
    ) -> ParameterMeta:
        hint = unannotated(hint, info.module, self._resolver)
        try:
            kind, enumeration = parameter_type_of(hint, info.module, info, self._resolver)
            if kind.name not in _KINDS:
                raise info.problem("a setting cannot be of type {type}", hint, type=kind.name)
            text = "" if isinstance(description, Unset) else description
            extra = unit_extra(text) if kind.name in NUMBERS else UNSET
            if enumeration is not None:
                members = enum_members(enumeration, self._resolver) or {}
                extra = encode(Extra(allowed_values=list(dict.fromkeys(members.values()))))
            default = self._actions.default(info, kind, enumeration, field.default)
            if kind.name != "string" and field.secret:
                raise info.problem("a secret setting must be of type str, not {type}", hint, type=kind.name)
            if kind.name != "string" and field.address:
                raise info.problem("an address must be of type str, not {type}", hint, type=kind.name)
        except AnalysisStopped as error:
            raise error.within("setting {name}: {reason}", name=name) from None
        except InvalidData as error:
            raise info.problem("setting {name}: {reason}", hint, name=name, reason=error) from None
        secret = kind.name == "string" and (is_secret_name(name) if field.secret is None else field.secret)
        if secret and default not in (UNSET, '""'):
            default = encode(HIDDEN)
        return ParameterMeta(
            name,
            kind.name,
            description=description,
            default_value=default,
            extra=extra,
            secret=secret or UNSET,
            address=UNSET if field.address is None else field.address,
            for_control=field.for_control or UNSET,
            found_by=field.found_by or UNSET,
        )


def _is(expression: ast.expr | None, value: bool) -> bool:
    return isinstance(expression, ast.Constant) and expression.value is value


def _declared(metadata: ast.expr | None, name: str) -> Any:
    """Return the value of `field(metadata={name: ...})`, None where it is missing."""
    if isinstance(metadata, ast.Dict):
        for key, value in zip(metadata.keys, metadata.values, strict=True):
            if isinstance(key, ast.Constant) and key.value == name and isinstance(value, ast.Constant):
                return value.value
    return None


def _flag(metadata: ast.expr | None, name: str) -> bool | None:
    value = _declared(metadata, name)
    return None if value is None else bool(value)


def _keyword(decorator: ast.expr, name: str) -> bool:
    return isinstance(decorator, ast.Call) and any(
        keyword.arg == name and _is(keyword.value, True) for keyword in decorator.keywords
    )
