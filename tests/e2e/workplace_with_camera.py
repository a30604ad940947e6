"""A workplace as seen by a camera: markers on paper, an arm, and their true poses."""

import math
from typing import Any

import numpy as np

from arcor2_fakes.cell import arm
from arcor2_hw.data.geometry import Orientation, Pose, Position

Q = (0.4, -1.3, 1.5, -1.2, -1.2, 0.3)
ROBOT = Pose(Position(0.10, 0.05, 0.0), Orientation.from_rotation_vector(0.0, 0.0, 0.35))
"""True pose of the robot's base."""
MARKERS = {10: (0.45, -0.35), 11: (0.75, -0.30), 12: (0.60, 0.35), 13: (0.35, 0.45)}
SIZE = 0.15


def looking_at(eye: tuple[float, float, float], target: tuple[float, float, float]) -> Pose:
    """Return the pose of a camera's optical frame."""
    z = np.subtract(target, eye) / np.linalg.norm(np.subtract(target, eye))
    x = np.cross(z, (0.0, 0.0, 1.0))
    x /= np.linalg.norm(x)
    matrix = np.eye(4)
    matrix[:3, :3] = np.column_stack((x, np.cross(z, x), z))
    matrix[:3, 3] = eye
    return Pose.from_matrix(matrix)


CAMERA = looking_at((1.2, -0.6, 0.85), (0.42, 0.03, 0.12))
"""True pose of the camera."""


def pose(of: Pose) -> dict[str, Any]:
    return {"position": list(of.position), "orientation": list(of.orientation)}


def paper_marker(number: int, x: float, y: float) -> dict[str, Any]:
    """Return a marker on paper in the fake camera's format. Its face is the plane of the origin."""
    return {
        "name": f"marker {number}",
        "pose": {"position": [x, y, -0.0005]},
        "size": [0.22, 0.22, 0.001],
        "color": [235, 235, 235],
        "marker": {"id": number, "size": SIZE},
    }


def rotated_about_z(angle: float) -> Orientation:
    return Orientation.from_rotation_vector(0.0, 0.0, angle)


def pose_error(found: Pose, truth: Pose) -> tuple[float, float]:
    """Return the distance and the angle between two poses, mm and degrees."""
    return 1e3 * found.position.distance_to(truth.position), math.degrees(found.orientation.angle_to(truth.orientation))


def visible_things(*, markers: bool = True, robot: bool = True) -> list[dict[str, Any]]:
    """Return the objects of the workplace in the fake camera's format."""
    things = [paper_marker(number, *place) for number, place in MARKERS.items()] if markers else []
    if robot:
        things += arm.things("ur5e", ROBOT.matrix(), Q, np.eye(4)).values()
    return things
