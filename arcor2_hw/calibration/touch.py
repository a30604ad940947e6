"""Frames and tools from touched points: base and user frames, the tip of a tool (TCP) and its orientation."""

from collections.abc import Sequence

from arcor2_hw.calibration.results import TouchedFrame, TouchedOrientation, TouchedTip
from arcor2_hw.data.geometry import Orientation, Pose, Position


def frame_by_axes(origin: Position, on_x: Position, in_plane: Sequence[Position]) -> TouchedFrame:
    """Find a frame from its origin, a point on its +x axis and points in its xy plane on the side of +y.

    The plane is the best fit of all points, the origin the first point's foot on it. With one point in the plane the
    three determine the frame exactly and nothing checks them.

    Args:
        origin: of the frame, touched, m.
        on_x: a point on the +x axis.
        in_plane: at least one point; the first one has +y on its side of x.

    Raises:
        InvalidData: no point in the plane, or a coordinate that is not finite.
        CalibrationRefused: the points lie on one line or too near each other.
    """
    raise NotImplementedError


def frame_by_points(known: Sequence[Position], touched: Sequence[Position]) -> TouchedFrame:
    """Find a frame in which at least three points are known, from where they were touched: best fit (Kabsch).

    Args:
        known: points in the frame that is looked for, m.
        touched: the same points in the frame of whoever touched them, in the same order.

    Raises:
        InvalidData: fewer than three, counts differ, or a coordinate that is not finite.
        CalibrationRefused: the points lie on one line or too near each other, or the two sets have different shapes.
    """
    raise NotImplementedError


def tip_by_touches(flange: Sequence[Pose]) -> TouchedTip:
    """Find the tip of a tool from at least four poses of the flange (base_from_flange) with the tip on one point.

    Raises:
        InvalidData: fewer than four poses, or a number that is not finite.
        CalibrationRefused: the orientations are too much alike, or turned about one axis only, or the touches do not
            agree on a point.
    """
    raise NotImplementedError


def orientation_by_alignment(flange: Sequence[Orientation], reference: Orientation) -> TouchedOrientation:
    """Find a tool's orientation from orientations of the flange with the tool's axes put along a reference's.

    Args:
        flange: base_from_flange, at least one.
        reference: base_from_reference, whose axes the tool's were put along.

    Raises:
        InvalidData: no orientation. CalibrationRefused: they differ by more than measuring explains.
    """
    raise NotImplementedError


def orientation_by_points(flange: Orientation, tip: Position, along_z: Position, on_x: Position) -> TouchedOrientation:
    """Find a tool's orientation by moving its tip, the flange not turning, along the tool's +z and to its +x side.

    Args:
        flange: base_from_flange, the same for all three.
        tip: position of the tip, or of the flange, before, in the base, m.
        along_z: after a move along the tool's +z, the way it works.
        on_x: after a move from `tip` to the side of the tool's +x.

    Raises:
        InvalidData: a number that is not finite. CalibrationRefused: moves too short, or along one line.
    """
    raise NotImplementedError
