"""Collision checks along motions of an arm, in which all joints move in proportion."""

import functools
import itertools
import math
from collections.abc import Iterable, Sequence
from typing import Final, NamedTuple

import numpy as np

from arcor2_hw.collision.robot import CollisionRobot
from arcor2_hw.collision.world import CollisionWorld
from arcor2_hw.exceptions import InvalidData
from arcor2_hw.kinematics.arm import Arm
from arcor2_hw.kinematics.shapes import Array

RESOLUTION: Final = 0.01
"""Maximum travel of any point of the robot, or of an attached body, between two checked configurations, m.

Overlaps of less than half of it can be missed. None is missed when the margin of the world is half of it.
"""
MAX_CHECK_TRAVEL: Final = 0.08
"""Maximum travel covered by one check with an enlarged margin, m."""
MAX_CHECKS: Final = 200_000
"""Maximum number of checks of one motion."""


class Hit(NamedTuple):
    """The first collision along a motion.

    Attributes:
        share: Position along the motion, 0 to 1.
        what: The two objects in contact, as text.
    """

    share: float
    what: str


class Sweep:
    """Checks motions of one arm of a robot in a collision world. Joint values are those of the arm.

    The other joints of the robot, other robots and all bodies are taken as they are when the sweep is created. Bodies
    attached to the robot are checked too. Not safe for use by two threads at once.

    Args:
        world: The world.
        robot: Id of the robot.
        arm: The arm.
        resolution: Maximum travel between two checked configurations, m.
        farthest: Maximum travel covered by one check with an enlarged margin, m.

    Attributes:
        levers: Maximum travel of any point of the robot per unit of each joint, m per rad or m per m.
        checks: Number of configurations checked so far.
    """

    def __init__(
        self,
        world: CollisionWorld,
        robot: str,
        arm: Arm,
        resolution: float = RESOLUTION,
        farthest: float = MAX_CHECK_TRAVEL,
    ) -> None:
        if not 1e-4 <= resolution <= 1.0:
            raise InvalidData("The resolution must be 0.0001 to 1 m, not {resolution!r}.", resolution=resolution)
        self.world, self.robot, self.arm, self.resolution = world, robot, arm, resolution
        self._standing = world.robot(robot)
        self._q = self._standing.q.copy()
        self.levers = travel_per_joint(self._standing)[arm.indices]
        self.checks = 0
        self._levels = int(np.log2(farthest / resolution)) if resolution < farthest else 0

    def travel(self, a: Array, b: Array) -> float:
        """Return an upper bound of the travel of any point of the robot from `a` to `b`, m."""
        return float(self.levers @ np.abs(b - a))

    def is_free(self, q: Array) -> bool:
        """Return whether joint values are free of collision."""
        self.checks += 1
        return self.world.is_free(self.robot, self.whole(q))

    def hit(self, q: Array) -> str:
        """Return the first contact at joint values as text, empty when there is none."""
        self.checks += 1
        return self.world.first_contact(self.robot, self.whole(q))

    def is_free_between(self, a: Array, b: Array, resolution: float | None = None) -> bool:
        """Return whether the motion from `a` to `b` is free of collision. `a` itself is taken to be free.

        Args:
            a: Joint values at the start.
            b: Joint values at the end; they are checked too.
            resolution: Travel between two checked configurations, m. A coarse value finds most collisions quickly.
                None: a coarse check first, then `is_free_at_full_resolution`.
        """
        if resolution is None:
            return self.is_free_between(a, b, 8.0 * self.resolution) and self.is_free_at_full_resolution(a, b)
        way = b - a
        count = self._count(a, b, resolution)
        return all(self.is_free(a + number / count * way) for number in _far_apart(count))

    def is_free_at_full_resolution(self, a: Array, b: Array) -> bool:
        """Return whether the motion from `a` to `b` is free of collision at the full resolution.

        Where the surroundings are farther away than the robot travels, no configuration between is checked. The links
        of the robot are always near each other, so self-collision is checked at every step.
        """
        way, count = b - a, self._count(a, b, self.resolution)
        standing = self._standing
        if any(standing.in_self_collision(self.whole(a + number / count * way)) for number in _far_apart(count)):
            return False
        chunks = self._chunks(count)
        return self._first_near(a, way, _far_apart(chunks), chunks) is None

    def first_contact(self, waypoints: Sequence[Array]) -> Array | None:
        """Return the first joint values on a path that collide with the surroundings, or None.

        Collisions of the robot with itself are ignored.
        """
        self.checks += 1
        if not self.world.is_free_around(self.robot, self.whole(waypoints[0])):
            return waypoints[0]
        for a, b in itertools.pairwise(waypoints):
            chunks = self._chunks(self._count(a, b, self.resolution))
            share = self._first_near(a, b - a, range(1, chunks + 1), chunks)
            if share is not None:
                return a + share * (b - a)
        return None

    def _chunks(self, count: int) -> int:
        return math.ceil(count / (1 << self._levels))

    def _first_near(self, a: Array, direction: Array, order: Iterable[int], chunks: int) -> float | None:
        """Return the first position, in the given order of chunks, that is too near something, or None."""
        for number in order:
            share = self._near(a, direction, (number - 0.5) / chunks, 0.5 / chunks, self._levels)
            if share is not None:
                return share
        return None

    def _near(self, a: Array, direction: Array, middle: float, half: float, levels: int) -> float | None:
        self.checks += 1
        more = self.resolution / 2.0 * 2.0**levels if levels else 0.0
        if self.world.is_free_around(self.robot, self.whole(a + middle * direction), more):
            return None
        if not levels:
            return middle
        before = self._near(a, direction, middle - half / 2.0, half / 2.0, levels - 1)
        return before if before is not None else self._near(a, direction, middle + half / 2.0, half / 2.0, levels - 1)

    def whole(self, q: Array) -> Array:
        """Return the joint values of the model for those of the arm, a view that the next call overwrites."""
        self._q[self.arm.indices] = q
        return self._q

    def first_hit(self, waypoints: Sequence[Array]) -> Hit | None:
        """Return the first collision along a path through waypoints, or None if there is none."""
        lengths = [self.travel(a, b) for a, b in itertools.pairwise(waypoints)]
        whole, done = sum(lengths), 0.0
        if what := self.hit(waypoints[0]):
            return Hit(0.0, what)
        for a, b, length in zip(waypoints, waypoints[1:], lengths, strict=False):
            count = self._count(a, b, self.resolution)
            for number in range(1, count + 1):
                if what := self.hit(a + number / count * (b - a)):
                    return Hit((done + number / count * length) / whole if whole > 0.0 else 0.0, what)
            done += length
        return None

    def _count(self, a: Array, b: Array, resolution: float) -> int:
        count = max(1, math.ceil(self.travel(a, b) / resolution - 1e-9))
        if count > MAX_CHECKS:
            raise InvalidData(
                "A motion of {name} needs {count} collision checks, but at most {most_checks} are allowed.",
                name=self.arm.model.name,
                count=count,
                most_checks=MAX_CHECKS,
            )
        return count


@functools.lru_cache(maxsize=4096)
def _far_apart(count: int) -> tuple[int, ...]:
    """Return 1 to `count`: the last first, then always halfway between. Collisions are found sooner in this order."""
    order, step = [count], 1 << (count - 1).bit_length()
    while step > 1:
        order += range(step // 2, count, step)
        step //= 2
    return tuple(order)


def travel_per_joint(robot: CollisionRobot) -> Array:
    """Return for each joint of the model an upper bound of the travel of any point of the robot per rad, or per m.

    The bound holds for all joint values within the limits: it adds up the distances from the joint axis to the
    farthest part behind it, as if the arm was stretched out.
    """
    tree = robot.tree
    parents, placements = list(tree.model.parents), tree.model.jointPlacements
    slides = _slides(robot)
    bounds = np.zeros(len(parents))
    reach = np.zeros(len(parents))
    for part in robot.parts:
        box, at = part.geometry, part.origin
        radius = float(np.linalg.norm(at[:3, :3] @ box.aabb_center + at[:3, 3]) + box.aabb_radius)
        reach[part.body] = max(reach[part.body], radius)
    for body in range(len(parents) - 1, 0, -1):  # a child always comes after its parent
        bounds[body] = 1.0 if slides[body] is not None else reach[body]
        beyond = float(np.linalg.norm(placements[body].translation)) + reach[body] + (slides[body] or 0.0)
        reach[parents[body]] = max(reach[parents[body]], beyond)
    # A joint moves all joints that mimic it.
    factors = tree.coupling
    return np.asarray(np.abs(factors).T @ bounds[1:])


def _slides(robot: CollisionRobot) -> list[float | None]:
    """Return for each body of Pinocchio's model the maximum travel of its prismatic joint, m, or None."""
    found: list[float | None] = [None]
    joints = {joint.name: joint for joint in robot.model.description.joints}
    for name in list(robot.tree.model.names)[1:]:
        joint = joints[name]
        farthest = max(abs(joint.lower), abs(joint.upper))
        if joint.mimic is not None:
            leader = joints[joint.mimic.joint]
            lead = max(abs(leader.lower), abs(leader.upper))
            farthest = abs(joint.mimic.multiplier) * lead + abs(joint.mimic.offset)
        found.append(float(farthest) if joint.kind == "prismatic" else None)
    return found
