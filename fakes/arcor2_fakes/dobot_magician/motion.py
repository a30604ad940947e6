"""A motion: a path of parts, each with a trapezoidal speed profile."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

from arcor2_fakes.dobot_magician.geometry import Four
from arcor2_fakes.trapezoid import Trapezoid


def between(a: Four, b: Four, share: float) -> Four:
    """Return the point at a fraction of the distance from `a` to `b`."""
    return (
        a[0] + (b[0] - a[0]) * share,
        a[1] + (b[1] - a[1]) * share,
        a[2] + (b[2] - a[2]) * share,
        a[3] + (b[3] - a[3]) * share,
    )


@dataclasses.dataclass(frozen=True)
class Part:
    """A part of a motion: speed profile, and joints at a fraction of it (None: out of reach)."""

    timing: Trapezoid
    joints_at: Callable[[float], Four | None]


class Motion:
    """Parts executed one after the other."""

    def __init__(self, parts: list[Part]) -> None:
        self._parts = parts
        self._time = 0.0

    def advance(self, seconds: float) -> tuple[Four | None, bool]:
        """Advance; return the joints (None: out of reach) and whether the motion has ended."""
        self._time += seconds
        while len(self._parts) > 1 and self._time >= self._parts[0].timing.duration:
            self._time -= self._parts.pop(0).timing.duration
        timing = self._parts[0].timing
        return self._parts[0].joints_at(timing.share(self._time)), self._time >= timing.duration
