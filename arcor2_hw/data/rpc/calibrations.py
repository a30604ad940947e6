"""Arguments and answers of requests about records of calibrations."""

from typing import Annotated, Final

from msgspec import Meta

from arcor2_hw.data.base import UNSET, Data, Unset
from arcor2_hw.data.calibration import CalibrationCheck, CalibrationKind, CalibrationRecord
from arcor2_hw.data.geometry import Pose
from arcor2_hw.data.role import Role
from arcor2_hw.data.rpc.envelope import Rpc


class ListCalibrationsArgs(Data, frozen=True):
    """Arguments of ListCalibrations: maximum number, latest date, object, kind."""

    limit: Annotated[int, Meta(ge=0, le=1000)] = 100
    object_id: str | Unset = UNSET
    kind: CalibrationKind | Unset = UNSET
    before: str | Unset = UNSET


class ListCalibrationsData(Data, frozen=True):
    """Answer to ListCalibrations: records, newest first."""

    records: list[CalibrationRecord]


class CheckCalibrationArgs(Data, frozen=True):
    """Arguments of CheckCalibration: a record, a pose in its frame, and the limits of the difference (m, rad).

    pose: a measured pose or a reference; default: the pose of the object in the open scene.
    """

    id: str
    pose: Pose | Unset = UNSET
    distance_limit: Annotated[float, Meta(gt=0)] = 0.002
    angle_limit: Annotated[float, Meta(gt=0)] = 0.0035


CALIBRATION_RPCS: Final = (
    Rpc("CheckCalibration", CheckCalibrationArgs, CalibrationCheck, Role.OPERATOR, additional=True),
    Rpc(
        "ListCalibrations",
        ListCalibrationsArgs,
        ListCalibrationsData,
        Role.OPERATOR,
        args_optional=True,
        additional=True,
    ),
)
"""Requests about calibrations."""
