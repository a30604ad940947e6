"""The balance without its port: MT-SICS commands and answers in time.

Source: MT-SICS interface commands, levels 0 and 1: @, I2, I3, I4, S, SI, Z, ZI, T, TI, TA, TAC; errors ES, ET, EL.
"""

from __future__ import annotations

import asyncio
import math
from collections import deque
from collections.abc import Callable
from typing import Final

UNITS: Final = {"g": 1e3, "kg": 1.0, "mg": 1e6, "lb": 2.20462262}
DECIMALS: Final = {"g": 2, "kg": 5, "mg": 0, "lb": 4}
ZERO_RANGE: Final = 0.02
"""Zero range around the zero point at power-on, relative to the capacity."""
_LONGEST_LINE: Final = 64
_LOOK: Final = 0.01
_AT_ONCE: Final = ("@", "I2", "I3", "I4", "SI", "ZI", "TI", "TA", "TAC")
_WHEN_STABLE: Final = ("S", "Z", "T")


class Balance:
    """A platform balance.

    Args:
        send: Sends bytes.
        capacity: Largest load, kg.
        settling: Time until the value is stable after a change of the load, s.
        stability_timeout: Time limit of S, T and Z for a stable value, s.
    """

    identity = ("MS3002S 3.2 kg", "2.10 10.28.0.493.142", "B021002593")

    def __init__(
        self, send: Callable[[bytes], None], *, capacity: float, settling: float, stability_timeout: float
    ) -> None:
        self._send = send
        self._loop = asyncio.get_running_loop()
        self._settling, self._stability_timeout = settling, stability_timeout
        self._from, self._changed = 0.0, -math.inf
        self._buffer = bytearray()
        self._too_long = False
        self._waiting: deque[str] = deque()
        self._timer: asyncio.TimerHandle | None = None
        self._began = 0.0
        self.capacity = capacity
        self.load = 0.0
        self.zero = 0.0
        self.tare = 0.0
        self.vibrating = False
        self.busy = False
        self.unit = "g"
        self.next_error: str | None = None
        self.received: deque[str] = deque(maxlen=200)

    # ------------------------------------------------------------------------------------------------ the line's side
    def feed(self, data: bytes) -> None:
        """Receive bytes; a command ends with CR LF."""
        for byte in data:
            if byte == 0x0A:
                line, too_long = bytes(self._buffer), self._too_long
                self.drop_input()
                command = line.removesuffix(b"\r").decode("ascii", "replace")
                if too_long:
                    self._answer("ES")
                elif command:
                    self._obey(command)
            elif len(self._buffer) < _LONGEST_LINE:
                self._buffer.append(byte)
            else:
                self._too_long = True

    def drop_input(self) -> None:
        """Discard an incomplete line."""
        self._buffer.clear()
        self._too_long = False

    def _obey(self, command: str) -> None:
        self.received.append(command)
        if command == "@":
            self.cancel()
            self.tare = 0.0
            self._answer(f'I4 A "{self.identity[2]}"')
            return
        self._waiting.append(command)
        if self._timer is None:
            self._next()

    def cancel(self) -> None:
        """Discard all pending commands."""
        self._waiting.clear()
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None

    def _next(self) -> None:
        """Answer in order; a command that waits for stability delays the following ones."""
        self._timer = None
        while self._waiting:
            command = self._waiting[0]
            if command in _WHEN_STABLE and not self._excuse(command):
                if self._began == 0.0:
                    self._began = self._loop.time()
                if not self.stable and self._loop.time() - self._began < self._stability_timeout:
                    self._timer = self._loop.call_later(_LOOK, self._next)
                    return
            self._began = 0.0
            self._waiting.popleft()
            self._answer(self._outcome(command))

    def _answer(self, text: str) -> None:
        self._send(text.encode("ascii") + b"\r\n")

    def _excuse(self, command: str) -> str:
        """Return the answer to a command that fails regardless of stability; empty otherwise."""
        if self.next_error:
            return self.next_error
        if self.busy:
            return f"{command} I"
        gross = self.shown()
        if gross > self.capacity or (command in ("Z", "ZI") and gross - self.zero > ZERO_RANGE * self.capacity):
            return f"{command[0] if command == 'SI' else command} +"
        if gross < -ZERO_RANGE * self.capacity or (command in ("T", "TI") and gross - self.zero < 0.0):
            return f"{command[0] if command == 'SI' else command} -"
        return ""

    def _outcome(self, command: str) -> str:
        word, _, argument = command.partition(" ")
        if self.next_error:
            error, self.next_error = self.next_error, None
            return error
        if word not in (*_AT_ONCE, *_WHEN_STABLE):
            return "ES"
        if argument:
            return "EL"
        if word[0] == "I":
            return f'{word} A "{self.identity[int(word[1]) - 2]}"'
        if word == "TA":
            return f"TA A {self._field(self.tare)}"
        if word == "TAC":
            self.tare = 0.0
            return "TAC A"
        if word == "SI" and self.busy:
            return "S I"
        return self._excuse(word) or self._measured(word)

    def _measured(self, word: str) -> str:
        stable, gross = self.stable, self.shown()
        if word in _WHEN_STABLE and not stable:
            return f"{word} I"  # not stable in time
        mark = "S" if stable else "D"
        if word in ("S", "SI"):
            return f"S {mark} {self._field(gross - self.zero - self.tare)}"
        if word in ("Z", "ZI"):
            self.zero, self.tare = gross, 0.0
            return "Z A" if word == "Z" else f"ZI {mark}"
        self.tare = gross - self.zero
        return f"{word} {mark} {self._field(self.tare)}"

    def _field(self, kilograms: float) -> str:
        """Return the value, right-aligned in ten characters, and the unit."""
        text = f"{kilograms * UNITS[self.unit]:.{DECIMALS[self.unit]}f}"
        return f"{text.removeprefix('-') if float(text) == 0.0 else text:>10} {self.unit}"

    # ------------------------------------------------------------------------------------------------ the world's side
    @property
    def stable(self) -> bool:
        """Return whether the displayed value is stable."""
        return not self.vibrating and self._loop.time() - self._changed >= self._settling

    def shown(self) -> float:
        """Return the present gross weight at the sensor, kg."""
        since = self._loop.time() - self._changed
        ripple = 0.003 * math.sin(60.0 * self._loop.time()) if self.vibrating else 0.0
        if since >= self._settling:
            return self.load + ripple
        return self.load + (self._from - self.load) * math.exp(-5.0 * since / self._settling) + ripple

    def put(self, kilograms: float) -> None:
        """Replace the load on the pan, kg. Raises ValueError."""
        if not math.isfinite(kilograms):
            raise ValueError("kg must be a finite number")
        self._from, self._changed, self.load = self.shown(), self._loop.time(), kilograms

    def renew(self) -> None:
        """Reset everything: empty pan, no pending command, no fault."""
        self.cancel()
        self.drop_input()
        self.received.clear()
        self.vibrating = self.busy = False
        self.unit, self.next_error = "g", None
        self.load = self.zero = self.tare = self._from = 0.0
        self._changed = -math.inf

    def power_cycle(self) -> None:
        """Switch off and on: the tare is lost, a small load is the new zero, and the balance sends its greeting."""
        self.cancel()
        self.drop_input()
        self.tare = 0.0
        if abs(self.load) <= ZERO_RANGE * self.capacity:
            self.zero = self.load
        self._answer(f'I4 A "{self.identity[2]}"')
