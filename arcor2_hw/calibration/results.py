"""What the calibrations of robots, frames and tools give. Imports no numerics: these travel and are stored."""

import enum

from arcor2_hw.data.base import Data
from arcor2_hw.data.geometry import Orientation, Pose, Position


class Grade(enum.StrEnum):
    """How far a result may be trusted. What may not be is refused (CalibrationRefused), never graded."""

    GOOD = "good"
    """As good as the method gets."""
    USABLE = "usable"
    """Nothing contradicts it, but it is less certain than usual, or nothing could check it; the verdict says why."""


class RobotPose(Data, frozen=True):
    """Where a robot stands, found from a depth picture.

    pose: world_from_base. fitness: part of the robot's visible surface that the picture confirms, 0..1; occluded: part
    of it that something else hides. uneven: rms over parts of the picture of how far the model is from what is seen
    there on the average, m: large when joints or model are not the robot's. residual: rms distance of the points used
    from the model's surface, m; points: how many were used. covariance: 6 × 6, of a small motion of the base in its own
    frame: position (m), then rotation vector (rad), as rows; position_deviation (m) and orientation_deviation (rad):
    standard deviation in the direction that is known worst. moved (m) and turned (rad): by how much the result differs
    from the pose that was assumed. starts: of the search, 7 where all of these agreed; agreed: how many of them ended
    at this pose. seconds: time it took.
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


class TouchedFrame(Data, frozen=True):
    """A frame from touched points.

    pose: of the frame, in the frame in which the points were stated. residuals: distance of each point from where the
    frame has it, m, in the order given; residual: their rms; worst: index of the largest. checked: whether there were
    more points than the frame needs; if not, residuals are zero by construction and say nothing. angle_deviation:
    rad, standard deviation of the worst known direction, 0 where not checked.
    """

    pose: Pose
    grade: Grade
    verdict: str
    residuals: list[float]
    residual: float
    worst: int
    checked: bool
    angle_deviation: float


class TouchedTip(Data, frozen=True):
    """A tool's tip, from one point touched in several orientations.

    position: of the tip on the flange (flange_from_tip), m. point: that was touched, in the robot's base. residuals:
    distance of the tip from the point for each orientation, m; residual: rms; worst: index of the largest.
    deviation: standard deviation of the position in the direction that is known worst, m.
    """

    position: Position
    point: Position
    grade: Grade
    verdict: str
    residuals: list[float]
    residual: float
    worst: int
    deviation: float


class TouchedOrientation(Data, frozen=True):
    """A tool's orientation on the flange (flange_from_tool). residuals: angle of each measurement from it, rad."""

    orientation: Orientation
    grade: Grade
    verdict: str
    residuals: list[float]
    residual: float
    worst: int
    checked: bool
