"""Where a robot stands, from an RGB-D camera: the depth picture registered onto the robot's model.

The robot's surface in its measured joint state is rendered from the camera; the averaged and filtered cloud is
registered onto what can be seen of it, point to plane with Tukey's kernel, from several starts; what comes out is
compared with the picture once more, pixel by pixel, and refused where the two disagree.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from arcor2_hw.calibration.results import RobotPose
from arcor2_hw.calibration.surface import RobotSurface
from arcor2_hw.data.camera import CameraParameters
from arcor2_hw.data.geometry import Pose

DepthPictures = npt.NDArray[np.uint16]
"""One picture (rows, columns) or several of a standing scene (n, rows, columns): mm, 0 where there is none."""


@dataclass(frozen=True)
class RobotPoseOptions:
    """How far to look for the robot (m, rad) and what to demand of a result.

    within and angle_within: how far the assumed pose may be off, including what was meant as a margin. least_fitness:
    part of the visible surface that the picture has to confirm, 0..1. most_deviation (m) and most_angle_deviation
    (rad): standard deviation of the worst known direction beyond which a view is refused as unobservable.
    """

    within: float = 0.08
    angle_within: float = 0.14
    least_fitness: float = 0.6
    most_deviation: float = 0.003
    most_angle_deviation: float = 0.009


def find_robot_pose(
    surface: RobotSurface,
    depth: DepthPictures,
    parameters: CameraParameters,
    camera_pose: Pose,
    assumed: Pose,
    options: RobotPoseOptions | None = None,
) -> RobotPose:
    """Find the pose of a robot's base in the world.

    Args:
        surface: of the robot in the joint state in which the picture was taken.
        depth: of the colour camera's view, one picture or several of which the mean is taken.
        parameters: of the lens, for the size of the pictures.
        camera_pose: world_from_camera, of the optical frame (x right, y down, z forward).
        assumed: world_from_base, at most `options.within` and `options.angle_within` off.
        options: limits.

    Raises:
        InvalidData: a depth picture of the wrong size or kind, parameters that are none.
        CalibrationRefused: too few points, no overlap, not converged, ambiguous, or a direction is left free.
    """
    raise NotImplementedError


def read_depth(picture: bytes) -> DepthPictures:
    """Read a PNG file of 16-bit depth in mm. Raises InvalidData: no picture, colour, 8 bit, too large."""
    raise NotImplementedError
