"""A synthetic depth sensor for the robot pose: one ray per pixel, intersected with shapes in closed form, and noise.

Shares no code with the solver: shapes are capsules and boxes met analytically, not triangles; the lens is inverted by
iteration; the arm is a Denavit-Hartenberg chain of its own (UR5e's published lengths). Noise grows with the square of
the distance, part of it fixed in the picture and smooth; depths are whole millimetres; edges have flying pixels; there
are holes, a table and a wall, and next to the arm a gripper and a cable that the model does not contain.
"""

import itertools
import math
from dataclasses import dataclass, field
from functools import lru_cache

import cv2
import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
UR5E = ((0.1625, 0.0, 90.0), (0.0, -0.425, 0.0), (0.0, -0.3922, 0.0), (0.1333, 0.0, 90.0), (0.0997, 0.0, -90.0))
"""d (m), a (m), alpha (deg) of the first five joints."""
FLANGE = 0.0996


@dataclass(frozen=True)
class Capsule:
    begin: Floats
    end: Floats
    radius: float


@dataclass(frozen=True)
class Block:
    """A box: pose of its middle (4 × 4) and its size."""

    pose: Floats
    size: tuple[float, float, float]


Shape = Capsule | Block


def turn(axis: Floats, angle: float) -> Floats:
    """Rodrigues' formula, as a 4 × 4 matrix."""
    x, y, z = axis / np.linalg.norm(axis)
    k = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    matrix = np.eye(4)
    matrix[:3, :3] += math.sin(angle) * k + (1 - math.cos(angle)) * k @ k
    return matrix


def shift(x: float, y: float, z: float) -> Floats:
    matrix = np.eye(4)
    matrix[:3, 3] = x, y, z
    return matrix


def looking(at: Floats, position: Floats) -> Floats:
    """Return world_from_camera with z towards a point and the top of the picture upwards."""
    z = (at - position) / np.linalg.norm(at - position)
    x = np.cross(z, [0.0, 0.0, 1.0])
    x /= np.linalg.norm(x)
    matrix = np.eye(4)
    matrix[:3, :3] = np.column_stack([x, np.cross(z, x), z])
    matrix[:3, 3] = position
    return matrix


def arm(joints: list[float]) -> list[Capsule]:
    """Return the links of an arm like a UR5e in its base frame (half a turn from its DH frame)."""
    frame = turn(np.array([0.0, 0.0, 1.0]), math.pi)
    frames = [frame]
    for (d, a, alpha), q in zip(UR5E, joints, strict=False):
        twist = turn(np.array([1.0, 0, 0]), math.radians(alpha))
        frame = frame @ turn(np.array([0, 0, 1.0]), q) @ shift(a, 0, d) @ twist
        frames.append(frame)

    def point(number: int, x: float = 0.0, y: float = 0.0, z: float = 0.0) -> Floats:
        return np.asarray((frames[number] @ [x, y, z, 1.0])[:3])

    return [
        Capsule(point(0, z=0.02), point(0, z=0.10), 0.075),
        Capsule(point(1, z=-0.03), point(1, z=0.15), 0.06),
        Capsule(point(2, 0.425, z=0.138), point(2, 0.0, z=0.138), 0.055),
        Capsule(point(2, z=0.16), point(2, z=-0.01), 0.055),
        Capsule(point(3, 0.3922, z=0.007), point(3, z=0.007), 0.045),
        Capsule(point(3, z=0.0), point(3, z=0.15), 0.042),
        Capsule(point(4, z=-0.03), point(4, z=0.11), 0.042),
        Capsule(point(5, z=-0.03), point(5, z=FLANGE - 0.03), 0.036),
    ]


def tool(joints: list[float]) -> list[Shape]:
    """Return objects at the arm that no model contains: a gripper and a cable along the forearm."""
    last = arm(joints)[-1]
    z = (last.end - last.begin) / np.linalg.norm(last.end - last.begin)
    x = np.cross(z, [0.3, 0.5, 0.8])
    x /= np.linalg.norm(x)
    pose = np.eye(4)
    pose[:3, :3] = np.column_stack([x, np.cross(z, x), z])
    pose[:3, 3] = last.end + 0.09 * z
    forearm = arm(joints)[4]
    aside = np.array([0.0, 0.0, 0.055])
    return [Block(pose, (0.10, 0.05, 0.10)), Capsule(forearm.begin + aside, forearm.end + aside, 0.008)]


def triangles(capsule: Capsule, around: int = 48, rings: int = 10) -> tuple[Floats, npt.NDArray[np.int64]]:
    """Return a capsule as triangles for the solver.

    Their corners lie on the surface, so that the mesh is slightly too small.
    """
    axis = capsule.end - capsule.begin
    length = float(np.linalg.norm(axis))
    z = axis / length
    x = np.cross(z, [1.0, 0, 0] if abs(z[0]) < 0.8 else [0, 1.0, 0])
    x /= np.linalg.norm(x)
    y = np.cross(z, x)
    profile = [(-capsule.radius * math.sin(a), capsule.radius * math.cos(a)) for a in _steps(math.pi / 2, 0.0, rings)]
    profile += [
        (length + capsule.radius * math.sin(a), capsule.radius * math.cos(a)) for a in _steps(0.0, math.pi / 2, rings)
    ]
    angles = np.arange(around) * 2 * math.pi / around
    circle = np.cos(angles)[:, None] * x + np.sin(angles)[:, None] * y
    vertices = np.concatenate([capsule.begin + h * z + max(r, 1e-6) * circle for h, r in profile])
    faces = []
    for ring, k in itertools.product(range(len(profile) - 1), range(around)):
        a, b = ring * around + k, ring * around + (k + 1) % around
        faces += [(a, b, a + around), (b, b + around, a + around)]
    return vertices, np.array(faces)


def _steps(begin: float, end: float, count: int) -> list[float]:
    return [begin + (end - begin) * i / count for i in range(count + 1)]


@dataclass
class Sensor:
    """A depth camera. Distortion: k1, k2, p1, p2, k3."""

    width: int = 640
    height: int = 360
    fx: float = 456.2
    fy: float = 456.0
    cx: float = 321.1
    cy: float = 178.9
    distortion: tuple[float, ...] = (0.08, -0.14, 0.0004, -0.0006, 0.05)
    noise: float = 0.0018
    fixed_noise: float = 0.0008
    pictures: int = 8
    shapes: list[Shape] = field(default_factory=list)
    table: float | None = 0.0
    wall: float | None = None
    """x of a wall in the world."""

    def rays(self) -> Floats:
        return _rays(self.width, self.height, self.fx, self.fy, self.cx, self.cy, self.distortion)

    def exact(self, world_from_camera: Floats) -> Floats:
        """Return the depth along the optical axis, m; infinite where the ray hits nothing."""
        rays = self.rays() @ world_from_camera[:3, :3].T
        origin = world_from_camera[:3, 3]
        depth = np.full(rays.shape[:2], np.inf)
        if self.table is not None:
            with np.errstate(divide="ignore"):
                t = (self.table - origin[2]) / rays[..., 2]
            hit = origin + np.where(np.isfinite(t), t, 0.0)[..., None] * rays
            depth = np.where((t > 0) & (np.abs(hit[..., :2]).max(axis=-1) < 1.2), t, depth)
        if self.wall is not None:
            with np.errstate(divide="ignore"):
                t = (self.wall - origin[0]) / rays[..., 0]
            depth = np.where((t > 0) & (t < depth), t, depth)
        for shape in self.shapes:
            meet = _meet_capsule if isinstance(shape, Capsule) else _meet_block
            depth = np.minimum(depth, meet(shape, origin, rays))  # type: ignore[arg-type]
        return depth

    def take(self, world_from_camera: Floats, rng: np.random.Generator) -> npt.NDArray[np.uint16]:
        """Return the mean of several noisy pictures, mm; 0 where there is no depth."""
        return self.noisy(self.exact(world_from_camera), rng)

    def noisy(self, exact: Floats, rng: np.random.Generator) -> npt.NDArray[np.uint16]:
        """Return the mean of several noisy pictures of exact depths, as `take`."""
        z = np.where(exact < 6.0, exact, 0.0).astype(np.float32)
        smooth = cv2.GaussianBlur(rng.standard_normal(z.shape).astype(np.float32), (0, 0), 3.0)
        smooth *= self.fixed_noise / smooth.std()
        far, near = cv2.dilate(z, np.ones((3, 3))), cv2.erode(z, np.ones((3, 3)))
        edge = (far - near > 0.03) & (rng.random(z.shape) < 0.6)
        mixed = np.where(edge, near + (far - near) * rng.random(z.shape), z)
        total, count = np.zeros(z.shape), np.zeros(z.shape)
        for _ in range(self.pictures):
            seen = mixed + z * z * (smooth + self.noise * rng.standard_normal(z.shape).astype(np.float32))
            there = (z > 0.2) & (rng.random(z.shape) > 0.02)
            total += np.where(there, np.rint(seen * 1000.0), 0.0)
            count += there
        mean = np.rint(total / np.maximum(count, 1))
        holes = rng.random(z.shape) < 0.005
        return np.where((count > 0) & ~holes, mean, 0.0).astype(np.uint16)


@lru_cache(maxsize=4)
def _rays(width: int, height: int, fx: float, fy: float, cx: float, cy: float, distortion: tuple[float, ...]) -> Floats:
    """Return the direction of the ray of each pixel, (height, width, 3), with z = 1."""
    k1, k2, p1, p2, k3 = distortion
    u, v = np.meshgrid(np.arange(width), np.arange(height))
    xd, yd = (u - cx) / fx, (v - cy) / fy
    x, y = xd, yd
    for _ in range(15):
        r2 = x * x + y * y
        radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3))
        dx, dy = 2 * p1 * x * y + p2 * (r2 + 2 * x * x), p1 * (r2 + 2 * y * y) + 2 * p2 * x * y
        x, y = (xd - dx) / radial, (yd - dy) / radial
    return np.stack([x, y, np.ones_like(x)], axis=-1)


def _meet_capsule(shape: Capsule, origin: Floats, rays: Floats) -> Floats:
    """Return the first intersections of rays with a cylinder between two balls (quadratic equations), or infinity."""
    best = np.full(rays.shape[:2], np.inf)
    axis = shape.end - shape.begin
    length2 = float(axis @ axis)
    away = origin - shape.begin
    along_ray, along_away = rays @ axis, float(away @ axis)
    a = np.sum(rays * rays, axis=-1) * length2 - along_ray**2
    b = (rays @ away) * length2 - along_ray * along_away
    c = float(away @ away) * length2 - along_away**2 - shape.radius**2 * length2
    root = b * b - a * c
    with np.errstate(invalid="ignore", divide="ignore"):
        t = (-b - np.sqrt(root)) / a
        where = (along_away + t * along_ray) / length2
    best = np.where((root > 0) & (where >= 0) & (where <= 1) & (t > 0), t, best)
    square = np.sum(rays * rays, axis=-1)
    for centre in (shape.begin, shape.end):
        away = origin - centre
        b = rays @ away
        root = b * b - square * (float(away @ away) - shape.radius**2)
        with np.errstate(invalid="ignore"):
            t = (-b - np.sqrt(root)) / square
        best = np.where((root > 0) & (t > 0) & (t < best), t, best)
    return best


def _meet_block(shape: Block, origin: Floats, rays: Floats) -> Floats:
    """Return the first intersections of rays with a box (slab method), or infinity."""
    turned = rays @ shape.pose[:3, :3]
    start = (origin - shape.pose[:3, 3]) @ shape.pose[:3, :3]
    half = np.array(shape.size) / 2
    with np.errstate(divide="ignore", invalid="ignore"):
        one, other = (-half - start) / turned, (half - start) / turned
    enter, leave = np.minimum(one, other).max(axis=-1), np.maximum(one, other).min(axis=-1)
    return np.where((enter <= leave) & (enter > 0), enter, np.inf)


def moved(shape: Shape, by: Floats) -> Shape:
    """The shape carried along by a rigid motion."""
    if isinstance(shape, Block):
        return Block(by @ shape.pose, shape.size)
    return Capsule(by[:3, :3] @ shape.begin + by[:3, 3], by[:3, :3] @ shape.end + by[:3, 3], shape.radius)
