"""The record that every calibration leaves, and the check of a later measurement against it. Imports no numerics."""

import enum
import hashlib
import math
from typing import Any

from msgspec import field

from arcor2_hw.data.base import UNSET, Data, Timestamp, Unset, new_id, now
from arcor2_hw.data.geometry import Pose
from arcor2_hw.exceptions import InvalidData

__all__ = ["CalibrationCheck", "CalibrationInput", "CalibrationKind", "CalibrationRecord", "check_against"]


class CalibrationKind(enum.StrEnum):
    """What was calibrated, and how."""

    CAMERA_POSE = "camera_pose"
    ROBOT_POSE = "robot_pose"
    HAND_EYE = "hand_eye"
    INTRINSICS = "intrinsics"
    BASE_FRAME = "base_frame"
    """Of a robot, by touch."""
    USER_FRAME = "user_frame"
    TOOL_TIP = "tool_tip"
    TOOL_ORIENTATION = "tool_orientation"
    BY_HAND = "by_hand"
    """A pose that a person typed in."""


class CalibrationInput(Data, frozen=True):
    """Something a calibration was computed from: sha256 in hex and size in bytes; file: where it is kept, if it is."""

    name: str
    sha256: str
    size: int
    file: str | Unset = UNSET

    @classmethod
    def of(cls, name: str, content: bytes, file: str | None = None) -> "CalibrationInput":
        """Describe the content."""
        return cls(name, hashlib.sha256(content).hexdigest(), len(content), UNSET if file is None else file)


class CalibrationRecord(Data, frozen=True):
    """One calibration.

    person: user name of whoever did it. object_id and object_name: of the scene object whose pose, lens or tool it is;
    parent: name of the frame in which the poses are stated ("world", a robot's base or flange). inputs: pictures and
    tables it was computed from; parameters: what else went in (joints, markers, options), as JSON values. residual: in
    residual_unit ("m", "rad" or "px"); result: the whole result, as JSON values. before and after: pose of the object
    until then and since, where the result is a pose; applied: whether the object was given it.
    """

    kind: CalibrationKind
    person: str
    object_id: str
    object_name: str
    parent: str
    verdict: str
    residual: float | Unset = UNSET
    residual_unit: str = "m"
    inputs: list[CalibrationInput] = field(default_factory=list)
    parameters: dict[str, Any] = field(default_factory=dict)
    result: dict[str, Any] = field(default_factory=dict)
    before: Pose | Unset = UNSET
    after: Pose | Unset = UNSET
    applied: bool = True
    id: str = field(default_factory=lambda: new_id("cal"))
    date: Timestamp = field(default_factory=now)


class CalibrationCheck(Data, frozen=True):
    """A later measurement compared with a record: distance (m), angle (rad), and whether both are within limits."""

    record_id: str
    date: Timestamp
    distance: float
    angle: float
    distance_limit: float
    angle_limit: float
    passed: bool
    verdict: str


def check_against(
    record: CalibrationRecord,
    measured: Pose,
    *,
    distance_limit: float = 0.002,
    angle_limit: float = math.radians(0.2),
) -> CalibrationCheck:
    """Compare a pose measured now, or a reference pose, with the pose of the record.

    Args:
        record: one with a pose as its result.
        measured: stated in the same parent frame as the record's.
        distance_limit: m, positive.
        angle_limit: rad, positive.

    Raises:
        InvalidData: the record's result is no pose, or a limit is not positive.
    """
    if isinstance(record.after, Unset):
        raise InvalidData(f"The calibration {record.id} ({record.kind.value}) gave no pose that could be checked.")
    for name, limit in (("distance_limit", distance_limit), ("angle_limit", angle_limit)):
        if not 0.0 < limit < math.inf:
            raise InvalidData(f"{name} has to be positive, not {limit}.")
    distance = record.after.position.distance_to(measured.position)
    angle = record.after.orientation.angle_to(measured.orientation)
    if not (math.isfinite(distance) and math.isfinite(angle)):
        raise InvalidData("The measured pose is not finite.")
    passed = distance <= distance_limit and angle <= angle_limit
    figures = f"{distance * 1e3:.1f} mm and {math.degrees(angle):.2f}°"
    limits = f"{distance_limit * 1e3:.1f} mm and {math.degrees(angle_limit):.2f}°"
    verdict = (
        f"{record.object_name} still stands as calibrated on {record.date[:10]}: {figures} off, allowed are {limits}."
        if passed
        else f"{record.object_name} is {figures} away from the calibration of {record.date[:10]}, allowed are {limits}:"
        " calibrate it again, or find out what was moved."
    )
    return CalibrationCheck(record.id, now(), distance, angle, distance_limit, angle_limit, passed, verdict)
