"""Rendering by ray casting: colour and depth of every pixel, without noise."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final, NamedTuple

import cv2
import numpy as np
import numpy.typing as npt
import open3d as o3d

from arcor2_fakes.oak_d.optics import Lens
from arcor2_fakes.oak_d.scene import Matrix, Pose, Thing

Bytes = npt.NDArray[np.uint8]
Floats = npt.NDArray[np.float32]

TABLE: Final = (1.6, 1.6, 0.02)
TABLE_COLOR: Final = (172, 164, 150)
BACKGROUND: Final = (58, 52, 48)
LIGHT: Final = np.array([0.35, -0.25, 0.9]) / np.linalg.norm([0.35, -0.25, 0.9])
AMBIENT: Final = 0.45
PIXELS_PER_MODULE: Final = 24
SIDES: Final = 48
RINGS: Final = 8
MAX_SOLIDS: Final = 500


class View(NamedTuple):
    """A view without noise: colour as B, G, R; depth in m, 0 where there is nothing."""

    color: Bytes
    depth: Floats


class Solid(NamedTuple):
    """An object as triangles in its own frame, with the image on its top, if any."""

    vertices: Floats
    triangles: npt.NDArray[np.uint32]
    texture: Bytes | None = None
    texture_size: tuple[float, float] = (0.0, 0.0)


def load_mesh(path: str) -> Solid:
    """Read a mesh, in metres. Raises ValueError when it is invalid."""
    mesh = o3d.io.read_triangle_mesh(Path(path))
    vertices = np.asarray(mesh.vertices, dtype=np.float32)
    if not len(mesh.triangles) or not np.isfinite(vertices).all():
        raise ValueError(f"{path} is not a mesh")
    return Solid(vertices, np.asarray(mesh.triangles, dtype=np.uint32))


def box(size: tuple[float, float, float]) -> Solid:
    """Return a box with its centre at the origin, 12 triangles."""
    mesh = o3d.geometry.TriangleMesh.create_box(*size)
    vertices = np.asarray(mesh.vertices) - np.asarray(size) / 2.0
    return Solid(vertices.astype(np.float32), np.asarray(mesh.triangles, dtype=np.uint32))


def round_body(radius: float, length: float, ball: bool) -> Solid:
    """Return a cylinder along z with its centre at the origin, with flat or hemispherical ends."""
    tilts = np.linspace(0.0, np.pi / 2.0, RINGS + 1) if ball else np.array([0.0])
    upper = [(length / 2.0 + radius * np.sin(tilt), radius * np.cos(tilt)) for tilt in tilts]
    if not ball:
        upper.append((length / 2.0, 0.0))
    heights, radii = np.array([(-h, r) for h, r in reversed(upper)] + upper).T
    angles = np.arange(SIDES) * 2.0 * np.pi / SIDES
    x, y = radii[:, None] * np.cos(angles), radii[:, None] * np.sin(angles)
    vertices = np.stack([x, y, np.broadcast_to(heights[:, None], x.shape)], axis=-1).reshape(-1, 3)
    ring, side = (each.ravel() for each in np.mgrid[: len(heights) - 1, :SIDES])
    a, b = ring * SIDES + side, ring * SIDES + (side + 1) % SIDES
    triangles = np.concatenate([np.stack([a, b, a + SIDES], 1), np.stack([b, b + SIDES, a + SIDES], 1)])
    flat = vertices[triangles]
    area = np.linalg.norm(np.cross(flat[:, 1] - flat[:, 0], flat[:, 2] - flat[:, 0]), axis=1)
    return Solid(vertices.astype(np.float32), triangles[area > 1e-12].astype(np.uint32))


def _dictionary(name: str) -> Any:
    number = getattr(cv2.aruco, name, None) if name.startswith("DICT_") else None
    if not isinstance(number, int):
        raise ValueError(f"marker dictionary {name} does not exist")
    return cv2.aruco.getPredefinedDictionary(number)


def solid_of(thing: Thing) -> Solid:
    """Return the triangles of an object. Raises ValueError for an invalid mesh or marker."""
    if thing.mesh is not None:
        return load_mesh(thing.mesh)
    if (form := thing.capsule or thing.cylinder) is not None:
        return round_body(*form, ball=thing.capsule is not None)
    assert thing.size is not None
    solid = box(thing.size)
    try:
        if (marker := thing.marker) is not None:
            dictionary = _dictionary(marker.dictionary)
            modules = dictionary.markerSize + 2
            picture = cv2.aruco.generateImageMarker(dictionary, marker.id, modules * PIXELS_PER_MODULE)
            framed = np.pad(picture, PIXELS_PER_MODULE, constant_values=255)
            side = marker.size * (modules + 2) / modules
            return solid._replace(texture=np.asarray(framed, np.uint8), texture_size=(side, side))
        if (board := thing.charuco) is not None:
            pattern = cv2.aruco.CharucoBoard(
                (board.columns, board.rows), board.square, board.marker, _dictionary(board.dictionary)
            )
            pixels = 6 * PIXELS_PER_MODULE
            picture = pattern.generateImage((board.columns * pixels, board.rows * pixels))
            size = (board.columns * board.square, board.rows * board.square)
            return solid._replace(texture=np.asarray(picture, np.uint8), texture_size=size)
    except cv2.error as e:
        raise ValueError(f"{thing.name}: {e.err}") from e
    return solid


class Renderer:
    """Casts the rays of a lens. Objects that do not move are rendered once.

    Not thread-safe.
    """

    def __init__(self, lens: Lens) -> None:
        self._lens = lens
        self._rays = lens.rays()
        self._solids: dict[tuple[Any, ...], Solid] = {}
        self._last: tuple[Thing, ...] = ()
        self._behind: tuple[tuple[Pose, float, frozenset[Thing]], View] | None = None

    def view(self, camera: Pose, table_height: float, things: tuple[Thing, ...]) -> View:
        """Return the view from the pose of the camera. Raises ValueError for an object that cannot be rendered."""
        world_from_camera = camera.matrix()
        table = _Part(box(TABLE), Pose((0.0, 0.0, table_height - TABLE[2] / 2.0)).matrix(), TABLE_COLOR)
        still = frozenset(things) & frozenset(self._last)
        self._last = things
        if self._behind is None or self._behind[0] != (camera, table_height, still):
            empty = View(np.zeros(self._rays.shape, np.uint8), np.zeros(self._rays.shape[:2], np.float32))
            standing = [self._part(thing) for thing in things if thing in still]
            _Cast([table, *standing]).into(empty, self._rays, world_from_camera, np.ones_like(empty.depth, np.bool_))
            self._behind = ((camera, table_height, still), empty)
        behind = self._behind[1]
        view = View(behind.color.copy(), behind.depth.copy())
        parts = [self._part(thing) for thing in things]
        mask = np.zeros(self._rays.shape[:2], np.bool_)
        for thing, part in zip(things, parts, strict=True):
            if thing not in still:
                where = self._lens.bounds(np.linalg.inv(world_from_camera) @ part.pose, part.solid.vertices)
                if where is not None:
                    mask[where] = True
        if mask.any():
            _Cast([table, *parts]).into(view, self._rays, world_from_camera, mask)
        return View(np.asarray(cv2.GaussianBlur(view.color, (3, 3), 0.7), np.uint8), view.depth)

    def _part(self, thing: Thing) -> _Part:
        return _Part(self._solid(thing), thing.pose.matrix(), thing.color)

    def _solid(self, thing: Thing) -> Solid:
        key = (thing.size, thing.mesh, thing.cylinder, thing.capsule, thing.marker, thing.charuco)
        if key not in self._solids:
            if len(self._solids) > MAX_SOLIDS:
                self._solids.clear()
            self._solids[key] = solid_of(thing)
        return self._solids[key]


class _Part(NamedTuple):
    """A solid with its pose."""

    solid: Solid
    pose: Matrix
    color: tuple[int, int, int]


class _Cast:
    """A set of solids for ray casting."""

    def __init__(self, parts: list[_Part]) -> None:
        self._parts = parts
        self._scene = o3d.t.geometry.RaycastingScene()
        palette: list[npt.NDArray[np.float64]] = [np.array([BACKGROUND[::-1]], dtype=np.float64)]
        offsets, count = [], 1
        for part in parts:
            vertices = (part.solid.vertices @ part.pose[:3, :3].T + part.pose[:3, 3]).astype(np.float32)
            self._scene.add_triangles(
                o3d.core.Tensor.from_numpy(vertices), o3d.core.Tensor.from_numpy(part.solid.triangles)
            )
            shade = _shades(vertices, part.solid.triangles)
            palette.append(shade[:, None] * np.array(part.color[::-1], dtype=np.float64))
            offsets.append(count)
            count += len(shade)
        self._palette: Bytes = np.concatenate(palette).clip(0, 255).astype(np.uint8)
        self._offsets = np.asarray(offsets, dtype=np.int32)

    def into(self, view: View, rays: Floats, world_from_camera: Matrix, mask: npt.NDArray[np.bool_]) -> None:
        """Render some pixels."""
        directions = rays[mask] @ world_from_camera[:3, :3].T.astype(np.float32)
        both = np.empty((len(directions), 6), np.float32)
        both[:, :3] = world_from_camera[:3, 3]
        both[:, 3:] = directions
        hit = self._scene.cast_rays(o3d.core.Tensor.from_numpy(both))
        # The component of each ray along the optical axis is 1 m, so its parameter is the depth.
        reach: Floats = hit["t_hit"].numpy()
        there = np.isfinite(reach)
        geometry = np.where(there, hit["geometry_ids"].numpy(), 0)
        index = np.where(there, self._offsets[geometry] + hit["primitive_ids"].numpy().astype(np.int32), 0)
        colors = np.take(self._palette, index, axis=0)
        pixel = float(abs(rays[0, 1, 0] - rays[0, 0, 0]))
        for number, part in enumerate(self._parts):
            if part.solid.texture is not None:
                found = np.flatnonzero(there & (geometry == number))
                _print(colors, found, reach, directions, world_from_camera, part.solid, part.pose, pixel)
        view.color[mask] = colors
        view.depth[mask] = np.where(there, reach, 0.0)


def _shades(vertices: Floats, triangles: npt.NDArray[np.uint32]) -> npt.NDArray[np.float64]:
    """Return the brightness of each triangle."""
    a, b, c = (vertices[triangles[:, i]].astype(np.float64) for i in range(3))
    normals = np.cross(b - a, c - a)
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    return np.asarray(AMBIENT + (1.0 - AMBIENT) * np.clip(normals @ LIGHT, 0.0, 1.0))


def _print(
    colors: Bytes,
    found: npt.NDArray[np.intp],
    depth: Floats,
    directions: Floats,
    world_from_camera: Matrix,
    solid: Solid,
    pose: Matrix,
    pixel: float,
) -> None:
    """Draw the image on the top of a solid, where the rays `found` hit it; each pixel is the mean of four rays."""
    assert solid.texture is not None
    height, width = solid.texture.shape
    level = float(solid.vertices[:, 2].max())
    origin = (world_from_camera[:3, 3] - pose[:3, 3]) @ pose[:3, :3]
    local = origin + depth[found, None] * (directions[found] @ pose[:3, :3])
    found = found[local[:, 2] > level - 1e-4]
    sideways = world_from_camera[:3, :2].T @ pose[:3, :3] * (pixel / 4.0)
    ways = directions[found] @ pose[:3, :3]
    ink, count = np.zeros(len(found)), np.zeros(len(found))
    for right, down in ((-1, -1), (-1, 1), (1, -1), (1, 1)):
        way = ways + right * sideways[0] + down * sideways[1]
        place = origin + ((level - origin[2]) / way[:, 2])[:, None] * way
        u = (place[:, 0] / solid.texture_size[0] + 0.5) * width
        v = (0.5 - place[:, 1] / solid.texture_size[1]) * height
        on = (u >= 0) & (u < width) & (v >= 0) & (v < height)
        ink[on] += solid.texture[v[on].astype(np.intp), u[on].astype(np.intp)]
        count += on
    whole = count == 4
    colors[found[whole]] = (ink[whole] / 4.0 * 0.85 + 20.0).astype(np.uint8)[:, None]
