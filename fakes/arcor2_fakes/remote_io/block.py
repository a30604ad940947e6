"""The block without Modbus: inputs, outputs, timed pulses and four watchdogs."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from enum import IntEnum

DIGITAL, ANALOG_IN, ANALOG_OUT, WATCHDOGS = 16, 4, 2, 4
ACKNOWLEDGE, RELEASE = 1, 2
BROKEN_WIRE = -32768


class WatchdogState(IntEnum):
    """State of a watchdog."""

    OFF = 0
    RUNNING = 1
    EXPIRED = 2


@dataclass
class Watchdog:
    """A watchdog: the outputs that it guards, and their safe states (bit masks)."""

    time_ms: int = 0
    number: int = 0
    do_guarded: int = 0
    do_switched: int = 0
    do_safe: int = 0
    ao_guarded: int = 0
    ao_switched: int = 0
    ao_safe: list[int] = field(default_factory=lambda: [0] * ANALOG_OUT)
    state: WatchdogState = WatchdogState.OFF
    expires: float = 0.0


class OutputLocked(ValueError):
    """An expired watchdog holds this output in its safe state."""


class Block:
    """The block; `clock` returns seconds. Callers call `advance` before every access: it applies what is due."""

    def __init__(self, clock: Callable[[], float]) -> None:
        self._clock = clock
        self.as_delivered()

    def as_delivered(self) -> None:
        """Reset everything: inputs off, nothing written, no fault."""
        self.inputs = [False] * DIGITAL
        self.analog_inputs = [0] * ANALOG_IN
        self.watchdogs_start = True
        self.diagnosis = 0  # bits: 1 supply of the outputs missing, 2 an output overloaded
        self.writes = 0
        self.history: deque[tuple[float, int, bool]] = deque(maxlen=200)
        self.power_on()

    def power_on(self) -> None:
        """Switch on: outputs off, watchdogs off."""
        self.outputs = [False] * DIGITAL
        self.analog_outputs = [0] * ANALOG_OUT
        self.watchdogs = [Watchdog() for _ in range(WATCHDOGS)]
        self._pulses: dict[int, float] = {}

    def advance(self) -> None:
        """Apply in order the ends of pulses and the expired watchdogs that are due."""
        now = self._clock()
        running = [dog for dog in self.watchdogs if dog.state is WatchdogState.RUNNING]
        ends = [(end, 0, number) for number, end in self._pulses.items()]
        ends += [(dog.expires, 1, number) for number, dog in enumerate(running)]
        for at, is_watchdog, number in sorted(end for end in ends if end[0] <= now):
            if is_watchdog:
                running[number].state = WatchdogState.EXPIRED
                self._to_safe_state(running[number], at)
            elif self._pulses.pop(number, None) is not None:
                self._switch(number, on=False, at=at)

    # -------------------------------------------------------------------------------- outputs
    def write_digital(self, number: int, *, on: bool) -> None:
        """Switch an output; ends a pulse on it."""
        self._pulses.pop(number, None)
        self._switch(number, on=on, at=self._clock())

    def write_analog(self, number: int, raw: int) -> None:
        """Set an analogue output."""
        self.analog_outputs[number] = raw

    def pulse(self, number: int, duration_ms: int) -> None:
        """Switch an output on for a time; 0 ends a pulse at once."""
        if duration_ms:
            self._pulses[number] = self._clock() + duration_ms / 1000.0
            self._switch(number, on=True, at=self._clock())
        elif self._pulses.pop(number, None) is not None:
            self._switch(number, on=False, at=self._clock())

    def check_unlocked(self, digital: int = 0, analog: int = 0) -> None:
        """Raise Locked when an expired watchdog guards one of these (bit masks)."""
        for dog in self.watchdogs:
            if dog.state is WatchdogState.EXPIRED and (dog.do_guarded & digital or dog.ao_guarded & analog):
                raise OutputLocked

    def _switch(self, number: int, *, on: bool, at: float) -> None:
        if self.outputs[number] != on:
            self.outputs[number] = on
            self.history.append((at, number, on))

    # -------------------------------------------------------------------------------- watchdogs
    def trigger(self, watchdog: Watchdog, number: int) -> None:
        """Start or trigger a watchdog for the host with this number."""
        watchdog.number = number
        if watchdog.state is not WatchdogState.EXPIRED:
            watchdog.state = WatchdogState.RUNNING if watchdog.time_ms and self.watchdogs_start else WatchdogState.OFF
            watchdog.expires = self._clock() + watchdog.time_ms / 1000.0

    def command(self, watchdog: Watchdog, command: int) -> None:
        """Acknowledge an expired watchdog, or release one: safe state at once, then off."""
        if command == RELEASE and watchdog.state is WatchdogState.RUNNING:
            self._to_safe_state(watchdog, self._clock())
        if command == RELEASE or (command == ACKNOWLEDGE and watchdog.state is WatchdogState.EXPIRED):
            watchdog.state, watchdog.number = WatchdogState.OFF, 0

    def _to_safe_state(self, watchdog: Watchdog, at: float) -> None:
        for number in range(DIGITAL):
            if watchdog.do_guarded & watchdog.do_switched & (1 << number):
                self._pulses.pop(number, None)
                self._switch(number, on=bool(watchdog.do_safe & (1 << number)), at=at)
        for number in range(ANALOG_OUT):
            if watchdog.ao_guarded & watchdog.ao_switched & (1 << number):
                self.analog_outputs[number] = watchdog.ao_safe[number]
