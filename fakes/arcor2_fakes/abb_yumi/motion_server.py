"""The RAPID motion server of one arm: numeric commands on a command socket and on a watch socket.

As in RAPID, only the watch socket is read while the arm moves.
"""

import time
from collections import deque
from collections.abc import Callable
from typing import Final, NamedTuple

import numpy as np

from arcor2_fakes.abb_yumi.arm import Arm
from arcor2_fakes.abb_yumi.controller import Controller
from arcor2_fakes.abb_yumi.kinematics import Array, NotReachable
from arcor2_fakes.abb_yumi.protocol import (
    ACCEPTED,
    ARGUMENTS,
    BAD_CODE,
    BAD_COUNT,
    BY_HAND,
    DONE,
    KEEP_ALIVE,
    MOVE_TOGETHER,
    NEED_SESSION,
    NO_PARTNER,
    NO_SESSION,
    STOP,
    STOPPED,
    UNREACHABLE,
    VERSION,
    WATCHDOG_STOPPED,
    Lines,
    Rejected,
    answer,
    parsed,
    require,
)
from arcor2_fakes.abb_yumi.staging import Staging, matrix
from arcor2_fakes.wire import Connection, TcpWire

TRAP_PERIOD: Final = 0.05
"""Time between two readings of the watch socket while the arm moves, s."""
PARTNER_TIMEOUT: Final = 2.0
"""Time to wait for the other arm of a synchronized motion, s."""
WATCHDOG: Final = (0.1, 5.0)


class SynchronizedMotion(NamedTuple):
    """A synchronized motion that waits for the other arm."""

    number: int
    duration: float
    until: float
    sequence: int


class MotionServer:
    """The server of one arm. `partner` is the server of the other arm. `own_time` is the clock of the watchdog."""

    def __init__(self, controller: Controller, name: str, own_time: Callable[[], float]) -> None:
        self.name = name
        self._own_time = own_time
        self.controller = controller
        self.arm: Arm = controller.arms[name]
        self.staging = Staging(self.arm)
        self.partner: MotionServer
        self.commands: Lines | None = None
        self.watch: Lines | None = None
        self.wires: dict[str, TcpWire] = {}
        self.meeting: SynchronizedMotion | None = None
        self.stops_taken: deque[float] = deque(maxlen=200)
        """Times at which the program read a stop from its socket, on the monotonic clock, s."""
        self._watchdog = 0.0
        self._last_keep_alive = 0.0
        self._last_trap = 0.0
        self._motion: tuple[int, int] | None = None
        self._end = DONE
        self._stops: list[tuple[int, int]] = []
        self._hand: tuple[int, int] | None = None
        controller.stopped.append(self._program_stopped)
        controller.reset_to_main.append(self._restarted)

    # -------------------------------------------------------------------------------- sockets
    def opened_commands(self, connection: Connection) -> None:
        """Serve a client of the command socket; refuse a second one."""
        if self.commands is not None:
            connection.close()
            return
        self.commands = Lines(connection)
        connection.closed = lambda: self._closed(connection)

    def opened_watch(self, connection: Connection) -> None:
        """Serve a client of the watch socket; refuse a second one."""
        if self.watch is not None:
            connection.close()
            return
        self.watch = Lines(connection)
        connection.closed = lambda: self._closed(connection)

    def _closed(self, connection: Connection) -> None:
        if self.commands is not None and self.commands.connection is connection:
            self.commands = None
        elif self.watch is not None and self.watch.connection is connection:
            self.watch = None
        else:
            return
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
        self.staging.clear()

    # -------------------------------------------------------------------------------- in time
    def tick(self) -> None:
        """Read the sockets and check for ended motions, as the program does."""
        if not (self.controller.running and self.controller.ours):
            return
        now = time.monotonic()
        if self._motion is None or now - self._last_trap >= TRAP_PERIOD:
            self._last_trap = now
            while self.watch is not None and self.watch.waiting:
                self._execute(self.watch, self.watch.waiting.popleft(), self._do_watch)
        if self._watchdog and self._own_time() - self._last_keep_alive > self._watchdog:
            self._watchdog = 0.0
            self._brake(WATCHDOG_STOPPED)
        if self._stops and not self.arm.moving:
            for sequence, code in self._stops:
                self._answer(self.watch, sequence, code, DONE)
            self._stops.clear()
        if self.meeting is not None and now > self.meeting.until:
            self._leave_meeting(NO_PARTNER)
        if self._hand is not None and not self.arm.hand.moving:
            (sequence, code), self._hand = self._hand, None
            self._answer(self.commands, sequence, code, DONE, self.arm.hand.width * 1e3)
        while self.commands is not None and self._motion is None and self._hand is None and self.commands.waiting:
            self._execute(self.commands, self.commands.waiting.popleft(), self._do)

    def _execute(self, lines: Lines, line: str, do: Callable[[int, int, list[float]], list[float] | None]) -> None:
        sequence = code = 0
        try:
            sequence, code, values = parsed(line)
            result = do(sequence, code, values)
        except Rejected as e:
            self._answer(lines, sequence, code, e.args[0])
        except NotReachable:
            self._answer(lines, sequence, code, UNREACHABLE)
        else:
            if result is not None:
                self._answer(lines, sequence, code, DONE, *result)

    @staticmethod
    def _answer(lines: Lines | None, sequence: int, code: int, status: int, *values: float) -> None:
        if lines is not None:
            lines.connection.send(answer(sequence, code, status, values))

    # -------------------------------------------------------------------------------- the watch socket
    def _do_watch(self, sequence: int, code: int, values: list[float]) -> list[float] | None:
        if values:
            raise Rejected(BAD_COUNT)
        if code == KEEP_ALIVE:
            self._last_keep_alive = self._own_time()
            return [float(self.arm.moving), float(self._watchdog > 0.0)]
        if code != STOP:
            raise Rejected(BAD_CODE)
        self._stops.append((sequence, code))
        self.stops_taken.append(time.monotonic())
        self._brake(STOPPED)
        return None

    def _brake(self, end: int) -> None:
        """Stop the motion; in a synchronized motion also the other arm, which the controller couples."""
        if self.meeting is not None:
            self._leave_meeting(end)
        elif self._motion is not None and self.arm.moving and self._end == DONE:
            self._end = end
            self.arm.stop()
            if self._motion[1] == MOVE_TOGETHER:
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
            return self.staging.describe(code, self.arm.q)
        if code < 30:
            self.staging.stage(code, values)
            return []
        if code < 40:
            self._move(sequence, code, values)
            return None
        if code < 50:
            return self.staging.compute(code)
        return self._use_hand(sequence, code, values)

    def _set(self, code: int, values: list[float]) -> list[float]:
        if code == 1:
            return [float(VERSION), 1.0 if self.name == "left" else 2.0]
        if code == 2:
            require(self.watch is not None and WATCHDOG[0] <= values[0] <= WATCHDOG[1])
            self._watchdog, self._last_keep_alive = values[0], self._own_time()
        elif code == 3:
            self._watchdog = 0.0
        elif code == 4:
            require(0.1 <= values[0] <= 1500.0 and 0.1 <= values[1] <= 500.0)
            self.staging.speed = values[0], values[1]
        elif code == 5:
            require(0.0 <= values[0] <= 200.0)
        elif code == 6:
            self.arm.tool = matrix(values[:3], values[3:])
        elif code == 7:
            require(0.0 < values[0] <= 0.75)
            self.arm.load = values[0], values[1], values[2], values[3]
        return []

    # -------------------------------------------------------------------------------- motion
    def _move(self, sequence: int, code: int, values: list[float]) -> None:
        if self.arm.lead_through:
            raise Rejected(BY_HAND)
        if code == MOVE_TOGETHER:
            _ = self.staging.joints
            require(0.0 < values[1] <= 600.0)
            self._motion = sequence, code
            self.meeting = SynchronizedMotion(int(values[0]), values[1], time.monotonic() + PARTNER_TIMEOUT, sequence)
            self._meet()
        elif code in (30, 32):
            require(0.0 < values[0] <= 600.0)
            goal = self.staging.joints if code == 30 else self.arm.kinematics.reach(self.staging.target(), self.arm.q)
            self._start(sequence, code, np.array([self.arm.q, goal]), values[0])
        else:
            targets = [self.staging.target()] if code == 31 else self.staging.waypoints
            require(bool(targets))
            self._start(sequence, code, *self.staging.lines(targets))

    def _meet(self) -> None:
        """Start the synchronized motion when both arms are ready."""
        mine, other = self.meeting, self.partner.meeting
        if mine is None or other is None or mine.number != other.number:
            return
        duration = max(mine.duration, other.duration)
        for server, meeting in ((self, mine), (self.partner, other)):
            server.meeting = None
            path = np.array([server.arm.q, server.staging.joints])
            server._start(meeting.sequence, MOVE_TOGETHER, path, duration)

    def _leave_meeting(self, status: int) -> None:
        assert self.meeting is not None
        sequence, self.meeting, self._motion = self.meeting.sequence, None, None
        self._answer(self.commands, sequence, MOVE_TOGETHER, status)

    def _start(self, sequence: int, code: int, path: Array, duration: float) -> None:
        self._answer(self.commands, sequence, code, ACCEPTED)
        self._motion, self._end = (sequence, code), DONE
        self.arm.begin(path, duration, self._on_end)

    def _on_end(self) -> None:
        if self._motion is not None:
            (sequence, code), self._motion = self._motion, None
            self._answer(self.commands, sequence, code, self._end)

    # -------------------------------------------------------------------------------- the hand
    def _use_hand(self, sequence: int, code: int, values: list[float]) -> list[float] | None:
        hand = self.arm.hand
        if code == 53:
            return [hand.width * 1e3]
        self.controller.wrote("hand")
        if code == 54:
            hand.vacuum = bool(values[0])
            return []
        if code == 55:
            hand.blowing = bool(values[0])
            return []
        if code == 50:
            hand.calibrated = True
            hand.goal = 0.0
        else:
            require(hand.calibrated)
            if code == 51:
                require(0.0 < values[0] <= 20.0)
                hand.grip(values[0])
            else:
                require(0.0 <= values[0] <= 25.0)
                hand.goal = values[0] / 1e3
        self._hand = sequence, code
        return None
