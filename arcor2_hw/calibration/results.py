"""Results of the calibrations of robots, frames and tools. Imports no numerics, because they are sent and stored.

`key` and `values` translate the verdict.
"""

import enum

from arcor2_hw.data.base import TranslatableData
from arcor2_hw.data.geometry import Orientation, Pose, Position


class Grade(enum.StrEnum):
    """Reliability of a result. An unreliable result is refused (CalibrationRefused), never graded."""

    GOOD = "good"
    """As good as the method gets."""
    USABLE = "usable"
    """Not contradicted, but less certain than usual or not checked by anything; the verdict says why."""


class RobotPose(TranslatableData, frozen=True):
    """The pose of a robot, found from depth images.

    Attributes:
        pose: world_from_base.
        fitness: Fraction of the robot's visible surface that the image confirms, 0 to 1.
        occluded: Fraction of the surface hidden by something else, 0 to 1.
        uneven: Root mean square, over parts of the image, of the mean distance between model and image, m; large when
            joints or model are not those of the robot.
        residual: Root mean square distance of the points used from the surface, m.
        points: Number of points used.
        covariance: (6, 6), of a small motion of the base in its own frame: position (m), then rotation vector (rad).
        position_deviation: Standard deviation of the position in the worst direction, m.
        orientation_deviation: Standard deviation of the orientation in the worst direction, rad.
        moved: Distance from the assumed pose, m.
        turned: Angle from the assumed pose, rad.
        starts: Number of starts of the search, 7 when all of these agreed.
        agreed: Number of starts that ended at this pose.
        seconds: Duration, s.
    """

    pose: Pose
    grade: Grade
    verdict: str
    fitness: float
    occluded: float
    uneven: float
    residual: float
    points: int
    covariance: list[list[float]]
    position_deviation: float
    orientation_deviation: float
    moved: float
    turned: float
    starts: int
    agreed: int
    seconds: float


class TouchedFrame(TranslatableData, frozen=True):
    """A frame from touched points.

    Attributes:
        pose: Pose of the frame, in the frame of the given points.
        residuals: Distance of each point from its place in the frame, m, in the given order.
        residual: Root mean square of the residuals, m.
        worst: Index of the largest residual.
        checked: Whether there were more points than needed; otherwise the residuals are zero by construction.
        angle_deviation: Standard deviation of the orientation in the worst direction, rad; that of touches accurate to
            0.5 mm when not checked.
    """

    pose: Pose
    grade: Grade
    verdict: str
    residuals: list[float]
    residual: float
    worst: int
    checked: bool
    angle_deviation: float


class TouchedTip(TranslatableData, frozen=True):
    """The tip of a tool, from one point touched in several orientations.

    Attributes:
        position: Position of the tip on the flange (flange_from_tip), m.
        point: The touched point in the robot's base, m.
        residuals: Distance of the tip from the point for each orientation, m.
        residual: Root mean square of the residuals, m.
        worst: Index of the largest residual.
        deviation: Standard deviation of the position in the worst direction, m.
    """

    position: Position
    point: Position
    grade: Grade
    verdict: str
    residuals: list[float]
    residual: float
    worst: int
    deviation: float


class TouchedOrientation(TranslatableData, frozen=True):
    """The orientation of a tool on the flange (flange_from_tool), with the angle of each measurement from it, rad."""

    orientation: Orientation
    grade: Grade
    verdict: str
    residuals: list[float]
    residual: float
    worst: int
    checked: bool
