"""Clearance between the arms: a path is checked before it is run, with capsules around nominal links.

Upper arm, forearm, wrist and hand of each arm are capsules. A path is sampled in steps. The other arm is
at the position read from the controller, or on the path that it executes. Body, table and parts are not considered.
"""

import threading
from typing import Final

import numpy as np

from arcor2_hw.data.geometry import Pose
from arcor2_hw.exceptions import Refused

from . import nominal
from .arms import other_arm
from .nominal import Array
from .settings import ARMS

RADII: Final = np.array([0.075, 0.065, 0.05, 0.04])
"""Radii of upper arm, forearm, wrist and hand, m; they contain the nominal links with their covers."""
AXES: Final = (1, 3, 4, 6)
"""Frames with their origins at shoulder, elbow, wrist and flange."""
ANGLE_STEP: Final = 0.05
"""Joint angle between two checked positions, rad."""
MAX_APPROACH: Final = 0.002
"""Maximum further approach of arms that are too close and are separating, m."""
MAX_TIMING_ERROR: Final = 0.05
"""Fraction of a synchronized path by which one arm may be ahead of the other."""


def capsule_points(arm: str, joints: Array, tcp: Pose) -> Array:
    """Return shoulder, elbow, wrist, flange and TCP, shape (n, 5, 3), for joints of shape (n, 7)."""
    found = nominal.frames(arm, joints)
    points = np.empty((len(joints), 5, 3))
    points[:, :4] = found[:, list(AXES)][:, :, :3, 3]
    points[:, 4] = found[:, 6, :3, 3] + found[:, 6, :3, :3] @ np.array([*tcp.position])
    return points


def clearances(one: Array, other: Array) -> Array:
    """Return the clearance of capsules, m, for points of shape (..., 5, 3), broadcast; negative if they overlap."""
    p, q = one[..., :-1, None, :], other[..., None, :-1, :]
    u, v = one[..., 1:, None, :] - p, other[..., None, 1:, :] - q
    w = p - q
    a, b, c = (u * u).sum(-1), (u * v).sum(-1), (v * v).sum(-1)
    d, e = (u * w).sum(-1), (v * w).sum(-1)
    determinant = a * c - b * b
    tiny = 1e-12
    s = np.clip(np.where(determinant > tiny, (b * e - c * d) / np.maximum(determinant, tiny), 0.0), 0.0, 1.0)
    t = np.clip((b * s + e) / np.maximum(c, tiny), 0.0, 1.0)
    s = np.clip((b * t - d) / np.maximum(a, tiny), 0.0, 1.0)
    gap = np.linalg.norm(w + s[..., None] * u - t[..., None] * v, axis=-1) - RADII[:, None] - RADII[None, :]
    out: Array = gap.min(axis=(-1, -2))
    return out


def joint_path(start: Array, goal: Array) -> Array:
    """Return the joints, shape (n, 7), of a motion with all axes together."""
    count = int(np.clip(np.abs(goal - start).max() / ANGLE_STEP, 2, 120))
    return start + np.linspace(0.0, 1.0, count + 1)[:, None] * (goal - start)


class Clearance:
    """Stores the path that each arm executes, and checks new ones against it."""

    def __init__(self, name: str, tools: dict[str, Pose], least: float) -> None:
        self._name, self._tools, self._least = name, tools, least
        self._lock = threading.Lock()
        self._paths: dict[str, Array] = {}

    def claim(self, arm: str, path: Array, other_joints: Array) -> None:
        """Check a path of one arm against the other one, and reserve it until `free`. Raise Refused."""
        other = other_arm(arm)
        with self._lock:
            there = self._paths.get(other, other_joints[None, :])
            mine = capsule_points(arm, path, self._tools[arm])
            theirs = capsule_points(other, there, self._tools[other])
            gaps = clearances(mine[:, None], theirs[None, :]).min(axis=1)
            self._check(arm, gaps)
            self._paths[arm] = path

    def claim_both(self, paths: dict[str, Array]) -> None:
        """Check paths that both arms execute in step, and reserve them until `free`. Raise Refused."""
        count = max(len(path) for path in paths.values())
        one, two = (_resampled(capsule_points(arm, paths[arm], self._tools[arm]), count) for arm in ARMS)
        with self._lock:
            reach = int(np.ceil(MAX_TIMING_ERROR * count))
            gaps = np.full(count, np.inf)
            for shift in range(-reach, reach + 1):
                at = np.clip(np.arange(count) + shift, 0, count - 1)
                gaps = np.minimum(gaps, clearances(one, two[at]))
            self._check("left", gaps)
            self._paths.update(paths)

    def check_joints(self, arm: str, joints: Array, other_joints: Array) -> None:
        """Check joints of one arm against the present ones of the other. Raise Refused."""
        other = other_arm(arm)
        mine, theirs = (
            capsule_points(arm, joints[None, :], self._tools[arm]),
            capsule_points(other, other_joints[None, :], self._tools[other]),
        )
        with self._lock:
            self._check(arm, np.append(np.inf, clearances(mine, theirs)))

    def free(self, arm: str) -> None:
        """Drop the path of an arm that is at standstill."""
        with self._lock:
            self._paths.pop(arm, None)

    def _check(self, arm: str, gaps: Array) -> None:
        least = float(gaps.min())
        if least < min(self._least, float(gaps[0]) - MAX_APPROACH):
            gap = f"{least * 1e3:.0f} mm" if least > 0.0 else "touching it"
            raise Refused(
                "{name}: the {arm} arm would come too close to the {other_arm} arm.",
                f"nominal clearance {gap}, required {self._least * 1e3:.0f} mm",
                name=self._name,
                arm=arm,
                other_arm=other_arm(arm),
            )


def _resampled(points: Array, count: int) -> Array:
    """Return `count` evenly spaced points of a path."""
    places = np.linspace(0.0, len(points) - 1.0, count)
    low = np.minimum(places.astype(int), len(points) - 2)
    part = (places - low)[:, None, None]
    out: Array = points[low] * (1.0 - part) + points[low + 1] * part
    return out
