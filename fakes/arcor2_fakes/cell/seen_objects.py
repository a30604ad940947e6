"""The objects in front of the camera: fixed objects and boards, in the format of the fake camera."""

from __future__ import annotations

from typing import Any

import numpy as np

from arcor2_fakes.cell.arm import pose_of
from arcor2_fakes.cell.layout import Camera, Matrix, Pose

GREEN, LABELLED = (40, 110, 20), (205, 215, 215)
"""Colours of a bare and of a labelled board: R, G, B."""
PAPER = 1.5
"""Ratio of the side of the paper of a marker to that of its black square."""
THICKNESS = 0.001
"""Thickness of the paper, m; the pose of a marker is at its surface."""
MOVED = 0.0005
"""Smallest displacement that is sent to the camera, m."""


def fixed(camera: Camera) -> list[dict[str, Any]]:
    """Return the fixed objects."""
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
    """Return a board whose grip point, at the top, is at a pose."""
    pose = pose_of(world_from_board @ _down(camera.board[2] / 2.0))
    return {"name": code, "pose": pose, "size": camera.board, "color": LABELLED if labelled else GREEN}


def changes(
    before: dict[str, dict[str, Any]], after: dict[str, dict[str, Any]]
) -> tuple[bool, dict[str, dict[str, Any]]]:
    """Return whether objects were added, removed or changed, and otherwise the poses of the moved objects."""
    if {name: _appearance(thing) for name, thing in before.items()} != {
        name: _appearance(thing) for name, thing in after.items()
    }:
        return True, {}
    return False, {name: thing["pose"] for name, thing in after.items() if _far(before[name]["pose"], thing["pose"])}


def _appearance(board: dict[str, Any]) -> dict[str, Any]:
    return {key: value for key, value in board.items() if key != "pose"}


def _far(one: dict[str, Any], other: dict[str, Any]) -> bool:
    turned = 1.0 - abs(float(np.dot(one["orientation"], other["orientation"])))
    return float(np.linalg.norm(np.subtract(one["position"], other["position"]))) > MOVED or turned > 1e-5


def _down(distance: float) -> Matrix:
    shifted = np.eye(4)
    shifted[2, 3] = -distance
    return shifted


def _pose(pose: Pose) -> dict[str, Any]:
    return {"position": list(pose.position), "orientation": list(pose.orientation)}
