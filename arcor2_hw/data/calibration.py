"""The record that every calibration leaves, and what a later measurement says of it."""

import enum
import hashlib
from typing import Any

from msgspec import field

from arcor2_hw.data.base import UNSET, Data, Timestamp, Unset, new_id, now
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
