"""Base classes of a class over any number of files, in Python's lookup order."""

import ast
import sys
from collections.abc import Iterator
from typing import Any, Final

from arcor2_hw.analysis.constants import constant
from arcor2_hw.analysis.module import Binding, ClassInfo, FunctionNode, Value
from arcor2_hw.analysis.symbols import External, Resolver, framework_name, is_framework

Ancestors = list["ClassInfo | External"]

DRIVER_BASES: Final = ("Connected", "PointActions")
"""Bases for drivers: mixins that implement methods which an object type base leaves to the driver."""


class Hierarchy:
    """Determines bases and lookup order of classes, with a cache."""

    def __init__(self, resolver: Resolver) -> None:
        self.resolver = resolver
        self._lineages: dict[ClassInfo, Ancestors] = {}
        self._ours: dict[ClassInfo, frozenset[str]] = {}
        self._offered: dict[ClassInfo, list[str]] = {}
        self._underway: list[ClassInfo] = []

    def bases(self, info: ClassInfo) -> "list[ClassInfo | External]":
        """Return the classes in the class statement.

        Raises:
            Broken: A base cannot be read.
        """
        result: list[ClassInfo | External] = []
        for expression in info.node.bases:
            # Generic[T] of typing: the subscript does not affect inheritance.
            plain = expression.value if isinstance(expression, ast.Subscript) else expression
            symbol = self.resolver.expression(plain, info.module)
            if isinstance(symbol, ClassInfo | External):
                result.append(symbol)
            else:
                shown = getattr(plain, "id", None) or getattr(plain, "attr", None) or "base"
                raise info.problem("{cls}: the base {base} cannot be read", expression, cls=info.name, base=shown)
        return result

    def base(self, info: ClassInfo) -> ClassInfo | None:
        """Return the base of an object type: the last one; all before it are mixins."""
        bases = self.bases(info)
        return bases[-1] if bases and isinstance(bases[-1], ClassInfo) else None

    def lineage(self, info: ClassInfo) -> Ancestors:
        """Return the class and its ancestors in Python's lookup order (C3).

        Raises:
            Broken: There is a circle, or the orders of the bases contradict each other.
        """
        if info in self._lineages:
            return self._lineages[info]
        if info in self._underway:
            names = " -> ".join(c.name for c in [*self._underway[self._underway.index(info) :], info])
            raise info.problem("{cls} is its own ancestor: {names}", cls=info.name, names=names)
        self._underway.append(info)
        try:
            bases = self.bases(info)
            sequences: list[Ancestors] = [
                list(self.lineage(base)) if isinstance(base, ClassInfo) else [base] for base in bases
            ]
            result: Ancestors = [info, *self._merged(info, [*sequences, list(bases)])]
        finally:
            self._underway.pop()
        self._lineages[info] = result
        return result

    def _merged(self, info: ClassInfo, sequences: list[Ancestors]) -> Ancestors:
        result: Ancestors = []
        while sequences := [sequence for sequence in sequences if sequence]:
            for sequence in sequences:
                candidate = sequence[0]
                if not any(candidate in other[1:] for other in sequences):
                    break
            else:
                raise info.problem("{cls}: the orders of its bases contradict each other", cls=info.name)
            result.append(candidate)
            for sequence in sequences:
                if sequence[0] == candidate:
                    del sequence[0]
        return result

    def ancestors(self, info: ClassInfo) -> Iterator[ClassInfo]:
        """Yield the class and those of its ancestors that can be read."""
        return (each for each in self.lineage(info) if isinstance(each, ClassInfo))

    def derives_from(self, info: ClassInfo, name: str) -> bool:
        """Return whether our base class `name` is the class itself or an ancestor."""
        if info not in self._ours:
            self._ours[info] = frozenset(found for each in self.lineage(info) if (found := framework_name(each)))
        return name in self._ours[info]

    def find(self, info: ClassInfo, name: str) -> tuple[ClassInfo, Binding] | None:
        """Return the binding of a member as seen from `info`, and the class that contains it."""
        for each in self.ancestors(info):
            if name in each.members:
                binding = each.members[name]
                if isinstance(binding, Value) and binding.expression is None:
                    continue  # only annotated, not bound at run time
                return each, binding
        return None

    def method(self, info: ClassInfo, name: str) -> tuple[ClassInfo, FunctionNode] | None:
        """Return a method as seen from `info`, with the class that defines it."""
        found = self.find(info, name)
        if found is None or not isinstance(found[1], ast.FunctionDef | ast.AsyncFunctionDef):
            return None
        return found[0], found[1]

    def attribute(self, info: ClassInfo, name: str, default: Any = None) -> Any:
        """Return the value of a class attribute.

        Raises:
            Broken: It cannot be determined from the source.
        """
        found = self.find(info, name)
        if found is None:
            return default
        owner, binding = found
        if not isinstance(binding, Value) or binding.expression is None:
            raise owner.problem("{cls}.{name} is not a plain value", cls=owner.name, name=name)
        return constant(binding.expression, owner.module, owner, self.resolver)

    def decorated(self, node: FunctionNode, owner: ClassInfo, *names: str) -> bool:
        """Return whether a function has one of these decorators, by their dotted names."""
        for decorator in node.decorator_list:
            plain = decorator.func if isinstance(decorator, ast.Call) else decorator
            symbol = self.resolver.expression(plain, owner.module, owner)
            if isinstance(symbol, External) and symbol.dotted in names:
                return True
        return False

    def is_abstract(self, node: FunctionNode, owner: ClassInfo) -> bool:
        """Return whether a method is abstract."""
        return self.decorated(node, owner, "abc.abstractmethod", "abc.abstractproperty")

    def unimplemented(self, info: ClassInfo) -> list[str]:
        """Return the names of the abstract methods that are not implemented."""
        seen: set[str] = set()
        missing: list[str] = []
        for each in self.ancestors(info):
            for name, member in each.members.items():
                if name in seen or (isinstance(member, Value) and member.expression is None):
                    continue
                seen.add(name)
                if isinstance(member, ast.FunctionDef | ast.AsyncFunctionDef) and self.is_abstract(member, each):
                    missing.append(name)
        return missing

    def is_hook_only(self, node: FunctionNode, owner: ClassInfo) -> bool:
        """Return whether a body only raises our not-implemented error."""
        body = node.body
        if body and isinstance(body[0], ast.Expr) and isinstance(body[0].value, ast.Constant):
            body = body[1:]
        if len(body) != 1 or not isinstance(body[0], ast.Raise) or body[0].exc is None:
            return False
        raised = body[0].exc
        symbol = self.resolver.expression(raised.func if isinstance(raised, ast.Call) else raised, owner.module, owner)
        return framework_name(symbol) == "Arcor2NotImplemented"

    def _offers(self, base: ClassInfo) -> list[str]:
        """Return the optional methods that one of our bases declares."""
        if base not in self._offered:
            self._offered[base] = [
                name
                for name, member in base.members.items()
                if not name.startswith("_")
                and isinstance(member, ast.FunctionDef)
                and not self.is_abstract(member, base)
            ]
        return self._offered[base]

    def implemented_hooks(self, info: ClassInfo) -> frozenset[str]:
        """Return the optional methods of our bases that the type, or one of its own ancestors, implements.

        A base for drivers implements all that it defines. Another base implements a method if a further base does not.
        """
        ours = [each for each in self.ancestors(info) if is_framework(each)]
        for_drivers = [each for each in ours if any(self.derives_from(each, name) for name in DRIVER_BASES)]
        offered = {name for each in ours if each not in for_drivers for name in self._offers(each)}
        result = set()
        for name in offered:
            found = self.method(info, name)
            if found is None or self.is_hook_only(found[1], found[0]):
                continue
            own = not is_framework(found[0]) or found[0] in for_drivers
            if own or self._fills_in(name, ours[ours.index(found[0]) + 1 :]):
                result.add(name)
        return frozenset(result)

    def _fills_in(self, name: str, bases: list[ClassInfo]) -> bool:
        """Return whether one of our bases leaves a method unimplemented: its body only raises an error."""
        declared = (each.function(name) for each in bases)
        return any(
            node is not None and self.is_hook_only(node, each) for node, each in zip(declared, bases, strict=True)
        )


def is_known_library(symbol: External) -> bool:
    """Return whether this belongs to the standard library or to us, so that it cannot be an object type."""
    top = symbol.dotted.partition(".")[0]
    return top in sys.stdlib_module_names or top in {"builtins", "arcor2_hw", "arcor2"}
