"""The gripper, independent of wires: registers, fingers that move in time, and the part between them."""

from __future__ import annotations

import dataclasses
import time
from collections import deque
from collections.abc import Callable
from typing import Final

MOVING, CONTACT_OPENING, CONTACT_CLOSING, ARRIVED = range(4)
"""gOBJ."""
RESET, ACTIVATING, ACTIVE = 0, 1, 3
"""gSTA."""
TOO_EARLY, NOT_ACTIVATED, INTERFERENCE, FIRST_MAJOR = 5, 7, 13, 10
"""gFLT: action before the activation has ended; without activation; activation fault; first fault that stops it."""
FAULTS: Final = frozenset({0, 5, 7, 8, 9, 10, 11, 12, 13, 14, 15})
REQUESTS: Final = ("ACT", "GTO", "ATR", "ARD", "POS", "SPE", "FOR")


@dataclasses.dataclass(frozen=True)
class Mechanics:
    """Mechanical properties of the model; positions in counts, the rest in SI units."""

    stroke: float = 0.085
    open_count: int = 3
    closed_count: int = 230
    speeds: tuple[float, float] = (0.020, 0.150)
    activation_speed: float = 0.100
    latency: float = 0.015

    def count(self, width: float) -> float:
        """Return the position at a width between the fingers."""
        return self.closed_count - (self.closed_count - self.open_count) * width / self.stroke

    def width(self, count: float) -> float:
        """Return the width between the fingers at a position."""
        return (self.closed_count - count) * self.stroke / (self.closed_count - self.open_count)

    def rate(self, speed: float) -> float:
        """Return the speed in counts/s for a speed in m/s."""
        return speed * (self.closed_count - self.open_count) / self.stroke


class Pace:
    """A clock of the simulation, whose speed can change."""

    def __init__(self, clock: Callable[[], float], factor: float) -> None:
        self._clock, self._factor = clock, factor
        self._since, self._now = clock(), 0.0

    def __call__(self) -> float:
        """Return the time of the simulation, s."""
        return self._now + (self._clock() - self._since) * self._factor

    def set(self, factor: float) -> None:
        """Set the speed; 1 is real time. Raise `ValueError`."""
        if not 0.01 <= factor <= 1000.0:
            raise ValueError("factor must be 0.01 to 1000")
        self._now, self._since, self._factor = self(), self._clock(), factor


class Gripper:
    """Fingers and registers. `clock` returns seconds; each access first advances the simulation to the present."""

    def __init__(self, clock: Callable[[], float], mechanics: Mechanics | None = None) -> None:
        self.mechanics = mechanics or Mechanics()
        self._clock = clock
        self._advanced_to = clock()
        self._pending: deque[tuple[float, dict[str, int]]] = deque()
        self.requested = dict.fromkeys(REQUESTS, 0)
        self._position = float(self.mechanics.open_count)
        self._status = RESET
        self._object = MOVING
        self._fault = 0
        self._legs: list[float] = []
        self._part: float | None = None
        self._blocked = False
        self.commands: deque[dict[str, int]] = deque(maxlen=50)
        self.stops: deque[float] = deque(maxlen=200)
        """Times of requests that end a motion (GTO 0), on the monotonic clock, s."""
        self.count = 0
        """Number of commands since the start."""

    # ------------------------------------------------------------------------------------------- from the wire
    def request(self, changes: dict[str, int]) -> None:
        """Receive requests; they take effect after the latency."""
        self.commands.append(dict(changes))
        self.count += 1
        if changes.get("GTO") == 0:
            self.stops.append(time.monotonic())
        self._pending.append((self._clock() + self.mechanics.latency, dict(changes)))

    def registers(self) -> dict[str, int]:
        """Return the present registers."""
        self.advance()
        moving = self._object == MOVING and (self._status == ACTIVATING or self.requested["GTO"] == 1)
        return {
            **self.requested,
            "STA": self._status,
            "OBJ": self._object,
            "FLT": self._fault,
            "PRE": self.requested["POS"],
            "POS": round(self._position),
            "COU": 30 if moving else 0,
        }

    # ------------------------------------------------------------------------------------------- from the world
    def put_part(self, width: float) -> None:
        """Put a part between the fingers. Raise `ValueError` if it does not fit."""
        self.advance()
        if not 0.0 < width <= self.mechanics.width(self._position) + 1e-9:
            raise ValueError(
                f"width must be above 0 and up to {self.mechanics.width(self._position):.4f} m, the opening"
            )
        self._part = width

    def remove_part(self) -> None:
        """Remove the part; the fingers continue to the requested position."""
        self.advance()
        self._part = None
        if self.requested["GTO"] and self._object == CONTACT_CLOSING and not self._blocked:
            self._object = MOVING

    def block(self, on: bool = True) -> None:
        """Block the fingers at their position, or release them."""
        self.advance()
        self._blocked = on
        if not on and self.requested["GTO"] and self._object in (CONTACT_OPENING, CONTACT_CLOSING):
            self._object = MOVING

    def fault(self, code: int) -> None:
        """Raise a fault; 0 clears a minor one. Faults from 10 on are cleared only by a reset (ACT 0)."""
        self.advance()
        if code not in FAULTS:
            raise ValueError(f"code must be one of {', '.join(map(str, sorted(FAULTS)))}")
        self._fault = code
        if code >= FIRST_MAJOR:
            self._legs = []

    def power_cycle(self) -> None:
        """Switch off and on: all registers are 0, the fingers keep their position."""
        self.advance()
        self._pending.clear()
        self._reset()
        self.requested = dict.fromkeys(REQUESTS, 0)

    def truth(self) -> dict[str, object]:
        """Return the true state."""
        registers = self.registers()
        width = self.mechanics.width(self._position)
        gripped = self._part is not None and abs(width - self._part) < 1e-6
        return {
            "registers": registers,
            "position": self._position,
            "width": width,
            "part": self._part,
            "gripped": gripped,
            "blocked": self._blocked,
            "count": self.count,
            "commands": list(self.commands),
        }

    # ------------------------------------------------------------------------------------------- in time
    def advance(self) -> None:
        """Advance the simulation to the present."""
        now = self._clock()
        while self._pending and self._pending[0][0] <= now:
            due, changes = self._pending.popleft()
            self._move(max(due - self._advanced_to, 0.0))
            self._advanced_to = max(due, self._advanced_to)
            self._apply(changes)
        self._move(now - self._advanced_to)
        self._advanced_to = now

    def _reset(self) -> None:
        self._status, self._object, self._fault, self._legs = RESET, MOVING, 0, []

    def _apply(self, changes: dict[str, int]) -> None:
        was = dict(self.requested)
        self.requested.update(changes)
        if not self.requested["ACT"]:
            self._reset()
            if self.requested["GTO"]:
                self._fault = NOT_ACTIVATED
            return
        if not was["ACT"]:
            self._status, self._fault = ACTIVATING, 0
            if self._part is not None or self._blocked:
                self._fault = INTERFERENCE
            else:
                ends = float(self.mechanics.open_count), float(self.mechanics.closed_count)
                self._legs = [ends[0], ends[1], ends[0]]
        if self._status == ACTIVATING and self.requested["GTO"] and self._fault == 0:
            self._fault = TOO_EARLY
        started = self.requested["GTO"] and (self.requested["POS"] != was["POS"] or not was["GTO"])
        if started and self._status == ACTIVE:
            self._object = MOVING

    def _move(self, seconds: float) -> None:
        """Advance by `seconds` under the present requests."""
        if self._fault >= FIRST_MAJOR:
            return
        if self._status == ACTIVATING:
            rate = self.mechanics.rate(self.mechanics.activation_speed)
            while self._legs and seconds > 0.0:
                seconds = self._approach(self._legs[0], rate, seconds)
                if self._position == self._legs[0]:
                    self._legs.pop(0)
            if not self._legs:
                self._status, self._object = ACTIVE, ARRIVED
                self._fault = 0 if self._fault == TOO_EARLY else self._fault
                if self.requested["GTO"]:
                    self._object = MOVING
        if self._status != ACTIVE or not self.requested["GTO"] or self._object != MOVING:
            return
        low, high = self.mechanics.speeds
        rate = self.mechanics.rate(low + (high - low) * self.requested["SPE"] / 255.0)
        target = min(max(float(self.requested["POS"]), self.mechanics.open_count), self.mechanics.closed_count)
        closing = target > self._position
        stop = target
        if self._blocked:
            stop = self._position
        elif closing and self._part is not None:
            stop = max(self._position, min(target, self.mechanics.count(self._part)))
        self._approach(stop, rate, seconds)
        if self._position == stop:
            self._object = ARRIVED if stop == target else CONTACT_CLOSING if closing else CONTACT_OPENING

    def _approach(self, target: float, rate: float, seconds: float) -> float:
        """Move towards `target` and return the remaining seconds."""
        distance = target - self._position
        if abs(distance) <= rate * seconds:
            self._position = target
            return seconds - abs(distance) / rate
        self._position += rate * seconds if distance > 0.0 else -rate * seconds
        return 0.0
