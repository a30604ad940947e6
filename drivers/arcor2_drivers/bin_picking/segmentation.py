"""Segmentation: the points inside a crate, without its floor, in clusters that may each be a part."""

from typing import Final, NamedTuple

import cv2
import numpy as np
import numpy.typing as npt
import open3d as o3d

Floats = npt.NDArray[np.float32]
Pixels = npt.NDArray[np.bool_]

WALL: Final = 0.004
"""m along the walls that are left out: there the wall is seen, give or take the noise."""
ABOVE_RIM: Final = 0.1
"""m that a heap may stand above the crate."""
FLOOR_SEARCH: Final = 0.02
"""m about where the floor should be in which it is looked for: a crate is not put down to the millimetre."""
FLOOR_TILT: Final = np.cos(np.radians(5.0))
FLOOR_PART: Final = 0.05
"""Part of what is seen in the crate that has to be floor to believe in it."""
FLOOR_SAMPLES: Final = 4000
VOXEL: Final = 0.002
NEIGHBOURS: Final = 5
"""Voxels within reach for one to belong to a cluster and not to the noise."""
REACH: Final = 0.0055
STEP: Final = 0.004
"""m between neighbouring pixels at which one thing ends and another begins."""


class Crate(NamedTuple):
    """What is seen in a crate: points in its frame, which pixels lie inside, how high each is above the floor."""

    points: Floats
    inside: Pixels
    height: Floats
    floor_seen: bool


def look_into(points: Floats, length: float, width: float, height: float, tolerance: float) -> Crate:
    """Find the inside and the floor of a crate, whose origin is in the middle of the floor. NaN: nothing is seen."""
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
    """Return the plane of the floor, normal upwards; None when too little of it is seen."""
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
    """Return the pixels of each thing above the floor; things that touch in space are one."""
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
    """Take a cluster apart where one pixel is by STEP higher than the next: parts that lie on one another."""
    z = np.where(pixels, crate.height, np.nan).astype(np.float32)
    with np.errstate(invalid="ignore"):
        edge = np.zeros(pixels.shape, np.bool_)
        edge[:, 1:] |= np.abs(np.diff(z, axis=1)) > STEP
        edge[1:] |= np.abs(np.diff(z, axis=0)) > STEP
    count, labels = cv2.connectedComponents((pixels & ~edge).astype(np.uint8), connectivity=4)
    return [labels == label for label in range(1, count)]
