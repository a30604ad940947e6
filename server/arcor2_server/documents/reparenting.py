"""Changes the parent of action points while they keep their pose in the world (protocol, section 10.1)."""

from typing import Final

from msgspec.structs import replace

from arcor2_hw.data.base import UNSET, Unset
from arcor2_hw.data.geometry import Orientation
from arcor2_hw.data.project import BareActionPoint
from arcor2_hw.data.project_index import ProjectLookup, global_pose, relative_pose
from arcor2_hw.exceptions import InvalidData, NotFound
from arcor2_server.documents.changes import Change, Kind
from arcor2_server.documents.document import Document

SAME_ROTATION: Final = 1e-12
"""Angle below which the orientations of two frames count as equal, so that descendants need no update, rad."""


def check_parent(lookup: ProjectLookup, parent_id: str, name: str) -> None:
    """Check that an object or action point can be the parent of the action point `name`.

    Raises:
        InvalidData: The object has no pose.
        NotFound: The object or action point does not exist.
    """
    try:
        lookup.action_point(parent_id)
    except NotFound:
        pass
    else:
        return
    try:
        obj = lookup.scene_object(parent_id)
    except NotFound:
        raise NotFound(
            "The parent of {name} is neither an object nor an action point: {parent_id!r}.",
            name=name,
            parent_id=parent_id,
        ) from None
    if isinstance(obj.pose, Unset):
        raise InvalidData(
            "{name} has no pose and cannot be the parent of {other_name}.", name=obj.name, other_name=name
        )


def changes_for_parent(document: Document, point_id: str, new_parent: str) -> tuple[list[Change], list[str]]:
    """Return the changes that set the parent of an action point, and the ids of the changed action points.

    Positions and orientations are converted to the new frame, so that nothing moves. If the frames have different
    orientations, those of descendants are converted, too.

    Args:
        document: The open document.
        point_id: The action point.
        new_parent: The id of an object or action point; empty for none.

    Raises:
        InvalidData: The parent has no pose, or is the action point itself or one of its descendants.
        NotFound: The parent does not exist.
    """
    point = document.action_point(point_id)
    moved = replace(point, parent=new_parent or UNSET)
    if new_parent:
        check_parent(document, new_parent, point.name)
        check_no_loop(document, point, new_parent)
    pose = relative_pose(document, moved, global_pose(document, point))
    changes = [document.update(Kind.POINT, point_id, replace(moved, position=pose.position))]
    # The pose of an action point has no rotation, so this is the rotation between the two frames.
    turn = pose.orientation
    if turn.angle_to(Orientation()) <= SAME_ROTATION:
        return changes, [point_id]
    changes += _turned(document, point_id, turn)
    changed = [point_id]
    for below in document.descendants(point_id):
        position = below.position.rotated(turn)
        changes.append(document.update(Kind.POINT, below.id, replace(below, position=position)))
        changes += _turned(document, below.id, turn)
        changed.append(below.id)
    return changes, changed


def _turned(document: Document, point_id: str, turn: Orientation) -> list[Change]:
    return [
        document.update(Kind.ORIENTATION, item.id, replace(item.value, orientation=turn * item.value.orientation))
        for item in document.owned(point_id, Kind.ORIENTATION)
    ]


def check_no_loop(document: Document, point: BareActionPoint, new_parent: str) -> None:
    """Raise InvalidData if a parent is the action point itself or one of its descendants."""
    at: str | Unset = new_parent
    while not isinstance(at, Unset):
        if at == point.id:
            raise InvalidData("{name} cannot be its own ancestor: choose another parent.", name=point.name)
        item = document.find(Kind.POINT, at)
        at = UNSET if item is None else item.value.parent
