"""Merges a generated script with a hand-edited script, and preserves its comments and formatting."""

import ast
import contextlib
from collections.abc import Callable, Mapping, Sequence
from typing import Final

import structlog
from msgspec.structs import replace

from arcor2_hw.actions.parameter_types import PARAMETER_TYPES
from arcor2_hw.data.base import Unset
from arcor2_hw.data.project import Action, ActionParameter, Project
from arcor2_hw.data.scene import Scene
from arcor2_hw.exceptions import Arcor2Error
from arcor2_server.build.frame import DOCSTRING, ChosenNames, Frame, References, TypeFacts
from arcor2_server.build.merging.equivalence import DeclaredParameter
from arcor2_server.build.merging.matching import Matching
from arcor2_server.build.merging.patching import CannotPatch, Edit, Patches, apply
from arcor2_server.build.merging.text import Lines, Statement, Text
from arcor2_server.build.merging.writing import MergingWriter
from arcor2_server.build.reading import completed_from_script
from arcor2_server.build.reading.completion import completed
from arcor2_server.build.style import Writer

log = structlog.get_logger(__name__)

_LIBRARIES: Final = ("arcor2_hw", "__future__", "typing")
"""Packages from which a script may import names that the generated one does not need."""

TreeOf = Callable[[Frame], ast.Module]
"""Generates the syntax tree of a script with the names of a frame."""


class _UnknownStructure(Exception):
    """The script does not have the parts of a generated one in their order."""


class _Parts:
    """The statements of a module: a text, imports, `main` and its entry point."""

    def __init__(self, statements: Sequence[Statement]) -> None:
        rest = list(statements)
        self.texts: list[Statement] = []
        self.imports: list[Statement] = []
        while rest and isinstance(rest[0].node, ast.Expr | ast.ImportFrom):
            first = rest.pop(0)
            (self.imports if isinstance(first.node, ast.ImportFrom) else self.texts).append(first)
        match [one.node for one in rest]:
            case [ast.FunctionDef(), ast.If()] | [ast.FunctionDef()]:
                self.main = rest[0]
                self.entry = rest[1] if len(rest) > 1 else None
            case _:
                raise _UnknownStructure


def merged(scene: Scene, project: Project, types: Mapping[str, TypeFacts], tree_of: TreeOf) -> str | None:
    """Return the script of a project with the text of `project.script`, None if this is not possible.

    Equivalent statements keep the hand-written text. Other statements are generated in the same place, with
    the comments around them. The result is read back: it states exactly the logic of the project.

    Args:
        scene: the scene of the project.
        project: a project with a script.
        types: the object types of the scene.
        tree_of: generates the syntax tree of the script.

    Raises:
        InvalidProject: an action or the logic is invalid.
        NotFound: `types` does not contain an object type.
    """
    assert not isinstance(project.script, Unset)
    try:
        text = Text(project.script)
        parts = _Parts(text.module.statements)
        names = _own_names(parts)
    except (SyntaxError, ValueError, RecursionError, MemoryError, _UnknownStructure) as error:
        log.warning("the comments of a script are not used", project=project.name, reason=str(error) or "its form")
        return None
    frame = Frame(scene, project, types, names)
    tree = tree_of(frame)
    wanted: Project | None = None
    for way in (_patched, _rewritten, _rewritten_in_order):
        if way is _rewritten_in_order:
            tree = tree_of(frame)  # the others have exchanged branches
        try:
            found = way(text, parts, tree, frame)
        except (CannotPatch, RecursionError):
            continue
        try:
            read = completed_from_script(found, scene, project, types)
        except Arcor2Error:
            continue
        if read == project:
            return found
        if wanted is None:
            wanted = _with_sorted_parameters(completed(project, scene, types))
        if _with_sorted_parameters(read) == wanted:
            return found
    log.warning("the comments of a script are not used", project=project.name, reason="the logic would change")
    return None


def _with_sorted_parameters(project: Project) -> Project:
    def action(action: Action) -> Action:
        return replace(action, parameters=sorted(action.parameters, key=lambda each: each.name))

    points, functions = (
        [replace(one, actions=[action(each) for each in one.actions]) for one in of]
        for of in (project.action_points, project.functions)
    )
    return replace(project, action_points=points, functions=functions)


# ---------------------------------------------------------------------------------------------- three ways
def _patched(text: Text, parts: _Parts, tree: ast.Module, frame: Frame) -> str:
    """Return the script with changed, new and removed statements in the structure that a person has written."""
    matching, writer, declared = _prepared(text, parts, tree, frame)
    return _text(text, [*_outside(parts, tree), *Patches(text, matching, writer, declared).edits])


def _rewritten_in_order(text: Text, parts: _Parts, tree: ast.Module, frame: Frame) -> str:
    """Return the script with the structure of the generated one and its order of branches.

    An `else` may have another condition than the opposite of its `if`. Exchanging the two would change the logic.
    """
    return _rewritten(text, parts, tree, frame, exchange=False)


def _rewritten(text: Text, parts: _Parts, tree: ast.Module, frame: Frame, *, exchange: bool = True) -> str:
    """Return the script with the structure of the generated one."""
    _, writer, _ = _prepared(text, parts, tree, frame, exchange=exchange)
    main = _main(tree)
    lines = writer.statements([main], "")
    return _text(text, [*_outside(parts, tree), Edit(parts.main.above, parts.main.end, lines)])


def _text(text: Text, edits: Sequence[Edit]) -> str:
    return "\n".join(apply(text.lines, edits))


def _prepared(
    text: Text, parts: _Parts, tree: ast.Module, frame: Frame, *, exchange: bool = True
) -> tuple[Matching, MergingWriter, "_DeclaredParameters"]:
    matching = Matching(_main(tree), parts.main, exchange=exchange)
    declared = _DeclaredParameters(frame)
    return matching, MergingWriter(frame.comments, text, matching, declared), declared


def _main(tree: ast.Module) -> ast.FunctionDef:
    return next(node for node in tree.body if isinstance(node, ast.FunctionDef))


# ---------------------------------------------------------------------------------------------- names
def _own_names(parts: _Parts) -> ChosenNames:
    """Return the names of objects and imports in a script."""
    objects: dict[str, str] = {}
    for statement in parts.main.blocks[0].statements:
        match statement.node:
            case ast.Assign([ast.Name(name)], ast.Subscript(_, ast.Constant(str(object_id)))) | ast.AnnAssign(
                ast.Name(name), _, ast.Subscript(_, ast.Constant(str(object_id)))
            ):
                objects[object_id] = name
    imports = {
        (node.module or "", alias.name): alias.asname or alias.name
        for statement in parts.imports
        if isinstance(node := statement.node, ast.ImportFrom)
        for alias in node.names
    }
    return ChosenNames(objects, imports)


class _DeclaredParameters:
    """The parameters of the methods and functions that actions call, by name of the action."""

    def __init__(self, frame: Frame) -> None:
        self._frame = frame
        self._actions = {action.name: action for action in frame.project.all_actions()}
        self._found: dict[str, list[DeclaredParameter]] = {}

    def __call__(self, name: str) -> list[DeclaredParameter]:
        action = self._actions[name]
        if action.is_parallel:
            return []
        if action.type not in self._found:
            object_id, type_name, method, meta = self._frame.resolve(action)
            names = References(self._frame, object_id, self._frame.types_of(type_name).enumerations, method)
            found = []
            for one in meta.parameters:
                default = None
                if not isinstance(one.default_value, Unset) and (kind := PARAMETER_TYPES.get(one.type)):
                    with contextlib.suppress(Arcor2Error):
                        default = kind.expression(ActionParameter(one.name, one.type, one.default_value), names)
                found.append(DeclaredParameter(one.name, one.type, default))
            self._found[action.type] = found
        return self._found[action.type]


# ---------------------------------------------------------------------------------------------- around `main`
def _outside(parts: _Parts, tree: ast.Module) -> list[Edit]:
    """Return the edits of the statements around `main`."""
    heading, *_, entry = tree.body
    edits: list[Edit] = []
    for statement in parts.texts[:1]:
        found = ast.unparse(statement.node)
        if found[3:].startswith(DOCSTRING) and ast.dump(heading) != ast.dump(statement.node):
            edits.append(Edit(statement.start, statement.end, _lines([heading])))
    edits += _imports(parts, [node for node in tree.body if isinstance(node, ast.ImportFrom)])
    if parts.entry is None:
        end = parts.main.end
        edits.append(Edit(end, end, ["", "", *_lines([entry])]))
    elif ast.dump(entry) != ast.dump(parts.entry.node):
        edits.append(Edit(parts.entry.start, parts.entry.end, _lines([entry])))
    return edits


def _imports(parts: _Parts, generated: Sequence[ast.ImportFrom]) -> list[Edit]:
    needed = {node.module or "": {_alias(one): one for one in node.names} for node in generated}
    edits: list[Edit] = []
    found = {key for statement in parts.imports for key in _imported(statement)}
    for statement in parts.imports:
        node = statement.node
        assert isinstance(node, ast.ImportFrom)
        module = node.module or ""
        library = module.partition(".")[0] in _LIBRARIES
        kept = [one for one in node.names if library or _alias(one) in needed.get(module, {})]
        # Names that the script does not import yet are added where it imports from the same module first.
        missing = [alias for key, alias in needed.pop(module, {}).items() if (module, *key) not in found]
        if missing or len(kept) < len(node.names):
            names = sorted([*kept, *missing], key=lambda one: one.name)
            lines = _lines([ast.ImportFrom(module, names, 0)]) if names else []
            if lines and statement.trailing:
                lines[-1] += f"  {statement.trailing}"
            edits.append(Edit(statement.start, statement.end, lines))
    rest = [node for node in generated if node.module in needed]
    if rest:
        above = [*parts.imports, *parts.texts]
        place = above[0].end if not parts.imports and above else parts.imports[-1].end if above else 0
        edits.append(Edit(place, place, _lines(rest)))
    return edits


def _alias(alias: ast.alias) -> tuple[str, str]:
    return alias.name, alias.asname or alias.name


def _imported(statement: Statement) -> list[tuple[str, str, str]]:
    node = statement.node
    return [(node.module or "", *_alias(one)) for one in node.names] if isinstance(node, ast.ImportFrom) else []


def _lines(nodes: Sequence[ast.stmt]) -> Lines:
    return Writer({}).statements(nodes, "")
