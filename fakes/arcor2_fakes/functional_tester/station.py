"""The station without Modbus: PackML states, door, clamp, tests and faults."""

from __future__ import annotations

import random
import time
from collections.abc import Callable

import msgspec

from arcor2_fakes.functional_tester.board import Board, Measured, measure
from arcor2_fakes.functional_tester.states import Answer as Answer, Command as Command, Fault as Fault, State as State


class Refusal(ValueError):
    """The operation is physically impossible now, such as putting a board through a closed door."""


class Result(msgspec.Struct, frozen=True):
    """A finished test."""

    number: int
    code: str
    result: str
    program: int
    measured: Measured


RUNNING = frozenset({State.STARTING, State.EXECUTE, State.COMPLETING, State.HOLDING, State.HELD, State.UNHOLDING})
DOOR_MAY_MOVE = frozenset({State.STOPPED, State.IDLE, State.COMPLETE, State.ABORTED})
DOOR_TIME = 0.5
TEST_PROGRAMS = range(1, 10)

# Acting states: duration, s, and following state. Execute lasts as long as the test.
_ACTING: dict[State, tuple[float, State]] = {
    State.CLEARING: (0.2, State.STOPPED),
    State.STARTING: (0.3, State.EXECUTE),
    State.STOPPING: (0.2, State.STOPPED),
    State.ABORTING: (0.1, State.ABORTED),
    State.HOLDING: (0.1, State.HELD),
    State.UNHOLDING: (0.1, State.EXECUTE),
    State.RESETTING: (0.2, State.IDLE),
    State.COMPLETING: (0.2, State.COMPLETE),
}
_NO_STOP = frozenset({State.ABORTING, State.ABORTED, State.CLEARING})
_ENDED = frozenset({State.STOPPING, State.STOPPED})


class Station:
    """A tester with one fixture behind a door.

    `advance` applies in order all changes that are due since the last call; every other method calls it first. The
    station thus needs no task, and tests can use their own clock.

    Args:
        seed: seed of the noise of measured values.
        test_time: duration of Execute, s.
        time_scale: how many times faster than real time the machine moves. The life counter and the host watchdog
            use real time.
        clock: seconds on a monotonic clock.
    """

    def __init__(
        self,
        *,
        seed: int = 0,
        test_time: float = 1.5,
        time_scale: float = 1.0,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._seed = seed
        self._test_time = test_time / time_scale
        self._time_scale = time_scale
        self._clock = clock
        self.as_delivered()

    def as_delivered(self) -> None:
        """Reset everything: door closed, fixture empty, nothing tested."""
        self._now = self._clock()
        self._door_at = 0.0  # 0 closed, 1 open, at the time _door_since
        self._door_since = self._now
        self._door_target: float | None = None
        self._board: Board | None = None
        self._board_seen = True  # False when the sensor does not detect the board
        self.emergency_stop_pressed = False
        self.mode = 1
        self._power_on()

    def _power_on(self) -> None:
        self._started = self._last_request = self._now
        self.state = State.STOPPED
        self._due: float | None = None  # when the acting state ends
        self._test_left = 0.0  # of Execute, while held
        self._program = 1
        self.clamped = False
        self.fault = Fault.NONE
        self._armed: Fault | None = None
        self.test_program = 1
        self.watchdog_ms = 0
        self.measured = Measured()
        self.results: list[Result] = []

    def power_cycle(self) -> None:
        """Switch off and on: board and door stay as they are; counters and settings are reset."""
        self.advance()
        self._door_at, self._door_since, self._door_target = self._door_position(), self._now, None
        self._power_on()
        if self.emergency_stop_pressed:
            self.state, self.fault = State.ABORTED, Fault.EMERGENCY_STOP

    # ------------------------------------------------------------------------------------------------ time

    def advance(self) -> None:
        """Apply all changes since the last call, in order."""
        now = self._clock()
        while (event := self._next_event()) is not None and event[0] <= now:
            due, happen = event
            self._now = max(due, self._now)  # the time of a fault that was armed late may be in the past
            happen()
        self._now = now

    def _next_event(self) -> tuple[float, Callable[[], None]] | None:
        events: list[tuple[float, Callable[[], None]]] = []
        if self._due is not None:
            events.append((self._due, self._end_acting))
            if self._armed is not None and self.state is State.EXECUTE:
                # In the middle of the remaining time, so that the fault occurs during a test.
                events.append((self._due - 0.5 * self._test_left, self._fire_armed))
        if (arrival := self._door_arrival()) is not None:
            events.append((arrival, self._end_door))
        if self.watchdog_ms and self.state in RUNNING:
            events.append((self._last_request + self.watchdog_ms / 1000.0, lambda: self._abort(Fault.HOST_LOST)))
        return min(events, key=lambda event: event[0], default=None)

    def _enter(self, state: State, duration: float | None = None) -> None:
        self.state = state
        if duration is None and state in _ACTING:
            duration = _ACTING[state][0] / self._time_scale
        self._due = None if duration is None else self._now + duration

    def _end_acting(self) -> None:
        state = self.state
        if state is State.EXECUTE:
            self._finish_test()
            self._enter(State.COMPLETING)
            return
        following = _ACTING[state][1]
        if state is State.STARTING:
            self.clamped = True
        elif state in (State.COMPLETING, State.STOPPING, State.ABORTING):
            self.clamped = False
        self._enter(following, self._test_left if following is State.EXECUTE else None)

    def _finish_test(self) -> None:
        assert self._board is not None, "a test runs only with a board behind a closed door"
        number = len(self.results) + 1
        noise = random.Random(f"{self._seed}/{self._board.code}/{number}")
        self.measured = measure(self._board, noise)
        verdict = "pass" if self.measured.within_limits() else "fail"
        self.results.append(Result(number, self._board.code, verdict, self._program, self.measured))

    # ------------------------------------------------------------------------------------------------ host

    def request_arrived(self) -> None:
        """Reset the host watchdog; call it for every request."""
        self.advance()
        self._last_request = self._now

    def command(self, code: int) -> Answer:
        """Execute a command and return the answer."""
        self.advance()
        try:
            command = Command(code)
        except ValueError:
            return Answer.UNKNOWN_COMMAND
        handlers: dict[Command, Callable[[], Answer]] = {
            Command.RESET: self._reset,
            Command.START: self._start,
            Command.STOP: self._stop,
            Command.HOLD: self._hold,
            Command.UNHOLD: self._unhold,
            Command.ABORT: self._abort_commanded,
            Command.CLEAR: self._clear,
        }
        return handlers[command]()

    def move_door(self, *, opening: bool) -> None:
        """Open or close the door, if it may move now."""
        self.advance()
        if self.state in DOOR_MAY_MOVE and not self.emergency_stop_pressed:
            self._halt_door()
            self._door_target = 1.0 if opening else 0.0

    def _reset(self) -> Answer:
        if self.state not in (State.STOPPED, State.COMPLETE):
            return Answer.WRONG_STATE
        self._enter(State.RESETTING)
        return Answer.ACCEPTED

    def _start(self) -> Answer:
        if self.state is not State.IDLE:
            return Answer.WRONG_STATE
        if not self.door_closed:
            return Answer.DOOR_NOT_CLOSED
        if not self.board_present:
            return Answer.NO_BOARD
        if self.test_program not in TEST_PROGRAMS:
            return Answer.UNKNOWN_PROGRAM
        self._program = self.test_program
        self._test_left = self._test_time
        self._enter(State.STARTING)
        return Answer.ACCEPTED

    def _stop(self) -> Answer:
        if self.state in _NO_STOP:
            return Answer.WRONG_STATE
        if self.state not in _ENDED:
            self._enter(State.STOPPING)
        return Answer.ACCEPTED

    def _hold(self) -> Answer:
        if self.state is not State.EXECUTE or self._due is None:
            return Answer.WRONG_STATE
        self._test_left = self._due - self._now
        self._enter(State.HOLDING)
        return Answer.ACCEPTED

    def _unhold(self) -> Answer:
        if self.state is not State.HELD:
            return Answer.WRONG_STATE
        self._enter(State.UNHOLDING)
        return Answer.ACCEPTED

    def _abort_commanded(self) -> Answer:
        self._abort(Fault.NONE)
        return Answer.ACCEPTED

    def _clear(self) -> Answer:
        if self.state is not State.ABORTED or self.emergency_stop_pressed:
            return Answer.WRONG_STATE
        self.fault = Fault.NONE
        self._board_seen = True
        self._enter(State.CLEARING)
        return Answer.ACCEPTED

    def _abort(self, fault: Fault) -> None:
        if self.state not in (State.ABORTING, State.ABORTED):
            self.fault = fault
            self._enter(State.ABORTING)
        elif self.fault is Fault.NONE or fault is Fault.EMERGENCY_STOP:
            self.fault = fault

    # ------------------------------------------------------------------------------------------------ door

    @property
    def door_open(self) -> bool:
        """Return the end position switch "open"."""
        return self._door_position() == 1.0

    @property
    def door_closed(self) -> bool:
        """Return the end position switch "closed"."""
        return self._door_position() == 0.0

    @property
    def door(self) -> str:
        """Return the state of the door: open, closed, opening, closing or stopped."""
        if self._door_target is not None:
            return "opening" if self._door_target else "closing"
        return {0.0: "closed", 1.0: "open"}.get(self._door_at, "between")

    def _door_arrival(self) -> float | None:
        if self._door_target is None:
            return None
        return self._door_since + abs(self._door_target - self._door_at) * DOOR_TIME / self._time_scale

    def _door_position(self) -> float:
        if self._door_target is None:
            return self._door_at
        travelled = (self._now - self._door_since) * self._time_scale / DOOR_TIME
        if self._door_target > self._door_at:
            return min(self._door_at + travelled, self._door_target)
        return max(self._door_at - travelled, self._door_target)

    def _halt_door(self) -> None:
        self._door_at, self._door_since, self._door_target = self._door_position(), self._now, None

    def _end_door(self) -> None:
        self._set_door(opening=bool(self._door_target))

    def _set_door(self, *, opening: bool) -> None:
        self._door_at, self._door_since, self._door_target = float(opening), self._now, None

    # ------------------------------------------------------------------------------------------------ simulated world

    @property
    def board(self) -> Board | None:
        """Return the board in the fixture."""
        return self._board

    @property
    def board_present(self) -> bool:
        """Return the value of the board sensor."""
        return self._board is not None and self._board_seen

    @property
    def passed(self) -> int:
        """Return the number of passed tests."""
        return sum(result.result == "pass" for result in self.results)

    @property
    def life(self) -> int:
        """Return the time since power-on, 0.1 s."""
        return int((self._now - self._started) * 10.0)

    def put_board(self, board: Board) -> None:
        """Put a board into the fixture.

        Raises:
            Refusal: The door is not open, or there is a board already.
        """
        self.advance()
        self._reach_in()
        if self._board is not None:
            raise Refusal(f"board {self._board.code} is already in the fixture")
        self._board = board
        self._board_seen = True

    def take_board(self) -> Board:
        """Take the board out of the fixture.

        Raises:
            Refusal: The door is not open, or there is no board.
        """
        self.advance()
        self._reach_in()
        if self._board is None:
            raise Refusal("the fixture is empty")
        board, self._board = self._board, None
        return board

    def _reach_in(self) -> None:
        if not self.door_open:
            raise Refusal(f"the door is {self.door}")

    def push_door(self, *, opening: bool) -> None:
        """Open or close the door by hand, at once."""
        self.advance()
        self._set_door(opening=opening)
        if opening and self.state in RUNNING:
            self._abort(Fault.DOOR_OPENED)

    def press_emergency_stop(self, *, pressed: bool) -> None:
        """Press or release the emergency stop button."""
        self.advance()
        if pressed:
            self._cause(Fault.EMERGENCY_STOP)
        self.emergency_stop_pressed = pressed

    def inject(self, fault: Fault, *, armed: bool = False) -> None:
        """Raise a fault: now, or armed, in the middle of the present or next test."""
        self.advance()
        if armed:
            self._armed = fault
        else:
            self._cause(fault)

    def _fire_armed(self) -> None:
        assert self._armed is not None
        fault, self._armed = self._armed, None
        self._cause(fault)

    def _cause(self, fault: Fault) -> None:
        """Simulate the cause of a fault at the sensors, and react to it."""
        if fault is Fault.EMERGENCY_STOP:
            self.emergency_stop_pressed = True
            self._halt_door()
        elif fault is Fault.BOARD_LOST:
            self._board_seen = False
        elif fault is Fault.DOOR_OPENED:
            self._set_door(opening=True)
        self._abort(fault)
