"""How long a motion may take: pure functions behind the driver's deadlines."""

import math
from typing import Final

SLACK: Final = 1.5
"""A move may take that many times what it should: the controller blends its own limits into ours."""
GRACE: Final = 3.0
"""Seconds on top: for the command to get there and the arm to come to rest."""
SLOWEST_FRACTION: Final = 0.05
"""Time runs slower for a move while the speed slider is down, but not slower than this."""
ROTATION_SPEED: Final = 0.5
"""rad/s the tool turns at least in a linear move with the TCP's speed limited."""


def trapezoid(distance: float, speed: float, acceleration: float) -> float:
    """Give the seconds of a motion from rest to rest with trapezoidal speed."""
    ramp = speed * speed / acceleration
    if distance >= ramp:
        return distance / speed + speed / acceleration
    return 2.0 * math.sqrt(distance / acceleration)


def joint_budget(start: tuple[float, ...], target: list[float], speed: float, acceleration: float) -> float:
    """Give the seconds at full speed slider that a joint motion may take."""
    longest = max(abs(b - a) for a, b in zip(start, target, strict=True))
    return SLACK * trapezoid(longest, speed, acceleration) + GRACE


def linear_budget(distance: float, angle: float, speed: float, acceleration: float) -> float:
    """Give the seconds at full speed slider that a linear motion may take; m and rad."""
    return SLACK * (trapezoid(distance, speed, acceleration) + angle / ROTATION_SPEED) + GRACE
