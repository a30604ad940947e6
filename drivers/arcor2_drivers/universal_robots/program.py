"""The URScript of our own motions: paths with blends, and lines that end at a force. Pure text, no I/O.

Beside ur_rtde's program because that one arms no watchdog before its path runs, and because a force is looked at in
every control cycle there, not after two network hops. The program stops by its own watchdog, by a register, and at
its force; what became of it stands in an output register. Source of the words: Universal Robots, "The URScript
Programming Language".
"""

import enum
from collections.abc import Sequence
from typing import Final, NamedTuple

from arcor2_hw.data.geometry import Pose

from .frames import to_vector

STATES: Final = 8
"""The output register holds the number of the run times this, and the state of it."""


class RunState(enum.IntEnum):
    """How far a run is, in the output register."""

    RUNNING = 0
    ARRIVED = 1
    PUSHED = 2
    STOPPED = 3
    STOPPING = 4


ENDED: Final = frozenset({RunState.ARRIVED, RunState.PUSHED, RunState.STOPPED})


class Registers(NamedTuple):
    """The integer registers of a run: kicks and the wish to stop go in, its state comes out."""

    kick: int
    stop: int
    state: int

    @classmethod
    def of(cls, upper: bool) -> "Registers":
        """Give those that ur_rtde leaves to its users, in the half that is ours."""
        first = 42 if upper else 18
        return cls(first, first + 1, first)


class Limit(NamedTuple):
    """A force at which a run ends, N; counted along a direction in the controller's base, or as a whole."""

    force: float
    direction: tuple[float, float, float] | None = None


class Tool(NamedTuple):
    """What hangs on the flange: TCP (in the flange), mass kg, centre of gravity m, inertia kg m² or None."""

    tcp: Pose
    mass: float
    cog: tuple[float, float, float]
    inertia: tuple[float, ...] | None = None


def numbers(values: Sequence[float]) -> str:
    """Give numbers as a URScript list."""
    return "[" + ", ".join(f"{value:.9g}" for value in values) + "]"


def linear(vector: Sequence[float], speed: float, acceleration: float, blend: float = 0.0) -> str:
    """Give a movel to a pose of the controller's base."""
    return f"movel(p{numbers(vector)}, a={acceleration:.6g}, v={speed:.6g}, r={blend:.6g})"


def joint(q: Sequence[float], speed: float, acceleration: float, blend: float = 0.0) -> str:
    """Give a movej to joint values."""
    return f"movej({numbers(q)}, a={acceleration:.6g}, v={speed:.6g}, r={blend:.6g})"


def tool_lines(tool: Tool) -> list[str]:
    """Give what tells the controller of its tool."""
    told = [f"set_tcp(p{numbers(to_vector(tool.tcp))})"]
    if tool.inertia is None:
        return [*told, f"set_payload({tool.mass:.6g}, {numbers(tool.cog)})"]
    return [*told, f"set_target_payload({tool.mass:.6g}, {numbers(tool.cog)}, {numbers(tool.inertia)})"]


def _push(limit: Limit) -> list[str]:
    """Give the lines that set `push` to the change of the force since the start, and `pressed` to whether it grew.

    A force that becomes less is that of a contact that is left; whichever sign a contact has, it is felt.
    """

    def along(force: str) -> str:
        if limit.direction is None:
            return f"norm([{force.format(0)}, {force.format(1)}, {force.format(2)}])"
        parts = (f"{force.format(i)} * {value:.9g}" for i, value in enumerate(limit.direction))
        return f"norm({' + '.join(parts)})"

    return [
        f"push = {along('(force[{0}] - rest[{0}])')}",
        f"pressed = {along('force[{0}]')} > {along('rest[{0}]')}",
    ]


def motion_program(
    number: int,
    moves: Sequence[str],
    registers: Registers,
    watchdog: float,
    tool: Tool,
    deceleration: float,
    limit: Limit | None = None,
) -> str:
    """Give the program of one run: `watchdog` in Hz is armed before anything moves, `deceleration` in m/s²."""

    def tell(state: RunState) -> str:
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
        f"  {tell(RunState.RUNNING)}",
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
        f"    {tell(RunState.STOPPING)}",
        "    kill mover",
        f"    stopl({deceleration:.6g})",
        "  end",
        f"  write_output_integer_register({registers.state}, {number * STATES} + state)",
        "end",
    ]
    return "\n".join(lines) + "\n"
