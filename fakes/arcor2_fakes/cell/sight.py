"""What the camera sees: the fixed things of the cell and its boards, in the form in which the fake camera is told."""

from __future__ import annotations

from typing import Any

import numpy as np
from transforms3d.quaternions import mat2quat

from arcor2_fakes.cell.layout import Camera, Matrix, Pose

GREEN, LABELLED = (40, 110, 20), (205, 215, 215)
"""A bare board, and one whose label covers it, as red, green, blue."""
MOVED = 0.0005
"""m; less than that is not worth a new picture."""


def fixed(camera: Camera) -> list[dict[str, Any]]:
    """Give the things that never move."""
    return [
        {"name": thing.name, "pose": _pose(thing.pose), "size": thing.size, "color": thing.color}
        for thing in camera.things
    ]


def board(camera: Camera, code: str, world_from_board: Matrix, labelled: bool) -> dict[str, Any]:
    """Give a board; its pose is that of its top, where it is gripped."""
    middle = world_from_board @ _down(camera.board[2] / 2.0)
    w, x, y, z = mat2quat(middle[:3, :3])
    position = [float(value) for value in middle[:3, 3]]
    pose = {"position": position, "orientation": [float(value) for value in (x, y, z, w)]}
    return {"name": code, "pose": pose, "size": camera.board, "color": LABELLED if labelled else GREEN}


def changes(
    before: dict[str, dict[str, Any]], after: dict[str, dict[str, Any]]
) -> tuple[bool, dict[str, dict[str, Any]]]:
    """Give whether other things stand there or look different now, and else the poses of those that were moved."""
    if {name: _look(thing) for name, thing in before.items()} != {name: _look(thing) for name, thing in after.items()}:
        return True, {}
    return False, {name: thing["pose"] for name, thing in after.items() if _far(before[name]["pose"], thing["pose"])}


def _look(thing: dict[str, Any]) -> tuple[Any, Any]:
    return thing["size"], thing["color"]


def _far(one: dict[str, Any], other: dict[str, Any]) -> bool:
    turned = 1.0 - abs(float(np.dot(one["orientation"], other["orientation"])))
    return float(np.linalg.norm(np.subtract(one["position"], other["position"]))) > MOVED or turned > 1e-5


def _down(distance: float) -> Matrix:
    shifted = np.eye(4)
    shifted[2, 3] = -distance
    return shifted


def _pose(pose: Pose) -> dict[str, Any]:
    return {"position": list(pose.position), "orientation": list(pose.orientation)}
