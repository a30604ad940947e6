"""Whether the arm is where it was to go: tolerances of a pose and of joint values."""

from collections.abc import Callable, Sequence
from typing import Final

from .frames import from_vector
from .observer import Sample

JOINTS_REACHED: Final = 0.01
POSITION_REACHED: Final = 0.002
ANGLE_REACHED: Final = 0.02


def at_pose(vector: list[float]) -> Callable[[Sample], bool]:
    """Give what tells whether the TCP is at a pose of the controller's base."""
    there = from_vector(vector)

    def reached(sample: Sample) -> bool:
        at = from_vector(sample.tcp)
        near = at.position.distance_to(there.position) < POSITION_REACHED
        return near and at.orientation.angle_to(there.orientation) < ANGLE_REACHED

    return reached


def at_joints(q: Sequence[float]) -> Callable[[Sample], bool]:
    """Give what tells whether the joints have their values."""
    return lambda sample: max(abs(a - b) for a, b in zip(sample.q, q, strict=True)) < JOINTS_REACHED
