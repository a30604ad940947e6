"""Calibration records over REST (docs/protocol.md)."""

from dataclasses import dataclass
from typing import Annotated, Any

import msgspec
from msgspec import Meta
from msgspec.structs import replace

from arcor2_hw.calibration.records import (
    CalibrationCheck,
    CalibrationInput,
    CalibrationKind,
    CalibrationRecord,
    check_against,
)
from arcor2_hw.data.base import UNSET, Data, Unset
from arcor2_hw.data.geometry import Pose
from arcor2_hw.data.role import Role
from arcor2_hw.data.rpc import ListCalibrationsArgs
from arcor2_server.rest.calibration import CALIBRATION
from arcor2_server.rest.operations import operation
from arcor2_server.storage.calibrations import Calibrations


class RecordAs(Data, frozen=True):
    """What a record is kept under: of which object, and in which frame its pose is stated. before: its pose so far."""

    object_id: str
    object_name: str = ""
    parent: str = "world"
    before: Pose | Unset = UNSET
    applied: bool = False


async def store_record(
    records: Calibrations,
    person: str,
    under: RecordAs | Unset,
    kind: CalibrationKind,
    found: Any,
    residual: float,
    unit: str,
    pictures: list[bytes],
    details: dict[str, Any],
    after: Pose | Unset,
) -> None:
    """Store a record of a result if requested. unit: of the residual. after: the pose, if the result is one."""
    if isinstance(under, Unset):
        return
    result: dict[str, Any] = msgspec.to_builtins(found)
    result.pop("picture", None)  # what can be drawn again
    inputs = [CalibrationInput.of(f"picture {number}", each) for number, each in enumerate(pictures, 1)]
    await records.put(
        CalibrationRecord(
            kind,
            person,
            under.object_id,
            under.object_name or under.object_id,
            under.parent,
            found.verdict,
            residual=residual,
            residual_unit=unit,
            inputs=inputs,
            parameters=msgspec.to_builtins(details),
            result=result,
            before=under.before,
            after=after,
            applied=under.applied,
        )
    )


async def store_touch_record(
    records: Calibrations, person: str, body: Any, kind: CalibrationKind, found: Any, after: Pose
) -> None:
    """Store a record of a touched result if requested."""
    unit = "rad" if kind is CalibrationKind.TOOL_ORIENTATION else "m"
    details = {"args": replace(body, record=UNSET)}
    await store_record(records, person, body.record, kind, found, found.residual, unit, [], details, after)


# ------------------------------------------------------------------------------------------------ records
class ByHandArgs(Data, frozen=True):
    """A pose that somebody typed in. remark: why, or from where."""

    object_id: str
    object_name: str
    pose: Pose
    parent: str = "world"
    before: Pose | Unset = UNSET
    remark: str = ""


class CheckArgs(Data, frozen=True):
    """A pose measured later, in the same frame as the record's, and how far it may be off (m, rad)."""

    pose: Pose
    distance_limit: Annotated[float, Meta(gt=0)] = 0.002
    angle_limit: Annotated[float, Meta(gt=0)] = 0.0035


@dataclass(frozen=True, slots=True)
class CalibrationRecordOperations:
    """Records of calibrations over REST (docs/protocol.md): kept, listed, checked later."""

    _calibration_records: Calibrations

    @operation("GET", "/api/calibrations", CALIBRATION, Role.OPERATOR, plain=True)
    async def list_calibrations(self, query: ListCalibrationsArgs) -> list[CalibrationRecord]:
        """List the records of calibrations, newest first."""
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
        """Return the record of a calibration."""
        return await self._calibration_records.get(calibration_id)

    @operation("PUT", "/api/calibrations/{calibration_id}/check", CALIBRATION, Role.OPERATOR, plain=True)
    async def check_calibration(self, calibration_id: str, body: CheckArgs) -> CalibrationCheck:
        """Compare a measured pose with the pose of a record."""
        record = await self._calibration_records.get(calibration_id)
        return check_against(record, body.pose, distance_limit=body.distance_limit, angle_limit=body.angle_limit)
