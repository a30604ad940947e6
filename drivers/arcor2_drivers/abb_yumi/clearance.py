"""The rule by which the arms keep clear of each other: capsules about nominal links, along the path before it is run.

Upper arm, forearm, wrist and hand of each arm are capsules. The joints of a path are taken in steps; where the other
arm stands or moves is known from the controller, or from what we had it do. Body, table and parts are not known here.
"""

import threading
from typing import Final

import numpy as np

from arcor2_hw.data.geometry import Pose
from arcor2_hw.exceptions import Refused

from . import nominal
from .nominal import Array
from .settings import ARMS

RADII: Final = np.array([0.075, 0.065, 0.05, 0.04])
"""m: upper arm, forearm, wrist, hand; nominal links with their covers lie within."""
AXES: Final = (1, 3, 4, 6)
"""Frames whose origins are shoulder, elbow, wrist, flange."""
ANGLE_STEP: Final = 0.05
"""rad between two joint positions that are looked at."""
ALREADY: Final = 0.002
"""m by which arms that stand too close already may come closer on their way apart."""
TIMING: Final = 0.05
"""Part of a synchronised path by which the arms may be ahead of each other."""


def bones(arm: str, joints: Array, tcp: Pose) -> Array:
    """Give the points of shoulder, elbow, wrist, flange and TCP, shape (n, 5, 3), of joints (n, 7)."""
    found = nominal.frames(arm, joints)
    points = np.empty((len(joints), 5, 3))
    points[:, :4] = found[:, list(AXES)][:, :, :3, 3]
    points[:, 4] = found[:, 6, :3, 3] + found[:, 6, :3, :3] @ np.array([*tcp.position])
    return points


def between(one: Array, other: Array) -> Array:
    """Give the clearance of the capsules, m, of points (..., 5, 3) that broadcast; negative inside."""
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
    """Give the joints (n, 7) of a motion in which all axes go evenly."""
    count = int(np.clip(np.abs(goal - start).max() / ANGLE_STEP, 2, 120))
    return start + np.linspace(0.0, 1.0, count + 1)[:, None] * (goal - start)


class Clearance:
    """Knows what each arm is doing, and judges what one is to do next."""

    def __init__(self, name: str, tools: dict[str, Pose], least: float) -> None:
        self._name, self._tools, self._least = name, tools, least
        self._lock = threading.Lock()
        self._paths: dict[str, Array] = {}

    def set_tool(self, arm: str, tcp: Pose) -> None:
        """Take note of another TCP; the hand reaches from the flange to there."""
        self._tools[arm] = tcp

    def claim(self, arm: str, path: Array, other_joints: Array) -> None:
        """Judge a path of one arm against where the other is, or may come to; keep it until `free`. Raises Refused."""
        other = other_arm(arm)
        with self._lock:
            there = self._paths.get(other, other_joints[None, :])
            mine = bones(arm, path, self._tools[arm])
            theirs = bones(other, there, self._tools[other])
            gaps = between(mine[:, None], theirs[None, :]).min(axis=1)
            self._judge(arm, gaps)
            self._paths[arm] = path

    def claim_both(self, paths: dict[str, Array]) -> None:
        """Judge paths that both arms run in step; keep them until `free`. Raises Refused."""
        count = max(len(path) for path in paths.values())
        one, two = (_resampled(bones(arm, paths[arm], self._tools[arm]), count) for arm in ARMS)
        with self._lock:
            reach = int(np.ceil(TIMING * count))
            gaps = np.full(count, np.inf)
            for shift in range(-reach, reach + 1):
                at = np.clip(np.arange(count) + shift, 0, count - 1)
                gaps = np.minimum(gaps, between(one, two[at]))
            self._judge("left", gaps)
            self._paths.update(paths)

    def judge_stand(self, arm: str, joints: Array, other_joints: Array) -> None:
        """Judge joints at which one arm would stand beside the other. Raises Refused."""
        other = other_arm(arm)
        mine, theirs = (
            bones(arm, joints[None, :], self._tools[arm]),
            bones(other, other_joints[None, :], self._tools[other]),
        )
        with self._lock:
            self._judge(arm, np.append(np.inf, between(mine, theirs)))

    def free(self, arm: str) -> None:
        """Forget an arm's path: it stands."""
        with self._lock:
            self._paths.pop(arm, None)

    def _judge(self, arm: str, gaps: Array) -> None:
        least = float(gaps.min())
        if least < min(self._least, float(gaps[0]) - ALREADY):
            gap = f"{least * 1e3:.0f} mm" if least > 0.0 else "touching it"
            raise Refused(
                f"{self._name}: the {arm} arm would come too close to the {other_arm(arm)} arm",
                f"nominal clearance {gap}, {self._least * 1e3:.0f} mm asked for",
            )


def other_arm(arm: str) -> str:
    """Give the other arm."""
    return ARMS[1 - ARMS.index(arm)]


def _resampled(points: Array, count: int) -> Array:
    """Give points at `count` equal parts of a path."""
    places = np.linspace(0.0, len(points) - 1.0, count)
    low = np.minimum(places.astype(int), len(points) - 2)
    part = (places - low)[:, None, None]
    out: Array = points[low] * (1.0 - part) + points[low + 1] * part
    return out
