"""URScript of clients: splitting programs, calls with literal arguments, and their effects.

Programs with variables, conditions, loops and threads are run by `language`. Motions blend with one of the same kind
only. The blend starts when the first motion brakes, so that a large radius is not used in full.
"""

import ast
import logging
import math
import operator
import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

from arcor2_fakes.ur.controller import Controller, Program, Steps
from arcor2_fakes.ur.kinematics import from_pose
from arcor2_fakes.ur.motion import Motion
from arcor2_fakes.ur.paths import JointBlend, JointMove, LinearBlend, LinearMove

log = logging.getLogger("script")

_DEFINITION = re.compile(r"^(def|sec)\s+(\w+)\s*\(\s*\)\s*:")
_BLOCK = re.compile(r"\s*(def|sec|thread|while|if)\b.*:\s*(#.*)?")
MAX_SCRIPT = 4 << 20


class Pose(tuple[float, ...]):
    """A pose ``p[x, y, z, rx, ry, rz]``, as opposed to a list of joints."""


@dataclass(frozen=True)
class Call:
    """One statement: a function with its arguments."""

    name: str
    arguments: tuple[Any, ...] = ()
    named: dict[str, Any] = field(default_factory=dict)

    def get(self, name: str, position: int, default: Any) -> Any:
        """Return an argument by name, else by position."""
        if name in self.named:
            return self.named[name]
        return self.arguments[position] if position < len(self.arguments) else default


_OPERATORS: dict[type[ast.operator], Callable[[Any, Any], Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
}


def _literal(node: ast.expr) -> Any:
    """Return the value of a literal, of a pose, or of arithmetic on numbers (clients write offsets as sums)."""
    if isinstance(node, ast.Subscript) and isinstance(node.value, ast.Name) and node.value.id == "p":
        return Pose(_literal(node.slice))
    if isinstance(node, ast.List | ast.Tuple):
        return tuple(_literal(element) for element in node.elts)
    if isinstance(node, ast.BinOp) and type(node.op) in _OPERATORS:
        return _OPERATORS[type(node.op)](_literal(node.left), _literal(node.right))
    return ast.literal_eval(node)


def parse_call(line: str) -> Call | None:
    """Return the call on a line; None if there is none, or its arguments are not literal."""
    try:
        node = ast.parse(line.strip(), mode="eval").body
        if not isinstance(node, ast.Call) or not isinstance(node.func, ast.Name):
            return None
        named = {k.arg: _literal(k.value) for k in node.keywords if k.arg}
        return Call(node.func.id, tuple(_literal(a) for a in node.args), named)
    except (SyntaxError, ValueError, TypeError, ZeroDivisionError, RecursionError):
        return None


def calls(text: str) -> list[Call]:
    """Return the calls of a program's body in order."""
    found = []
    for line in text.splitlines():
        bare = line.split("#", 1)[0].strip()
        if not bare or bare == "end" or _DEFINITION.match(bare):
            continue
        call = parse_call(bare)
        if call is None:
            log.info("line not understood: %s", bare)
        else:
            found.append(call)
    return found


class Splitter:
    """Splits received text into programs: from ``def`` or ``sec`` to ``end``, or a single line."""

    def __init__(self) -> None:
        self._rest = b""
        self._lines: list[str] = []
        self._depth = 0

    def feed(self, data: bytes) -> Iterator[tuple[str, str, str]]:
        """Return the programs completed by `data`, as (kind, name, text); kind is def, sec or line.

        Raise `ValueError` if one is too long.
        """
        *lines, self._rest = (self._rest + data).split(b"\n")
        if len(self._rest) + sum(map(len, self._lines)) > MAX_SCRIPT:
            raise ValueError("the script is too long")
        for raw in lines:
            line = raw.decode("utf-8", "replace").rstrip("\r")
            if self._lines:
                self._lines.append(line)
                if _BLOCK.fullmatch(line):
                    self._depth += 1
                elif line.split("#", 1)[0].strip() == "end":
                    self._depth -= 1
                if self._depth == 0:
                    text = "\n".join(self._lines)
                    definition = _DEFINITION.match(text)
                    assert definition is not None
                    self._lines = []
                    yield definition[1], definition[2], text
            elif _DEFINITION.match(line):
                self._lines, self._depth = [line], 1
            elif line.strip():
                yield "line", line.strip(), line


class Interpreter:
    """Runs calls on the controller. Only motions take time."""

    def __init__(self, controller: Controller) -> None:
        self.controller = controller
        self._left: Motion | None = None
        """Motion that a blend has left early."""

    def run(self, statements: Sequence[Call]) -> Steps:
        """Run all calls in order. Raise `MotionRefused`, or `ValueError` and the like."""
        for call in statements:
            yield from self.statement(call)

    def statement(self, call: Call) -> Steps:
        """Run one call."""
        match call.name:
            case "movej":
                goal = call.get("q", 0, None)
                q = self.joints(goal) if isinstance(goal, Pose) else goal
                yield from self.move_joints(q, call.get("v", 2, 1.05), call.get("a", 1, 1.4), call.get("r", 4, 0.0))
            case "movel" | "movep":
                goal = call.get("pose", 0, None)
                v, a, r = call.get("v", 2, 0.25), call.get("a", 1, 1.2), call.get("r", 4, 0.0)
                yield from self.move_linear(goal, v, a, isinstance(goal, Pose), r)
            case "stopj" | "stopl":
                yield from self.stop(call.get("a", 0, 2.0), linear=call.name == "stopl")
            case "sleep":
                for _ in range(round(call.get("t", 0, 0.0) * self.controller.frequency)):
                    yield
            case "sync":
                yield
            case _:
                self.at_once(call)

    def at_once(self, call: Call) -> None:
        """Run a call that takes no time: outputs, registers, payload, TCP. Raise `ValueError` for others."""
        c = self.controller
        first, second = call.get("n", 0, 0), call.get("b", 1, 0)
        match call.name:
            case "set_standard_digital_out" | "set_digital_out":
                self._output(first, second)
            case "set_configurable_digital_out":
                self._output(8 + first, second)
            case "set_tool_digital_out":
                self._output(16 + first, second)
            case "write_output_integer_register":
                c.output_ints[first] = second
            case "write_output_float_register":
                c.output_doubles[first] = second
            case "set_tcp":
                c.tcp_offset = tuple(first)
                c.arm.set_tcp(first)
            case "set_payload":
                c.payload, c.payload_cog = float(first), tuple(second or c.payload_cog)
                c.payload_inertia = (0.0,) * 6
            case "set_target_payload":
                inertia = call.get("inertia", 2, (0.0,) * 6)
                c.payload, c.payload_cog, c.payload_inertia = float(first), tuple(second), tuple(inertia)
            case "textmsg" | "popup":
                log.info("message: %s", call.arguments)
            case _:
                raise ValueError(f"{call.name} is not modelled, or takes time")

    def _output(self, bit: int, on: bool) -> None:
        c = self.controller
        c.digital_outputs = c.digital_outputs & ~(1 << bit) | int(bool(on)) << bit
        c.changed()

    def joints(self, pose: Sequence[float], near: Sequence[float] | None = None) -> tuple[float, ...]:
        """Return the joint positions for a pose (get_inverse_kin). Raise `NoSolution`."""
        return self.controller.chain.inverse(from_pose(pose), near or self.controller.arm.q)

    def move_joints(self, q: Sequence[float], velocity: float, acceleration: float, blend: float = 0.0) -> Steps:
        """Run a movej to its end, to its blend, or until another motion replaces it."""
        arm = self.controller.arm
        self._check(q, velocity, acceleration)
        self.controller.note_command("movej", q=list(q), v=velocity, a=acceleration, r=blend)
        blends = isinstance(arm.motion, JointMove | JointBlend)
        yield from self._free(blends)
        arm.move_joints(q, velocity, acceleration, blends)
        yield from self._to_end(blend, self.controller.chain.forward(q)[3])

    def move_linear(
        self, goal: Sequence[float], velocity: float, acceleration: float, is_pose: bool, blend: float = 0.0
    ) -> Steps:
        """Run a movel to a pose, or to the pose of joint values."""
        arm = self.controller.arm
        self._check(goal, velocity, acceleration)
        target = from_pose(goal) if is_pose else self.controller.chain.forward(goal)
        self.controller.note_command("movel", goal=list(goal), v=velocity, a=acceleration, r=blend)
        blends = isinstance(arm.motion, LinearMove | LinearBlend)
        yield from self._free(blends)
        arm.move_linear(target, velocity, acceleration, blends)
        yield from self._to_end(blend, target[3])

    def _free(self, blends: bool) -> Steps:
        """Wait until the next motion may start: at once if it blends with the previous one."""
        arm = self.controller.arm
        while arm.moving and not (blends and arm.motion is self._left):
            yield

    def stop(self, deceleration: float, linear: bool) -> Steps:
        """Run a stopl or stopj until standstill."""
        arm = self.controller.arm
        self.controller.note_command("stopl" if linear else "stopj", a=deceleration)
        arm.halt(max(0.01, deceleration), linear)
        yield from self._to_end()

    def _to_end(self, blend: float = 0.0, corner: Sequence[float] = ()) -> Steps:
        arm = self.controller.arm
        motion = arm.motion
        while motion is not None and arm.motion is motion:
            if blend > 0.0 and motion.along_path and _rounds(motion) and math.dist(arm.pose[:3], corner) <= blend:
                self._left = motion
                return
            yield

    @staticmethod
    def _check(goal: Sequence[float], velocity: float, acceleration: float) -> None:
        if len(goal) != 6 or not all(map(math.isfinite, goal)):
            raise ValueError("a goal is six numbers")
        if not (0.0 < velocity < math.inf and 0.0 < acceleration < math.inf):
            raise ValueError("a motion needs a velocity and an acceleration above zero")


def _rounds(motion: Motion) -> bool:
    return isinstance(motion, JointMove | JointBlend | LinearMove | LinearBlend) and motion.braking


class ForeignProgram(Program):
    """A foreign program: moves between two configurations forever."""

    def __init__(self, controller: Controller, name: str = "production.urp") -> None:
        self.name = name
        self._controller = controller
        self._interpreter = Interpreter(controller)

    def run(self) -> Steps:
        """Run until the program is stopped."""
        here = self._controller.arm.q
        there = (here[0] + 0.4, *here[1:])
        while True:
            yield from self._interpreter.move_joints(there, 0.6, 1.2)
            yield from self._interpreter.move_joints(here, 0.6, 1.2)
