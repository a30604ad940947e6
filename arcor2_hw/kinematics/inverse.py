"""Joints for a pose: nearest to a seed, within limits, free of collision if asked; or all distinct ones.

An arm of the UR's kind, or with a spherical wrist as most industrial ones, has its up to eight configurations
computed, see `closed_form`, and each refined; for any other arm damped least squares (Levenberg and Marquardt's)
start at the seed and, if need be, at up to 40 random places. These places are the same in every call, so that the
same question has the same answer.
"""

import itertools
from collections.abc import Callable, Iterator
from typing import Any, Final

import numpy as np
import pinocchio as pin

from arcor2_hw.kinematics.arm import Arm
from arcor2_hw.kinematics.closed_form import NEARLY, SphericalWrist, ThreeParallel, closed_form
from arcor2_hw.kinematics.errors import OnlyInCollision, OutOfReach
from arcor2_hw.kinematics.shapes import Array

CollisionCheck = Callable[[Array], str]
"""Function from joint values of the arm to the first contact as text, empty when there is none."""

STARTS: Final = 40
"""At most; an arm with few joints has no more than so many minima to be caught in."""
_STARTS_PER_JOINT: Final = 6
ROUNDS: Final = 60
EXACT: Final = 1e-8
"""m and rad at which a solution counts as exact; what is less exact has to keep the end effector's tolerances."""
SAME: Final = 1e-3
"""rad or m by which some joint of two distinct solutions differs at least."""
_FEW: Final = 2
_MOST_DAMPING: Final = 1e-4
_LEAST_DAMPING: Final = 1e-14
_SLACK: Final = 1e-6
"""rad or m by which rounding may put a joint beyond its limit; it is put back there."""
_PATIENCE: Final = 8
_PROGRESS: Final = 0.9
"""Rounds after which at most this share of the error has to be left."""
_STEP: Final = 0.7
"""rad, or m, that a joint goes in one round at most."""


class InverseKinematics:
    """Finds joints of one arm. Targets are (4, 4) in the frame of the model's root link; joints in the arm's order.

    Not safe for two threads at once.
    """

    def __init__(self, arm: Arm) -> None:
        self.arm = arm
        self._rows = arm.rows
        self._tolerance = arm.end_effector.position_tolerance, arm.end_effector.orientation_tolerance
        self._turning = np.array([not prismatic for prismatic in arm.prismatic])
        self._form = _closed_form(arm) if len(self._rows) == 6 else None
        lower, upper = arm.lower.copy(), arm.upper.copy()
        wide = self._turning & (upper - lower > 2.0 * np.pi)
        # A turn more leads to the same place: to begin within one is enough.
        middle = np.clip(0.0, lower[wide] + np.pi, upper[wide] - np.pi)
        lower[wide], upper[wide] = middle - np.pi, middle + np.pi
        self._starts = np.random.default_rng(0).uniform(
            lower, upper, (min(STARTS, _STARTS_PER_JOINT * arm.dof), arm.dof)
        )

    @property
    def has_closed_form(self) -> bool:
        """Tell whether the configurations are computed rather than searched for."""
        return self._form is not None

    # -------------------------------------------------------------------------------- answers
    def solve(self, target: Array, seed: Array | None = None, check: CollisionCheck | None = None) -> Array:
        """Give joints for a pose, of those that are free the nearest to `seed` (the middle of the joints if None).

        Raises OutOfReach, or OnlyInCollision naming the pair that the nearest of them is in.
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
            raise OnlyInCollision(f"{self.arm.model.name} reaches the pose only in collision: {hit}.", f"at {at}")
        raise OutOfReach(f"{self.arm.model.name} cannot reach the pose.", f"at {at} in its root's frame")

    def solutions(
        self, target: Array, seed: Array | None = None, check: CollisionCheck | None = None, *, turns: bool = False
    ) -> list[Array]:
        """Give all distinct joints found for a pose, nearest to `seed` first; none when it is out of reach.

        Joints that differ by whole turns count as one, the nearest, unless `turns` are asked for. Of an arm with more
        joints than it needs there is a continuum: what comes then is a sample of it.
        """
        near = self._checked(target, seed)
        found = [q for q in self._nearest_first(target, near, everything=True) if not (check and check(q))]
        if turns:
            found = [other for q in found for other in self._all_turns(q)]
        return sorted(found, key=lambda q: float(np.sum((q - near) ** 2)))

    def candidates(self, target: Array, seed: Array | None = None) -> Iterator[Array]:
        """Give joints for a pose one after the other, nearest to `seed` first, each found when it is asked for."""
        return self._nearest_first(target, self._checked(target, seed))

    def _checked(self, target: Array, seed: Array | None) -> Array:
        if target.shape != (4, 4) or not np.isfinite(target).all():
            raise OutOfReach(f"The pose for {self.arm.model.name} has numbers that are not finite.")
        if seed is None:
            seed = self.arm.middle()
        if seed.shape != (self.arm.dof,) or not np.isfinite(seed).all():
            raise OutOfReach(f"{self.arm.model.name} needs {self.arm.dof} finite joint values to begin with.")
        return seed

    # -------------------------------------------------------------------------------- candidates
    def _nearest_first(self, target: Array, seed: Array, everything: bool = False) -> Iterator[Array]:
        if float(np.linalg.norm(target[:3, 3] - self.arm.centre)) > self.arm.reach + self._tolerance[0]:
            return
        if self._form is not None:
            raw = np.array(self._form.solve(target, seed)).reshape(-1, 6)
            near = self._near(raw, seed, NEARLY)  # calibrated, it may keep the limits yet
            some = False
            for q in self._computed(pin.SE3(target), near, seed):
                some = True
                yield q
            if some or not len(near):
                return
            # At the edge of reach, and where axes meet, what was computed may be too far off to be refined.
            yield from self._searched(target, seed, everything, _FEW)
        else:
            yield from self._searched(target, seed, everything, STARTS)

    def _computed(self, goal: Any, near: Array, seed: Array) -> Iterator[Array]:
        given: list[Array] = []
        for i in np.argsort(((near - seed) ** 2).sum(axis=1)):
            q = self._refined(goal, near[i], rounds=12, clamp=False)
            if q is None:
                continue
            q = self._near(q, seed)
            if self.arm.within(q, _SLACK) and not self._known(q, given):
                q = np.clip(q, self.arm.lower, self.arm.upper)
                given.append(q)
                yield q

    def _searched(self, target: Array, seed: Array, everything: bool, starts: int) -> Iterator[Array]:
        """Give what is found from the seed, then what is found from elsewhere, in the order of its distance."""
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
            if not everything and found and idle >= STARTS // 5:
                break
        yield from sorted(found, key=lambda q: float(np.sum((q - seed) ** 2)))

    def _known(self, q: Array, given: list[Array]) -> bool:
        for other in given:
            apart = q - other
            apart = np.where(self._turning, np.remainder(apart + np.pi, 2.0 * np.pi) - np.pi, apart)
            if np.abs(apart).max() < SAME:
                return True
        return False

    # -------------------------------------------------------------------------------- turns
    def _near(self, q: Array, seed: Array, slack: float = _SLACK) -> Array:
        """Give joints, (n) or (m, n), the same place by whole turns, as near to the seed as the limits allow."""
        turned = q + np.where(self._turning, 2.0 * np.pi * np.round((seed - q) / (2.0 * np.pi)), 0.0)
        over, under = turned > self.arm.upper + slack, turned < self.arm.lower - slack
        if over.any() or under.any():
            back = np.where(over, np.ceil((turned - self.arm.upper - slack) / (2.0 * np.pi)), 0.0)
            forth = np.where(under, np.ceil((self.arm.lower - slack - turned) / (2.0 * np.pi)), 0.0)
            turned = turned + np.where(self._turning, 2.0 * np.pi * (forth - back), 0.0)
        return np.asarray(turned)

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
    def _refined(self, goal: Any, q: Array, rounds: int = ROUNDS, clamp: bool = True) -> Array | None:
        """Give joints near `q` that meet the goal, None when these steps lead to none."""
        arm = self.arm
        error, size = self._error(goal, q)
        damping = min(max(size * size, _LEAST_DAMPING), _MOST_DAMPING)
        jacobian: Array | None = None
        before = np.inf
        for number in range(rounds):
            if size < EXACT:
                break
            if number % _PATIENCE == 0:
                if size > _PROGRESS * before:  # a minimum that is none of nothing, or the way along a limit
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
                if size - smaller < 1e-6 * size and damping <= _LEAST_DAMPING:
                    break
                q, error, size, jacobian = trial, after, smaller, None
                damping = min(max(damping * 0.1, _LEAST_DAMPING), max(size * size, _LEAST_DAMPING))
            else:
                damping *= 10.0
                if damping > 1e2:
                    break
        if size < EXACT:
            return q
        position, orientation = self._tolerance
        rows = int(np.count_nonzero(self._rows < 3))
        good = np.linalg.norm(error[:rows]) <= position and np.linalg.norm(error[rows:]) <= orientation
        return q if good else None

    def _error(self, goal: Any, q: Array) -> tuple[Array, float]:
        """Give what is missing to the goal in the tip's axes, of the directions that are commanded, and its size."""
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


def _closed_form(arm: Arm) -> ThreeParallel | SphericalWrist | None:
    """Read axes and points off the arm at zero angles."""
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
