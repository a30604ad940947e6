"""Resolution of names through the imports of any number of files."""

import ast
import builtins
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final, TypeAlias

from arcor2_hw.analysis.module import ClassInfo, FunctionNode, Import, Module, Value
from arcor2_hw.data.older_names import OLDER_NAMES, OLDER_PACKAGES


@dataclass(frozen=True, slots=True)
class External:
    """A name in a module that is not read: `builtins.int`, `numpy.ndarray`, `arcor2_hw.data.geometry.Pose`."""

    dotted: str


@dataclass(frozen=True, slots=True)
class ModuleSymbol:
    """A module that can be read."""

    module: Module


@dataclass(frozen=True, slots=True)
class Constant:
    """A name bound to an expression, with the module and class in which its own names are resolved."""

    value: Value
    module: Module
    owner: ClassInfo | None


@dataclass(frozen=True, slots=True)
class Function:
    """A function or method."""

    node: FunctionNode
    module: Module


Symbol: TypeAlias = ClassInfo | ModuleSymbol | Constant | Function | External
Load: TypeAlias = Callable[[str], Module | None]

_BASES: Final = "arcor2_hw.objects"

FRAMEWORK: Final = OLDER_PACKAGES | {"arcor2_hw"}
"""Top-level packages that are ours."""

_DEPTH: Final = 40
"""Maximum number of steps from import to import; more are a circle."""


def our_spelling(module: str, name: str) -> tuple[str, str]:
    """Return our module and name for an import of older object types (protocol, section 9.6)."""
    return OLDER_NAMES.get(module, {}).get(name, (module, name))


def dotted_name(expression: ast.expr) -> list[str] | None:
    """Return the parts of `a.b.c`, None for any other expression."""
    parts: list[str] = []
    while isinstance(expression, ast.Attribute):
        parts.append(expression.attr)
        expression = expression.value
    if not isinstance(expression, ast.Name):
        return None
    parts.append(expression.id)
    parts.reverse()
    return parts


class Resolver:
    """Resolves names. `load` returns a module by its dotted name, or None if it is not to be read."""

    def __init__(self, load: Load) -> None:
        self._load = load

    def expression(self, expression: ast.expr, module: Module, owner: ClassInfo | None = None) -> Symbol | None:
        """Return the symbol of a dotted name, or None if it is not bound, or is not a dotted name."""
        parts = dotted_name(expression)
        return None if parts is None else self.parts(parts, module, owner)

    def parts(
        self, parts: list[str], module: Module, owner: ClassInfo | None = None, depth: int = _DEPTH
    ) -> Symbol | None:
        """Return the symbol of the dotted name of `parts`, as seen from `module`, or from the body of `owner`."""
        if depth <= 0:
            return None
        found: Symbol | None = None
        if owner is not None and parts[0] in owner.members:
            found = self._bound(owner.members[parts[0]], owner.module, owner, depth - 1)
        if found is None:
            found = self.name(parts[0], module, depth - 1)
        for part in parts[1:]:
            found = self._attribute(found, part, depth - 1)
        return found

    def name(self, name: str, module: Module, depth: int = _DEPTH) -> Symbol | None:
        """Return the symbol of a name at the top level of a module."""
        if (found := self._own(name, module, depth)) is not None:
            return found
        return External(f"builtins.{name}") if hasattr(builtins, name) else None

    def _own(self, name: str, module: Module, depth: int) -> Symbol | None:
        """Return the names that a module binds, or imports with `from x import *`."""
        if depth <= 0:
            return None
        if name in module.bindings:
            return self._bound(module.bindings[name], module, None, depth - 1)
        for star in module.stars:
            source = self._load(star.module)
            if source is not None and (found := self._own(name, source, depth - 1)) is not None:
                return found
            if name in OLDER_NAMES.get(star.module, ()):
                return self._member(star.module, name, depth - 1)
        return None

    def _bound(
        self, binding: "ClassInfo | FunctionNode | Import | Value", module: Module, owner: ClassInfo | None, depth: int
    ) -> Symbol | None:
        match binding:
            case ClassInfo():
                return binding
            case Import():
                return self._imported(binding, depth)
            case Value(expression=expression):
                # An alias: `Joints = ProjectRobotJoints`.
                parts = dotted_name(expression) if expression is not None else None
                if parts is not None and depth > 0:
                    aliased = self.parts(parts, module, owner, depth - 1)
                    if isinstance(aliased, ClassInfo | External | ModuleSymbol):
                        return aliased
                return Constant(binding, module, owner)
            case _:
                return Function(binding, module)

    def _imported(self, found: Import, depth: int) -> Symbol | None:
        if found.name is None:
            module = self._load(found.module)
            return ModuleSymbol(module) if module is not None else External(found.module)
        return self._member(found.module, found.name, depth)

    def _member(self, dotted: str, name: str, depth: int) -> Symbol | None:
        dotted, name = our_spelling(dotted, name)
        if (source := self._load(dotted)) is not None:
            if name in source.bindings or source.stars:
                return self.name(name, source, depth - 1)
            submodule = self._load(f"{dotted}.{name}")
            return ModuleSymbol(submodule) if submodule is not None else None
        submodule = self._load(f"{dotted}.{name}")
        return ModuleSymbol(submodule) if submodule is not None else External(f"{dotted}.{name}")

    def _attribute(self, symbol: Symbol | None, name: str, depth: int) -> Symbol | None:
        match symbol:
            case ModuleSymbol(module=module):
                if name in module.bindings:
                    return self.name(name, module, depth)
                submodule = self._load(f"{module.dotted}.{name}")
                return ModuleSymbol(submodule) if submodule is not None else None
            case External(dotted=dotted):
                return self._member(dotted, name, depth)
            case ClassInfo():
                if name in symbol.members:
                    return self._bound(symbol.members[name], symbol.module, symbol, depth)
                return None
            case _:
                return None


def framework_name(symbol: Symbol | None) -> str | None:
    """Return the last part of one of our names, None for any other symbol."""
    if isinstance(symbol, External):
        top, _, rest = symbol.dotted.partition(".")
        return rest.rpartition(".")[2] if top in FRAMEWORK and rest else None
    if isinstance(symbol, ClassInfo) and is_framework(symbol):
        return symbol.name
    return None


def is_framework(info: ClassInfo) -> bool:
    """Return whether this is one of our abstract bases; stock types are ordinary types."""
    dotted = info.module.dotted
    return dotted.startswith(_BASES) and not dotted.startswith(f"{_BASES}.stock")
