"""Differences between two exports, matched by id and reported by name."""

import difflib
import hashlib
import re
from collections.abc import Iterator, Mapping
from typing import Any, Final, Literal

import msgspec
from msgspec import UNSET

from arcor2_hw.data.base import Data, Unset
from arcor2_hw.data.object_type import ObjectTypeSource
from arcor2_hw.data.project import END, START, Project
from arcor2_server.documents.comparisons import text_of
from arcor2_server.exchange.archive import Archive

IGNORED_FIELDS: Final = frozenset({"created", "modified", "int_modified"})
"""Fields that are not compared."""
VECTOR_FIELDS: Final = (frozenset("xyz"), frozenset("xyzw"))
"""Fields of positions and orientations, which are compared as one value."""
_ID: Final = re.compile(r"[a-z]+_[0-9a-f]{32}")


class Difference(Data, frozen=True):
    """An entry that differs between two exports, or is missing from one of them.

    Attributes:
        change: The kind of difference.
        path: Names from the outermost to the innermost: "scene", "objects", "tester", "pose", "position".
        old: JSON value in the old export, UNSET if there is none.
        new: JSON value in the new export, UNSET if there is none.
        text: Lines of a unified diff if a source or script differs.
    """

    change: Literal["added", "removed", "changed"]
    path: list[str]
    old: Any = UNSET
    new: Any = UNSET
    text: list[str] | Unset = UNSET


def differences(old: Archive, new: Archive) -> list[Difference]:
    """Return the differences, ignoring the order of entries and the times of saving."""
    return list(_compare(_tree(old), _tree(new), [], names_of(old, new)))


def names_of(*archives: Archive) -> dict[str, str]:
    """Return the names of items by id; the last export takes precedence."""
    names = {START: START, END: END}
    for archive in archives:
        names |= _names(archive)
    return names


def _tree(archive: Archive) -> dict[str, Any]:
    return {
        "scene": UNSET if archive.scene is None else msgspec.to_builtins(archive.scene),
        "project": UNSET if archive.project is None else _project(archive.project),
        "script": UNSET if archive.script is None else _Text(archive.script),
        "object types": {name: _type(one) for name, one in archive.types.items()},
        "installed": dict.fromkeys(archive.installed, "needed"),
        "assets": {
            key: f"{len(asset.content)} bytes, SHA-256 {hashlib.sha256(asset.content).hexdigest()[:16]}"
            for key, asset in archive.assets.items()
        },
        "stored parameters": msgspec.to_builtins(archive.parameters),
        "stored overrides": msgspec.to_builtins(archive.overrides),
    }


def _project(project: Project) -> dict[str, Any]:
    found: dict[str, Any] = msgspec.to_builtins(project)
    return found | {"script": _Text(project.script)} if project.script else found


def _type(source: ObjectTypeSource) -> dict[str, Any]:
    model = UNSET if isinstance(source.model, Unset) else msgspec.to_builtins(source.model)
    modules = {name: _Text(text) for name, text in source.own_modules.items()}
    return {"source": _Text(source.source), "modules": modules, "model": model}


class _Text(str):
    """A text that is compared line by line."""

    __slots__ = ()


def _names(archive: Archive) -> dict[str, str]:
    names = {START: START, END: END}
    if archive.scene is not None:
        names |= {one.id: one.name for one in (*archive.scene.objects, *(archive.scene.interlocks or ()))}
    project = archive.project
    if project is not None:
        names |= {one.id: one.name for one in project.parameters}
        for point in project.action_points:
            names[point.id] = point.name
            for one in (*point.orientations, *point.robot_joints, *point.actions):
                names[one.id] = one.name  # type: ignore[attr-defined]
        for function in project.functions:
            names[function.id] = function.name
            names |= {action.id: action.name for action in function.actions}
        results = {
            f"{action.id}/default/{index}": output
            for action in project.all_actions()
            for index, output in enumerate(action.outputs())
        }
        for item in (*project.logic, *(item for function in project.functions for item in function.logic)):
            branch = "" if isinstance(item.condition, Unset) else f" if {item.condition.value}"
            if not isinstance(item.when, Unset) and item.when.comparisons:
                branch = f" if {text_of(item.when, lambda what: results.get(what) or names.get(what, what))}"
            if item.error_kinds:
                branch = f" on {', '.join(item.error_kinds)}"
            start, end = (names.get(key.partition("/")[0], key) for key in (item.start, item.end))
            names[item.id] = f"{start} → {end}{branch}"
    return names


def _compare(old: Any, new: Any, path: list[str], names: Mapping[str, str]) -> Iterator[Difference]:
    if isinstance(old, list) and isinstance(new, list):
        before, after = _keyed(old), _keyed(new)
        if before is not None and after is not None:
            old, new = before, after
    if isinstance(old, dict) and isinstance(new, dict) and not _is_one_value(old, new):
        for key in [*old, *(key for key in new if key not in old)]:
            if key not in IGNORED_FIELDS:
                yield from _compare(old.get(key, UNSET), new.get(key, UNSET), [*path, names.get(key, key)], names)
        return
    if old == new:
        return
    if isinstance(old, _Text) and isinstance(new, _Text):
        lines = difflib.unified_diff(old.splitlines(), new.splitlines(), lineterm="", n=2)
        yield Difference("changed", path, text=list(lines)[2:])
        return
    change: Literal["added", "removed", "changed"] = "changed"
    if old is UNSET or new is UNSET:
        change = "added" if old is UNSET else "removed"
    yield Difference(change, path, _plain(old), _plain(new))


def _is_one_value(old: dict[str, Any], new: dict[str, Any]) -> bool:
    return old.keys() == new.keys() and frozenset(old) in VECTOR_FIELDS


def _keyed(items: list[Any]) -> dict[str, Any] | None:
    """Return a list of items by id, or by name; None if the items have neither."""
    for key in ("id", "name"):
        if all(isinstance(item, dict) and item.get(key) for item in items):
            found = {item[key]: item for item in items}
            if len(found) == len(items):
                return found
    return None


def _plain(value: Any) -> Any:
    """Return a value for JSON, with the number of lines in place of a source or script."""
    if isinstance(value, _Text):
        return f"{len(value.splitlines())} lines"
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items() if item is not UNSET}
    if isinstance(value, list):
        return [_plain(item) for item in value]
    return value


def describe(value: Any, names: Mapping[str, str]) -> str:
    """Return a short description of a value, with names in place of ids."""
    match value:
        case dict() if frozenset(value) in VECTOR_FIELDS:
            return f"({', '.join(f'{float(one):g}' for one in value.values())})"
        case dict():
            kind = value.get("type")
            return describe(kind, names) if isinstance(kind, str) else ""
        case list():
            return f"{len(value)} entries"
        case str():
            return _ID.sub(lambda found: names.get(found[0], found[0]), value)
    return msgspec.json.encode(value).decode()
