"""URScript of our motion programs: paths with blends, and lines that end at a force. Pure text, no I/O.

ur_rtde's own paths are not used: they arm no watchdog, and a force is checked only after two network hops. A motion
program checks the force in every control cycle. It stops by its own watchdog, by a register and at its force, and
writes the outcome to an output register. Source: Universal Robots, "The URScript Programming Language".
"""

import enum
from collections.abc import Sequence
from typing import Final, NamedTuple

from arcor2_hw.data.geometry import Pose

from .geometry import to_vector

STATES: Final = 8
"""Factor in the output register, which contains `STATES` times the number of the run, plus its state."""


class RunState(enum.IntEnum):
    """State of a run."""

    RUNNING = 0
    ARRIVED = 1
    PUSHED = 2
    STOPPED = 3
    STOPPING = 4


ENDED: Final = frozenset({RunState.ARRIVED, RunState.PUSHED, RunState.STOPPED})


class Registers(NamedTuple):
    """Integer registers of a run: inputs for the watchdog signal and the stop request, an output for the state."""

    kick: int
    stop: int
    state: int

    @classmethod
    def of(cls, upper: bool) -> "Registers":
        """Return the registers that ur_rtde leaves free, in the upper or lower range."""
        first = 42 if upper else 18
        return cls(first, first + 1, first)


class Limit(NamedTuple):
    """Force at which a run ends, N: along a direction in the controller's base, or the magnitude."""

    force: float
    direction: tuple[float, float, float] | None = None


class Tool(NamedTuple):
    """Tool at the flange: TCP in the flange, mass in kg, center of gravity in m, inertia in kg m² or None."""

    tcp: Pose
    mass: float
    cog: tuple[float, float, float]
    inertia: tuple[float, ...] | None = None


def numbers(values: Sequence[float]) -> str:
    """Return numbers as a URScript list."""
    return "[" + ", ".join(f"{value:.9g}" for value in values) + "]"


def linear(vector: Sequence[float], speed: float, acceleration: float, blend: float = 0.0) -> str:
    """Return a movel to a pose of the controller's base."""
    return f"movel(p{numbers(vector)}, a={acceleration:.6g}, v={speed:.6g}, r={blend:.6g})"


def joint(q: Sequence[float], speed: float, acceleration: float, blend: float = 0.0) -> str:
    """Return a movej to joint values."""
    return f"movej({numbers(q)}, a={acceleration:.6g}, v={speed:.6g}, r={blend:.6g})"


def tool_lines(tool: Tool) -> list[str]:
    """Return the lines that set the tool."""
    lines = [f"set_tcp(p{numbers(to_vector(tool.tcp))})"]
    if tool.inertia is None:
        return [*lines, f"set_payload({tool.mass:.6g}, {numbers(tool.cog)})"]
    return [*lines, f"set_target_payload({tool.mass:.6g}, {numbers(tool.cog)}, {numbers(tool.inertia)})"]


def _push(limit: Limit) -> list[str]:
    """Return the lines that set `push` to the change of the force since the start, and `pressed` if it increased.

    A decreasing force means that a contact is released. The sign of the force does not matter.
    """

    def along(force: str) -> str:
        if limit.direction is None:
            return f"norm([{force.format(0)}, {force.format(1)}, {force.format(2)}])"
        terms = (f"{force.format(i)} * {value:.9g}" for i, value in enumerate(limit.direction))
        return f"norm({' + '.join(terms)})"

    return [f"push = {along('(force[{0}] - rest[{0}])')}", f"pressed = {along('force[{0}]')} > {along('rest[{0}]')}"]


def motion_program(
    number: int,
    moves: Sequence[str],
    registers: Registers,
    watchdog: float,
    tool: Tool,
    deceleration: float,
    limit: Limit | None = None,
) -> str:
    """Return the program of a run.

    Args:
        number: Number of the run.
        moves: Lines of URScript that move the arm.
        registers: Registers of the run.
        watchdog: Watchdog frequency, Hz; it is armed before the arm moves.
        tool: Tool to set.
        deceleration: Deceleration of a stop, m/s².
        limit: Force at which the run ends.
    """

    def report(state: RunState) -> str:
        return f"write_output_integer_register({registers.state}, {number * STATES + state})"

    watched: list[str] = []
    if limit is not None:
        watched = [
            "    else:",
            "      force = get_tcp_force()",
            *(f"      {line}" for line in _push(limit)),
            f"      if pressed and push > {limit.force:.6g} and state == {RunState.RUNNING}:",
            f"        state = {RunState.PUSHED}",
            "      end",
        ]
    lines = [
        "def arcor2_motion():",
        f'  rtde_set_watchdog("input_int_register_{registers.kick}", {watchdog:.6g}, "stop")',
        f"  {report(RunState.RUNNING)}",
        *(f"  {line}" for line in tool_lines(tool)),
        f"  global state = {RunState.RUNNING}",
        "  thread moves():",
        *(f"    {line}" for line in moves),
        f"    state = {RunState.ARRIVED}",
        "  end",
        "  sync()",
        *(["  rest = get_tcp_force()"] if limit is not None else []),
        "  mover = run moves()",
        f"  while state == {RunState.RUNNING}:",
        f"    if read_input_integer_register({registers.stop}) != 0:",
        f"      state = {RunState.STOPPED}",
        *watched,
        "    end",
        "    sync()",
        "  end",
        f"  if state != {RunState.ARRIVED}:",
        f"    {report(RunState.STOPPING)}",
        "    kill mover",
        f"    stopl({deceleration:.6g})",
        "  end",
        f"  write_output_integer_register({registers.state}, {number * STATES} + state)",
        "end",
    ]
    return "\n".join(lines) + "\n"
