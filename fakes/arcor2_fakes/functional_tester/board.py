"""Boards under test: the defects one can have, what the station measures on each, and the limits it judges by."""

from __future__ import annotations

import random
from typing import Literal

import msgspec

Defect = Literal["short", "open", "leakage"]

# Mean supply voltage (V), supply current (A) and contact resistance (Ω) of each kind of board. A short pulls the supply
# down into its current limit, an open circuit draws next to nothing through a contact that isn't one, leakage adds
# current.
_NOMINAL: dict[Defect | None, tuple[float, float, float]] = {
    None: (5.0, 0.120, 0.050),
    "short": (3.1, 1.950, 0.048),
    "open": (5.1, 0.002, 47.0),
    "leakage": (4.98, 0.190, 0.052),
}
_SPREAD = 0.02  # greatest relative deviation of a reading; the limits below leave room for it on every side

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
        """Say whether the test program passes a board with these values."""
        return (
            VOLTAGE_LIMITS[0] <= self.supply_voltage <= VOLTAGE_LIMITS[1]
            and CURRENT_LIMITS[0] <= self.supply_current <= CURRENT_LIMITS[1]
            and self.contact_resistance <= MAX_CONTACT_RESISTANCE
        )


def measure(board: Board, noise: random.Random) -> Measured:
    """Measure a board; `noise` supplies the scatter of the readings."""
    return Measured(*(mean * (1.0 + noise.uniform(-_SPREAD, _SPREAD)) for mean in _NOMINAL[board.defect]))
