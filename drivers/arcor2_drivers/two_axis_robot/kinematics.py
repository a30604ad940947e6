"""Kinematics of a planar arm with two links: positions in the plane of the base, m, and angles, rad."""

import math
from typing import Final

OUT_OF_REACH: Final = 1e-9
"""Rounding error of the distance of a point, m."""

STRETCHED: Final = 0.05
"""Sine of the elbow angle below which the arm counts as stretched: joint speeds would be unlimited."""


def forward(links: tuple[float, float], q: tuple[float, float]) -> tuple[float, float, float]:
    """Return x, y of the tool center point and its heading."""
    heading = q[0] + q[1]
    x = links[0] * math.cos(q[0]) + links[1] * math.cos(heading)
    y = links[0] * math.sin(q[0]) + links[1] * math.sin(heading)
    return x, y, heading


def rates(links: tuple[float, float], q: tuple[float, float], x: float, y: float) -> tuple[float, float] | None:
    """Return the joints' rates, rad/s, for a velocity of the tool center point, m/s; None for a stretched arm."""
    first, second = links
    if abs(math.sin(q[1])) < STRETCHED:
        return None
    heading = q[0] + q[1]
    determinant = first * second * math.sin(q[1])
    here_x, here_y, _ = forward(links, q)
    one = second * (math.cos(heading) * x + math.sin(heading) * y) / determinant
    return one, -(here_x * x + here_y * y) / determinant


def _turned(angle: float) -> float:
    """Return an angle between -pi and pi."""
    return math.remainder(angle, math.tau)


def inverse(links: tuple[float, float], x: float, y: float) -> list[tuple[float, float]]:
    """Return the solutions, elbow left and right: two, one for a stretched arm, none if out of reach."""
    first, second = links
    distance = math.hypot(x, y)
    if distance > first + second + OUT_OF_REACH or distance < abs(first - second) - OUT_OF_REACH:
        return []
    cosine = (distance**2 - first**2 - second**2) / (2.0 * first * second)
    elbow = math.acos(max(-1.0, min(1.0, cosine)))
    found = []
    for q2 in (elbow, -elbow) if elbow else (elbow,):
        q1 = math.atan2(y, x) - math.atan2(second * math.sin(q2), first + second * math.cos(q2))
        found.append((_turned(q1), q2))
    return found


def nearest(
    solutions: list[tuple[float, float]], seed: tuple[float, float], limits: tuple[tuple[float, float], ...]
) -> tuple[float, float] | None:
    """Return the solution within the limits whose largest joint motion from the seed is smallest, or None."""
    allowed = [q for q in solutions if all(low <= a <= high for a, (low, high) in zip(q, limits, strict=True))]
    return min(allowed, key=lambda q: max(abs(q[0] - seed[0]), abs(q[1] - seed[1])), default=None)
