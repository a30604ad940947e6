"""An obstacle for the tool: a plane with a stiffness, such as a bench or a part in a vice."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

STIFFNESS = 20_000.0  # N/m: a part on a bench, with the compliance of the arm
COLLISION_FORCE = 150.0  # N: force at the TCP at which the controller stops the arm; UR's default limit
CONTACT_FORCE = 5.0  # N: force that counts as a contact (tool_contact)


@dataclass(frozen=True)
class Obstacle:
    """A plane through a point in the base; the normal points away from the obstacle."""

    point: tuple[float, float, float]
    normal: tuple[float, float, float]
    stiffness: float = STIFFNESS

    @classmethod
    def of(cls, point: Sequence[float], normal: Sequence[float], stiffness: float = STIFFNESS) -> "Obstacle":
        """Check the values. Raise `ValueError`."""
        length = math.hypot(*normal)
        if len(point) != 3 or len(normal) != 3 or not 0.0 < length < math.inf or not 0.0 < stiffness < math.inf:
            raise ValueError("an obstacle has a point and a normal of three numbers and a stiffness above zero")
        x, y, z = (v / length for v in normal)
        return cls((point[0], point[1], point[2]), (x, y, z), stiffness)

    def force(self, tip: Sequence[float]) -> tuple[float, float, float]:
        """Return the force on the tool, N in base axes: that of a spring, when the tip is behind the plane."""
        depth = sum(n * (p - t) for n, p, t in zip(self.normal, self.point, tip, strict=False))
        if depth <= 0.0:
            return (0.0, 0.0, 0.0)
        x, y, z = (self.stiffness * depth * n for n in self.normal)
        return (x, y, z)
