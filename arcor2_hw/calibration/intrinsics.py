"""A camera's intrinsics and distortion, from pictures of a ChArUco board."""

from collections.abc import Callable, Sequence

from arcor2_hw.calibration.camera_results import Intrinsics, IntrinsicsOptions
from arcor2_hw.calibration.layout import CharucoBoard
from arcor2_hw.calibration.pictures import Picture


def find_intrinsics(
    pictures: Sequence[Picture],
    board: CharucoBoard,
    options: IntrinsicsOptions | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Intrinsics:
    """Find the intrinsics of a camera.

    Args:
        pictures: of the board from various directions and distances, all over the picture; 10 to 30 are good.
        board: its pose does not matter.
        options: lens model and limits.
        progress: is called with how many pictures are done, and how many there are.

    Raises:
        InvalidPicture: as find_camera_pose; pictures of different sizes.
        InvalidData: a board that cannot be.
        CalibrationRefused: too few points (in too few pictures, or in too little of the picture); degenerate (the
            board is seen from one direction only); implausible (the errors are large: another board, a bent one).
    """
    raise NotImplementedError
