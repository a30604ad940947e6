"""What the calibration worker does for each task; the libraries are imported by the functions that need them."""

from collections.abc import Callable

from arcor2_hw.calibration.camera_results import CameraPose, HandEye, Intrinsics
from arcor2_hw.calibration.results import TouchedFrame, TouchedOrientation, TouchedTip
from arcor2_hw.compute import calibration_tasks as t
from arcor2_hw.compute.desk import Desk
from arcor2_hw.data.camera import MarkerCorners


# ------------------------------------------------------------------------------------------------ pictures
def camera_pose(task: t.FindCameraPose, desk: Desk) -> CameraPose:
    """Give the pose of a camera in the origin's frame."""
    from arcor2_hw.calibration.camera_pose import find_camera_pose

    desk.progress(0.0, "looking for markers")
    return find_camera_pose(task.pictures, task.parameters, task.layout, task.options)


def drawn_camera_pose(task: t.DrawCameraPose, _: Desk) -> bytes:
    """Give a PNG file."""
    from arcor2_hw.calibration.camera_pose import draw_camera_pose

    return draw_camera_pose(task.picture, task.parameters, task.layout, task.result)


def marker_corners(task: t.FindMarkers, _: Desk) -> list[MarkerCorners]:
    """Give the corners of all markers."""
    from arcor2_hw.calibration.markers import find_marker_corners

    return find_marker_corners(task.picture, task.parameters, task.dictionary)


def hand_eye(task: t.FindHandEye, desk: Desk) -> HandEye:
    """Give where a camera sits on the flange, or in the robot's base frame."""
    from arcor2_hw.calibration.hand_eye import find_hand_eye

    return find_hand_eye(
        task.samples, task.parameters, task.target, task.mounting, task.options, _counted(desk, "picture")
    )


def intrinsics(task: t.FindIntrinsics, desk: Desk) -> Intrinsics:
    """Give the intrinsics of a camera."""
    from arcor2_hw.calibration.intrinsics import find_intrinsics

    return find_intrinsics(task.pictures, task.board, task.options, _counted(desk, "picture"))


def _counted(desk: Desk, what: str) -> Callable[[int, int], None]:
    """Give what tells the progress of a computation that counts what it is through with."""

    def told(done: int, count: int) -> None:
        share = done / count if count else 0.0
        desk.progress(min(max(share, 0.0), 1.0), f"{what} {done} of {count}")

    return told


# ------------------------------------------------------------------------------------------------ by touch
def frame_by_axes(task: t.FrameByAxes, _: Desk) -> TouchedFrame:
    """Give a frame."""
    from arcor2_hw.calibration import touch

    return touch.frame_by_axes(task.origin, task.on_x, task.in_plane)


def frame_by_points(task: t.FrameByPoints, _: Desk) -> TouchedFrame:
    """Give a frame."""
    from arcor2_hw.calibration import touch

    return touch.frame_by_points(task.known, task.touched)


def tip_by_touches(task: t.TipByTouches, _: Desk) -> TouchedTip:
    """Give the tip of a tool on the flange."""
    from arcor2_hw.calibration import touch

    return touch.tip_by_touches(task.flange)


def orientation_by_alignment(task: t.OrientationByAlignment, _: Desk) -> TouchedOrientation:
    """Give the orientation of a tool on the flange."""
    from arcor2_hw.calibration import touch

    return touch.orientation_by_alignment(task.flange, task.reference)


def orientation_by_points(task: t.OrientationByPoints, _: Desk) -> TouchedOrientation:
    """Give the orientation of a tool on the flange."""
    from arcor2_hw.calibration import touch

    return touch.orientation_by_points(task.flange, task.tip, task.along_z, task.on_x)
