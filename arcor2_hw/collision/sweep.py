"""Whether an arm may move from joint values to others, all joints in proportion, at a stated resolution."""

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
"""m that no point of the robot, nor of what it holds, travels farther between two configurations that are looked at.
So what is missed is an overlap of less than half of it; nothing is when the world's margin is half of it."""
FARTHEST: Final = 0.08
"""m, the most that a motion is taken in one piece when it is looked whether everything is farther away."""
MOST_CHECKS: Final = 200_000
"""Configurations of one motion."""


class Hit(NamedTuple):
    """That a motion is in collision: at which share of it, and what with what."""

    share: float
    what: str


class Sweep:
    """Asks a collision world about motions of one arm of a robot in it. Joint values are the arm's.

    The robot's other joints, other robots and all bodies stand as they do when this is made. What the robot holds is
    part of it. levers: m (per m where prismatic) that a point of the robot travels at most per unit of each joint.
    checks: configurations checked. Not safe for two threads at once.
    """

    def __init__(self, world: CollisionWorld, robot: str, arm: Arm, resolution: float = RESOLUTION) -> None:
        if not 1e-4 <= resolution <= 1.0:
            raise InvalidData(f"The resolution must be 0.0001 to 1 m, not {resolution!r}.")
        self.world, self.robot, self.arm, self.resolution = world, robot, arm, resolution
        self._standing = world.robot(robot)
        self._q = self._standing.q.copy()
        self.levers = levers(self._standing)[arm.indices]
        self.checks = 0
        self._levels = int(np.log2(FARTHEST / resolution)) if resolution < FARTHEST else 0

    def travel(self, a: Array, b: Array) -> float:
        """Give a bound, m, on how far any point of the robot travels from `a` to `b`."""
        return float(self.levers @ np.abs(b - a))

    def is_free(self, q: Array) -> bool:
        """Tell whether joint values are in collision with nothing."""
        self.checks += 1
        return self.world.is_free(self.robot, self._whole(q))

    def hit(self, q: Array) -> str:
        """Give what joint values are in collision with, empty when they are free."""
        self.checks += 1
        return self.world.first_contact(self.robot, self._whole(q))

    def is_free_between(self, a: Array, b: Array, resolution: float | None = None) -> bool:
        """Tell whether nothing is in the way from `a`, which is taken for free, to `b`; `b` is looked at too.

        Looked at where points of the robot are `resolution` apart, no nearer: quick, to say no. None: see `proves`.
        """
        if resolution is None:
            return self.is_free_between(a, b, 8.0 * self.resolution) and self.proves(a, b)
        way = b - a
        count = self._count(a, b, resolution)
        return all(self.is_free(a + number / count * way) for number in _far_apart(count))

    def proves(self, a: Array, b: Array) -> bool:
        """Tell whether nothing is in the way from `a` to `b`, in the resolution.

        Where everything around is farther from the robot than its points travel there is nothing to look for. Its own
        links, which are always near each other, are looked at everywhere.
        """
        way, count = b - a, self._count(a, b, self.resolution)
        standing = self._standing
        if any(standing.hits_itself(self._whole(a + number / count * way)) for number in _far_apart(count)):
            return False
        chunks = self._chunks(count)
        return self._first_near(a, way, _far_apart(chunks), chunks) is None

    def first_contact(self, waypoints: Sequence[Array]) -> Array | None:
        """Return the first joint values on a path that collide with the surroundings, or None.

        Collisions of the robot with itself are ignored.
        """
        self.checks += 1
        if not self.world.is_free_around(self.robot, self._whole(waypoints[0])):
            return waypoints[0]
        for a, b in itertools.pairwise(waypoints):
            chunks = self._chunks(self._count(a, b, self.resolution))
            share = self._first_near(a, b - a, range(1, chunks + 1), chunks)
            if share is not None:
                return a + share * (b - a)
        return None

    def _chunks(self, count: int) -> int:
        return math.ceil(count / (1 << self._levels))

    def _first_near(self, a: Array, way: Array, order: Iterable[int], chunks: int) -> float | None:
        """Return the first share, in the order of chunks, at which something is too near, or None."""
        for number in order:
            share = self._near(a, way, (number - 0.5) / chunks, 0.5 / chunks, self._levels)
            if share is not None:
                return share
        return None

    def _near(self, a: Array, way: Array, middle: float, half: float, levels: int) -> float | None:
        self.checks += 1
        more = self.resolution / 2.0 * 2.0**levels if levels else 0.0
        if self.world.is_free_around(self.robot, self._whole(a + middle * way), more):
            return None
        if not levels:
            return middle
        before = self._near(a, way, middle - half / 2.0, half / 2.0, levels - 1)
        return before if before is not None else self._near(a, way, middle + half / 2.0, half / 2.0, levels - 1)

    def _whole(self, q: Array) -> Array:
        self._q[self.arm.indices] = q
        return self._q

    def first_hit(self, waypoints: Sequence[Array]) -> Hit | None:
        """Give what is met first on the way through waypoints, at which share of its travel; None when it is free."""
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
        if count > MOST_CHECKS:
            raise InvalidData(
                f"A motion of {self.arm.model.name} needs {count} checks; at most {MOST_CHECKS} are made."
            )
        return count


@functools.lru_cache(maxsize=4096)
def _far_apart(count: int) -> tuple[int, ...]:
    """Give 1 to `count`, the last first, then always halfway between: what is in the way is found sooner so."""
    order, step = [count], 1 << (count - 1).bit_length()
    while step > 1:
        order += range(step // 2, count, step)
        step //= 2
    return tuple(order)


def levers(robot: CollisionRobot) -> Array:
    """Give for each joint of the model the m that a point of the robot travels at most per rad, or per m.

    A bound for all joint values within the limits: the lengths from the joint's axis to the farthest part behind it,
    stretched out.
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
    # A joint moves all that mimic it.
    factors = tree.coupling
    return np.asarray(np.abs(factors).T @ bounds[1:])


def _slides(robot: CollisionRobot) -> list[float | None]:
    """Give for each body of Pinocchio's model how far it slides from its place at most, m; None where it turns."""
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
