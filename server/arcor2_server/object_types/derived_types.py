"""Source code of object types that only derive from another type."""

import ast

from arcor2_hw.runtime.messages import TypeCode


def derived_source(name: str, base: TypeCode, description: str = "") -> str:
    """Return the module of an object type that derives from `base` without changes."""
    module, _, imported = base.entry_point.partition(":")
    import_base = ast.ImportFrom(module or base.module, [ast.alias(imported or base.name)], 0 if module else 1)
    return _source(name, imported or base.name, import_base, description)


def virtual_source(name: str, base: str) -> str:
    """Return the module of an object type that consists of a collision model; `base` is from arcor2_hw.objects."""
    return _source(name, base, ast.ImportFrom("arcor2_hw.objects", [ast.alias(base)], 0))


def _source(name: str, base: str, import_base: ast.ImportFrom, description: str = "") -> str:
    body: list[ast.stmt] = [ast.Expr(ast.Constant(description))] if description else []
    body.append(ast.Assign([ast.Name("_ABSTRACT", ast.Store())], ast.Constant(False)))
    derived = ast.ClassDef(name, [ast.Name(base, ast.Load())], [], body, [])
    return ast.unparse(ast.fix_missing_locations(ast.Module([import_base, derived], []))) + "\n"
