"""What the camera sees: the fixed things of the cell and its boards, in the form in which the fake camera is told."""

from __future__ import annotations

from typing import Any

import numpy as np

from arcor2_fakes.cell.arm import pose_of
from arcor2_fakes.cell.layout import Camera, Matrix, Pose

GREEN, LABELLED = (40, 110, 20), (205, 215, 215)
"""A bare board, and one whose label covers it, as red, green, blue."""
PAPER = 1.5
"""The side of a marker's paper, of its black square's: it has a white margin."""
THICKNESS = 0.001
"""m, of the paper; the marker's pose is that of its face."""
MOVED = 0.0005
"""m; less than that is not worth a new picture."""


def fixed(camera: Camera) -> list[dict[str, Any]]:
    """Return the things that never move."""
    found = [
        {"name": thing.name, "pose": _pose(thing.pose), "size": thing.size, "color": thing.color}
        for thing in camera.things
    ]
    for marker in camera.markers:
        side = PAPER * marker.size
        found.append(
            {
                "name": f"marker {marker.id}",
                "pose": pose_of(marker.pose.matrix() @ _down(THICKNESS / 2.0)),
                "size": (side, side, THICKNESS),
                "color": (235, 235, 235),
                "marker": {"id": marker.id, "size": marker.size},
            }
        )
    return found


def board(camera: Camera, code: str, world_from_board: Matrix, labelled: bool) -> dict[str, Any]:
    """Return a board; its pose is that of its top, where it is gripped."""
    pose = pose_of(world_from_board @ _down(camera.board[2] / 2.0))
    return {"name": code, "pose": pose, "size": camera.board, "color": LABELLED if labelled else GREEN}


def changes(
    before: dict[str, dict[str, Any]], after: dict[str, dict[str, Any]]
) -> tuple[bool, dict[str, dict[str, Any]]]:
    """Return whether other things stand there or look different now, and else the poses of those that were moved."""
    if {name: _look(thing) for name, thing in before.items()} != {name: _look(thing) for name, thing in after.items()}:
        return True, {}
    return False, {name: thing["pose"] for name, thing in after.items() if _far(before[name]["pose"], thing["pose"])}


def _look(thing: dict[str, Any]) -> dict[str, Any]:
    return {key: value for key, value in thing.items() if key != "pose"}


def _far(one: dict[str, Any], other: dict[str, Any]) -> bool:
    turned = 1.0 - abs(float(np.dot(one["orientation"], other["orientation"])))
    return float(np.linalg.norm(np.subtract(one["position"], other["position"]))) > MOVED or turned > 1e-5


def _down(distance: float) -> Matrix:
    shifted = np.eye(4)
    shifted[2, 3] = -distance
    return shifted


def _pose(pose: Pose) -> dict[str, Any]:
    return {"position": list(pose.position), "orientation": list(pose.orientation)}
