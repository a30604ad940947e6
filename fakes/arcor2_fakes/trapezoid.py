"""Trapezoidal speed profiles of simulated motions."""

import math


class Trapezoid:
    """A trapezoidal or triangular speed profile over a distance, from standstill to standstill."""

    def __init__(self, distance: float, speed: float, acceleration: float) -> None:
        self.distance = distance
        self._acceleration = acceleration
        self._peak = min(speed, math.sqrt(distance * acceleration)) if distance > 0.0 else 0.0
        self.ramp = self._peak / acceleration
        """Duration of each ramp, s."""
        cruise = (distance - self._peak * self.ramp) / self._peak if self._peak > 0.0 else 0.0
        self.duration = 2.0 * self.ramp + cruise
        """Duration of the motion, s."""

    def position(self, t: float) -> float:
        """Return the distance covered after `t` s."""
        if t >= self.duration:
            return self.distance
        if t < self.ramp:
            return 0.5 * self._acceleration * t * t
        left = self.duration - t
        if left < self.ramp:
            return self.distance - 0.5 * self._acceleration * left * left
        return self._peak * (t - 0.5 * self.ramp)

    def share(self, t: float) -> float:
        """Return the fraction of the distance covered after `t` s."""
        return 1.0 if t >= self.duration else self.position(t) / self.distance
