"""Where a camera sits on a robot's flange (eye in hand), or beside the robot (eye to hand)."""

from collections.abc import Callable, Sequence

from arcor2_hw.calibration.camera_results import HandEye, HandEyeOptions, HandEyeSample, Mounting
from arcor2_hw.calibration.layout import Layout
from arcor2_hw.data.camera import CameraParameters


def find_hand_eye(
    samples: Sequence[HandEyeSample],
    parameters: CameraParameters,
    target: Layout,
    mounting: Mounting,
    options: HandEyeOptions | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> HandEye:
    """Find a camera's pose on the flange, or in the robot's base frame.

    Args:
        samples: at least three, better ten or more, with the flange turned about two axes or more in between.
        parameters: of the lens, for the size of the pictures.
        target: the markers or the board, their poses in the target's own frame, wherever that is.
        mounting: `eye_in_hand`: the target stands still; `eye_to_hand`: the flange carries the target.
        options: limits.
        progress: is called with how many pictures are done, and how many there are.

    Raises:
        InvalidPicture, InvalidData: as find_camera_pose; fewer than three samples; a flange's pose that is not finite.
        CalibrationRefused: no marker (in too many pictures); degenerate (all rotations about one axis, or hardly any);
            implausible (the flange's poses do not belong to the pictures).
    """
    raise NotImplementedError
