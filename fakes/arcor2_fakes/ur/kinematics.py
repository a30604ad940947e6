"""Forward and inverse kinematics of the UR e-series from nominal DH parameters, in plain floats for the 500 Hz cycle.

Poses are in the controller's base: rigid transforms here, x, y, z and rotation vector on the wire. A real arm has its
own calibration and differs by millimetres. Source of the parameters: Universal Robots, "DH Parameters
for calculations of kinematics and dynamics", e-Series table. The inverse follows from the geometry: the wrist center
gives joint 1, the offset along the normal of joint 1's plane gives joint 5, and two links are left for joints 2 to 4.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

Vector = tuple[float, float, float]
Transform = tuple[Vector, Vector, Vector, Vector]
"""The axes x, y, z and the origin of a frame, each in base coordinates."""

IDENTITY: Transform = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (0.0, 0.0, 0.0))
_SINGULAR = 1e-6  # sine of joint 5: the precision of acos near 1
_MARGIN = 1e-7  # tolerance of a cosine above 1, at the limit of the reach
_DAMPING = 1e-10 * np.eye(6)
_SMALL_STEP = 1e-4  # rad


@dataclass(frozen=True)
class Geometry:
    """DH lengths in metres, named as in the vendor's table."""

    d1: float
    a2: float
    a3: float
    d4: float
    d5: float
    d6: float


MODELS = {
    "ur3e": Geometry(0.15185, -0.24355, -0.2132, 0.13105, 0.08535, 0.0921),
    "ur5e": Geometry(0.1625, -0.425, -0.3922, 0.1333, 0.0997, 0.0996),
    "ur10e": Geometry(0.1807, -0.6127, -0.57155, 0.17415, 0.11985, 0.11655),
    "ur16e": Geometry(0.1807, -0.4784, -0.36, 0.17415, 0.11985, 0.11655),
}


class NoSolution(ValueError):
    """The pose cannot be reached."""


def cross(a: Vector, b: Vector) -> Vector:
    """Return the vector product."""
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def dot(a: Vector, b: Vector) -> float:
    """Return the scalar product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def _combine(f: float, a: Vector, g: float, b: Vector) -> Vector:
    return (f * a[0] + g * b[0], f * a[1] + g * b[1], f * a[2] + g * b[2])


def compose(a: Transform, b: Transform) -> Transform:
    """Return the frame `b`, given in `a`, in the base of `a`."""
    x, y, z, o = a

    def turn(v: Vector) -> Vector:
        return (
            x[0] * v[0] + y[0] * v[1] + z[0] * v[2],
            x[1] * v[0] + y[1] * v[1] + z[1] * v[2],
            x[2] * v[0] + y[2] * v[1] + z[2] * v[2],
        )

    p = turn(b[3])
    return (turn(b[0]), turn(b[1]), turn(b[2]), (p[0] + o[0], p[1] + o[1], p[2] + o[2]))


def invert(a: Transform) -> Transform:
    """Return the base in the frame `a`."""
    x, y, z, o = a
    return (
        (x[0], y[0], z[0]),
        (x[1], y[1], z[1]),
        (x[2], y[2], z[2]),
        (-dot(x, o), -dot(y, o), -dot(z, o)),
    )


def from_pose(pose: Sequence[float]) -> Transform:
    """Return the transform of x, y, z [m] and a rotation vector [rad] (Rodrigues' formula)."""
    px, py, pz, rx, ry, rz = pose
    angle = math.sqrt(rx * rx + ry * ry + rz * rz)
    if angle < 1e-12:
        return ((1.0, rz, -ry), (-rz, 1.0, rx), (ry, -rx, 1.0), (px, py, pz))
    kx, ky, kz = rx / angle, ry / angle, rz / angle
    c, s = math.cos(angle), math.sin(angle)
    t = 1.0 - c
    return (
        (c + kx * kx * t, kx * ky * t + kz * s, kx * kz * t - ky * s),
        (kx * ky * t - kz * s, c + ky * ky * t, ky * kz * t + kx * s),
        (kx * kz * t + ky * s, ky * kz * t - kx * s, c + kz * kz * t),
        (px, py, pz),
    )


def rotation_vector(a: Transform) -> Vector:
    """Return axis times angle, angle in [0, pi]; stable at both ends."""
    x, y, z, _ = a
    vx, vy, vz = y[2] - z[1], z[0] - x[2], x[1] - y[0]
    sine2 = math.sqrt(vx * vx + vy * vy + vz * vz)  # 2 sin
    cosine2 = x[0] + y[1] + z[2] - 1.0  # 2 cos
    angle = math.atan2(sine2, cosine2)
    if sine2 > 1e-6:
        f = angle / sine2
        return (vx * f, vy * f, vz * f)
    if cosine2 > 0.0:
        return (vx / 2.0, vy / 2.0, vz / 2.0)
    # Half a turn: the axis is the largest column of (R + 1) / 2 = k k^T.
    columns: list[Vector] = [(x[0] + 1.0, x[1], x[2]), (y[0], y[1] + 1.0, y[2]), (z[0], z[1], z[2] + 1.0)]
    k = max(columns, key=lambda v: dot(v, v))
    f = angle / math.sqrt(dot(k, k))
    if vx * k[0] + vy * k[1] + vz * k[2] < 0.0:
        f = -f
    return (k[0] * f, k[1] * f, k[2] * f)


def to_pose(a: Transform) -> tuple[float, ...]:
    """Return x, y, z [m] and rotation vector [rad] of a transform."""
    return (*a[3], *rotation_vector(a))


def difference(a: Transform, b: Transform) -> tuple[Vector, Vector]:
    """Return translation and rotation vector, in base axes, from `a` to `b`."""
    o, p = a[3], b[3]
    turn = compose((b[0], b[1], b[2], (0.0, 0.0, 0.0)), invert((a[0], a[1], a[2], (0.0, 0.0, 0.0))))
    return (p[0] - o[0], p[1] - o[1], p[2] - o[2]), rotation_vector(turn)


class Chain:
    """The six joints of one model with the tool center point mounted on the flange."""

    def __init__(self, model: str = "ur5e") -> None:
        if model not in MODELS:
            raise ValueError(f"model {model!r} does not exist; available: {', '.join(MODELS)}")
        self.geometry = MODELS[model]
        self.tcp = IDENTITY
        self._flange_from_tcp = IDENTITY

    def set_tcp(self, offset: Sequence[float]) -> None:
        """Set the TCP in the flange, x, y, z [m] and rotation vector [rad]."""
        self.tcp = from_pose(offset)
        self._flange_from_tcp = invert(self.tcp)

    def forward(self, q: Sequence[float]) -> Transform:
        """Return the TCP in the base."""
        return compose(self._frames(q)[0], self.tcp)

    def flange(self, q: Sequence[float]) -> Transform:
        """Return the tool flange in the base."""
        return self._frames(q)[0]

    def jacobian(self, q: Sequence[float]) -> np.ndarray:
        """Return the Jacobian, shape (6, 6): TCP velocity (m/s, rad/s, base axes) per joint velocity."""
        return self._tip_and_jacobian(q)[1]

    def _tip_and_jacobian(self, q: Sequence[float]) -> tuple[Transform, np.ndarray]:
        flange, axes, origins = self._frames(q)
        tip = compose(flange, self.tcp)
        p = tip[3]
        columns = [
            (*cross(axis, (p[0] - o[0], p[1] - o[1], p[2] - o[2])), *axis)
            for axis, o in zip(axes, origins, strict=True)
        ]
        return tip, np.array(columns).T

    def _frames(self, q: Sequence[float]) -> tuple[Transform, tuple[Vector, ...], tuple[Vector, ...]]:
        """Return the flange, and axis and point of each joint. Each line is one row of the DH table."""
        g = self.geometry
        c1, s1 = math.cos(q[0]), math.sin(q[0])
        x1: Vector = (c1, s1, 0.0)
        n: Vector = (s1, -c1, 0.0)  # axis of joints 2, 3 and 4
        a, b = q[1] + q[2], q[1] + q[2] + q[3]
        p1: Vector = (0.0, 0.0, g.d1)
        r2, r3 = g.a2 * math.cos(q[1]), g.a3 * math.cos(a)
        p2: Vector = (r2 * c1, r2 * s1, g.d1 + g.a2 * math.sin(q[1]))
        p3: Vector = (p2[0] + r3 * c1, p2[1] + r3 * s1, p2[2] + g.a3 * math.sin(a))
        cb, sb = math.cos(b), math.sin(b)
        x4: Vector = (cb * x1[0], cb * x1[1], sb)
        z4: Vector = (sb * x1[0], sb * x1[1], -cb)
        p4 = _combine(1.0, p3, g.d4, n)
        p5 = _combine(1.0, p4, g.d5, z4)
        c5, s5 = math.cos(q[4]), math.sin(q[4])
        x5 = _combine(c5, x4, s5, n)
        z5 = _combine(-s5, x4, c5, n)
        c6, s6 = math.cos(q[5]), math.sin(q[5])
        x6 = _combine(c6, x5, -s6, z4)
        y6 = _combine(-s6, x5, -c6, z4)
        flange = (x6, y6, z5, _combine(1.0, p5, g.d6, z5))
        return flange, ((0.0, 0.0, 1.0), n, n, n, z4, z5), ((0.0, 0.0, 0.0), p1, p2, p3, p4, p5)

    def solutions(self, target: Transform, q6_if_free: float = 0.0) -> list[tuple[float, ...]]:
        """Return up to eight joint configurations that bring the TCP to `target`, angles in (-pi, pi]."""
        g = self.geometry
        x6, y6, z6, p = compose(target, self._flange_from_tcp)
        wx, wy = p[0] - g.d6 * z6[0], p[1] - g.d6 * z6[1]
        radius = math.hypot(wx, wy)
        if radius < g.d4 * (1.0 - _MARGIN):
            return []
        found = []
        toward, lean = math.atan2(wy, wx), math.asin(min(1.0, g.d4 / radius))
        for q1 in (toward + lean, toward + math.pi - lean):
            c1, s1 = math.cos(q1), math.sin(q1)
            n: Vector = (s1, -c1, 0.0)
            cosine = (dot(p, n) - g.d4) / g.d6
            if abs(cosine) > 1.0 + _MARGIN:
                continue
            bend = math.acos(min(1.0, max(-1.0, cosine)))
            for q5 in (bend, -bend):
                c5, s5 = math.cos(q5), math.sin(q5)
                free = abs(s5) < _SINGULAR  # joints 4 and 6 are parallel, so one of them is free
                q6 = q6_if_free if free else math.atan2(-dot(y6, n) / s5, dot(x6, n) / s5)
                c6, s6 = math.cos(q6), math.sin(q6)
                x5 = _combine(c6, x6, -s6, y6)
                z4 = _combine(-s6, x6, -c6, y6)
                x4 = _combine(c5, x5, -s5, z6)
                q234 = math.atan2(x4[2], x4[0] * c1 + x4[1] * s1)
                p3 = _combine(1.0, _combine(1.0, _combine(1.0, p, -g.d6, z6), -g.d5, z4), -g.d4, n)
                u, w = p3[0] * c1 + p3[1] * s1, p3[2] - g.d1
                cosine = (u * u + w * w - g.a2 * g.a2 - g.a3 * g.a3) / (2.0 * g.a2 * g.a3)
                if abs(cosine) > 1.0 + _MARGIN:
                    continue
                fold = math.acos(min(1.0, max(-1.0, cosine)))
                for q3 in (fold, -fold):
                    q2 = math.atan2(w, u) - math.atan2(g.a3 * math.sin(q3), g.a2 + g.a3 * math.cos(q3))
                    q = (q1, q2, q3, q234 - q2 - q3, q5, q6)
                    found.append(tuple(math.remainder(angle, math.tau) for angle in q))
        return found

    def inverse(self, target: Transform, near: Sequence[float]) -> tuple[float, ...]:
        """Return the configuration closest to `near` within +-2 pi. Raise `NoSolution` if there is none."""
        best, least = None, math.inf
        for solution in self.solutions(target, near[5]):
            q = tuple(_unwind(angle, n) for angle, n in zip(solution, near, strict=True))
            far = max(abs(a - b) for a, b in zip(q, near, strict=True))
            if far < least:
                best, least = q, far
        if best is None:
            raise NoSolution("the pose is out of reach")
        return self.follow(target, best) or best  # near singularities, solutions are inexact without a Newton step

    def follow(self, target: Transform, q: Sequence[float], steps: int = 5) -> tuple[float, ...] | None:
        """Return a configuration next to `q` (Newton's method, damped); None if it does not converge."""
        for _ in range(steps):
            tip, jacobian = self._tip_and_jacobian(q)
            shift, turn = difference(tip, target)
            error = np.array((*shift, *turn))
            step = (jacobian.T @ np.linalg.solve(jacobian @ jacobian.T + _DAMPING, error)).tolist()
            q = [a + b for a, b in zip(q, step, strict=True)]
            # Newton converges quadratically: the error after a small step is its square.
            if max(map(abs, step)) < _SMALL_STEP:
                return tuple(q)
        return None

    def joint_rates(self, q: Sequence[float], twist: Sequence[float]) -> list[float]:
        """Return joint velocities that give the TCP the velocity `twist`."""
        jacobian = self.jacobian(q)
        damped = jacobian @ jacobian.T + 1e-8 * np.eye(6)
        rates: list[float] = (jacobian.T @ np.linalg.solve(damped, np.array(twist))).tolist()
        return rates


def _unwind(angle: float, near: float) -> float:
    turned = near + math.remainder(angle - near, math.tau)
    if abs(turned) <= math.tau:
        return turned
    return turned - math.copysign(math.tau, turned)
