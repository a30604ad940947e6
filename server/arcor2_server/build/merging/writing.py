"""Writes generated statements with the text, comments and blank lines of the statements that they replace."""

import ast
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence

from arcor2_server.build.merging.equivalence import DeclaredOf, same
from arcor2_server.build.merging.matching import Matching, parts_of
from arcor2_server.build.merging.text import Block, Lines, Statement, Text
from arcor2_server.build.style import Writer


def moved(lines: Sequence[str], indent: str, to: str) -> Lines | None:
    """Return lines with another indentation, None if the text of a string would change."""
    if indent == to:
        return list(lines)
    if any(quotes in line for line in lines for quotes in ('"""', "'''")):
        return None
    return [to + line[len(indent) :] if line.startswith(indent) else line for line in lines]


class MergingWriter(Writer):
    """Writes the generated function `main`.

    Args:
        comments: the comments above generated statements.
        text: the script that a person has written.
        matching: the statements that the generated ones replace.
        declared: the parameters of an action.
    """

    def __init__(self, comments: Mapping[ast.stmt, str], text: Text, matching: Matching, declared: DeclaredOf) -> None:
        super().__init__(comments)
        self._text, self._matching, self._declared = text, matching, declared
        self._titles = set(text.comments(0, len(text.lines)))
        [main] = [statement for statement in text.module.statements if isinstance(statement.node, ast.FunctionDef)]
        self.unit = main.blocks[0].indent
        self._adopted: dict[Statement, Lines] = defaultdict(list)
        """Comments of lines that the generated script does not have, by the statement above which they are written."""
        for statement in main.inside():
            self._adopt(statement)

    def _adopt(self, statement: Statement) -> None:
        """Move the comments of removed lines to the first action to which these lines led."""
        node = self._matching.generated.get(statement)
        text = self._text
        if node is None:
            found = text.comments(statement.above, statement.start) + text.inner_comments(statement)
            # The comments above `try` belong to its action.
            blocks = statement.blocks[:1] if isinstance(statement.node, ast.Try) else statement.blocks
            self._hand_over([*found, statement.trailing], (one for block in blocks for one in _inside(block)))
        present = set() if node is None else {key for key, body in parts_of(node) if body}
        for block in statement.blocks:
            if block.key in present:
                continue
            comments = [*text.comments(block.above, block.begin), block.trailing] if block.key != "body" else []
            self._hand_over([*comments, *text.comments(block.tail, block.end)], _inside(block))

    def _hand_over(self, comments: Sequence[str], statements: Iterator[Statement]) -> None:
        if any(comments):
            target = next((one for one in statements if one in self._matching.generated), None)
            if target is not None:
                self._adopted[target] += filter(None, comments)

    # ------------------------------------------------------------------------------------------------ comments
    def _above(self, before: ast.stmt | None, node: ast.stmt, indent: str) -> None:
        statement = self._matching.written.get(node)
        if statement is None:
            if (title := self._comments.get(node)) is not None and f"# {title}" in self._titles:
                self._lines += [""] if before is not None else []
            else:
                super()._above(before, node, indent)
            return
        self._comments_above(statement, indent)

    def _comments_above(self, statement: Statement, indent: str) -> None:
        lines = self._text.lines[statement.above : statement.start]
        if comments := self._adopted.get(statement):
            blank = next((number for number, line in enumerate(lines) if line.strip()), len(lines))
            lines[blank:blank] = comments
        self._write_comments(lines, indent)

    def _write_comments(self, lines: Sequence[str], indent: str) -> None:
        self._lines += [f"{indent}{text}" if (text := line.strip()) else "" for line in lines]

    # ------------------------------------------------------------------------------------------------ statements
    def _head(self, node: ast.stmt, lines: Sequence[str], indent: str) -> None:
        statement = self._matching.written.get(node)
        self._lines += lines if statement is None else self.head(node, statement, lines, indent)

    def head(self, node: ast.stmt, statement: Statement, lines: Sequence[str], indent: str) -> Lines:
        """Return the lines of a statement or of its head: the hand-written ones if they are equivalent to `lines`."""
        text = self._text
        own = text.lines[statement.start : statement.head_end]
        if statement.alone and same(node, statement.node, self._declared):
            kept = moved(own, statement.block.indent, indent)
            if kept is not None:
                return self._with_word(lines, kept, indent)
        inner = [f"{indent}{comment}" for comment in text.inner_comments(statement)]
        return [*inner, *_with_trailing(lines, statement.trailing)]

    @staticmethod
    def _with_word(lines: Sequence[str], kept: Lines, indent: str) -> Lines:
        """Return the head of a condition with `if` or `elif`, as the generated one has it."""
        for word, other in (("if", "elif"), ("elif", "if")):
            if lines[0].startswith((f"{indent}{word} ", f"{indent}{word}(")) and kept[0].startswith(f"{indent}{other}"):
                kept[0] = f"{indent}{word}{kept[0][len(indent) + len(other) :]}"
                break
        return kept

    def _alternative(self, node: ast.If, branch: ast.If, indent: str) -> None:
        statement = self._matching.written.get(branch)
        owner = self._matching.written.get(node)
        block = None if owner is None else owner.part("else")
        if block is not None and block.begin > block.above:
            self._part_comments(block, indent)
        if statement is not None:
            self._comments_above(statement, indent)
        super()._alternative(node, branch, indent)

    def _part_comments(self, block: Block, indent: str) -> None:
        trailing = [block.trailing] if block.trailing else []
        self._write_comments([*self._text.comments(block.above, block.head), *trailing], indent)

    def _part(self, node: ast.stmt, key: object, body: Sequence[ast.stmt], indent: str, head: str = "") -> None:
        statement = self._matching.written.get(node)
        block = None if statement is None else statement.part(key)
        if head and block is not None:
            self._write_comments(self._text.lines[block.above : block.head], indent)
            self._lines += _with_trailing([f"{indent}{head}"], block.trailing)
        elif head:
            self._lines.append(f"{indent}{head}")
        deeper = indent + self.unit
        if block is not None and isinstance(node, ast.FunctionDef) and _is_text(block.statements[0].node):
            first = block.statements[0]
            self._comments_above(first, deeper)
            self._lines += moved(self._text.lines[first.start : first.end], block.indent, deeper) or []
        self._block(body, deeper)
        if block is not None:
            self._write_comments(self._text.lines[block.tail : block.end], deeper)


def _inside(block: Block) -> Iterator[Statement]:
    for statement in block.statements:
        yield statement
        yield from statement.inside()


def _with_trailing(lines: Sequence[str], comment: str) -> Lines:
    """Return generated lines with a comment behind the last one."""
    return [*lines[:-1], f"{lines[-1]}  {comment}"] if comment else list(lines)


def _is_text(node: ast.stmt) -> bool:
    return isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)
