"""Calibration records over REST (docs/protocol.md)."""

from dataclasses import dataclass
from typing import Annotated

from msgspec import Meta

from arcor2_hw.calibration.records import (
    CalibrationCheck,
    CalibrationKind,
    CalibrationRecord,
    check_against,
)
from arcor2_hw.data.base import UNSET, Data, Unset
from arcor2_hw.data.geometry import Pose
from arcor2_hw.data.role import Role
from arcor2_hw.data.rpc import ListCalibrationsArgs
from arcor2_server.rest.calibration_service import CALIBRATION
from arcor2_server.rest.operations import operation
from arcor2_server.storage.calibrations import Calibrations


class RecordAs(Data, frozen=True):
    """The object of a record, and the frame of its poses. before: pose of the object before the calibration."""

    object_id: str
    object_name: str = ""
    parent: str = "world"
    before: Pose | Unset = UNSET
    applied: bool = False


class ByHandArgs(Data, frozen=True):
    """A pose entered by hand. remark: its reason or source."""

    object_id: str
    object_name: str
    pose: Pose
    parent: str = "world"
    before: Pose | Unset = UNSET
    remark: str = ""


class CheckArgs(Data, frozen=True):
    """A later measured pose in the frame of the record, and the maximum distance (m) and angle (rad) between both."""

    pose: Pose
    distance_limit: Annotated[float, Meta(gt=0)] = 0.002
    angle_limit: Annotated[float, Meta(gt=0)] = 0.0035


@dataclass(frozen=True, slots=True)
class CalibrationRecordOperations:
    """Calibration records over REST (docs/protocol.md)."""

    _calibration_records: Calibrations

    @operation("GET", "/api/calibrations", CALIBRATION, Role.OPERATOR, plain=True)
    async def list_calibrations(self, query: ListCalibrationsArgs) -> list[CalibrationRecord]:
        """Return calibration records, newest first."""
        return await self._calibration_records.find(query)

    @operation("POST", "/api/calibrations", CALIBRATION, Role.TECHNICIAN, plain=True)
    async def record_by_hand(self, body: ByHandArgs, person: str) -> CalibrationRecord:
        """Store a record of a pose entered by hand."""
        record = CalibrationRecord(
            CalibrationKind.BY_HAND,
            person,
            body.object_id,
            body.object_name,
            body.parent,
            body.remark or "Typed in by hand.",
            before=body.before,
            after=body.pose,
        )
        await self._calibration_records.put(record)
        return record

    @operation("GET", "/api/calibrations/{calibration_id}", CALIBRATION, Role.OPERATOR, plain=True)
    async def get_calibration(self, calibration_id: str) -> CalibrationRecord:
        """Return a calibration record."""
        return await self._calibration_records.get(calibration_id)

    @operation("PUT", "/api/calibrations/{calibration_id}/check", CALIBRATION, Role.OPERATOR, plain=True)
    async def check_calibration(self, calibration_id: str, body: CheckArgs) -> CalibrationCheck:
        """Compare a measured pose with the pose of a record."""
        record = await self._calibration_records.get(calibration_id)
        return check_against(record, body.pose, distance_limit=body.distance_limit, angle_limit=body.angle_limit)
