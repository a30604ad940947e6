"""Changes single statements in the text of a script, and leaves everything else as it is."""

import ast
from collections.abc import Sequence
from typing import NamedTuple

from arcor2_server.build.merging.equivalence import DeclaredOf, action_name, same
from arcor2_server.build.merging.matching import Matching, names_in, parts_of, walk
from arcor2_server.build.merging.text import Block, Lines, Statement, Text
from arcor2_server.build.merging.writing import MergingWriter
from arcor2_server.build.style import Writer


class Edit(NamedTuple):
    """Replaces the lines from `start` to before `end`."""

    start: int
    end: int
    lines: Lines


class CannotPatch(Exception):
    """The statements of a script cannot be changed one by one."""


class _Heads(Writer):
    """Writes compound statements without their blocks."""

    def _part(self, node: ast.stmt, key: object, body: Sequence[ast.stmt], indent: str, head: str = "") -> None:
        pass

    def _alternative(self, node: ast.If, branch: ast.If, indent: str) -> None:
        pass


def apply(lines: Sequence[str], edits: Sequence[Edit]) -> Lines:
    """Return the edited lines. Raise CannotPatch if two edits concern the same lines."""
    found: Lines = []
    place = 0
    for edit in sorted(edits, key=lambda one: (one.start, one.end)):
        if edit.start < place:
            raise CannotPatch
        found += lines[place : edit.start]
        found += edit.lines
        place = edit.end
    return [*found, *lines[place:]]


class Patches:
    """The edits that turn the function `main` of a script into the generated one, if its structure stays the same.

    Args:
        text: the script that a person has written.
        matching: the statements that the generated ones replace.
        writer: writes changed statements.
        declared: the parameters of an action.

    Raises:
        CannotPatch: the structure of the generated function differs.
    """

    def __init__(self, text: Text, matching: Matching, writer: MergingWriter, declared: DeclaredOf) -> None:
        self.edits: list[Edit] = []
        self._text, self._matching, self._writer, self._declared = text, matching, writer, declared
        [(main, statement), *rest] = matching.written.items()
        for node, written in rest:
            self._change(node, written)
        self._change(main, statement)
        for block in statement.blocks:
            self._remove(block)
        self._add(main)

    def _change(self, node: ast.stmt, statement: Statement) -> None:
        if same(node, statement.node, self._declared):
            return
        indent = statement.block.indent
        if not statement.alone:
            raise CannotPatch
        heads = _Heads({}).statements([node], indent)
        if self._text.lines[statement.start].startswith(f"{indent}elif"):
            heads[0] = f"{indent}el{heads[0][len(indent) :]}"
        lines = self._writer.head(node, statement, heads, indent)
        self.edits.append(Edit(statement.start, statement.head_end, lines))

    # ------------------------------------------------------------------------------------------------ removal
    def _remove(self, block: Block) -> None:
        removed = [statement for statement in block.statements if self._is_removed(statement)]
        for statement in removed:
            if not statement.alone:
                raise CannotPatch
            self.edits.append(Edit(statement.above, statement.end, []))
        if removed and len(removed) == len(block.statements):
            last = removed[-1]
            self.edits[-1] = Edit(last.above, last.end, [f"{block.indent}pass"])
        for statement in block.statements:
            if statement not in removed:
                for inner in statement.blocks:
                    self._remove(inner)

    def _is_removed(self, statement: Statement) -> bool:
        if statement in self._matching.generated:
            return False
        node = statement.node
        if not statement.blocks:
            return bool(action_name(node)) or isinstance(node, ast.Assign | ast.AnnAssign)
        inside = list(statement.inside())
        if not any(one in self._matching.generated for one in inside):
            return any(action_name(one.node) for one in inside)
        if isinstance(node, ast.If):
            return False
        raise CannotPatch

    # ------------------------------------------------------------------------------------------------ addition
    def _add(self, owner: ast.stmt) -> None:
        for _, body in parts_of(owner):
            group: list[ast.stmt] = []
            before: ast.stmt | None = None
            for node in body:
                if node in self._matching.written:
                    self._insert(group, before, node)
                    group, before = [], node
                elif self._is_added(node):
                    group.append(node)
                self._add(node)
            self._insert(group, before, None)

    def _is_added(self, node: ast.stmt) -> bool:
        if not parts_of(node):
            return not isinstance(node, ast.Continue | ast.Return | ast.Pass) and _is_named(node)
        if not any(one in self._matching.written for one in walk([node])):
            return bool(names_in(node))
        if isinstance(node, ast.If):
            return False
        raise CannotPatch

    def _insert(self, group: Sequence[ast.stmt], before: ast.stmt | None, after: ast.stmt | None) -> None:
        if not group:
            return
        written = self._matching.written
        writer = Writer({})
        writer.unit = self._writer.unit
        if before is not None:
            statement = written[before]
            [*lines] = writer.statements([before, *group], statement.block.indent)
            skipped = len(writer.statements([before], statement.block.indent))
            place = statement.end
            lines = lines[skipped:]
        elif after is not None:
            statement = written[after]
            place, lines = statement.above, writer.statements(group, statement.block.indent)
        else:
            raise CannotPatch
        if not statement.alone:
            raise CannotPatch
        self.edits.append(Edit(place, place, lines))


def _is_named(node: ast.stmt) -> bool:
    return bool(action_name(node)) or isinstance(node, ast.Assign | ast.AnnAssign)
