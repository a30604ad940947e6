"""Checks that the tests named in quality.yaml exist and are collected."""

import ast
from collections.abc import Iterable, Mapping, Sequence
from functools import lru_cache
from pathlib import Path

_Test = ast.FunctionDef | ast.AsyncFunctionDef


def missing_tests(
    rules: Mapping[str, Sequence[str]], folders: Iterable[Path], near: str, collected: Mapping[str, frozenset[str]]
) -> list[str]:
    """Return a sentence for each problem of the named tests.

    Args:
        rules: Tests by rule.
        folders: Folders of tests.
        near: Name of the driver's folder, which distinguishes files of the same name.
        collected: Names of collected tests by path of their file.
    """
    named = [(rule, test) for rule, tests in rules.items() for test in tests]
    if not named:
        return ["rules names no test"]
    files = _files(tuple(folders))
    wrong = []
    for rule, test in named:
        file, _, name = test.partition("::")
        found = files.get(Path(file).name, [])
        found = [path for path in found if near in path.parts] or found
        if not found:
            wrong.append(f"rule {rule}: there is no file {file}")
        elif len(found) > 1:
            wrong.append(f"rule {rule}: there are {len(found)} files {file}")
        elif problem := _problem(found[0], name, collected.get(str(found[0]))):
            wrong.append(f"rule {rule}: {test} {problem}")
    return wrong


@lru_cache(maxsize=8)
def _files(folders: tuple[Path, ...]) -> dict[str, list[Path]]:
    found: dict[str, list[Path]] = {}
    for path in sorted({path for folder in folders for path in folder.rglob("*.py")}):
        found.setdefault(path.name, []).append(path)
    return found


def _problem(path: Path, name: str, collected: frozenset[str] | None) -> str:
    if not (path.name.startswith("test_") or path.name.endswith("_test.py")):
        return "is in a file that pytest does not collect"
    test = _tests(path).get(name.rpartition("::")[2])
    if test is None:
        return "does not exist"
    if any(_is_skip(each) for each in test.decorator_list):
        return "is skipped or expected to fail"
    if collected is not None and test.name not in collected:
        return "is not collected"
    return ""


@lru_cache(maxsize=256)
def _tests(path: Path) -> dict[str, _Test]:
    try:
        tree = ast.parse(path.read_bytes())
    except (OSError, SyntaxError, ValueError):
        return {}
    places: list[ast.Module | ast.ClassDef] = [tree]
    places += [node for node in tree.body if isinstance(node, ast.ClassDef) and node.name.startswith("Test")]
    return {
        node.name: node
        for place in places
        for node in place.body
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef) and node.name.startswith("test")
    }


def _is_skip(decorator: ast.expr) -> bool:
    plain = decorator.func if isinstance(decorator, ast.Call) else decorator
    return isinstance(plain, ast.Attribute) and plain.attr in ("skip", "xfail")
