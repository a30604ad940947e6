"""The shape of the robot arm for the camera: tubes around the Denavit-Hartenberg frames of a UR, at the present joints.

Source of the lengths: Universal Robots, "DH Parameters for calculations of kinematics and dynamics". The radii of the
tubes and the offsets of the arms along their joints are estimated. Elbows and the ends of tubes are spheres; foot and
tool flange are flat.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from transforms3d.quaternions import mat2quat

from arcor2_fakes.cell.layout import Matrix
from arcor2_fakes.ur.kinematics import MODELS

COLOR: Final = (184, 189, 199)
_ALPHA: Final = (np.pi / 2, 0.0, 0.0, np.pi / 2, -np.pi / 2, 0.0)
_CLEARANCE: Final = 0.005
_FLANGE: Final = 0.94
"""Ratio of the radius of the flange to that of the last wrist."""
_GRIPPER: Final = (0.07, 0.045)


@dataclass(frozen=True)
class Tubes:
    """Radii of foot, shoulder, upper arm, forearm and wrists, and offsets of both arms along their joints, m."""

    foot: float
    shoulder: float
    upper: float
    forearm: float
    wrist: float
    upper_at: float
    forearm_at: float


TUBES: Final = {
    "ur3e": Tubes(0.064, 0.052, 0.045, 0.036, 0.032, 0.120, 0.027),
    "ur5e": Tubes(0.075, 0.063, 0.057, 0.046, 0.040, 0.138, 0.007),
    "ur10e": Tubes(0.095, 0.080, 0.070, 0.056, 0.046, 0.176, 0.039),
}


def things(model: str, base_link: Matrix, q: Sequence[float], tip: Matrix) -> dict[str, dict[str, Any]]:
    """Return links and gripper by name, in the format of the fake camera.

    `base_link` is in the world, `q` in rad; the gripper extends from the flange to `tip`.
    """
    frames = _frames(model, base_link, q)
    length, tube = MODELS[model], TUBES[model]
    elbow = tube.upper_at - tube.upper - tube.forearm
    begin = tube.forearm_at + tube.forearm
    side = tube.upper_at - tube.upper - tube.shoulder
    found = [
        _link("foot", "cylinder", frames[0], (0, 0, 0), (0, 0, length.d1 - tube.shoulder - _CLEARANCE), tube.foot),
        _link("shoulder", "capsule", frames[1], (0, 0, length.d1), (0, -side, length.d1), tube.shoulder),
        _link("upper arm", "capsule", frames[2], (0, 0, tube.upper_at), (length.a2, 0, tube.upper_at), tube.upper),
        _link("elbow", "capsule", frames[3], (0, 0, tube.forearm_at), (0, 0, elbow), tube.forearm),
        _link("forearm", "capsule", frames[3], (0, 0, tube.forearm_at), (length.a3, 0, tube.forearm_at), tube.forearm),
        _link("wrist 1", "capsule", frames[4], (0, 0, begin), (0, 0, length.d4), tube.wrist),
        _link("wrist 2", "capsule", frames[5], (0, 0, 0), (0, 0, length.d5), tube.wrist),
        _link("wrist 3", "cylinder", frames[6], (0, 0, tube.wrist), (0, 0, length.d6), _FLANGE * tube.wrist),
    ]
    if (reach := float(tip[2, 3])) > 0.05:
        size = (*_GRIPPER, 0.8 * reach)
        middle = frames[6] @ _at(0.0, 0.0, length.d6 + size[2] / 2.0)
        found.append({"name": "robot gripper", "pose": pose_of(middle), "size": size, "color": (60, 62, 66)})
    return {thing["name"]: thing for thing in found}


def pose_of(matrix: Matrix) -> dict[str, Any]:
    """Return a transform in the JSON format of a pose."""
    w, x, y, z = mat2quat(matrix[:3, :3])
    return {"position": [float(v) for v in matrix[:3, 3]], "orientation": [float(v) for v in (x, y, z, w)]}


def _frames(model: str, base_link: Matrix, q: Sequence[float]) -> list[Matrix]:
    """Return the frame of the foot, and for each joint the frame that rotates with it, z along its axis."""
    length = MODELS[model]
    frames = [base_link]
    frame = base_link @ _about_z(np.pi)  # the base frame of the controller is rotated by 180°
    offsets = (length.d1, 0.0, 0.0, length.d4, length.d5, length.d6)
    arms = (0.0, length.a2, length.a3, 0.0, 0.0, 0.0)
    for angle, d, a, alpha in zip(q, offsets, arms, _ALPHA, strict=True):
        turned = frame @ _about_z(angle)
        frames.append(turned)
        frame = turned @ _at(a, 0.0, d) @ _about_x(alpha)
    return frames


def _link(
    name: str, kind: str, frame: Matrix, begin: Sequence[float], end: Sequence[float], radius: float
) -> dict[str, Any]:
    first, last = np.asarray(begin, dtype=np.float64), np.asarray(end, dtype=np.float64)
    length = float(np.linalg.norm(last - first))
    z = (last - first) / length
    aside = np.array([1.0, 0.0, 0.0]) if abs(z[0]) < 0.9 else np.array([0.0, 1.0, 0.0])
    y = np.cross(z, aside)
    y /= np.linalg.norm(y)
    local = np.eye(4)
    local[:3, :3] = np.column_stack([np.cross(y, z), y, z])
    local[:3, 3] = (first + last) / 2.0
    return {"name": f"robot {name}", "pose": pose_of(frame @ local), kind: (radius, length), "color": COLOR}


def _about_z(angle: float) -> Matrix:
    matrix = np.eye(4)
    matrix[:2, :2] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
    return matrix


def _about_x(angle: float) -> Matrix:
    matrix = np.eye(4)
    matrix[1:3, 1:3] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
    return matrix


def _at(x: float, y: float, z: float) -> Matrix:
    matrix = np.eye(4)
    matrix[:3, 3] = x, y, z
    return matrix
