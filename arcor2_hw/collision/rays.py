"""Intersections of straight lines with shapes, computed exactly in the frame of the shape."""

from typing import Final

import numpy as np

from arcor2_hw.collision import lines
from arcor2_hw.kinematics.shapes import Array, Hull, Shape, TriangleMesh, coal_geometry

_TINY: Final = 1e-12
_CONTACTS: Final = 1000


def entry(shape: Shape, start: Array, direction: Array, inflation: float = 0.0) -> float | None:
    """Return the position along a line, 0 to 1, at which it enters a shape, or None if it does not.

    The position is 0 for a line that starts inside.

    Edges, heights and radii are enlarged by `inflation`, as the protocol demands; the planes of a hull are moved out by
    half of it; a mesh is met where a triangle is nearer than half of it.

    Args:
        shape: The shape.
        start: Start of the line, (3).
        direction: Vector from start to end, (3).
        inflation: Length added to sizes, m.
    """
    match shape:
        case Hull():
            return _hull(shape, start, direction, inflation / 2.0)
        case TriangleMesh():
            return _mesh(shape, start, direction, inflation / 2.0)
        case _:
            return lines.entry(shape, start.tolist(), direction.tolist(), inflation)


def _hull(shape: Hull, start: Array, direction: Array, half: float) -> float | None:
    first, second, third = (shape.vertices[shape.triangles[:, corner]] for corner in range(3))
    normals = np.cross(second - first, third - first)
    lengths = np.linalg.norm(normals, axis=1)
    real = lengths > _TINY
    normals = normals[real] / lengths[real, None]
    inside = ((first[real] - start) * normals).sum(axis=1) + half  # distance to each plane, positive inside
    closing = normals @ direction
    parallel = np.abs(closing) < _TINY
    if (inside[parallel] < 0.0).any():
        return None
    at = inside[~parallel] / closing[~parallel]
    entering = closing[~parallel] < 0.0
    low, high = max(0.0, at[entering].max(initial=0.0)), min(1.0, at[~entering].min(initial=1.0))
    return float(low) if low <= high else None


def _mesh(shape: TriangleMesh, start: Array, direction: Array, half: float) -> float | None:
    """Return the entry into the nearest triangle (T. Möller, B. Trumbore, Journal of Graphics Tools 2 (1997) 21)."""
    first, second, third = (shape.vertices[shape.triangles[:, corner]] for corner in range(3))
    u, v = second - first, third - first
    p = np.cross(direction, v)
    determinant = (u * p).sum(axis=1)
    crossing = np.abs(determinant) > _TINY * _TINY
    scale = np.where(crossing, determinant, 1.0)
    s = start - first
    alpha = (s * p).sum(axis=1) / scale
    q = np.cross(s, u)
    beta = (q @ direction) / scale
    at = (v * q).sum(axis=1) / scale
    met = crossing & (alpha >= 0.0) & (beta >= 0.0) & (alpha + beta <= 1.0) & (at >= 0.0) & (at <= 1.0)
    found = float(at[met].min()) if met.any() else None
    return found if not half else _touched(shape, start, direction, half, found)


def _touched(shape: TriangleMesh, start: Array, direction: Array, half: float, found: float | None) -> float | None:
    """Return where a line of radius `half` first touches a mesh, at most `found`."""
    import coal

    length = float(np.linalg.norm(direction))
    if length < _TINY:
        return found
    along = direction / length
    aside = np.cross(along, (0.0, 0.0, 1.0) if abs(along[2]) < 0.9 else (1.0, 0.0, 0.0))
    aside /= np.linalg.norm(aside)
    placed = coal.Transform3s(np.column_stack((aside, np.cross(along, aside), along)), start + direction / 2.0)
    request, result = coal.CollisionRequest(), coal.CollisionResult()
    request.num_max_contacts = _CONTACTS
    mesh, still = coal_geometry(shape), coal.Transform3s.Identity()
    if not coal.collide(coal.Capsule(half, length), placed, mesh, still, request, result):
        return found
    shares = [float((np.asarray(each.pos) - start) @ along) / length for each in result.getContacts()]
    return min([min(max(share, 0.0), 1.0) for share in shares] + ([] if found is None else [found]))
