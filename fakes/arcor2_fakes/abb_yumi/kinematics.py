"""Nominal kinematics of one arm of the fake: a Denavit-Hartenberg table (Craig) and numeric inverse kinematics.

Joints are in the order of the wire: axes 1 to 6, then axis 7, which is between 2 and 3. Units are m and rad.
"""

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

CHAIN: Final = (0, 1, 6, 2, 3, 4, 5)
"""The axes from the body to the flange, as indices of the wire's order."""
TABLE: Final = (
    (0.0, 0.0, 0.1, 0.0),
    (math.pi / 2, 0.03, 0.0, 0.0),
    (-math.pi / 2, -0.03, 0.2515, 0.0),
    (math.pi / 2, -0.0405, 0.0, math.pi / 2),
    (-math.pi / 2, 0.0405, 0.265, 0.0),
    (math.pi / 2, -0.027, 0.0, 0.0),
    (-math.pi / 2, 0.027, 0.036, math.pi),
)
"""Per link: alpha, a (of the link before), d, offset of theta."""
LIMITS: Final = np.radians(
    [(-168.5, 168.5), (-143.5, 43.5), (-123.5, 80.0), (-290.0, 290.0), (-88.0, 138.0), (-229.0, 229.0), (-168.5, 168.5)]
)
MAX_SPEED: Final = np.radians([180.0, 180.0, 180.0, 400.0, 400.0, 400.0, 180.0])
BASES: Final = {
    "left": ((0.05355, 0.0725, 0.41492), (0.9781, -0.5716, 2.3180)),
    "right": ((0.05355, -0.0725, 0.41492), (-0.9795, -0.5682, -2.3155)),
}
"""Position and roll, pitch, yaw of the base of each arm on the body."""
HOME: Final = {
    "left": np.radians([0.0, -130.0, 30.0, 0.0, 40.0, 0.0, 135.0]),
    "right": np.radians([0.0, -130.0, 30.0, 0.0, 40.0, 0.0, -135.0]),
}
_ANGLE_WEIGHT: Final = 0.2  # weight of an error of the arm angle relative to the position, m/rad
_TURN_WEIGHT: Final = 0.3  # weight of an error of the orientation relative to the position, m/rad
_STEP: Final = 1e-6
_TOLERANCE: Final = 1e-6


class NotReachable(Exception):
    """No joints reach the target."""


@dataclass(frozen=True)
class Target:
    """A robtarget: pose of the flange in the world, configuration (cf1, cf4, cf6, cfx), arm angle in rad."""

    pose: Array
    configuration: tuple[int, int, int, int]
    angle: float


def _fixed(roll: float, pitch: float, yaw: float, position: tuple[float, float, float]) -> Array:
    (cr, sr), (cp, sp), (cy, sy) = ((math.cos(v), math.sin(v)) for v in (roll, pitch, yaw))
    out = np.eye(4)
    out[:3, :3] = [
        [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
        [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
        [-sp, cp * sr, cp * cr],
    ]
    out[:3, 3] = position
    return out


def quaternion(rotation: Array) -> tuple[float, float, float, float]:
    """Return w, x, y, z of a rotation matrix."""
    m = rotation
    values = np.array(
        [
            1.0 + m[0, 0] + m[1, 1] + m[2, 2],
            1.0 + m[0, 0] - m[1, 1] - m[2, 2],
            1.0 - m[0, 0] + m[1, 1] - m[2, 2],
            1.0 - m[0, 0] - m[1, 1] + m[2, 2],
        ]
    )
    big = int(np.argmax(values))
    s = 2.0 * math.sqrt(values[big])
    rows = (
        (s / 4, (m[2, 1] - m[1, 2]) / s, (m[0, 2] - m[2, 0]) / s, (m[1, 0] - m[0, 1]) / s),
        ((m[2, 1] - m[1, 2]) / s, s / 4, (m[0, 1] + m[1, 0]) / s, (m[0, 2] + m[2, 0]) / s),
        ((m[0, 2] - m[2, 0]) / s, (m[0, 1] + m[1, 0]) / s, s / 4, (m[1, 2] + m[2, 1]) / s),
        ((m[1, 0] - m[0, 1]) / s, (m[0, 2] + m[2, 0]) / s, (m[1, 2] + m[2, 1]) / s, s / 4),
    )
    w, x, y, z = (float(v) for v in rows[big])
    return w, x, y, z


def pose_of(position: tuple[float, float, float], wxyz: tuple[float, float, float, float]) -> Array:
    """Return the matrix of a position and a quaternion w, x, y, z. Raise ValueError unless it is a unit quaternion."""
    norm = math.sqrt(sum(v * v for v in wxyz))
    if not 0.99 < norm < 1.01:
        raise ValueError("not a unit quaternion")
    w, x, y, z = (v / norm for v in wxyz)
    out = np.eye(4)
    out[:3, :3] = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    out[:3, 3] = position
    return out


def turn(rotation: Array) -> Array:
    """Return axis times angle of a rotation matrix."""
    w, x, y, z = quaternion(rotation)
    if w < 0.0:
        w, x, y, z = -w, -x, -y, -z
    s = math.sqrt(x * x + y * y + z * z)
    return np.array([x, y, z]) * (2.0 if s < 1e-12 else 2.0 * math.atan2(s, w) / s)


def turned(vector: Array) -> Array:
    """Return the rotation matrix of axis times angle."""
    angle = float(np.linalg.norm(vector))
    half = math.sin(angle / 2) / angle if angle > 1e-12 else 0.5
    w, (x, y, z) = math.cos(angle / 2), vector * half
    return pose_of((0.0, 0.0, 0.0), (w, float(x), float(y), float(z)))[:3, :3]


class Kinematics:
    """Kinematics of one arm; `base` is its pose on the body."""

    def __init__(self, arm: str) -> None:
        position, (roll, pitch, yaw) = BASES[arm]
        self.home = HOME[arm]
        self._base = _fixed(roll, pitch, yaw, position)

    def frames(self, q: Array) -> Array:
        """Return the frames of the seven links in the world, shape (n, 7, 4, 4), of joints of shape (n, 7)."""
        at = np.broadcast_to(self._base, (len(q), 4, 4))
        out = np.empty((len(q), 7, 4, 4))
        for link, (axis, (alpha, a, d, offset)) in enumerate(zip(CHAIN, TABLE, strict=True)):
            c, s = np.cos(q[:, axis] + offset), np.sin(q[:, axis] + offset)
            ca, sa = math.cos(alpha), math.sin(alpha)
            step = np.zeros((len(q), 4, 4))
            step[:, 0, 0], step[:, 0, 1], step[:, 0, 3] = c, -s, a
            step[:, 1, 0], step[:, 1, 1], step[:, 1, 2], step[:, 1, 3] = s * ca, c * ca, -sa, -sa * d
            step[:, 2, 0], step[:, 2, 1], step[:, 2, 2], step[:, 2, 3] = s * sa, c * sa, ca, ca * d
            step[:, 3, 3] = 1.0
            at = at @ step
            out[:, link] = at
        return out

    def forward(self, q: Array) -> Array:
        """Return the flange in the world for seven joints."""
        flange: Array = self.frames(q[None, :])[0, 6]
        return flange

    def _angles(self, frames: Array) -> Array:
        """Return the arm angle: the elbow about the line from shoulder to wrist, from the vertical plane."""
        shoulder, elbow, wrist = frames[:, 1, :3, 3], frames[:, 3, :3, 3], frames[:, 4, :3, 3]
        line = wrist - shoulder
        line = line / np.linalg.norm(line, axis=1)[:, None]
        out = elbow - shoulder
        out = out - (out * line).sum(1)[:, None] * line
        up = np.array([0.0, 0.0, 1.0]) - line[:, 2:3] * line
        side = np.cross(line, up)
        angles: Array = np.arctan2((out * side).sum(1), (out * up).sum(1))
        return angles

    def describe(self, q: Array) -> Target:
        """Return the robtarget of joints."""
        frames = self.frames(q[None, :])
        quadrants = [math.floor(math.degrees(q[axis]) / 90.0) for axis in (0, 3, 5)]
        cfx = 4 * (q[4] < 0.0) + 2 * (q[2] < 0.0) + (q[1] < 0.0)
        return Target(
            frames[0, 6], (quadrants[0], quadrants[1], quadrants[2], int(cfx)), float(self._angles(frames)[0])
        )

    def solve(self, pose: Array, angle: float | None, seed: Array, rounds: int = 60) -> Array:
        """Return joints within the limits for a pose of the flange, and for an arm angle if one is given.

        Raise NotReachable if the descent from the seed does not converge.
        """
        q = np.clip(seed, LIMITS[:, 0], LIMITS[:, 1])
        damping = 1e-3
        error, jacobian = self._linearised(q, pose, angle)
        for _ in range(rounds):
            size = float(np.linalg.norm(error))
            if size < _TOLERANCE:
                return q
            moved = jacobian.copy()
            for _ in range(3):
                square = moved @ moved.T + damping * damping * np.eye(len(error))
                step = moved.T @ np.linalg.solve(square, error)
                outwards = ((q <= LIMITS[:, 0]) & (step < 0.0)) | ((q >= LIMITS[:, 1]) & (step > 0.0))
                if not outwards.any():
                    break
                moved[:, outwards] = 0.0
            step *= min(1.0, 0.5 / float(np.abs(step).max() + 1e-12))
            trial = np.clip(q + step, LIMITS[:, 0], LIMITS[:, 1])
            after, jacobian_after = self._linearised(trial, pose, angle)
            if float(np.linalg.norm(after)) < size:
                q, error, jacobian, damping = trial, after, jacobian_after, max(damping / 3.0, 1e-6)
            elif damping > 3.0:
                break
            else:
                damping *= 5.0
        raise NotReachable

    def reach(self, target: Target, present: Array) -> Array:
        """Return joints for a robtarget with its configuration and arm angle. Raise NotReachable."""
        quadrant = dict(zip((0, 3, 5), target.configuration[:3], strict=True))
        middle = present.copy()
        for axis, number in quadrant.items():
            if math.floor(math.degrees(middle[axis]) / 90.0) != number:
                middle[axis] = math.radians(90.0 * number + 45.0)
        mixed = 0.5 * (middle + self.home)
        for axis in quadrant:
            mixed[axis] = middle[axis]
        for seed in (present, middle, mixed):
            try:
                q = self.solve(target.pose, target.angle, seed)
            except NotReachable:
                continue
            degrees = np.degrees(q)
            if all(90.0 * n - 1e-3 <= degrees[axis] <= 90.0 * (n + 1) + 1e-3 for axis, n in quadrant.items()):
                return q
        raise NotReachable

    def _linearised(self, q: Array, pose: Array, angle: float | None) -> tuple[Array, Array]:
        """Return the error to the target, and its Jacobian."""
        frames = self.frames(q[None, :] if angle is None else q[None, :] + np.vstack([np.zeros(7), _STEP * np.eye(7)]))
        flange, axes, origins = frames[0, 6], frames[0, :, :3, 2], frames[0, :, :3, 3]
        missing = np.concatenate([pose[:3, 3] - flange[:3, 3], _TURN_WEIGHT * turn(pose[:3, :3] @ flange[:3, :3].T)])
        jacobian = np.empty((6, 7))
        chain = list(CHAIN)
        jacobian[:3, chain] = np.cross(axes, flange[:3, 3] - origins).T
        jacobian[3:, chain] = _TURN_WEIGHT * axes.T
        if angle is None:
            return missing, jacobian
        angles = self._angles(frames)
        lacking = _ANGLE_WEIGHT * _wrapped(angle - float(angles[0]))
        slope = [_ANGLE_WEIGHT * _wrapped(float(a - angles[0])) / _STEP for a in angles[1:]]
        return np.append(missing, lacking), np.vstack([jacobian, slope])


def _wrapped(angle: float) -> float:
    return math.remainder(angle, 2.0 * math.pi)
