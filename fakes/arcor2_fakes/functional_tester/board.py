"""Boards under test: their defects, the values measured on them, and the limits of the test."""

from __future__ import annotations

import random
from typing import Literal

import msgspec

Defect = Literal["short", "open", "leakage"]

# Mean supply voltage (V), supply current (A) and contact resistance (Ω) of each kind of board. A short pulls the supply
# down to its current limit, an open circuit has almost no current and a high resistance, leakage adds current.
_NOMINAL: dict[Defect | None, tuple[float, float, float]] = {
    None: (5.0, 0.120, 0.050),
    "short": (3.1, 1.950, 0.048),
    "open": (5.1, 0.002, 47.0),
    "leakage": (4.98, 0.190, 0.052),
}
_SPREAD = 0.02  # largest relative deviation of a reading; smaller than the distance to the limits below

VOLTAGE_LIMITS = (4.75, 5.25)
CURRENT_LIMITS = (0.100, 0.150)
MAX_CONTACT_RESISTANCE = 0.2


class Board(msgspec.Struct, frozen=True):
    """A printed circuit board in the fixture."""

    code: str
    defect: Defect | None = None


class Measured(msgspec.Struct, frozen=True):
    """Values measured in one test, in V, A and Ω."""

    supply_voltage: float = 0.0
    supply_current: float = 0.0
    contact_resistance: float = 0.0

    def within_limits(self) -> bool:
        """Return whether the values are within the limits."""
        return (
            VOLTAGE_LIMITS[0] <= self.supply_voltage <= VOLTAGE_LIMITS[1]
            and CURRENT_LIMITS[0] <= self.supply_current <= CURRENT_LIMITS[1]
            and self.contact_resistance <= MAX_CONTACT_RESISTANCE
        )


def measure(board: Board, noise: random.Random) -> Measured:
    """Return the values measured on a board with random noise."""
    return Measured(*(mean * (1.0 + noise.uniform(-_SPREAD, _SPREAD)) for mean in _NOMINAL[board.defect]))
