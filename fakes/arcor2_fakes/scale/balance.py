"""The balance without its port: MT-SICS commands and answers in time.

Source: Mettler Toledo, "Standard Interface Command Set" (MT-SICS 0 version 2.3x, MT-SICS 1 version 2.2x): all
commands of the levels 0 and 1, and some settings of level 2. A wrong parameter is answered by L behind the command,
or by EL where none is allowed.
"""

from __future__ import annotations

import asyncio
import math
import re
from collections import deque
from collections.abc import Callable
from typing import Final

UNITS: Final = {"g": 1e3, "kg": 1.0, "mg": 1e6, "lb": 2.20462262}
DECIMALS: Final = {"g": 2, "kg": 5, "mg": 0, "lb": 4}
ZERO_RANGE: Final = 0.02
"""Zero range around the zero point at power-on, relative to the capacity."""
SETTINGS: Final = {"M01": (0, 3), "M02": (2, 2), "M03": (1, 1), "M35": (0, 1)}
"""Some settings of level 2: value as delivered, and highest value. They do not change how it weighs."""
LEVELS: Final = (
    ("I0", "I1", "I2", "I3", "I4", "I5", "S", "SI", "SIR", "Z", "ZI", "@"),
    ("D", "DW", "K", "SR", "T", "TA", "TAC", "TI"),
    tuple(SETTINGS),
)
KEYS: Final = {"zero": 1, "tare": 2}
"""Codes of the keys; those of real balances differ from model to model."""
KEYS_ACT, KEYS_OFF, KEYS_REPORT, KEYS_ACT_AND_REPORT = range(1, 5)
DISPLAY: Final = 16
"""Characters of the display."""
_MAX_LINE: Final = 64
_LOOK: Final = 0.01
_REPEAT: Final = 0.1
_WHEN_STABLE: Final = ("S", "Z", "T", "SR")
_WITH_PARAMETER: Final = ("D", "K", "SR", "TA")
_WEIGHINGS: Final = ("S", "SI", "SIR", "SR")
_TEXT: Final = re.compile(r'"([^"]*)"')
_WEIGHT: Final = re.compile(r"(\d{1,9}(?:\.\d{1,6})?) ([a-z]+)")
_DEFLECTION, _MIN_DEFLECTION = 0.125, 30
"""Change of the weight after which SR sends again: relative to the last value, and at least, digits."""


class Balance:
    """A platform balance.

    Args:
        send: Sends bytes.
        capacity: Largest load, kg.
        settling: Time until the value is stable after a change of the load, s.
        stability_timeout: Time limit of S, T and Z for a stable value, s.
    """

    identity: Final = {
        "I1": ("01", "2.30", "2.20", "", ""),  # levels, and the versions of level 0 to 3
        "I2": ("MS3002S 3.2 kg",),
        "I3": ("2.10 10.28.0.493.142",),
        "I4": ("B021002593",),
        "I5": ("12121306C",),
    }

    def __init__(
        self, send: Callable[[bytes], None], *, capacity: float, settling: float, stability_timeout: float
    ) -> None:
        self._send = send
        self._loop = asyncio.get_running_loop()
        self.settings = {word: value for word, (value, _) in SETTINGS.items()}
        self._settling, self._stability_timeout = settling, stability_timeout
        self._from, self._changed = 0.0, -math.inf
        self._buffer = bytearray()
        self._too_long = False
        self._waiting: deque[str] = deque()
        self._timer: asyncio.TimerHandle | None = None
        self._repeater: asyncio.TimerHandle | None = None
        self._began = 0.0
        self.capacity = capacity
        self.load = 0.0
        self.zero = 0.0
        self.tare = 0.0
        self.vibrating = False
        self.busy = False
        self.unit = "g"
        self.display: str | None = None
        """A text shown instead of the weight."""
        self.keys = KEYS_ACT
        self.next_error: str | None = None
        self.received: deque[str] = deque(maxlen=200)

    # ------------------------------------------------------------------------------------------------ serial line
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
            elif len(self._buffer) < _MAX_LINE:
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
            self._restart()
            return
        if command.partition(" ")[0] in _WEIGHINGS:
            self._stop_repeating()
        self._waiting.append(command)
        if self._timer is None:
            self._next()

    def _restart(self) -> None:
        self.cancel()
        self.tare, self.display, self.keys = 0.0, None, KEYS_ACT
        self._answer(self._identify("I4"))

    def _stop_repeating(self) -> None:
        if self._repeater is not None:
            self._repeater.cancel()
            self._repeater = None

    def cancel(self) -> None:
        """Discard all pending commands."""
        self._stop_repeating()
        self._waiting.clear()
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None

    def _next(self) -> None:
        """Answer in order; a command that waits for stability delays the following ones."""
        self._timer = None
        while self._waiting:
            command = self._waiting[0]
            if command.partition(" ")[0] in _WHEN_STABLE and not self._excuse(command):
                if self._began == 0.0:
                    self._began = self._loop.time()
                if not self.stable and self._loop.time() - self._began < self._stability_timeout:
                    self._timer = self._loop.call_later(_LOOK, self._next)
                    return
            self._began = 0.0
            self._waiting.popleft()
            for line in self._outcome(command).split("\n"):
                self._answer(line)

    def _answer(self, text: str) -> None:
        self._send(text.encode("ascii") + b"\r\n")

    def _identify(self, command: str) -> str:
        return " ".join([command, "A", *(f'"{text}"' for text in self.identity[command])])

    def _excuse(self, command: str) -> str:
        """Return the answer to a command that fails regardless of stability; empty otherwise."""
        word, _, argument = command.partition(" ")
        answered = "S" if word in _WEIGHINGS else word
        if self.next_error:
            return self.next_error
        if argument and (word != "SR" or self._kilograms(argument) is None):
            return f"{answered} L" if word in _WITH_PARAMETER else "EL"
        if self.busy:
            return f"{answered} I"
        gross = self.shown()
        if gross > self.capacity or (word in ("Z", "ZI") and gross - self.zero > ZERO_RANGE * self.capacity):
            return f"{answered} +"
        if gross < -ZERO_RANGE * self.capacity or (word in ("T", "TI") and gross - self.zero < 0.0):
            return f"{answered} -"
        return ""

    def _outcome(self, command: str) -> str:
        """Execute a command and return its answer, possibly of several lines."""
        word, _, argument = command.partition(" ")
        if self.next_error:
            error, self.next_error = self.next_error, None
            return error
        if word in SETTINGS:
            return self._setting(word, argument)
        if word == "@" or not any(word in level for level in LEVELS):
            return "ES"
        if argument and word not in _WITH_PARAMETER:
            return "EL"
        if word == "I0":
            every = [f'{level} "{each}"' for level, commands in enumerate(LEVELS) for each in commands]
            return "\n".join([*(f"I0 B {each}" for each in every[:-1]), f"I0 A {every[-1]}"])
        if word in self.identity:
            return self._identify(word)
        if word in ("D", "DW", "K", "TA", "TAC"):
            return self._set(word, argument)
        return self._excuse(command) or self._measured(word, argument)

    def _setting(self, word: str, argument: str) -> str:
        """Read a setting, or write it."""
        if not argument:
            return f"{word} A {self.settings[word]}"
        if self.busy:
            return f"{word} I"
        if not argument.isdigit() or int(argument) > SETTINGS[word][1]:
            return f"{word} L"
        self.settings[word] = int(argument)
        return f"{word} A"

    def _set(self, word: str, argument: str) -> str:
        """Execute a command that does not depend on the load."""
        if self.busy:
            return f"{word} I"
        mark = "A"
        match word:
            case "D":
                text = _TEXT.fullmatch(argument)
                if text is None:
                    return "D L"
                self.display, mark = text[1][-DISPLAY:], "R" if len(text[1]) > DISPLAY else "A"
            case "DW":
                self.display = None
            case "K":
                if argument not in ("1", "2", "3", "4"):
                    return "K L"
                self.keys = int(argument)
            case "TAC":
                self.tare = 0.0
            case "TA" if argument:
                preset = self._kilograms(argument)
                if preset is None or preset > self.capacity:
                    return "TA L"
                self.tare = round(preset * UNITS[self.unit], DECIMALS[self.unit]) / UNITS[self.unit]
        return f"TA A {self._field(self.tare)}" if word == "TA" else f"{word} {mark}"

    @staticmethod
    def _kilograms(argument: str) -> float | None:
        """Return a weight in kg from a parameter such as `10.00 g`; None if it is not one."""
        weight = _WEIGHT.fullmatch(argument)
        return float(weight[1]) / UNITS[weight[2]] if weight is not None and weight[2] in UNITS else None

    def _measured(self, word: str, argument: str = "") -> str:
        stable, gross = self.stable, self.shown()
        if word in _WHEN_STABLE and not stable:
            return f"{'S' if word == 'SR' else word} I"  # did not become stable in time
        mark = "S" if stable else "D"
        if word in _WEIGHINGS:
            net = gross - self.zero - self.tare
            if word == "SIR":
                self._repeater = self._loop.call_later(_REPEAT, self._repeat)
            elif word == "SR":
                self._watch(net, self._kilograms(argument))
            return f"S {mark} {self._field(net)}"
        if word in ("Z", "ZI"):
            self.zero, self.tare = gross, 0.0
            return "Z A" if word == "Z" else f"ZI {mark}"
        self.tare = gross - self.zero
        return f"{word} {mark} {self._field(self.tare)}"

    # ------------------------------------------------------------------------------------------------ repeated weights
    def _repeat(self) -> None:
        """Send the weight (SIR)."""
        self._answer(self._outcome("SI"))
        self._repeater = self._loop.call_later(_REPEAT, self._repeat)

    def _watch(self, last: float, preset: float | None) -> None:
        """Wait for a change of the weight, and send the dynamic weight (SR)."""
        digit = 10.0 ** -DECIMALS[self.unit] / UNITS[self.unit]
        limit = max(_DEFLECTION * abs(last), _MIN_DEFLECTION * digit) if preset is None else preset
        if abs(self.shown() - self.zero - self.tare - last) >= max(limit, digit):
            self._answer(self._outcome("SI"))
            self._repeater = self._loop.call_later(_LOOK, self._settle, preset)
        else:
            self._repeater = self._loop.call_later(_LOOK, self._watch, last, preset)

    def _settle(self, preset: float | None) -> None:
        """Wait until the weight is stable, send it, and wait for the next change."""
        if self.stable:
            self._answer(self._outcome("SI"))
            self._watch(self.shown() - self.zero - self.tare, preset)
        else:
            self._repeater = self._loop.call_later(_LOOK, self._settle, preset)

    def _field(self, kilograms: float) -> str:
        """Return the value, right-aligned in ten characters, and the unit."""
        text = f"{kilograms * UNITS[self.unit]:.{DECIMALS[self.unit]}f}"
        return f"{text.removeprefix('-') if float(text) == 0.0 else text:>10} {self.unit}"

    # ------------------------------------------------------------------------------------------------ simulated world
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
        self.settings = {word: value for word, (value, _) in SETTINGS.items()}
        self.display, self.keys = None, KEYS_ACT
        self.load = self.zero = self.tare = self._from = 0.0
        self._changed = -math.inf

    def power_cycle(self) -> None:
        """Switch off and on: the tare is lost, a small load is the new zero, and the balance sends its greeting."""
        self.drop_input()
        if abs(self.load) <= ZERO_RANGE * self.capacity:
            self.zero = self.load
        self._restart()

    def press(self, key: str) -> None:
        """Press a key. Raises ValueError."""
        if key not in KEYS:
            raise ValueError(f"key must be one of {', '.join(KEYS)}")
        code = KEYS[key]
        if self.keys == KEYS_REPORT:
            self._answer(f"K C {code}")
        elif self.keys != KEYS_OFF:
            word = key[0].upper()
            done = not self._excuse(word) and self.stable
            if done:
                self._measured(word)
            if self.keys == KEYS_ACT_AND_REPORT:
                self._answer(f"K B {code}")
                self._answer(f"K {'A' if done else 'I'} {code}")
