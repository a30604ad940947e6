"""Checks that the tests named in quality.yaml exist and are collected."""

import ast
from collections.abc import Iterable, Mapping, Sequence
from functools import lru_cache
from pathlib import Path
from types import MappingProxyType

from arcor2_hw.parsing import parse

_Test = ast.FunctionDef | ast.AsyncFunctionDef


def missing_tests(
    claims: Mapping[str, Sequence[str]],
    folders: Iterable[Path],
    near: str,
    collected: Mapping[str, frozenset[str]],
    cases: Mapping[str, bool] = MappingProxyType({}),
) -> list[str]:
    """Return a sentence for each problem of the named tests.

    Args:
        claims: Tests by claim.
        folders: Folders of tests.
        near: Name of the driver's folder, which distinguishes files of the same name.
        collected: Names of collected tests by path of their file.
        cases: Whether each case of the suite passed, for tests that a class inherits from `Conformance`.
    """
    named = [(claim, test) for claim, tests in claims.items() for test in tests]
    if not named:
        return ["rules names no test"]
    files = _files(tuple(folders))
    wrong = []
    for claim, test in named:
        file, _, name = test.partition("::")
        found = files.get(Path(file).name, [])
        found = [path for path in found if near in path.parts] or found
        if not found:
            wrong.append(f"{claim}: file {file} does not exist")
        elif len(found) > 1:
            wrong.append(f"{claim}: there are {len(found)} files {file}")
        elif problem := _problem(found[0], name, collected.get(str(found[0])), cases):
            wrong.append(f"{claim}: {test} {problem}")
    return wrong


@lru_cache(maxsize=8)
def _files(folders: tuple[Path, ...]) -> dict[str, list[Path]]:
    found: dict[str, list[Path]] = {}
    for path in sorted({path for folder in folders for path in folder.rglob("*.py")}):
        found.setdefault(path.name, []).append(path)
    return found


def _problem(path: Path, name: str, collected: frozenset[str] | None, cases: Mapping[str, bool]) -> str:
    if not (path.name.startswith("test_") or path.name.endswith("_test.py")):
        return "is in a file that pytest does not collect"
    place, _, test = name.rpartition("::")
    if test not in _tests(path):
        passed = cases.get(test.removeprefix("test_")) if place in _suites(path) else None
        return {None: "does not exist", False: "did not pass", True: ""}[passed]
    if test in _skipped(path):
        return "is skipped or expected to fail"
    if collected is not None and test not in collected:
        return "is not collected"
    return ""


@lru_cache(maxsize=256)
def _suites(path: Path) -> frozenset[str]:
    """Return the test classes that inherit the cases of the suite."""
    found = [place for place in _places(path) if isinstance(place, ast.ClassDef)]
    return frozenset(place.name for place in found if "Conformance" in [_last_name(base) for base in place.bases])


def _last_name(node: ast.expr) -> str:
    return node.attr if isinstance(node, ast.Attribute) else node.id if isinstance(node, ast.Name) else ""


@lru_cache(maxsize=256)
def _tests(path: Path) -> dict[str, _Test]:
    return {
        node.name: node
        for place in _places(path)
        for node in place.body
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef) and node.name.startswith("test")
    }


@lru_cache(maxsize=256)
def _places(path: Path) -> list[ast.Module | ast.ClassDef]:
    """Return the module and its test classes."""
    try:
        tree = parse(path.read_bytes())
    except (OSError, SyntaxError, ValueError):
        return []
    return [tree, *(node for node in tree.body if isinstance(node, ast.ClassDef) and node.name.startswith("Test"))]


@lru_cache(maxsize=256)
def _skipped(path: Path) -> frozenset[str]:
    """Return the tests that are skipped everywhere or expected to fail: by their file, their class or themselves."""
    found: set[str] = set()
    for place in _places(path):
        whole = _skips(place.body) or (isinstance(place, ast.ClassDef) and any(map(_is_skip, place.decorator_list)))
        for node in place.body if whole else ():
            found |= {each.name for each in ast.walk(node) if isinstance(each, _Test)}
    found |= {
        test.name for test in _tests(path).values() if any(map(_is_skip, test.decorator_list)) or _skips(test.body)
    }
    return frozenset(found)


def _skips(body: Sequence[ast.stmt]) -> bool:
    """Return whether statements always skip: `pytestmark = pytest.mark.skip` or `pytest.skip(...)`."""
    for statement in body:
        match statement:
            case ast.Assign(targets=[ast.Name("pytestmark")], value=value):
                if any(map(_is_skip, value.elts if isinstance(value, ast.List | ast.Tuple) else [value])):
                    return True
            case ast.Expr(value=ast.Call() as call) if _is_skip(call):
                return True
    return False


def _is_skip(found: ast.expr) -> bool:
    plain = found.func if isinstance(found, ast.Call) else found
    return isinstance(plain, ast.Attribute) and plain.attr in ("skip", "xfail")
