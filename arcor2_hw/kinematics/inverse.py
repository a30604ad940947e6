"""Inverse kinematics: joint values within limits nearest to a seed, optionally collision-free; or all distinct ones.

Arms like the UR, or with a spherical wrist, have up to eight configurations computed in closed form (see
`closed_form`) and then refined. Other arms are solved by damped least squares (Levenberg-Marquardt), from the seed
and, if needed, from up to 40 random starts. The starts are the same in every call, so that equal calls return the
same result.
"""

import itertools
import math
import operator
from collections.abc import Callable, Iterator
from typing import Any, Final

import numpy as np
import pinocchio as pin

from arcor2_hw.kinematics.arm import Arm
from arcor2_hw.kinematics.closed_form import NEARLY, SphericalWrist, ThreeParallel, closed_form
from arcor2_hw.kinematics.errors import OnlyInCollision, OutOfReach
from arcor2_hw.kinematics.shapes import Array
from arcor2_hw.kinematics.subproblems import Values, nearest_turn

CollisionCheck = Callable[[Array], str]
"""Function from joint values of the arm to the first contact as text, empty when there is none."""

MAX_STARTS: Final = 40
"""Maximum number of random starts; an arm with few joints has fewer local minima and gets fewer starts."""
_STARTS_PER_JOINT: Final = 6
MAX_ITERATIONS: Final = 60
EXACT_ERROR: Final = 1e-8
"""Error below which a solution is exact, m and rad; others must be within the tolerances of the end effector."""
DISTINCT_SOLUTIONS: Final = 1e-3
"""Minimum difference of some joint between two distinct solutions, rad or m."""
_FEW: Final = 2
_MAX_DAMPING: Final = 1e-4
_MIN_DAMPING: Final = 1e-14
_SLACK: Final = 1e-6
"""Rounding error beyond a limit that is clipped, rad or m."""
_PATIENCE: Final = 8
_PROGRESS: Final = 0.9
"""Maximum fraction of the error that may remain after _PATIENCE iterations."""
_STEP: Final = 0.7
"""Maximum change of a joint in one iteration, rad or m."""


class InverseKinematics:
    """Inverse kinematics of one arm. Not safe for use by two threads at once.

    Targets are (4, 4) in the frame of the model's root link; joint values are in the order of the arm.
    """

    def __init__(self, arm: Arm) -> None:
        self.arm = arm
        self._rows = arm.rows
        self._tolerance = arm.end_effector.position_tolerance, arm.end_effector.orientation_tolerance
        self._turning = np.array([not prismatic for prismatic in arm.prismatic])
        self._centre = arm.centre.tolist()
        self._limits = arm.lower.tolist(), arm.upper.tolist()
        self._form = _closed_form(arm) if len(self._rows) == 6 else None
        # A computed solution may be slightly beyond a limit, and be moved within by refinement.
        self._loose, self._tight = (
            ((arm.lower - slack).tolist(), (arm.upper + slack).tolist()) for slack in (NEARLY, _SLACK)
        )
        lower, upper = arm.lower.copy(), arm.upper.copy()
        wide = self._turning & (upper - lower > 2.0 * np.pi)
        # Whole turns lead to the same place, so starts within one turn are enough.
        middle = np.clip(0.0, lower[wide] + np.pi, upper[wide] - np.pi)
        lower[wide], upper[wide] = middle - np.pi, middle + np.pi
        self._starts = np.random.default_rng(0).uniform(
            lower, upper, (min(MAX_STARTS, _STARTS_PER_JOINT * arm.dof), arm.dof)
        )

    @property
    def has_closed_form(self) -> bool:
        """Return whether the configurations are computed in closed form."""
        return self._form is not None

    # -------------------------------------------------------------------------------- answers
    def solve(self, target: Array, seed: Array | None = None, check: CollisionCheck | None = None) -> Array:
        """Return joint values for a pose.

        Args:
            target: The pose, (4, 4).
            seed: The nearest solution to these joint values is returned; default: the middle of the ranges.
            check: Collision check; solutions in collision are skipped.

        Raises:
            OutOfReach: No solution was found.
            OnlyInCollision: All solutions are in collision; the message names the contact of the nearest one.
        """
        near = self._checked(target, seed)
        hit = ""
        for q in self._nearest_first(target, near):
            reason = check(q) if check is not None else ""
            if not reason:
                return q
            hit = hit or reason
        at = ", ".join(f"{value:.3f}" for value in target[:3, 3])
        if hit:
            raise OnlyInCollision(
                "{name} reaches the pose only in collision: {hit}.", f"at {at}", name=self.arm.model.name, hit=hit
            )
        raise OutOfReach("{name} cannot reach the pose.", f"at {at} in its root's frame", name=self.arm.model.name)

    def solutions(
        self, target: Array, seed: Array | None = None, check: CollisionCheck | None = None, *, turns: bool = False
    ) -> list[Array]:
        """Return all distinct solutions for a pose, nearest to `seed` first; empty when it is out of reach.

        An arm with redundant joints has infinitely many solutions, of which this is a sample.

        Args:
            target: The pose, (4, 4).
            seed: Joint values for ordering; default: the middle of the ranges.
            check: Collision check; solutions in collision are skipped.
            turns: Whether solutions that differ by whole turns are distinct; otherwise only the nearest is returned.
        """
        near = self._checked(target, seed)
        found = [q for q in self._nearest_first(target, near, everything=True) if not (check and check(q))]
        if turns:
            found = [other for q in found for other in self._all_turns(q)]
        return sorted(found, key=lambda q: _apart(q, near))

    def candidates(self, target: Array, seed: Array | None = None) -> Iterator[Array]:
        """Yield solutions for a pose, nearest to `seed` first, each computed when needed."""
        return self._nearest_first(target, self._checked(target, seed))

    def _checked(self, target: Array, seed: Array | None) -> Array:
        if target.shape != (4, 4) or not _is_finite(target):
            raise OutOfReach("The pose for {name} has numbers that are not finite.", name=self.arm.model.name)
        if seed is None:
            seed = self.arm.middle()
        if seed.shape != (self.arm.dof,) or not _is_finite(seed):
            raise OutOfReach(
                "{name} needs {dof} finite joint values as a seed.", name=self.arm.model.name, dof=self.arm.dof
            )
        return seed

    # -------------------------------------------------------------------------------- candidates
    def _nearest_first(self, target: Array, seed: Array, everything: bool = False) -> Iterator[Array]:
        if math.dist(target[:3, 3].tolist(), self._centre) > self.arm.reach + self._tolerance[0]:
            return iter(())
        if self._form is None:
            return self._searched(target, seed, everything, MAX_STARTS)
        return self._computed(self._form, target, seed, everything)

    def _computed(
        self, form: ThreeParallel | SphericalWrist, target: Array, seed: Array, everything: bool
    ) -> Iterator[Array]:
        """Yield the solutions in closed form, nearest first, refined where they are not exact or beyond a limit."""
        some = False
        given: list[Array] = []
        late: list[Array] = []
        for values in form.nearest(target, seed.tolist(), *self._loose):
            some, is_late = True, False
            q = np.array(values)
            if not (self._is_exact(target, q) and self._is_within(values)):
                refined = self._refined(pin.SE3(target), q, rounds=12, clamp=False)
                if refined is None:
                    continue
                q = self._near(refined, seed)
                if not self.arm.within(q, _SLACK):
                    continue
                q = np.clip(q, self.arm.lower, self.arm.upper)
                is_late = (
                    math.dist(q.tolist(), values) > 1.0
                )  # still beyond a limit, and therefore shifted by a turn away from the seed
            if self._known(q, given):
                continue
            given.append(q)
            if is_late:
                late = sorted((*late, q), key=lambda each: _apart(each, seed))
                continue
            while late and _apart(late[0], seed) < _apart(q, seed):
                yield late.pop(0)
            yield q
        yield from late
        if some and not given:
            # At the edge of the workspace and at singularities, the closed form may be too inexact to be refined.
            yield from self._searched(target, seed, everything, _FEW)

    def _is_exact(self, target: Array, q: Array) -> bool:
        """Return whether the error is below EXACT_ERROR. The norm of a difference of rotations exceeds their angle."""
        apart = self.arm.forward(q) - target
        return float(np.vdot(apart, apart)) < EXACT_ERROR * EXACT_ERROR

    def _is_within(self, values: Values) -> bool:
        lower, upper = self._limits
        return all(map(operator.le, lower, values)) and all(map(operator.le, values, upper))

    def _searched(self, target: Array, seed: Array, everything: bool, starts: int) -> Iterator[Array]:
        """Yield the solution found from the seed, then those found from other starts, nearest first."""
        goal = pin.SE3(target)
        first = self._refined(goal, np.clip(seed, self.arm.lower, self.arm.upper))
        given: list[Array] = []
        if first is not None:
            given.append(self._near(first, seed))
            yield given[0]
        found: list[Array] = []
        idle = 0
        for start in self._starts[:starts]:
            q = self._refined(goal, start)
            idle += 1
            if q is None:
                continue
            q = self._near(q, seed)
            if self.arm.within(q) and not self._known(q, [*given, *found]):
                found.append(q)
                idle = 0
            if not everything and found and idle >= MAX_STARTS // 5:
                break
        yield from sorted(found, key=lambda q: _apart(q, seed))

    def _known(self, q: Array, given: list[Array]) -> bool:
        values = q.tolist()
        return any(
            all(
                abs(math.remainder(one - two, math.tau) if turning else one - two) < DISTINCT_SOLUTIONS
                for one, two, turning in zip(values, other.tolist(), self._turning, strict=True)
            )
            for other in given
        )

    # -------------------------------------------------------------------------------- turns
    def _near(self, q: Array, seed: Array) -> Array:
        """Shift joint values by whole turns as near to the seed as the limits allow."""
        shifted = map(nearest_turn, q.tolist(), seed.tolist(), *self._tight)
        return np.where(self._turning, list(shifted), q)

    def _all_turns(self, q: Array) -> Iterator[Array]:
        choices = []
        for value, lower, upper, turning in zip(q, self.arm.lower, self.arm.upper, self._turning, strict=True):
            if not turning or not (np.isfinite(lower) and np.isfinite(upper)):
                choices.append([value])
                continue
            first, last = np.ceil((lower - value) / (2 * np.pi) - 1e-9), np.floor((upper - value) / (2 * np.pi) + 1e-9)
            choices.append([value + 2.0 * np.pi * turn for turn in np.arange(first, last + 1)])
        return (np.array(each) for each in itertools.product(*choices))

    # -------------------------------------------------------------------------------- refinement
    def _refined(self, goal: Any, q: Array, rounds: int = MAX_ITERATIONS, clamp: bool = True) -> Array | None:
        """Refine joint values near `q` until they reach the goal; None when the iteration does not converge."""
        arm = self.arm
        error, size = self._error(goal, q)
        damping = min(max(size * size, _MIN_DAMPING), _MAX_DAMPING)
        jacobian: Array | None = None
        before = np.inf
        for number in range(rounds):
            if size < EXACT_ERROR:
                break
            if number % _PATIENCE == 0:
                if size > _PROGRESS * before:  # a local minimum, or motion along a limit
                    break
                before = size
            if jacobian is None:
                jacobian = arm.jacobian_in_tip(q)[self._rows]
            step = jacobian.T @ np.linalg.solve(jacobian @ jacobian.T + damping * np.eye(len(error)), error)
            largest = float(np.abs(step).max())
            if largest > _STEP:
                step *= _STEP / largest
            trial = q + step
            if clamp:
                trial = np.clip(trial, arm.lower, arm.upper)
            after, smaller = self._error(goal, trial)
            if smaller < size:
                if size - smaller < 1e-6 * size and damping <= _MIN_DAMPING:
                    break
                q, error, size, jacobian = trial, after, smaller, None
                damping = min(max(damping * 0.1, _MIN_DAMPING), max(size * size, _MIN_DAMPING))
            else:
                damping *= 10.0
                if damping > 1e2:
                    break
        if size < EXACT_ERROR:
            return q
        position, orientation = self._tolerance
        rows = int(np.count_nonzero(self._rows < 3))
        good = np.linalg.norm(error[:rows]) <= position and np.linalg.norm(error[rows:]) <= orientation
        return q if good else None

    def _error(self, goal: Any, q: Array) -> tuple[Array, float]:
        """Return the remaining error of the commanded directions in the axes of the tip, and its norm."""
        missing = self.arm.placement(q).actInv(goal)
        if len(self._rows) == 6:
            error = np.concatenate((missing.translation, pin.log3(missing.rotation)))
        elif len(self._rows) == 3:
            error = np.array(missing.translation)
        else:
            x, y, z = missing.rotation[:, 2]
            across = float(np.hypot(x, y))
            angle = float(np.arctan2(across, z))
            factor = angle / across if across > 1e-12 else (1.0 if z > 0.0 else 0.0)
            turn = (-y * factor, x * factor) if across > 1e-12 or z > 0.0 else (np.pi, 0.0)
            error = np.concatenate((missing.translation, turn))
        return error, float(np.sqrt(error @ error))


def _apart(q: Array, other: Array) -> float:
    """Return the distance between joint values."""
    return math.dist(q.tolist(), other.tolist())


def _is_finite(array: Array) -> bool:
    """Return whether all numbers are finite; for few numbers this is faster than with NumPy."""
    return all(map(math.isfinite, array.ravel().tolist()))


def _closed_form(arm: Arm) -> ThreeParallel | SphericalWrist | None:
    """Read axes and points of the arm at zero angles."""
    if arm.dof != 6 or len(arm.moving) != 6 or any(arm.prismatic) or not np.array_equal(arm.coupling[0], np.eye(6)):
        return None
    if arm.coupling[1].any():
        return None
    at = np.eye(4)
    axes, points = [], []
    for origin, axis, _ in arm.moving:
        at = at @ origin
        axes.append(at[:3, :3] @ axis)
        points.append(at[:3, 3])
    return closed_form(np.array(axes), np.array(points), at @ arm.tip_in_last)
