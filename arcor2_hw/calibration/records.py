"""The check of a later measurement against the record of a calibration. Imports no numerics."""

import math

from arcor2_hw.data.base import Unset, now
from arcor2_hw.data.calibration import CalibrationCheck, CalibrationInput, CalibrationKind, CalibrationRecord
from arcor2_hw.data.geometry import Pose
from arcor2_hw.exceptions import InvalidData
from arcor2_hw.messages import Message

__all__ = ["CalibrationCheck", "CalibrationInput", "CalibrationKind", "CalibrationRecord", "check_against"]


def check_against(
    record: CalibrationRecord, measured: Pose, *, distance_limit: float = 0.002, angle_limit: float = math.radians(0.2)
) -> CalibrationCheck:
    """Compare a measured pose, or a reference pose, with the pose of the record.

    Args:
        record: A record whose result has a pose.
        measured: Pose in the same parent frame as that of the record.
        distance_limit: Maximum distance, m, positive.
        angle_limit: Maximum angle, rad, positive.

    Raises:
        InvalidData: The result has no pose, or a limit is not positive.
    """
    if isinstance(record.after, Unset):
        raise InvalidData(
            "The calibration {id} ({value}) has no pose that could be checked.", id=record.id, value=record.kind.value
        )
    for name, limit in (("distance_limit", distance_limit), ("angle_limit", angle_limit)):
        if not 0.0 < limit < math.inf:
            raise InvalidData("{name} must be positive, not {limit}.", name=name, limit=limit)
    distance = record.after.position.distance_to(measured.position)
    angle = record.after.orientation.angle_to(measured.orientation)
    if not (math.isfinite(distance) and math.isfinite(angle)):
        raise InvalidData("The measured pose is not finite.")
    passed = distance <= distance_limit and angle <= angle_limit
    verdict = Message.of(
        "{name} is still as calibrated on {date}: {difference} off, within {limits}."
        if passed
        else "{name} differs by {difference} from the calibration of {date}, more than {limits}: calibrate it again, "
        "or check what was moved.",
        name=record.object_name,
        date=record.date[:10],
        difference=_shown(distance, angle),
        limits=_shown(distance_limit, angle_limit),
    )
    return CalibrationCheck(
        record.id,
        now(),
        distance,
        angle,
        distance_limit,
        angle_limit,
        passed,
        verdict.text,
        **verdict.translation(),
    )


def _shown(distance: float, angle: float) -> Message:
    return Message.of("{distance:.1f} mm and {angle:.2f}°", distance=distance * 1e3, angle=math.degrees(angle))
