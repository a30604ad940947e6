"""Reachability of poses by an arm: many at once, with a cache that is invalidated only near what changed."""

import collections
import enum
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np

from arcor2_hw.collision.world import CollisionWorld
from arcor2_hw.data.base import UNSET, Data, Unset
from arcor2_hw.data.geometry import Pose
from arcor2_hw.kinematics.arm import NEAR_SINGULAR, Arm
from arcor2_hw.kinematics.inverse import InverseKinematics
from arcor2_hw.kinematics.shapes import Array
from arcor2_hw.messages import Message

CACHE_SIZE: Final = 20_000
"""Maximum number of cached poses."""


_State = tuple[int, bytes]
"""Revision of the robot, and the values of its joints that the arm does not move."""


class Reach(enum.StrEnum):
    """How an arm reaches a pose."""

    REACHABLE = "reachable"
    NEAR_LIMIT = "near_limit"
    IN_COLLISION = "in_collision"
    OUT_OF_REACH = "out_of_reach"


class Judgement(Data, frozen=True):
    """The result for one pose.

    Attributes:
        reach: Reachability of the pose by the arm.
        joints: Joint values of the arm, empty when it is out of reach.
        reason: Reason why it is not reachable, or only with reservation; None if it is reachable.
    """

    reach: Reach
    joints: tuple[float, ...] = ()
    reason: Message | None = None


@dataclass(eq=False, slots=True)
class _Candidate:
    """Joint values that reach a pose.

    Attributes:
        q: Joint values of the arm.
        whole: Joint values of the model.
        reservation: Reason why other joint values would be better; unset before this is known, None if they are good.
        box: Bounding box of the arm, (2, 3).
        state: State of the robot for which the box holds.
    """

    q: Array
    whole: Array
    reservation: Message | Unset | None = UNSET
    box: Array | None = None
    state: _State = (-1, b"")


class _Candidates:
    """Joint values that reach a pose, computed when they are first needed."""

    def __init__(self, found: Iterator[_Candidate]) -> None:
        self._coming = found
        self._known: list[_Candidate] = []

    def __iter__(self) -> Iterator[_Candidate]:
        yield from self._known
        for candidate in self._coming:
            self._known.append(candidate)
            yield candidate


@dataclass(eq=False, slots=True)
class _CacheEntry:
    target: Array
    candidates: _Candidates
    judgement: Judgement | None = None
    revision: int = -1
    state: _State = (-1, b"")
    box: Array | None = None


class Reachability:
    """Judges poses for one arm of a robot in a collision world. Not safe for use by two threads at once.

    Results are cached by pose. After a change of the world only those results are checked again whose configurations
    are near the change; inverse kinematics is never solved again for them.

    Attributes:
        computed: Number of poses for which inverse kinematics was solved.
        checked: Number of poses that were checked for collisions.
    """

    def __init__(self, world: CollisionWorld, robot: str, arm: Arm) -> None:
        self._world, self._name, self.arm = world, robot, arm
        self._standing = world.robot(robot)
        self._inverse = InverseKinematics(arm)
        self._cache: collections.OrderedDict[tuple[float, ...], _CacheEntry] = collections.OrderedDict()
        self._update_base()
        self._near_what: dict[int, Array | None] = {}
        self.computed = 0
        self.checked = 0

    def judge(self, poses: Iterable[Pose]) -> list[Judgement]:
        """Return the reachability of each pose in the world by the arm."""
        if not np.array_equal(self._base, self._standing.base):
            self._cache.clear()
            self._update_base()
        self._near_what = {}
        # The state of the robot, and its other joints, are part of the key of every result.
        others = np.delete(self._standing.q, self.arm.indices)
        state = (self._standing.revision, others.tobytes())
        return [self._judged(pose, state) for pose in poses]

    def forget(self) -> None:
        """Clear the cache."""
        self._cache.clear()

    def _update_base(self) -> None:
        self._base = self._standing.base
        self._root_from_world = np.linalg.inv(self._base)

    # -------------------------------------------------------------------------------- one pose
    def _judged(self, pose: Pose, state: _State) -> Judgement:
        at, turn = pose.position, pose.orientation
        key = (at.x, at.y, at.z, turn.x, turn.y, turn.z, turn.w)
        entry = self._cache.get(key)
        if entry is None:
            self.computed += 1
            target = self._root_from_world @ pose.matrix()
            entry = self._cache[key] = _CacheEntry(target, _Candidates(self._found(target)))
            if len(self._cache) > CACHE_SIZE:
                self._cache.popitem(last=False)
        else:
            self._cache.move_to_end(key)
        if entry.judgement is None or entry.state != state or self._touched(entry):
            self.checked += 1
            entry.judgement, entry.box = self._check(entry, state)
        entry.state, entry.revision = state, self._world.revision
        return entry.judgement

    def _touched(self, entry: _CacheEntry) -> bool:
        """Return whether something changed near the configurations of a result."""
        if entry.revision == self._world.revision or entry.box is None:
            return False
        if entry.revision not in self._near_what:
            self._near_what[entry.revision] = self._changes_since(entry.revision)
        boxes = self._near_what[entry.revision]
        if boxes is None:
            return True
        return bool(((boxes[:, 0] <= entry.box[1]) & (boxes[:, 1] >= entry.box[0])).all(axis=1).any())

    def _changes_since(self, revision: int) -> Array | None:
        """Return the bounding boxes (n, 2, 3) of changes after a revision, or None if they are no longer recorded."""
        changes = self._world.changed_since(revision)
        if changes is None:
            return None
        return np.array([change.box for change in changes if change.name != self._name]).reshape(-1, 2, 3)

    def _found(self, target: Array) -> Iterator[_Candidate]:
        for q in self._inverse.candidates(target):
            yield _Candidate(q, q)

    def _check(self, entry: _CacheEntry, state: _State) -> tuple[Judgement, Array | None]:
        """Judge a pose; also return the bounding box of the configurations checked; None: no collision matters."""
        second: Judgement | None = None
        hit: Judgement | None = None
        boxes: list[Array] = []
        for one in entry.candidates:
            if one.box is None or one.state != state:
                one.whole = self.arm.whole(one.q, self._standing.q)
                one.box, one.state = self._standing.box(one.whole), state
            boxes.append(one.box)
            joints = tuple(map(float, one.q))
            if not self._world.is_free(self._name, one.whole):
                hit = hit or Judgement(Reach.IN_COLLISION, joints, self._collision(one.whole))
                continue
            if isinstance(one.reservation, Unset):
                one.reservation = self._reservation(one.q)
            if one.reservation is None:
                return Judgement(Reach.REACHABLE, joints), _around(boxes)
            second = second or Judgement(Reach.NEAR_LIMIT, joints, one.reservation)
        if best := second or hit:
            return best, _around(boxes)
        return Judgement(Reach.OUT_OF_REACH, reason=why_out_of_reach(self.arm, entry.target)), None

    def _collision(self, whole: Array) -> Message:
        if found := self._world.contacts(self._name, whole):
            return Message.of("Reached only in collision: {contact}.", contact=found[0])
        return Message.of("Reached only in collision: too close to an obstacle.")

    def _reservation(self, q: Array) -> Message | None:
        near = self.arm.near_limits(q)
        if len(near) == 1:
            return Message.of("{joint} would be near its limit.", joint=near[0])
        if near:
            return Message.of("{joints} would be near their limits.", joints=", ".join(near))
        if self.arm.smallest(q) < NEAR_SINGULAR:
            return Message.of("The arm would be near a singularity.")
        return None


def why_out_of_reach(arm: Arm, target: Array) -> Message:
    """Return the reason why an arm does not reach a pose (4, 4) in the frame of the model's root link."""
    distance = float(np.linalg.norm(target[:3, 3] - arm.centre))
    if distance > arm.reach:
        return Message.of(
            "The pose is {distance:.2f} m from the robot, which reaches at most {reach:.2f} m.",
            distance=distance,
            reach=arm.reach,
        )
    return Message.of("The robot does not reach the pose with this orientation.")


def _around(boxes: list[Array]) -> Array:
    every = np.array(boxes)
    return np.array((every[:, 0].min(axis=0), every[:, 1].max(axis=0)))
