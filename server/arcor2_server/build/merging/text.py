"""The text of a script as statements with the comments and blank lines around them.

The lines are those of the file, and the positions those of Python's syntax tree, so that nothing is lost that a person
has written. A tokenizer or a concrete syntax tree would take many times longer (decision record 27).
"""

import ast
import io
import tokenize
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Final

from arcor2_hw.parsing import parse

Lines = list[str]
_TAB: Final = 8


@dataclass(slots=True, eq=False)
class Statement:
    """A statement of a script. Lines count from 0; an end is the line after the last one.

    Args:
        node: its syntax tree.
        block: the block that contains it.
        number: its place in the block.
        above: the first line of the comments and blank lines above it.
        start: its first line.
        head_end: the end of the statement, or of the head of a compound statement.
        end: its end with all blocks.
        trailing: the comment behind it, or behind its head.
        alone: whether the lines of the statement, or of its head, contain nothing else.
        blocks: the blocks of a compound statement.
    """

    node: ast.stmt
    block: "Block"
    number: int
    above: int
    start: int
    head_end: int = 0
    end: int = 0
    trailing: str = ""
    alone: bool = True
    blocks: list["Block"] = field(default_factory=list)

    @property
    def next(self) -> "Statement | None":
        """The next statement of the block."""
        following = self.block.statements[self.number + 1 : self.number + 2]
        return following[0] if following else None

    @property
    def previous(self) -> "Statement | None":
        """The previous statement of the block."""
        return self.block.statements[self.number - 1] if self.number else None

    def part(self, key: object) -> "Block | None":
        """Return a block by its key."""
        return next((block for block in self.blocks if block.key == key), None)

    def inside(self) -> Iterator["Statement"]:
        """Return the statements of all blocks, in their order."""
        for block in self.blocks:
            for statement in block.statements:
                yield statement
                yield from statement.inside()


@dataclass(slots=True, eq=False)
class Block:
    """A block of a script.

    Args:
        key: "body", "else", or the number of an `except` block.
        above: the first line of the comments above its `else` or `except`, the same as `head` without such a line.
        head: the first line of its `else` or `except`.
        begin: the first line after its head.
        indent: the characters before its statements.
        trailing: the comment behind `else` or `except`.
        statements: its statements.
        tail: the first line of the comments after the last statement.
        end: the end of these comments.
    """

    key: object
    above: int
    head: int
    begin: int
    indent: str = ""
    trailing: str = ""
    statements: list[Statement] = field(default_factory=list)
    tail: int = 0
    end: int = 0


class Text:
    """A script with its statements.

    Raises:
        SyntaxError, ValueError, RecursionError, MemoryError: the script is not valid Python.
    """

    def __init__(self, source: str) -> None:
        module = parse(source, "script.py")
        self.lines: Lines = source.replace("\r\n", "\n").replace("\r", "\n").split("\n")
        self.module = Block("body", 0, 0, 0)
        self._fill(self.module, module.body, len(self.lines))

    def comments(self, start: int, end: int) -> Lines:
        """Return the comments in lines without code, without their indentation."""
        return [text for line in self.lines[start:end] if (text := line.strip()).startswith("#")]

    def inner_comments(self, statement: Statement) -> Lines:
        """Return the comments within the lines of a statement, or of its head, except the one behind it."""
        lines = self.lines[statement.start : statement.head_end]
        if len(lines) == 1 or not any("#" in line for line in lines):
            return []
        found = [
            token.string
            for token in tokenize.generate_tokens(io.StringIO("\n".join([*lines, ""])).readline)
            if token.type == tokenize.COMMENT
        ]
        return found[:-1] if statement.trailing else found

    # ------------------------------------------------------------------------------------------------ statements
    def _fill(self, block: Block, nodes: Sequence[ast.stmt], limit: int) -> None:
        """Add the statements of a block, which ends before line `limit`."""
        first = _first_line(nodes[0])
        line = self.lines[first]
        block.indent = line[: len(line) - len(line.lstrip())]
        place = block.begin
        for number, node in enumerate(nodes):
            bound = _first_line(nodes[number + 1]) if number + 1 < len(nodes) else limit
            statement = Statement(node, block, number, min(place, _first_line(node)), _first_line(node))
            block.statements.append(statement)
            self._measure(statement, bound)
            place = statement.end
        block.tail = block.end = place
        if line.startswith("elif", len(block.indent)):
            return  # the comment is indented like the statement after the whole condition
        width = _width(block.indent)
        for row in range(place, limit):
            text = self.lines[row]
            if text.strip().startswith("#"):
                if _width(text) < width:
                    break
                block.end = row + 1
            elif text.strip():
                break

    def _measure(self, statement: Statement, limit: int) -> None:
        node = statement.node
        before = self.lines[statement.start][: _column(self.lines, statement.start, node.col_offset)]
        statement.alone = not before.strip()
        match node:
            case ast.If(test=test) | ast.While(test=test):
                self._head(statement, test)
                self._parts(statement, [("body", node.body), ("else", node.orelse)], limit)
            case ast.FunctionDef(args=args):
                known = [each.annotation or each for each in (*args.args, *args.kwonlyargs)]
                self._head(statement, node.returns or (known[-1] if known else None), node.lineno - 1)
                self._parts(statement, [("body", node.body)], limit)
            case ast.With():
                last = node.items[-1]
                self._head(statement, last.optional_vars or last.context_expr)
                self._parts(statement, [("body", node.body)], limit)
            case ast.Try():
                self._head(statement, None)
                handlers = [(number, handler.body) for number, handler in enumerate(node.handlers)]
                rest = [("else", node.orelse), ("finally", node.finalbody)]
                self._parts(statement, [("body", node.body), *handlers, *rest], limit)
            case _:
                assert node.end_lineno is not None
                assert node.end_col_offset is not None
                row = node.end_lineno - 1
                statement.head_end = statement.end = row + 1
                rest_of_line = self.lines[row][_column(self.lines, row, node.end_col_offset) :].strip()
                statement.trailing = rest_of_line if rest_of_line.startswith("#") else ""
                statement.alone &= not rest_of_line or bool(statement.trailing)

    def _head(self, statement: Statement, last: ast.expr | ast.arg | None, row: int | None = None) -> None:
        """Find the end of the head of a compound statement: the first colon after the expression `last`."""
        row, rest = self._colon(statement.start if row is None else row, last)
        statement.head_end = row + 1
        statement.trailing = rest if rest.startswith("#") else ""
        statement.alone &= not rest or bool(statement.trailing)

    def _colon(self, row: int, last: ast.expr | ast.arg | None) -> tuple[int, str]:
        """Return the line of the first colon after an expression, or from a line on, and the text behind the colon."""
        column = 0
        if last is not None:
            assert last.end_lineno is not None
            assert last.end_col_offset is not None
            row = last.end_lineno - 1
            column = _column(self.lines, row, last.end_col_offset)
        while True:
            code, _, _ = self.lines[row][column:].partition("#")
            if ":" in code:
                place = self.lines[row].index(":", column)
                return row, self.lines[row][place + 1 :].strip()
            row, column = row + 1, 0

    def _parts(self, statement: Statement, parts: Sequence[tuple[object, Sequence[ast.stmt]]], limit: int) -> None:
        """Add the blocks of a compound statement."""
        filled = [(key, nodes) for key, nodes in parts if nodes]
        place = statement.head_end
        for number, (key, nodes) in enumerate(filled):
            block = Block(key, place, place, place)
            if number:
                block.head = self._part_head(statement, key, nodes, place)
                if not self._is_elif(key, nodes):
                    row, rest = self._colon(block.head, _kinds(statement.node, key))
                    block.begin = row + 1
                    block.trailing = rest if rest.startswith("#") else ""
                else:
                    block.begin = block.above
            statement.blocks.append(block)
            bound = limit
            if number + 1 < len(filled):
                bound = self._part_head(statement, *filled[number + 1], _last_line(nodes[-1]))
            self._fill(block, nodes, bound)
            place = block.end
        statement.end = place

    def _is_elif(self, key: object, nodes: Sequence[ast.stmt]) -> bool:
        first = nodes[0]
        if key != "else" or not isinstance(first, ast.If):
            return False
        return self.lines[first.lineno - 1].lstrip().startswith("elif")

    def _part_head(self, statement: Statement, key: object, nodes: Sequence[ast.stmt], place: int) -> int:
        """Return the line of `else`, `elif`, `except` or `finally`, the first line of code from `place` on."""
        if isinstance(key, int) and isinstance(statement.node, ast.Try):
            return statement.node.handlers[key].lineno - 1
        if self._is_elif(key, nodes):
            return nodes[0].lineno - 1
        while not (text := self.lines[place].strip()) or text.startswith("#"):
            place += 1
        return place


def _kinds(node: ast.stmt, key: object) -> ast.expr | None:
    """Return the kinds of errors of an `except` block."""
    return node.handlers[key].type if isinstance(node, ast.Try) and isinstance(key, int) else None


def _first_line(node: ast.stmt) -> int:
    decorators = getattr(node, "decorator_list", None)
    return (decorators[0].lineno if decorators else node.lineno) - 1


def _last_line(node: ast.stmt) -> int:
    assert node.end_lineno is not None
    return node.end_lineno


def _column(lines: Sequence[str], row: int, offset: int) -> int:
    """Return the column of a position, which syntax trees state in bytes."""
    line = lines[row]
    return max(offset, 0) if line.isascii() else len(line.encode()[: max(offset, 0)].decode())


def _width(line: str) -> int:
    text = line.expandtabs(_TAB)
    return len(text) - len(text.lstrip())
