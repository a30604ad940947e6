"""Functions of the calibration worker, one for each task. Each function imports the libraries it needs."""

from collections.abc import Callable

from arcor2_hw.calibration.camera_results import CameraPose, HandEye, Intrinsics, LensCheck
from arcor2_hw.calibration.results import RobotPose, TouchedFrame, TouchedOrientation, TouchedTip
from arcor2_hw.compute import calibration_tasks as t
from arcor2_hw.compute.worker_state import WorkerState
from arcor2_hw.data.camera import MarkerCorners
from arcor2_hw.exceptions import InvalidData


# ------------------------------------------------------------------------------------------------ pictures
def camera_pose(task: t.FindCameraPose, state: WorkerState) -> CameraPose:
    """Find the pose of a camera in the frame of the origin."""
    from arcor2_hw.calibration.camera_pose import find_camera_pose

    state.progress(0.0, "searching for markers")
    return find_camera_pose(task.pictures, task.parameters, task.layout, task.options)


def lens_check(task: t.CheckLens, state: WorkerState) -> LensCheck:
    """Check the focal length of a camera by markers."""
    from arcor2_hw.calibration.camera_pose import check_lens

    state.progress(0.0, "searching for markers")
    return check_lens(task.pictures, task.parameters, task.layout, task.options)


def drawn_camera_pose(task: t.DrawCameraPose, _: WorkerState) -> bytes:
    """Draw the expected markers onto an image; return a PNG file."""
    from arcor2_hw.calibration.camera_pose import draw_camera_pose

    return draw_camera_pose(task.picture, task.parameters, task.layout, task.result)


def marker_corners(task: t.FindMarkers, _: WorkerState) -> list[MarkerCorners]:
    """Find the corners of all markers."""
    from arcor2_hw.calibration.markers import find_marker_corners

    return find_marker_corners(task.picture, task.parameters, task.dictionary)


def hand_eye(task: t.FindHandEye, state: WorkerState) -> HandEye:
    """Find the pose of a camera on the flange, or in the frame of the robot's base."""
    from arcor2_hw.calibration.hand_eye import find_hand_eye

    return find_hand_eye(
        task.samples, task.parameters, task.target, task.mounting, task.options, _counted(state, "picture")
    )


def intrinsics(task: t.FindIntrinsics, state: WorkerState) -> Intrinsics:
    """Find the intrinsic parameters of a camera."""
    from arcor2_hw.calibration.intrinsics import find_intrinsics

    return find_intrinsics(task.pictures, task.board, task.options, _counted(state, "picture"))


def _counted(state: WorkerState, label: str) -> Callable[[int, int], None]:
    """Return a function that reports progress as "`label` 3 of 20"."""

    def report(done: int, count: int) -> None:
        share = done / count if count else 0.0
        state.progress(min(max(share, 0.0), 1.0), f"{label} {done} of {count}")

    return report


def robot_pose(task: t.FindRobotPose, state: WorkerState) -> RobotPose:
    """Find the pose of a robot's base in the world."""
    from dataclasses import replace

    import numpy as np

    from arcor2_hw.calibration.depth import read_depth
    from arcor2_hw.calibration.robot_pose import RobotPoseOptions
    from arcor2_hw.calibration.robot_states import JointState, find_robot_pose_of_states
    from arcor2_hw.calibration.surface import surface_of

    states = []
    for index, each in enumerate([t.RobotState(task.joints, task.depth), *task.other_states]):
        if not each.depth:
            raise InvalidData("The pose of a robot needs at least one depth image. Take one, then try again.")
        state.progress(0.3 * index / (len(task.other_states) + 1), "reading the depth images and the robot's model")
        depth = [read_depth(picture) for picture in each.depth]
        if len({picture.shape for picture in depth}) > 1:
            raise InvalidData("The depth images have different sizes. Take all of them with the same camera settings.")
        surface = surface_of(state.robot(task.robot), each.joints)
        if task.robot.called:
            surface = replace(surface, name=task.robot.called)
        states.append(JointState(surface, np.stack(depth)))
    state.progress(0.3, "searching for the robot")
    options = RobotPoseOptions(within=task.distance, angle_within=task.angle)
    return find_robot_pose_of_states(states, task.parameters, task.camera_pose, task.robot.base, options)


# ------------------------------------------------------------------------------------------------ by touch
def frame_by_axes(task: t.FrameByAxes, _: WorkerState) -> TouchedFrame:
    """Compute a frame from axes."""
    from arcor2_hw.calibration import touch

    return touch.frame_by_axes(task.origin, task.on_x, task.in_plane)


def frame_by_points(task: t.FrameByPoints, _: WorkerState) -> TouchedFrame:
    """Compute a frame from known points."""
    from arcor2_hw.calibration import touch

    return touch.frame_by_points(task.known, task.touched)


def tip_by_touches(task: t.TipByTouches, _: WorkerState) -> TouchedTip:
    """Compute the tip of a tool in the frame of the flange."""
    from arcor2_hw.calibration import touch

    return touch.tip_by_touches(task.flange)


def orientation_by_alignment(task: t.OrientationByAlignment, _: WorkerState) -> TouchedOrientation:
    """Compute the orientation of a tool in the frame of the flange."""
    from arcor2_hw.calibration import touch

    return touch.orientation_by_alignment(task.flange, task.reference)


def orientation_by_points(task: t.OrientationByPoints, _: WorkerState) -> TouchedOrientation:
    """Compute the orientation of a tool in the frame of the flange."""
    from arcor2_hw.calibration import touch

    return touch.orientation_by_points(task.flange, task.tip, task.along_z, task.on_x)
