"""The record of a calibration, and the check of a later measurement against it."""

import enum
import hashlib
from typing import Any

from msgspec import field

from arcor2_hw.data.base import UNSET, Data, Timestamp, TranslatableData, Unset, new_id, now
from arcor2_hw.data.geometry import Pose


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
    """A pose entered by a user."""


class CalibrationInput(Data, frozen=True):
    """An input of a calibration: SHA-256 in hex, size in bytes, and the path of the file if it is stored."""

    name: str
    sha256: str
    size: int
    file: str | Unset = UNSET

    @classmethod
    def of(cls, name: str, content: bytes, file: str | None = None) -> "CalibrationInput":
        """Return the description of content."""
        return cls(name, hashlib.sha256(content).hexdigest(), len(content), UNSET if file is None else file)


class CalibrationRecord(TranslatableData, frozen=True):
    """One calibration.

    person: name of the user who did it. object_id and object_name: the scene object that was calibrated; parent:
    name of the frame of the poses ("world", a robot's base or flange). inputs: images and tables for the computation;
    parameters: other inputs (joints, markers, options), as JSON values. residual: in residual_unit ("m", "rad" or
    "px"); result: the complete result, as JSON values. before and after: pose of the object before and after, where the
    result is a pose; applied: whether the object's pose was set. key and values translate the verdict.
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


class CalibrationCheck(TranslatableData, frozen=True):
    """A later measurement compared with a record: distance (m), angle (rad), and whether both are within limits.

    key and values translate the verdict.
    """

    record_id: str
    date: Timestamp
    distance: float
    angle: float
    distance_limit: float
    angle_limit: float
    passed: bool
    verdict: str
