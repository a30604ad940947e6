"""The RAPID motion server of one arm: lines of numeric codes on a command socket and on a watch socket.

A line is ``seq code argument... *check``: at most 79 characters, fields separated by one blank, the check being the sum
of position times character code, from 1, modulo 997, of all before the asterisk. An answer is ``seq code status
value... *check``. As in RAPID, nothing but the watch socket is read while the arm moves.
"""

import math
import time
from collections import deque
from collections.abc import Callable
from typing import Final

import numpy as np

from arcor2_fakes.abb_yumi.arm import Arm
from arcor2_fakes.abb_yumi.controller import Controller
from arcor2_fakes.abb_yumi.kinematics import LIMITS, Array, NotReachable, Target, pose_of, quaternion
from arcor2_fakes.wire import Connection, TcpWire

VERSION: Final = 1
LONGEST_LINE: Final = 79
TRAP_PERIOD: Final = 0.05
"""Seconds between two looks at the watch socket while the arm moves."""
PARTNER_WITHIN: Final = 2.0
WATCHDOG: Final = (0.1, 5.0)
MOST_WAYPOINTS: Final = 50

DONE, ACCEPTED, STOPPED, WATCHDOG_STOPPED = 0, 1, 2, 3
BAD_CHECK, BAD_CODE, BAD_COUNT, BAD_VALUE, UNREACHABLE, NO_SESSION, BY_HAND, NO_PARTNER = 10, 11, 12, 13, 14, 15, 16, 20

COUNTS: Final = {1: 0, 2: 1, 3: 0, 4: 2, 5: 1, 6: 7, 7: 4, 10: 0, 11: 0, 12: 0, 20: 7, 21: 4, 22: 8, 23: 0, 24: 0}
COUNTS_OF_ACTS: Final = {
    30: 1,
    31: 0,
    32: 1,
    33: 0,
    34: 2,
    40: 0,
    41: 0,
    42: 0,
    50: 0,
    51: 1,
    52: 1,
    53: 0,
    54: 1,
    55: 1,
}
ARGUMENTS: Final = COUNTS | COUNTS_OF_ACTS
"""How many numbers each code takes."""
NEED_SESSION: Final = frozenset({6, 7, 30, 31, 32, 33, 34, 50, 51, 52, 54, 55})


_PARTS: Final = frozenset({12, 42})  # answers that hold a quaternion


class Rejected(Exception):
    """A command was not done; `args[0]` is the status."""


def check(text: str) -> int:
    """Give the check number of a line's text."""
    return sum(place * ord(sign) for place, sign in enumerate(text, 1)) % 997


def framed(text: str) -> bytes:
    """Give the line of a text."""
    return f"{text}*{check(text)}\n".encode()


def parsed(line: str) -> tuple[int, int, list[float]]:
    """Give sequence number, code and arguments of a line. Raises Rejected."""
    text, star, number = line.rpartition("*")
    if not star or len(line) > LONGEST_LINE or number != str(check(text)):
        raise Rejected(BAD_CHECK)
    try:
        sequence, code, *arguments = text.split(" ")
        values = [float(each) for each in arguments]
        if not all(map(math.isfinite, values)):
            raise ValueError
        return int(sequence), int(code), values
    except ValueError:
        raise Rejected(BAD_VALUE) from None


class Lines:
    """A connection's bytes as lines, waiting until the server looks at them."""

    def __init__(self, connection: Connection) -> None:
        self.connection = connection
        self.waiting: deque[str] = deque()
        self._rest = b""
        connection.received = self._feed

    def _feed(self, data: bytes) -> None:
        *lines, self._rest = (self._rest + data).split(b"\n")
        self._rest = self._rest[-2 * LONGEST_LINE :]
        self.waiting.extend(line.decode("latin-1") for line in lines)


class MotionServer:
    """The server of one arm. `partner` is set to the other arm's."""

    def __init__(self, controller: Controller, name: str) -> None:
        self.name = name
        self.controller = controller
        self.arm: Arm = controller.arms[name]
        self.partner: MotionServer
        self.commands: Lines | None = None
        self.watch: Lines | None = None
        self.wires: dict[str, TcpWire] = {}
        self._watchdog = 0.0
        self._heard = 0.0
        self._looked = 0.0
        self._motion: tuple[int, int] | None = None
        self._end = DONE
        self._stops: list[tuple[int, int]] = []
        self.stops_taken: deque[float] = deque(maxlen=200)
        """When the program took a stop from its socket, by the machine's monotonic clock, s."""
        self._joints: Array | None = None
        self._position: list[float] | None = None
        self._orientation: list[float] | None = None
        self._waypoints: list[Target] = []
        self._speed = (100.0, 50.0)
        self._zone = 0.0
        self.meeting: tuple[int, float, float, int] | None = None
        self._hand: tuple[int, int] | None = None
        controller.stopped.append(self._program_stopped)
        controller.reset_to_main.append(self._restarted)

    # -------------------------------------------------------------------------------- sockets
    def opened_commands(self, connection: Connection) -> None:
        """Serve a client of the command socket; the former is dropped."""
        if self.commands is not None:
            connection.close()
            return
        self.commands = Lines(connection)
        connection.closed = lambda: self._closed(connection)

    def opened_watch(self, connection: Connection) -> None:
        """Serve a client of the watch socket."""
        if self.watch is not None:
            connection.close()
            return
        self.watch = Lines(connection)
        connection.closed = lambda: self._closed(connection)

    def _closed(self, connection: Connection) -> None:
        mine = [each for each in (self.commands, self.watch) if each is not None and each.connection is connection]
        if not mine:
            return
        if self.commands in mine:
            self.commands = None
        else:
            self.watch = None
        self._watchdog = 0.0
        self._brake(WATCHDOG_STOPPED)

    def _program_stopped(self) -> None:
        self._motion = self.meeting = self._hand = None
        self._stops.clear()
        self._watchdog = 0.0

    def _restarted(self) -> None:
        for wire in self.wires.values():
            wire.reset()
        self.commands = self.watch = None
        self._joints = self._position = self._orientation = None
        self._waypoints = []

    @property
    def _serving(self) -> bool:
        return self.controller.running and self.controller.ours

    # -------------------------------------------------------------------------------- in time
    def tick(self) -> None:
        """Look at the sockets as the program does."""
        if not self._serving:
            return
        now = time.monotonic()
        busy = self._motion is not None
        if not busy or now - self._looked >= TRAP_PERIOD:
            self._looked = now
            self._look_at_watch()
        if self._watchdog and now - self._heard > self._watchdog:
            self._watchdog = 0.0
            self._brake(WATCHDOG_STOPPED)
        if self._stops and not self.arm.moving:
            for sequence, code in self._stops:
                self._answer(self.watch, sequence, code, DONE)
            self._stops.clear()
        if self.meeting is not None and now > self.meeting[2]:
            sequence, self.meeting = self.meeting[3], None
            self._motion = None
            self._answer(self.commands, sequence, 34, NO_PARTNER)
        if self._hand is not None and not self.arm.hand.moving:
            (sequence, code), self._hand = self._hand, None
            self._answer(self.commands, sequence, code, DONE, self.arm.hand.width * 1e3)
        while self.commands is not None and self._motion is None and self._hand is None and self.commands.waiting:
            self._take(self.commands, self.commands.waiting.popleft(), self._do)

    def _look_at_watch(self) -> None:
        while self.watch is not None and self.watch.waiting:
            self._take(self.watch, self.watch.waiting.popleft(), self._do_watch)

    def _take(self, lines: Lines, line: str, do: Callable[[int, int, list[float]], list[float] | None]) -> None:
        sequence = code = 0
        try:
            sequence, code, values = parsed(line)
            given = do(sequence, code, values)
        except Rejected as e:
            self._answer(lines, sequence, code, e.args[0])
        except NotReachable:
            self._answer(lines, sequence, code, UNREACHABLE)
        else:
            if given is not None:
                self._answer(lines, sequence, code, DONE, *given)

    def _answer(self, lines: Lines | None, sequence: int, code: int, status: int, *values: float) -> None:
        if lines is not None:
            text = " ".join(
                [
                    str(sequence),
                    str(code),
                    str(status),
                    *(_short(value, 6 if code in _PARTS else 3) for value in values),
                ]
            )
            lines.connection.send(framed(text))

    # -------------------------------------------------------------------------------- the watch socket
    def _do_watch(self, sequence: int, code: int, values: list[float]) -> list[float] | None:
        if values:
            raise Rejected(BAD_COUNT)
        if code == 90:
            self._heard = time.monotonic()
            return [float(self.arm.moving), float(self._watchdog > 0.0)]
        if code != 91:
            raise Rejected(BAD_CODE)
        self._stops.append((sequence, code))
        self.stops_taken.append(time.monotonic())
        self._brake(STOPPED)
        return None

    def _brake(self, end: int) -> None:
        """Stop what moves; in a synchronised motion the other arm too, as the controller couples them."""
        if self.meeting is not None:
            sequence, self.meeting, self._motion = self.meeting[3], None, None
            self._answer(self.commands, sequence, 34, end)
            return
        if self._motion is not None and self.arm.moving and self._end == DONE:
            self._end = end
            self.arm.stop()
            if self._motion[1] == 34:
                self.partner._brake(end)

    # -------------------------------------------------------------------------------- the command socket
    def _do(self, sequence: int, code: int, values: list[float]) -> list[float] | None:
        if code not in ARGUMENTS:
            raise Rejected(BAD_CODE)
        if len(values) != ARGUMENTS[code]:
            raise Rejected(BAD_COUNT)
        if code in NEED_SESSION and not self._watchdog:
            raise Rejected(NO_SESSION)
        if code < 10:
            return self._set(code, values)
        if code < 20:
            return self._where(code, self.arm.q)
        if code < 30:
            return self._stage(code, values)
        if code < 40:
            self._move(sequence, code, values)
            return None
        if code < 50:
            return self._compute(code)
        return self._use_hand(sequence, code, values)

    def _set(self, code: int, values: list[float]) -> list[float]:
        if code == 1:
            return [float(VERSION), 1.0 if self.name == "left" else 2.0]
        if code == 2:
            if self.watch is None or not WATCHDOG[0] <= values[0] <= WATCHDOG[1]:
                raise Rejected(BAD_VALUE)
            self._watchdog, self._heard = values[0], time.monotonic()
        elif code == 3:
            self._watchdog = 0.0
        elif code == 4:
            _require(0.1 <= values[0] <= 1500.0 and 0.1 <= values[1] <= 500.0)
            self._speed = values[0], values[1]
        elif code == 5:
            _require(0.0 <= values[0] <= 200.0)
            self._zone = values[0]
        elif code == 6:
            self.arm.tool = _matrix(values[:3], values[3:])
        elif code == 7:
            _require(0.0 < values[0] <= 0.75)
            self.arm.load = values[0], values[1], values[2], values[3]
        return []

    def _where(self, code: int, q: Array) -> list[float]:
        if code in (10, 40):
            return [float(value) for value in np.degrees(q)]
        target = self.arm.kinematics.describe(q)
        tcp = target.pose @ self.arm.tool
        if code in (11, 41):
            return [*(float(value) * 1e3 for value in tcp[:3, 3]), math.degrees(target.angle)]
        return [*quaternion(tcp[:3, :3]), *map(float, target.configuration)]

    def _stage(self, code: int, values: list[float]) -> list[float]:
        if code == 20:
            q = np.radians(values)
            _require(not ((q < LIMITS[:, 0] - 1e-4) | (q > LIMITS[:, 1] + 1e-4)).any())
            self._joints = np.clip(q, LIMITS[:, 0], LIMITS[:, 1])
        elif code == 21:
            _require(all(abs(value) < 2000.0 for value in values[:3]))
            self._position = values
        elif code == 22:
            _matrix([0.0, 0.0, 0.0], values[:4])
            self._orientation = values
        elif code == 23:
            self._waypoints = []
        else:
            _require(len(self._waypoints) < MOST_WAYPOINTS)
            self._waypoints.append(self._target())
        return []

    def _target(self) -> Target:
        """Give the staged robtarget of the flange."""
        if self._position is None or self._orientation is None:
            raise Rejected(BAD_VALUE)
        tcp = _matrix(self._position[:3], self._orientation[:4])
        cf1, cf4, cf6, cfx = (int(value) for value in self._orientation[4:])
        pose: Array = tcp @ np.linalg.inv(self.arm.tool)
        return Target(pose, (cf1, cf4, cf6, cfx), math.radians(self._position[3]))

    def _compute(self, code: int) -> list[float]:
        if code == 40:
            return self._where(40, self.arm.kinematics.reach(self._target(), self.arm.q))
        if self._joints is None:
            raise Rejected(BAD_VALUE)
        return self._where(code, self._joints)

    # -------------------------------------------------------------------------------- motion
    def _move(self, sequence: int, code: int, values: list[float]) -> None:
        if self.arm.lead_through:
            raise Rejected(BY_HAND)
        if code in (30, 34) and self._joints is None:
            raise Rejected(BAD_VALUE)
        if code == 34:
            _require(0.0 < values[1] <= 600.0)
            self._motion = sequence, code
            self.meeting = int(values[0]), values[1], time.monotonic() + PARTNER_WITHIN, sequence
            self._meet()
            return
        if code in (30, 32):
            _require(0.0 < values[0] <= 600.0)
            goal = self._joints if code == 30 else self.arm.kinematics.reach(self._target(), self.arm.q)
            path, duration = np.array([self.arm.q, goal]), values[0]
        else:
            targets = [self._target()] if code == 31 else self._waypoints
            _require(bool(targets))
            path, duration = self._lines(targets)
        self._begin(sequence, code, path, duration)

    def _lines(self, targets: list[Target]) -> tuple[Array, float]:
        """Give the path through poses in straight lines, and the time it takes."""
        present, parts, duration = self.arm.q, [self.arm.q[None, :]], 0.0
        try:
            for target in targets:
                before = self.arm.kinematics.describe(self.arm.q)
                part = self.arm.line(target.pose, target.angle)
                distance = float(np.linalg.norm(target.pose[:3, 3] - before.pose[:3, 3])) * 1e3
                cos = float(np.trace(before.pose[:3, :3].T @ target.pose[:3, :3]) - 1.0) / 2.0
                turning = math.degrees(math.acos(min(max(cos, -1.0), 1.0)))
                duration += max(distance / self._speed[0], turning / self._speed[1], 0.02)
                parts.append(part[1:])
                self.arm.q = part[-1]
        finally:
            self.arm.q = present
        return np.vstack(parts), duration + 0.2

    def _meet(self) -> None:
        other = self.partner
        if self.meeting is None or other.meeting is None or self.meeting[0] != other.meeting[0]:
            return
        duration = max(self.meeting[1], other.meeting[1])
        for server in (self, other):
            assert server.meeting is not None
            assert server._joints is not None
            sequence, server.meeting = server.meeting[3], None
            server._begin(sequence, 34, np.array([server.arm.q, server._joints]), duration)

    def _begin(self, sequence: int, code: int, path: Array, duration: float) -> None:
        self._answer(self.commands, sequence, code, ACCEPTED)
        self._motion, self._end = (sequence, code), DONE
        self.arm.begin(path, duration, self._over)

    def _over(self) -> None:
        if self._motion is not None:
            (sequence, code), self._motion = self._motion, None
            self._answer(self.commands, sequence, code, self._end)

    # -------------------------------------------------------------------------------- the hand
    def _use_hand(self, sequence: int, code: int, values: list[float]) -> list[float] | None:
        hand = self.arm.hand
        if code == 53:
            return [hand.width * 1e3]
        self.controller.wrote("hand")
        if code == 50:
            hand.calibrated = True
            hand.goal = 0.0
        elif code == 54:
            hand.vacuum = bool(values[0])
            return []
        elif code == 55:
            hand.blowing = bool(values[0])
            return []
        elif not hand.calibrated:
            raise Rejected(BAD_VALUE)
        elif code == 51:
            _require(0.0 < values[0] <= 20.0)
            hand.grip(values[0])
        else:
            _require(0.0 <= values[0] <= 25.0)
            hand.goal = values[0] / 1e3
        self._hand = sequence, code
        return None


def _require(holds: bool) -> None:
    if not holds:
        raise Rejected(BAD_VALUE)


def _matrix(millimetres: list[float], wxyz: list[float]) -> Array:
    x, y, z = (value / 1e3 for value in millimetres)
    w, i, j, k = wxyz
    try:
        return pose_of((x, y, z), (w, i, j, k))
    except ValueError:
        raise Rejected(BAD_VALUE) from None


def _short(value: float, decimals: int) -> str:
    """Give a number as RAPID's NumToStr writes it."""
    text = f"{value:.{decimals}f}"
    return text.rstrip("0").rstrip(".") if "." in text else text
