"""Collision-free paths of an arm: RRT-Connect, shortened, then checked at the full resolution.

J. J. Kuffner, S. M. LaValle: RRT-Connect: an efficient approach to single-query path planning (ICRA 2000). OMPL is not
used because its bindings can neither be seeded per plan nor free the memory of a plan
(docs/decisions/0012-planning-of-our-own.md). The same question with the same seed has the same answer, unless time
runs out.
"""

import itertools
import time
from collections.abc import Callable, Sequence
from typing import Final

import numpy as np

from arcor2_hw.collision.sweep import Sweep
from arcor2_hw.exceptions import Cancelled, InvalidData
from arcor2_hw.kinematics.errors import GoalInCollision, NoPath, OnlyInCollision, StartInCollision
from arcor2_hw.kinematics.inverse import InverseKinematics
from arcor2_hw.kinematics.shapes import Array

TIME_LIMIT: Final = 2.0
"""Maximum time of planning, s."""
COARSE: Final = 8.0
"""Factor between the resolution of the search and the resolution of the final check."""
STEP: Final = 1.5
"""Maximum step of a tree, in joint values times their levers, m."""
SEARCH_RANGE: Final = np.pi
"""Range of joint values beyond start and goals that is searched first, rad; longer detours are rarely useful."""
MAX_GOALS: Final = 8
SHORTCUTS: Final = 60
MAX_FAILED_SHORTCUTS: Final = 15
"""Number of failed shortcuts in a row after which shortening ends."""
LIMIT_TOLERANCE: Final = 0.05
"""Distance by which a joint may be beyond its limit at the start, rad or m: a real joint can be slightly beyond it."""
_GIVEN: Final = 1e-9

Stopped = Callable[[], bool]


class Planner:
    """Plans motions of the arm of a `Sweep`. Not safe for use by two threads at once.

    Joint values are those of the arm; targets are (4, 4), in the frame of the model's root link.

    Args:
        sweep: Collision checks of the arm.
        name: Name of the robot in messages.
    """

    def __init__(self, sweep: Sweep, name: str = "") -> None:
        self.sweep, self.arm = sweep, sweep.arm
        self.name = name or sweep.arm.model.name
        self._scale = np.maximum(sweep.levers, 1e-3)

    def to_pose(
        self, start: Array, target: Array, *, within: float = TIME_LIMIT, seed: int = 0, stopped: Stopped | None = None
    ) -> list[Array]:
        """Plan a path to a pose. The joint values at the end are chosen for a short path.

        Args:
            start: Joint values at the start.
            target: Pose, (4, 4).
            within: Maximum time, s.
            seed: Seed of the random numbers.
            stopped: Returns whether planning is to be cancelled.

        Returns:
            Waypoints, straight in joint space between.

        Raises:
            OutOfReach: The pose is out of reach.
            OnlyInCollision: All joint values that reach the pose are in collision; the message names a contact.
            StartInCollision: The start is in collision.
            NoPath: No path was found in time.
            Cancelled: `stopped` returned true.
        """
        inverse = InverseKinematics(self.arm)
        found = inverse.solutions(target, start)
        if not found:
            inverse.solve(target, start)  # raises with the reason
        hits = [(q, self.sweep.hit(q)) for q in found]
        goals = [q for q, hit in hits if not hit]
        if not goals:
            at = ", ".join(f"{value:.3f}" for value in target[:3, 3])
            raise OnlyInCollision(
                "{name} reaches the pose only in collision: {hit}.", f"at {at}", name=self.name, hit=hits[0][1]
            )
        return self.to_any(start, goals, within=within, seed=seed, stopped=stopped)

    def to_joints(
        self, start: Array, goal: Array, *, within: float = TIME_LIMIT, seed: int = 0, stopped: Stopped | None = None
    ) -> list[Array]:
        """Plan a path to joint values.

        Args:
            start: Joint values at the start.
            goal: Joint values at the end.
            within: Maximum time, s.
            seed: Seed of the random numbers.
            stopped: Returns whether planning is to be cancelled.

        Returns:
            Waypoints, straight in joint space between.

        Raises:
            InvalidData: A joint is beyond its limit.
            GoalInCollision: The goal is in collision; the message names the contact.
            StartInCollision: The start is in collision.
            NoPath: No path was found in time.
            Cancelled: `stopped` returned true.
        """
        self._check_goal(goal)
        if hit := self.sweep.hit(goal):
            raise GoalInCollision("{name} would be in collision at the goal: {hit}.", name=self.name, hit=hit)
        return self.to_any(start, [goal], within=within, seed=seed, stopped=stopped)

    def to_any(
        self,
        start: Array,
        goals: Sequence[Array],
        *,
        within: float = TIME_LIMIT,
        seed: int = 0,
        stopped: Stopped | None = None,
    ) -> list[Array]:
        """Plan a path to the nearest possible of several collision-free goals; see `to_joints`."""
        self._check_start(start)
        if hit := self.sweep.hit(start):
            raise StartInCollision("{name} is in collision at the start: {hit}.", name=self.name, hit=hit)
        goals = sorted(goals, key=lambda q: self._length([start, q]))[:MAX_GOALS]
        for goal in goals:
            if self.sweep.is_free_between(start, goal):
                return [start, goal]
        search = _Search(self, start, goals, time.monotonic() + within, seed, stopped)
        for resolution in (COARSE * self.sweep.resolution, self.sweep.resolution):
            way = search.way(resolution)
            if way is None:
                break
            way = search.shortened(way, resolution)
            way[0], way[-1] = start, _nearest(goals, way[-1])  # exactly as given, without rounding
            if all(self.sweep.is_free_between(a, b) for a, b in itertools.pairwise(way)):
                return way
        between = self.sweep.first_hit([start, goals[0]])
        if between is None:
            raise NoPath("{name} found no collision-free path within {within:g} s.", name=self.name, within=within)
        raise NoPath(
            "{name} found no collision-free path within {within:g} s; the direct path meets {hit}.",
            name=self.name,
            within=within,
            hit=between.what,
        )

    def _check_start(self, q: Array) -> None:
        self._check_finite(q)
        if beyond := self._beyond_limits(q, LIMIT_TOLERANCE):
            raise InvalidData(
                "{name} cannot move from there: {names} would be beyond the limits.", name=self.name, names=beyond
            )

    def _check_goal(self, q: Array) -> None:
        self._check_finite(q)
        if beyond := self._beyond_limits(q, 1e-4):
            raise InvalidData(
                "{name} cannot move there: {names} would be beyond the limits.", name=self.name, names=beyond
            )

    def _check_finite(self, q: Array) -> None:
        if q.shape != (self.arm.dof,) or not np.isfinite(q).all():
            raise InvalidData("{name} needs {dof} finite joint values to plan.", name=self.name, dof=self.arm.dof)

    def _beyond_limits(self, q: Array, slack: float) -> str:
        over = (q < self.arm.lower - slack) | (q > self.arm.upper + slack)
        return ", ".join(name for name, is_over in zip(self.arm.joint_names, over, strict=True) if is_over)

    def _length(self, path: Sequence[Array]) -> float:
        """Return the length of a path in joint values times their levers, m."""
        return float(sum(np.linalg.norm((b - a) * self._scale) for a, b in itertools.pairwise(path)))


def _nearest(given: Sequence[Array], q: Array) -> Array:
    return min(given, key=lambda each: float(np.abs(each - q).max()))


class _Tree:
    """Tree of configurations, scaled by the levers, each with its parent."""

    def __init__(self, roots: Array) -> None:
        self.size = len(roots)
        self.points = np.empty((max(256, 2 * self.size), roots.shape[1]))
        self.points[: self.size] = roots
        self.parents = [-1] * self.size

    def add(self, point: Array, parent: int) -> int:
        if self.size == len(self.points):
            self.points = np.concatenate((self.points, np.empty_like(self.points)))
        self.points[self.size] = point
        self.parents.append(parent)
        self.size += 1
        return self.size - 1

    def nearest(self, point: Array) -> int:
        apart = self.points[: self.size] - point
        return int(np.argmin(np.einsum("ij,ij->i", apart, apart)))

    def path_from_root(self, node: int) -> list[Array]:
        way = []
        while node >= 0:
            way.append(self.points[node].copy())
            node = self.parents[node]
        return way[::-1]


class _Search:
    """One search: two trees that grow towards each other, in joint values times their levers."""

    def __init__(
        self,
        planner: Planner,
        start: Array,
        goals: Sequence[Array],
        deadline: float,
        seed: int,
        stopped: Stopped | None,
    ) -> None:
        self._planner, self._sweep = planner, planner.sweep
        self._scale, self._deadline, self._stopped = planner._scale, deadline, stopped
        self._chance = np.random.default_rng(seed)
        self._start, self._goals = start * self._scale, np.array(goals) * self._scale
        arm, ends = planner.arm, np.array([start, *goals])
        slides = np.array(arm.prismatic)
        # A prismatic joint, or a revolute one with a range below two turns, is searched in its whole range.
        far = np.where(slides, np.inf, SEARCH_RANGE)
        lower = np.maximum(arm.lower, ends.min(axis=0) - far)
        upper = np.minimum(arm.upper, ends.max(axis=0) + far)
        self._box = np.minimum(lower, ends.min(axis=0)) * self._scale, np.maximum(upper, ends.max(axis=0)) * self._scale

    def _over(self) -> bool:
        if self._stopped is not None and self._stopped():
            raise Cancelled("Planning for {name} was cancelled.", name=self._planner.name)
        return time.monotonic() > self._deadline

    def _free(self, a: Array, b: Array, resolution: float) -> bool:
        return self._sweep.is_free_between(a / self._scale, b / self._scale, resolution)

    # -------------------------------------------------------------------------------- searching
    def way(self, resolution: float) -> list[Array] | None:
        """Return waypoints from the start to a goal, None when time ran out."""
        forth, back = _Tree(self._start[None]), _Tree(self._goals)
        grown, other = forth, back
        while not self._over():
            target = self._chance.uniform(*self._box)
            node = self._grow(grown, target, resolution)
            if node is not None:
                met = self._connect(other, grown.points[node], resolution)
                if met is not None:
                    ends = (node, met) if grown is forth else (met, node)
                    way = forth.path_from_root(ends[0]) + back.path_from_root(ends[1])[::-1][1:]
                    return [point / self._scale for point in way]
            grown, other = other, grown
        return None

    def _grow(self, tree: _Tree, target: Array, resolution: float) -> int | None:
        """Add one step towards `target` and return its node, or None if the step is not free."""
        near = tree.nearest(target)
        return self._step(tree, near, target, resolution)

    def _connect(self, tree: _Tree, target: Array, resolution: float) -> int | None:
        """Add steps until `target` is reached and return its node, or None if it is not reached."""
        node: int | None = tree.nearest(target)
        while node is not None:
            if float(np.abs(tree.points[node] - target).max()) < _GIVEN:
                return node
            if self._over():
                return None
            node = self._step(tree, node, target, resolution)
        return None

    def _step(self, tree: _Tree, node: int, target: Array, resolution: float) -> int | None:
        at = tree.points[node]
        way = target - at
        length = float(np.linalg.norm(way))
        if length < _GIVEN:
            return node
        point = target if length <= STEP else at + way * (STEP / length)
        return tree.add(point, node) if self._free(at, point, resolution) else None

    # -------------------------------------------------------------------------------- shortening
    def shortened(self, path: list[Array], resolution: float) -> list[Array]:
        """Shorten a path by straight segments between random points, and drop waypoints that are not needed."""
        points = [q * self._scale for q in path]
        points = self._drop_redundant(points, resolution)
        idle = 0
        for _ in range(SHORTCUTS):
            if len(points) < 3 or idle >= MAX_FAILED_SHORTCUTS or self._over():
                break
            idle += 1
            at = np.concatenate(([0.0], np.cumsum([np.linalg.norm(b - a) for a, b in itertools.pairwise(points)])))
            one, two = np.sort(self._chance.uniform(0.0, at[-1], 2))
            first, last = (int(np.clip(np.searchsorted(at, s, "right") - 1, 0, len(points) - 2)) for s in (one, two))
            if first == last:
                continue
            a, b = (
                points[n] + (points[n + 1] - points[n]) * ((s - at[n]) / max(at[n + 1] - at[n], _GIVEN))
                for n, s in ((first, one), (last, two))
            )
            saved = (two - one) - float(np.linalg.norm(b - a))
            if saved < 0.02 * (two - one) or not self._free(a, b, resolution):
                continue
            points = [*points[: first + 1], a, b, *points[last + 1 :]]
            idle = 0
        return [point / self._scale for point in self._drop_redundant(points, resolution)]

    def _drop_redundant(self, points: list[Array], resolution: float) -> list[Array]:
        """Drop waypoints without which the path is still free, as many at once as possible."""
        remaining = [points[0]]
        at = 0
        while at < len(points) - 1:
            further = at + 1
            for other in range(len(points) - 1, at + 1, -1):
                if self._free(points[at], points[other], resolution):
                    further = other
                    break
            remaining.append(points[further])
            at = further
        return remaining
