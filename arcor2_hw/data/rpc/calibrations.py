"""Arguments and answers of the requests about records of calibrations (docs/protocol.md)."""

from typing import Annotated

from msgspec import Meta

from arcor2_hw.data.base import UNSET, Data, Unset
from arcor2_hw.data.calibration import CalibrationKind, CalibrationRecord
from arcor2_hw.data.geometry import Pose


class ListCalibrationsArgs(Data, frozen=True):
    """Arguments of ListCalibrations: at most so many, the newest ones before a date, of an object, of a kind."""

    limit: Annotated[int, Meta(ge=0, le=1000)] = 100
    object_id: str | Unset = UNSET
    kind: CalibrationKind | Unset = UNSET
    before: str | Unset = UNSET


class ListCalibrationsData(Data, frozen=True):
    """What ListCalibrations answers: records, newest first."""

    records: list[CalibrationRecord]


class CheckCalibrationArgs(Data, frozen=True):
    """Arguments of CheckCalibration: a record, a pose in its frame, and how far that may be off (m, rad).

    pose: one that was measured, or a reference; left out, that of the object in the open scene.
    """

    id: str
    pose: Pose | Unset = UNSET
    distance_limit: Annotated[float, Meta(gt=0)] = 0.002
    angle_limit: Annotated[float, Meta(gt=0)] = 0.0035
