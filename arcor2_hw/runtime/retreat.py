"""Motion of a robot out of a zone: along the retract path of the zone, or without one by the shortest path.

None of this is a safety function.
"""

import math
from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Final

from msgspec.structs import replace

from arcor2_hw.collision.description import Obstacle
from arcor2_hw.data import object_type
from arcor2_hw.data.geometry import Position
from arcor2_hw.exceptions import Cancelled, Interlocked
from arcor2_hw.kinematics.primitives import Box, Cylinder, Sphere, primitive_of
from arcor2_hw.messages import Message
from arcor2_hw.runtime.messages import Lease

MAX_SPEED: Final = 0.05
"""Maximum speed of a robot that leaves a zone, m/s."""
TOLERANCE: Final = 0.003
"""Distance by which a robot may move back while it leaves, m: noise of its readings."""
PROBE_LENGTH: Final = 0.01
"""Length of the motion for which the progress of a velocity is computed, m."""
MIN_PROGRESS: Final = 0.3
"""Minimum fraction of a motion that has to lead out of each zone."""
REACHED_DISTANCE: Final = 0.005
"""Distance to a point of the path at which it counts as reached, m."""


class Retreat:
    """The path out of one zone.

    Args:
        body: the zone, a primitive shape.
        path: points in the frame of the body, the last one outside; none for the shortest path.
        tips: indices of the end effectors that are in the zone.
    """

    def __init__(self, body: Obstacle, path: Sequence[Position], tips: Sequence[int] = (0,)) -> None:
        self._body, self._path = body, list(path)
        self._into = body.pose.inverted()
        self.tips = tips

    def remaining(self, tips: Sequence[Position]) -> float:
        """Return the sum of the distances of end effectors (poses in the world) from the ends of their paths, m.

        Without a path, it is negative outside of the zone.
        """
        return math.fsum(self._length(self._local(tips[index])) for index in self.tips)

    def direction(self, tip: Position) -> Position | None:
        """Return the unit vector in the world along which an end effector leaves; None at the end of the path."""
        point = self._local(tip)
        if self._path:
            target = self._path[self._next(point)] - point
        else:
            depth, target = _outwards(self._body, point)
            if depth < 0.0:
                return None
        length = math.hypot(*target)
        if length < REACHED_DISTANCE and self._path:
            return None
        return Position(*(each / length for each in target)).rotated(self._body.pose.orientation)

    def _local(self, tip: Position) -> Position:
        return self._into.position + tip.rotated(self._into.orientation)

    def _length(self, point: Position) -> float:
        if not self._path:
            return _outwards(self._body, point)[0]
        following = self._path[self._next(point) :]
        return point.distance_to(following[0]) + math.fsum(a.distance_to(b) for a, b in pairwise(following))

    def _next(self, point: Position) -> int:
        """Return the index of the next point of the path: the end of the nearest section."""
        sections = list(pairwise(self._path))
        if not sections:
            return 0
        nearest = min(range(len(sections)), key=lambda index: _distance(point, *sections[index]))
        at_end = point.distance_to(self._path[nearest + 1]) < REACHED_DISTANCE
        return min(nearest + 1 + at_end, len(self._path) - 1)


class ZoneExit:
    """A hold-to-run motion out of zones, which is slow and may not lead deeper into any of them.

    Args:
        device: name of the robot.
        ways: the path out of each zone, by the name of the zone.
        tips: positions of the end effectors in the world.
    """

    def __init__(self, device: str, ways: Mapping[str, Retreat], tips: Sequence[Position]) -> None:
        self._device, self._ways = device, dict(ways)
        self._remaining = {zone: way.remaining(tips) for zone, way in ways.items()}

    def check(self, tips: Sequence[Position]) -> Message | None:
        """Return the reason if the robot has moved back and has to stop. Return None while it moves out."""
        for zone, way in self._ways.items():
            now = way.remaining(tips)
            if now > self._remaining[zone] + TOLERANCE:
                return Message.of("It may only move out of the zone {zone}", zone=zone)
            self._remaining[zone] = min(now, self._remaining[zone])
        return None

    def left(self, zone: str) -> None:
        """Record that the robot has left a zone by itself, so that it may move in any direction there."""
        self._ways.pop(zone, None)

    def steer(self, lease: Lease, tips: Sequence[Position]) -> tuple[Lease, float]:
        """Return a lease with a slow velocity out of the zones, and the scale of its velocity.

        Raises:
            Interlocked: the velocity does not lead out of the zones, or its direction in the world is unknown.
            Cancelled: the robot is at the end of its path.
        """
        if lease.retract:
            way = next(iter(self._ways.values()))
            direction = way.direction(tips[way.tips[0]])
            if direction is None:
                raise Cancelled("{device} has left the zone.", device=self._device)
            x, y, z = (MAX_SPEED * each for each in direction)
            return replace(lease, twist=(x, y, z, 0.0, 0.0, 0.0), frame="world"), 1.0
        if lease.twist is None or lease.frame != "world" or any(lease.twist[3:]):
            raise Interlocked(
                "{device} is in the zone {zone}. Move it straight out, in the axes of the world.",
                device=self._device,
                zone=next(iter(self._ways), ""),
            )
        speed = math.hypot(*lease.twist[:3])
        if speed == 0.0:
            return lease, 1.0
        step = Position(*(PROBE_LENGTH * each / speed for each in lease.twist[:3]))
        for zone, way in self._ways.items():
            if way.remaining(tips) - way.remaining([tip + step for tip in tips]) < MIN_PROGRESS * PROBE_LENGTH:
                raise Interlocked(
                    "{device} may only move out of the zone {zone}, not deeper.", device=self._device, zone=zone
                )
        scale = min(1.0, MAX_SPEED / speed)
        x, y, z = (scale * each for each in lease.twist[:3])
        return replace(lease, twist=(x, y, z, 0.0, 0.0, 0.0)), scale


def ends_outside(path: Sequence[Position], model: object_type.Models) -> bool:
    """Return whether a retract path, in the frame of the body, ends outside of the body."""
    if isinstance(model, object_type.Mesh):
        return False
    return _depth(primitive_of(model), path[-1])[0] < 0.0


def _distance(point: Position, start: Position, end: Position) -> float:
    """Return the distance of a point to a section, m."""
    way, to = end - start, point - start
    square = math.fsum(each * each for each in way)
    share = math.fsum(a * b for a, b in zip(way, to, strict=True)) / square if square > 0.0 else 0.0
    share = min(max(share, 0.0), 1.0)
    return point.distance_to(start + Position(*(share * each for each in way)))


def _outwards(body: Obstacle, point: Position) -> tuple[float, Position]:
    assert not isinstance(body.model, object_type.Mesh)  # no zone is a mesh
    return _depth(primitive_of(body.model), point)


def _depth(shape: Box | Cylinder | Sphere, point: Position) -> tuple[float, Position]:
    """Return the distance to the nearest surface, m, negative outside, and the unit vector to it."""
    match shape:
        case Box():
            halves = (shape.x / 2, shape.y / 2, shape.z / 2)
            index = min(range(3), key=lambda axis: halves[axis] - abs(tuple(point)[axis]))
            value = tuple(point)[index]
            normal = [0.0, 0.0, 0.0]
            normal[index] = math.copysign(1.0, value)
            return halves[index] - abs(value), Position(*normal)
        case Sphere():
            distance = math.hypot(*point)
            return shape.radius - distance, _unit(point, distance)
        case Cylinder():
            around, up = math.hypot(point.x, point.y), shape.length / 2 - abs(point.z)
            if up < shape.radius - around:
                return up, Position(0.0, 0.0, math.copysign(1.0, point.z))
            return shape.radius - around, _unit(Position(point.x, point.y, 0.0), around)


def _unit(vector: Position, length: float) -> Position:
    return Position(*(each / length for each in vector)) if length > 1e-6 else Position(1.0, 0.0, 0.0)
