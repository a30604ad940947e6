"""Nominal geometry of the arms (Denavit-Hartenberg parameters as the maker publishes them for each model).

A real arm differs from it by millimetres, which its controller knows; here it only bounds a speed.
"""

import math
from typing import Final, NamedTuple

from arcor2_hw.data.geometry import Orientation, Pose, Position

STEP: Final = 1e-3
"""Seconds over which a speed is taken from two positions."""


class Dimensions(NamedTuple):
    """The lengths of an arm, m."""

    d1: float
    a2: float
    a3: float
    d4: float
    d5: float
    d6: float


UR3E: Final = Dimensions(0.15185, -0.24355, -0.2132, 0.13105, 0.08535, 0.0921)
UR5E: Final = Dimensions(0.1625, -0.425, -0.3922, 0.1333, 0.0997, 0.0996)
UR10E: Final = Dimensions(0.1807, -0.6127, -0.57155, 0.17415, 0.11985, 0.11655)


def flange(arm: Dimensions, q: list[float]) -> Pose:
    """Give the flange in the controller's base for six joint values, rad."""
    quarter = math.pi / 2.0
    links = (
        (0.0, arm.d1, quarter),
        (arm.a2, 0.0, 0.0),
        (arm.a3, 0.0, 0.0),
        (0.0, arm.d4, quarter),
        (0.0, arm.d5, -quarter),
        (0.0, arm.d6, 0.0),
    )
    pose = Pose()
    for (a, d, twist), angle in zip(links, q, strict=True):
        turn = Orientation.from_rotation_vector(0.0, 0.0, angle) * Orientation.from_rotation_vector(twist, 0.0, 0.0)
        pose = pose * Pose(Position(a * math.cos(angle), a * math.sin(angle), d), turn)
    return pose


def tcp_speed(arm: Dimensions, q: list[float], rates: list[float], tcp: Pose) -> float:
    """Give the speed of a TCP (pose in the flange), m/s, at joint values q (rad) and rates (rad/s)."""
    there = [value + STEP * rate for value, rate in zip(q, rates, strict=True)]
    return (flange(arm, q) * tcp).position.distance_to((flange(arm, there) * tcp).position) / STEP
