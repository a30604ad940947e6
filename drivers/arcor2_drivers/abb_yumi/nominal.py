"""Nominal kinematics of both arms for reachability and clearance, which the controller does not compute.

They use the published dimensions and the usual mounting of the arms. A real arm differs by some millimetres, so no
motion is commanded from these numbers. Joints are axes 1 to 7 in rad; axis 7 is between 2 and 3.
"""

import math
from typing import Final

import numpy as np
import numpy.typing as npt

from .settings import LEFT, RIGHT

Array = npt.NDArray[np.float64]

AXIS_ORDER: Final = (0, 1, 6, 2, 3, 4, 5)
"""Axes from the foot to the flange."""
LIMITS: Final = tuple(
    (math.radians(low), math.radians(high))
    for low, high in (
        (-168.5, 168.5),
        (-143.5, 43.5),
        (-123.5, 80.0),
        (-290.0, 290.0),
        (-88.0, 138.0),
        (-229.0, 229.0),
        (-168.5, 168.5),
    )
)
"""Ranges of the axes, rad, from the product specification."""
HALF: Final = math.pi / 2.0
LINKS: Final = (
    ((0.0, 0.0, 0.1), (0.0, 0.0, 0.0)),
    ((0.03, 0.0, 0.0), (HALF, 0.0, 0.0)),
    ((-0.03, 0.2515, 0.0), (-HALF, 0.0, 0.0)),
    ((-0.0405, 0.0, 0.0), (HALF, -HALF, 0.0)),
    ((0.0405, 0.265, 0.0), (-HALF, 0.0, 0.0)),
    ((-0.027, 0.0, 0.0), (HALF, 0.0, 0.0)),
    ((0.027, 0.036, 0.0), (-HALF, math.pi, 0.0)),
)
"""Frame of each axis in the previous one: position (m), roll, pitch, yaw (rad)."""
FEET: Final = {
    LEFT: ((0.05355, 0.0725, 0.41492), (0.9781, -0.5716, 2.3180)),
    RIGHT: ((0.05355, -0.0725, 0.41492), (-0.9795, -0.5682, -2.3155)),
}
MAX_ERROR: Final = 0.03
"""Maximum error of nominal kinematics, m; above it, the controller is not asked for a solution."""


def _transform(position: tuple[float, float, float], rpy: tuple[float, float, float]) -> Array:
    def about(axis: int, angle: float) -> Array:
        c, s = math.cos(angle), math.sin(angle)
        out = np.eye(3)
        i, j = (axis + 1) % 3, (axis + 2) % 3
        out[i, i], out[i, j], out[j, i], out[j, j] = c, -s, s, c
        return out

    roll, pitch, yaw = rpy
    out = np.eye(4)
    out[:3, :3] = about(2, yaw) @ about(1, pitch) @ about(0, roll)
    out[:3, 3] = position
    return out


_STEPS: Final = [_transform(*link) for link in LINKS]
_FEET: Final = {arm: _transform(*foot) for arm, foot in FEET.items()}


def frames(arm: str, joints: Array) -> Array:
    """Return the frames of the axes in the robot's, shape (n, 7, 4, 4), for joints (n, 7); the last is the flange."""
    out = np.empty((len(joints), 7, 4, 4))
    at = np.broadcast_to(_FEET[arm], (len(joints), 4, 4))
    for link, (axis, step) in enumerate(zip(AXIS_ORDER, _STEPS, strict=True)):
        at = at @ step
        c, s = np.cos(joints[:, axis])[:, None], np.sin(joints[:, axis])[:, None]
        turned = at.copy()
        turned[:, :, 0] = at[:, :, 0] * c + at[:, :, 1] * s
        turned[:, :, 1] = at[:, :, 1] * c - at[:, :, 0] * s
        out[:, link] = at = turned
    return out


def nearest(arm: str, flange: Array, seed: Array, rounds: int = 40) -> tuple[Array, float]:
    """Return joints near a seed that bring the flange nearest to a pose, shape (4, 4), and the error, m."""
    low, high = np.array(LIMITS).T
    q = np.clip(seed, low, high)
    missing, jacobian = _linearised(arm, q, flange)
    damping = 1e-3
    for _ in range(rounds):
        size = float(np.linalg.norm(missing))
        if size < 1e-5:
            break
        free = np.ones(7)
        for _ in range(3):  # keep an axis at its limit from moving beyond it
            reduced = jacobian * free
            step = reduced.T @ np.linalg.solve(reduced @ reduced.T + damping**2 * np.eye(6), missing)
            blocked = ((q <= low) & (step < 0.0)) | ((q >= high) & (step > 0.0))
            if not blocked.any():
                break
            free = np.where(blocked, 0.0, free)
        step *= min(1.0, 0.4 / float(np.abs(step).max() + 1e-12))
        trial = np.clip(q + step, low, high)
        after, slope = _linearised(arm, trial, flange)
        if float(np.linalg.norm(after)) < size:
            q, missing, jacobian, damping = trial, after, slope, max(damping / 3.0, 1e-6)
        elif damping > 3.0:
            break
        else:
            damping *= 5.0
    return q, float(np.linalg.norm(missing))


def _linearised(arm: str, q: Array, flange: Array) -> tuple[Array, Array]:
    """Return the error to a pose (0.3 m per radian), and its Jacobian by the joints."""
    found = frames(arm, q[None, :])[0]
    at = found[6]
    missing = np.empty(6)
    missing[:3] = flange[:3, 3] - at[:3, 3]
    missing[3:] = 0.3 * _turn(flange[:3, :3] @ at[:3, :3].T)
    axes, origins = found[:, :3, 2], found[:, :3, 3]
    jacobian = np.empty((6, 7))
    jacobian[:3, list(AXIS_ORDER)] = np.cross(axes, at[:3, 3] - origins).T
    jacobian[3:, list(AXIS_ORDER)] = 0.3 * axes.T
    return missing, jacobian


def _turn(rotation: Array) -> Array:
    """Return axis times angle of a rotation matrix."""
    skew = np.array([rotation[2, 1] - rotation[1, 2], rotation[0, 2] - rotation[2, 0], rotation[1, 0] - rotation[0, 1]])
    sine, cosine = float(np.linalg.norm(skew)) / 2.0, (float(np.trace(rotation)) - 1.0) / 2.0
    angle = math.atan2(sine, cosine)
    if sine > 1e-9:
        out: Array = skew * (angle / (2.0 * sine))
        return out
    if cosine > 0.0:
        return skew / 2.0
    axis = np.sqrt(np.clip((np.diag(rotation) + 1.0) / 2.0, 0.0, None))  # a half turn: both signs are equivalent
    return np.asarray(axis * math.pi)


def straight(arm: str, start: Array, flange: Array, step: float = 0.02) -> Array | None:
    """Return joints, shape (n, 7), along a line of the flange to a pose; None if there is no solution on the line."""
    first = frames(arm, start[None, :])[0, 6]
    distance = float(np.linalg.norm(flange[:3, 3] - first[:3, 3]))
    turn = _turn(flange[:3, :3] @ first[:3, :3].T)
    angle = float(np.linalg.norm(turn))
    count = int(np.clip(max(distance / step, angle / 0.1), 2, 60))
    path = [start]
    for part in np.linspace(0.0, 1.0, count + 1)[1:]:
        pose = np.eye(4)
        pose[:3, :3] = _rotation(turn * part) @ first[:3, :3]
        pose[:3, 3] = first[:3, 3] + part * (flange[:3, 3] - first[:3, 3])
        q, missed = nearest(arm, pose, path[-1], rounds=12)
        if missed > MAX_ERROR:
            return None
        path.append(q)
    return np.array(path)


def _rotation(turn: Array) -> Array:
    """Return the rotation matrix of axis times angle (Rodrigues)."""
    angle = float(np.linalg.norm(turn))
    if angle < 1e-12:
        return np.eye(3)
    x, y, z = turn / angle
    skew = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    out: Array = np.eye(3) + math.sin(angle) * skew + (1.0 - math.cos(angle)) * (skew @ skew)
    return out
