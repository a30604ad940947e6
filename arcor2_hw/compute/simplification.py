"""Mesh simplification for display: vertices merged, surfaces simplified by quadric error, normals computed."""

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from arcor2_hw.kinematics.meshes import Surface, linear_of
from arcor2_hw.kinematics.shapes import Array, Triangles

MAX_TRIANGLES: Final = 40_000
"""Maximum number of triangles of a mesh of 0.5 m or more; smaller meshes get proportionally fewer."""
MIN_TRIANGLES: Final = 4_000
"""Number of triangles that a mesh of any size may have."""
_FULL_SIZE: Final = 0.5
"""Diagonal of the bounding box of a mesh that gets MAX_TRIANGLES triangles, m."""
CREASE: Final = np.cos(np.radians(40.0))
"""Cosine of the angle between triangles below which they are shaded as one smooth surface."""
_CAREFUL: Final = 3.0
_FAST: Final = 7.0
"""Aggressiveness of the simplification: the first keeps shapes better, the second always reaches the target."""
_MANY: Final = 48
"""Number of triangles around one vertex above which it is shaded flat, as the tip of a cone or the centre of a disc."""


class DisplayMesh(NamedTuple):
    """A mesh for a graphics card.

    Attributes:
        positions: (n, 3), m.
        normals: (n, 3), in units of 1/127.
        colours: (n, 4), linear, in units of 1/65535, or None.
        triangles: (m, 3).
    """

    positions: NDArray[np.float32]
    normals: NDArray[np.int8]
    colours: NDArray[np.uint16] | None
    triangles: NDArray[np.uint32]


def budget(vertices: Array) -> int:
    """Return the maximum number of triangles of a mesh of this size."""
    size = float(np.linalg.norm(np.ptp(vertices, axis=0)))
    return max(MIN_TRIANGLES, min(MAX_TRIANGLES, round(MAX_TRIANGLES * size / _FULL_SIZE)))


def simplified(surface: Surface, most: int) -> Surface:
    """Return a surface with merged vertices and about `most` triangles at most.

    The result is empty when all triangles have zero area.
    """
    vertices, triangles, colours = _joined(surface)
    if len(triangles) > most:
        vertices, triangles, colours = _simplified(Surface(vertices, triangles, colours), most)
    corners = vertices[triangles]
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    return Surface(vertices, triangles[area > 0.0], colours)


def _joined(surface: Surface) -> Surface:
    """Merge vertices at the same place that have the same colour."""
    used, inverse = np.unique(surface.triangles, return_inverse=True)
    triangles = inverse.reshape(-1, 3)
    attributes = np.ascontiguousarray(surface.vertices[used], dtype=np.float32) + np.float32(0.0)  # no negative zeros
    if surface.colours is not None:
        attributes = np.hstack((attributes, np.round(surface.colours[used] * 255.0).astype(np.float32)))
    rows = np.ascontiguousarray(attributes).view(f"V{attributes.shape[1] * 4}").ravel()
    _, first, joined = np.unique(rows, return_index=True, return_inverse=True)
    triangles = joined[triangles].reshape(-1, 3)
    a, b, c = triangles.T
    triangles = triangles[(a != b) & (b != c) & (c != a)]
    colours = None if surface.colours is None else surface.colours[used][first]
    return Surface(surface.vertices[used][first], triangles, colours)


def _simplified(surface: Surface, most: int) -> Surface:
    import fast_simplification

    # Centred and scaled to size 1, because the library works without units.
    middle, size = surface.vertices.mean(axis=0), float(np.ptp(surface.vertices, axis=0).max())
    points = np.ascontiguousarray((surface.vertices - middle) / size)
    faces = np.ascontiguousarray(surface.triangles, dtype=np.int32)
    for aggressiveness in (_CAREFUL, _FAST):
        vertices, triangles, collapses = fast_simplification.simplify(
            points, faces, target_count=most, return_collapses=True, agg=aggressiveness
        )
        if len(triangles) <= most:
            break
    triangles = np.asarray(triangles, dtype=np.int64)
    colours = None
    if surface.colours is not None:
        vertices, triangles, became = fast_simplification.replay_simplification(points, faces, collapses)
        triangles = np.asarray(triangles, dtype=np.int64)
        colours = np.full((len(vertices), 3), 0.75, dtype=np.float32)
        remaining = (became >= 0) & (became < len(vertices))
        colours[became[remaining]] = surface.colours[remaining]
    return Surface(np.asarray(vertices, dtype=np.float64) * size + middle, triangles, colours)


# ------------------------------------------------------------------------------------------------ normals
def with_normals(surface: Surface) -> DisplayMesh:
    """Return a surface with normals: smooth where triangles meet at small angles, with edges elsewhere."""
    normals = np.round(_corner_normals(surface.vertices, surface.triangles) * 127.0).astype(np.int8)
    corners = surface.triangles.ravel()
    key = (corners.astype(np.int64) << 24) | (normals.astype(np.int64) & 0xFF) @ np.array((1 << 16, 1 << 8, 1))
    _, first, index = np.unique(key, return_index=True, return_inverse=True)
    at = corners[first]
    colours = None
    if surface.colours is not None:
        colours = np.full((len(at), 4), 65535, dtype=np.uint16)
        colours[:, :3] = np.round(linear_of(surface.colours[at]) * 65535.0)
    return DisplayMesh(
        surface.vertices[at].astype(np.float32), normals[first], colours, index.reshape(-1, 3).astype(np.uint32)
    )


def _corner_normals(vertices: Array, triangles: Triangles) -> Array:
    """Return the normal at each corner of each triangle, (3 m, 3): area-weighted mean up to a crease."""
    corners = vertices[triangles]
    weighted = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    unit = weighted / np.linalg.norm(weighted, axis=1, keepdims=True)
    order = np.argsort(triangles.ravel(), kind="stable")
    counts = np.bincount(triangles.ravel())
    counts = counts[counts > 0]
    starts = np.cumsum(counts) - counts
    # Corners ordered by vertex, each with all corners of the same vertex.
    around = np.repeat(np.where(counts > _MANY, 1, counts), counts)
    begins = np.where(np.repeat(counts > _MANY, counts), np.arange(len(order)), np.repeat(starts, counts))
    one = np.repeat(np.arange(len(order)), around)
    other = np.arange(len(one)) - np.repeat(np.cumsum(around) - around, around) + np.repeat(begins, around)
    face, beside = order[one] // 3, order[other] // 3
    round_there = np.einsum("ij,ij->i", unit[face], unit[beside]) >= CREASE
    one, beside = one[round_there], beside[round_there]
    sums = np.stack([np.bincount(one, weighted[beside, axis], len(order)) for axis in range(3)], axis=1)
    out = np.empty_like(sums)
    out[order] = sums
    length = np.linalg.norm(out, axis=1, keepdims=True)
    return np.where(length > 0.0, out / np.where(length > 0.0, length, 1.0), np.repeat(unit, 3, axis=0))
