"""Segmentation: clusters of points in a crate above its floor, each of which may be a part."""

from typing import Final, NamedTuple

import cv2
import numpy as np
import numpy.typing as npt
import open3d as o3d

Floats = npt.NDArray[np.float32]
Pixels = npt.NDArray[np.bool_]

WALL: Final = 0.004
"""Width of the ignored margin along the walls, m: its points may belong to the wall."""
ABOVE_RIM: Final = 0.1
"""Largest height of a heap above the rim, m."""
FLOOR_SEARCH: Final = 0.02
"""Largest distance of the real floor from its expected height, m."""
FLOOR_TILT: Final = np.cos(np.radians(5.0))
"""Cosine of the largest tilt of the floor."""
FLOOR_PART: Final = 0.05
"""Smallest fraction of the points in the crate that a detected floor must have."""
FLOOR_SAMPLES: Final = 4000
"""Number of points used to detect the floor."""
VOXEL: Final = 0.002
"""Voxel size for clustering, m."""
NEIGHBOURS: Final = 5
"""Number of neighbours from which a voxel belongs to a cluster and is not noise."""
REACH: Final = 0.0055
"""Largest distance between neighbours, m."""
STEP: Final = 0.004
"""Height difference between neighbouring pixels that separates two surfaces, m."""


class Crate(NamedTuple):
    """Points in the frame of the crate, pixels inside the crate, and heights above the floor, m."""

    points: Floats
    inside: Pixels
    height: Floats
    floor_seen: bool


def segment(points: Floats, length: float, width: float, height: float, tolerance: float) -> Crate:
    """Find inside and floor of a crate. Its frame is at the centre of its floor; NaN: no point."""
    x, y, z = points[..., 0], points[..., 1], points[..., 2]
    with np.errstate(invalid="ignore"):
        inside = (np.abs(x) < length / 2.0 - WALL) & (np.abs(y) < width / 2.0 - WALL)
        inside &= (z > -FLOOR_SEARCH - 3.0 * tolerance) & (z < height + ABOVE_RIM)
        low = points[inside & (np.abs(z) < FLOOR_SEARCH)]
    plane = _floor(low, int(inside.sum()), tolerance)
    if plane is None:
        return Crate(points, inside, z, False)
    return Crate(points, inside, points @ plane[:3] + plane[3], True)


def _floor(low: Floats, seen: int, tolerance: float) -> Floats | None:
    """Return the plane of the floor, normal up; None when too little of it is visible."""
    if len(low) < 50:
        return None
    step = max(1, len(low) // FLOOR_SAMPLES)
    o3d.utility.random.seed(1)
    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(low[::step].astype(np.float64)))
    found, members = cloud.segment_plane(tolerance, 3, 200)
    plane = np.asarray(found)
    plane = plane / np.linalg.norm(plane[:3]) * (1.0 if plane[2] > 0.0 else -1.0)
    if plane[2] < FLOOR_TILT or len(members) * step < FLOOR_PART * seen:
        return None
    return plane.astype(np.float32)


def clusters(crate: Crate, tolerance: float) -> list[Pixels]:
    """Return the pixels of each object above the floor; touching objects are one."""
    with np.errstate(invalid="ignore"):
        above = crate.inside & (crate.height > tolerance)
    rows, columns = np.nonzero(above)
    if not len(rows):
        return []
    voxels, member = np.unique(
        np.floor(crate.points[rows, columns] / VOXEL).astype(np.int64), axis=0, return_inverse=True
    )
    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector((voxels + 0.5) * VOXEL))
    labels = np.asarray(cloud.cluster_dbscan(REACH, NEIGHBOURS))[member.reshape(-1)]
    found = []
    for label in range(labels.max() + 1):
        pixels = np.zeros(above.shape, np.bool_)
        chosen = labels == label
        pixels[rows[chosen], columns[chosen]] = True
        found.append(pixels)
    return found


def surfaces(crate: Crate, pixels: Pixels) -> list[Pixels]:
    """Split a cluster at height differences above STEP: into parts that are on top of each other."""
    z = np.where(pixels, crate.height, np.nan).astype(np.float32)
    with np.errstate(invalid="ignore"):
        edge = np.zeros(pixels.shape, np.bool_)
        edge[:, 1:] |= np.abs(np.diff(z, axis=1)) > STEP
        edge[1:] |= np.abs(np.diff(z, axis=0)) > STEP
    count, labels = cv2.connectedComponents((pixels & ~edge).astype(np.uint8), connectivity=4)
    return [labels == label for label in range(1, count)]
