"""URScript as a language: blocks, variables, conditions, loops and threads, to run the programs of clients.

A program is parsed line by line into statements, with Python expressions except for ``p[...]``. All variables are in
one scope. A call that waits (a motion, ``sync``, ``sleep``) must be a separate statement. As on the controller, a
program that cannot be parsed does not start, and an unknown name or function ends it. Source: Universal Robots, "The
URScript Programming Language".
"""

import ast
import math
import operator
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any, Final

from arcor2_fakes.ur.controller import Controller, Program, Steps
from arcor2_fakes.ur.urscript import Call, Interpreter, Pose

_OPERATORS: Final[dict[type[ast.AST], Callable[..., Any]]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Mod: operator.mod,
    ast.Eq: operator.eq,
    ast.NotEq: operator.ne,
    ast.Lt: operator.lt,
    ast.LtE: operator.le,
    ast.Gt: operator.gt,
    ast.GtE: operator.ge,
    ast.USub: operator.neg,
    ast.Not: operator.not_,
}
_BLOCK = re.compile(r"(def|thread)\s+(\w+)\s*\(\s*\)\s*:|(while|if|elif)\b(.+):|(else)\s*:")
_ASSIGNMENT = re.compile(r"(?:(?:global|local)\s+)?(\w+)\s*=(?!=)\s*(.+)")
_RUN = re.compile(r"run\s+(\w+)\s*\(\s*\)")
_HANDLING = re.compile(r"(kill|join)\s+(\w+)")
_MAX_AT_ONCE = 10_000  # statements in one control cycle; a larger number is treated as an infinite loop


@dataclass
class Statement:
    """One statement: `kind`, a name, an expression, and the statements of its block."""

    kind: str
    name: str = ""
    expression: ast.expr | None = None
    body: list["Statement"] = field(default_factory=list)
    other: list["Statement"] = field(default_factory=list)


def parse(text: str) -> list[Statement]:
    """Return the statements of a program. Raise `ValueError` naming a line that cannot be parsed."""
    lines = iter([line.split("#", 1)[0].strip() for line in text.splitlines()])
    body, end = _block(lines)
    if end:
        raise ValueError(f"{end!r} without a beginning")
    return body


def _block(lines: Iterator[str]) -> tuple[list[Statement], str]:
    """Return statements up to the line that ends them, and that line."""
    found: list[Statement] = []
    for line in lines:
        if not line:
            continue
        if line == "end" or line.startswith(("elif", "else")):
            return found, line
        block = _BLOCK.fullmatch(line)
        if block is None:
            found.append(_simple(line))
        elif block[1]:
            inner, end = _block(lines)
            found.append(Statement(block[1], block[2], body=_closed(inner, end)))
        else:
            found.append(_conditional(block[3], block[4], lines))
    return found, ""


def _closed(body: list[Statement], end: str) -> list[Statement]:
    if end != "end":
        raise ValueError(f"a block ends with {end!r}")
    return body


def _conditional(kind: str, condition: str, lines: Iterator[str]) -> Statement:
    made = Statement("while" if kind == "while" else "if", expression=_expression(condition))
    made.body, end = _block(lines)
    if kind != "while" and end.startswith("elif"):
        further = _BLOCK.fullmatch(end)
        if further is None:
            raise ValueError(f"cannot parse: {end}")
        made.other = [_conditional("elif", further[4], lines)]
    elif kind != "while" and end.startswith("else"):
        made.other = _closed(*_block(lines))
    else:
        _closed([], end)
    return made


def _simple(line: str) -> Statement:
    if line in ("break", "return", "halt"):
        return Statement(line)
    if (handling := _HANDLING.fullmatch(line)) is not None:
        return Statement(handling[1], handling[2])
    if (assignment := _ASSIGNMENT.fullmatch(line)) is not None and "(" not in line.split("=", 1)[0]:
        if (run := _RUN.fullmatch(assignment[2])) is not None:
            return Statement("run", assignment[1], _expression(run[1]))
        return Statement("assign", assignment[1], _expression(assignment[2]))
    return Statement("do", expression=_expression(line))


def _expression(text: str) -> ast.expr:
    try:
        return ast.parse(text.strip(), mode="eval").body
    except SyntaxError:
        raise ValueError(f"cannot parse: {text.strip()}") from None


class _AtOnce(Interpreter):
    """Runs only calls that take no time."""

    def statement(self, call: Call) -> Steps:
        """Run one call."""
        self.at_once(call)
        yield from ()


def run_secondary(controller: Controller, name: str, text: str) -> None:
    """Run a secondary program: at once, next to the playing one. Raise `ValueError` if it takes time."""
    for _ in WrittenProgram(controller, name, text.replace("sec", "def", 1), _AtOnce).run():
        raise ValueError("a secondary program takes no time")


class _Leave(Exception):
    """Unwinding by `break`, `return` or `halt`."""


class WrittenProgram(Program):
    """A program of a client."""

    def __init__(
        self, controller: Controller, name: str, text: str, interpreter: type[Interpreter] = Interpreter
    ) -> None:
        self.name = name
        self._c = controller
        self._interpreter = interpreter(controller)
        self._statements = parse(text)
        self._variables: dict[str, Any] = {"True": True, "False": False}
        self._defined: dict[str, list[Statement]] = {}
        self._threads: dict[int, Steps] = {}
        self._number = self._done = 0
        self._functions: dict[str, Callable[..., Any]] = self._table()

    def run(self) -> Steps:
        """Run all threads, one control cycle at a time, until the main thread ends."""
        main = self._main()
        while True:
            self._done = 0
            try:
                next(main)
            except StopIteration:
                return
            for number, thread in tuple(self._threads.items()):
                try:
                    next(thread)
                except (StopIteration, _Leave):
                    self._threads.pop(number, None)
            yield

    def _main(self) -> Steps:
        try:
            yield from self._run(self._statements)
            for statement in self._statements:
                if statement.kind == "def":
                    yield from self._run(statement.body)
        except _Leave:
            return

    def _run(self, statements: list[Statement]) -> Steps:
        for statement in statements:
            self._done += 1
            if self._done > _MAX_AT_ONCE:
                raise ValueError("an infinite loop")
            yield from self._statement(statement)

    def _statement(self, statement: Statement) -> Steps:
        expression = statement.expression
        match statement.kind:
            case "def" | "thread":
                self._defined[statement.name] = statement.body
            case "assign":
                self._variables[statement.name] = self.value(expression)
            case "if":
                yield from self._run(statement.body if self.value(expression) else statement.other)
            case "while":
                while self.value(expression):
                    try:
                        yield from self._run(statement.body)
                    except _Leave as leave:
                        if str(leave) != "break":
                            raise
                        break
            case "run":
                assert isinstance(expression, ast.Name)
                self._number += 1
                self._threads[self._number] = self._run(self._defined[expression.id])
                self._variables[statement.name] = self._number
            case "kill":
                thread = self._threads.pop(self._variables[statement.name], None)
                if thread is not None:
                    thread.close()
                    self._c.arm.halt()
            case "join":
                while self._variables[statement.name] in self._threads:
                    yield
            case "do":
                yield from self._call(expression)
            case _:
                raise _Leave(statement.kind)

    def _call(self, node: ast.expr | None) -> Steps:
        if not isinstance(node, ast.Call) or not isinstance(node.func, ast.Name):
            raise ValueError("a statement that does nothing")
        name = node.func.id
        if name in self._defined:
            try:
                yield from self._run(self._defined[name])
            except _Leave as leave:
                if str(leave) != "return":
                    raise
        elif name in self._functions:
            self.value(node)
        else:
            named = {keyword.arg: self.value(keyword.value) for keyword in node.keywords if keyword.arg}
            yield from self._interpreter.statement(Call(name, tuple(map(self.value, node.args)), named))

    # ------------------------------------------------------------------------------------------------ expressions
    def value(self, node: ast.expr | None) -> Any:
        """Return the value of an expression. Raise `ValueError`, `LookupError`, `TypeError`."""
        match node:
            case ast.Constant():
                return node.value
            case ast.Name():
                return self._variables[node.id]
            case ast.List() | ast.Tuple():
                return tuple(map(self.value, node.elts))
            case ast.Subscript(value=ast.Name(id="p")):
                return Pose(self.value(node.slice))
            case ast.Subscript():
                return self.value(node.value)[self.value(node.slice)]
            case ast.BinOp():
                return _OPERATORS[type(node.op)](self.value(node.left), self.value(node.right))
            case ast.UnaryOp():
                return _OPERATORS[type(node.op)](self.value(node.operand))
            case ast.BoolOp():
                each = map(self.value, node.values)
                return all(each) if isinstance(node.op, ast.And) else any(each)
            case ast.Compare(ops=[op], comparators=[right]):
                return _OPERATORS[type(op)](self.value(node.left), self.value(right))
            case ast.Call(func=ast.Name(id=name)) if name in self._functions:
                return self._functions[name](*map(self.value, node.args))
        raise ValueError(f"cannot parse: {ast.unparse(node) if node is not None else 'nothing'}")

    def _table(self) -> dict[str, Callable[..., Any]]:
        c = self._c

        def set_watchdog(variable: str, frequency: float = 10.0, action: str = "stop") -> None:
            register = re.fullmatch(r"input_int_register_(\d+)", variable)
            if register is None or action != "stop":
                raise ValueError("only a watchdog on an integer register that stops the program is modelled")
            c.set_watchdog(int(register[1]), frequency)

        return {
            "get_tcp_force": lambda: Pose(c.tcp_force),
            "get_actual_tcp_pose": lambda: Pose(c.arm.pose),
            "get_actual_joint_positions": lambda: c.arm.q,
            "read_input_integer_register": lambda register: c.input_ints[register],
            "read_input_float_register": lambda register: c.input_doubles[register],
            "get_standard_digital_in": lambda number: bool(c.digital_inputs >> number & 1),
            "rtde_set_watchdog": set_watchdog,
            "is_steady": lambda: not c.arm.moving,
            "sqrt": math.sqrt,
            "norm": lambda a: math.hypot(*a) if isinstance(a, tuple) else abs(a),
        }
