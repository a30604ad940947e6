"""Requests about calibration records (docs/protocol.md)."""

import msgspec

from arcor2_hw.calibration.records import check_against
from arcor2_hw.data.base import Unset
from arcor2_hw.data.calibration import CalibrationCheck, CalibrationRecord
from arcor2_hw.data.geometry import Pose
from arcor2_hw.data.rpc import CheckCalibrationArgs, ListCalibrationsArgs, ListCalibrationsData
from arcor2_server.documents import Session
from arcor2_server.errors import RequestRefused
from arcor2_server.rpc.registry import Context, rpc
from arcor2_server.storage.calibrations import Calibrations


class CalibrationRecordRequests:
    """Requests about records of calibrations."""

    def __init__(self, session: Session, calibration_records: Calibrations) -> None:
        self._session = session
        self._calibration_records = calibration_records

    @rpc("ListCalibrations")
    async def list_calibrations(self, context: Context, args: ListCalibrationsArgs) -> ListCalibrationsData:
        """Return the newest records of calibrations."""
        given = {name: value for name, value in msgspec.structs.asdict(args).items() if not isinstance(value, Unset)}
        return ListCalibrationsData(await self._calibration_records.find(**given))

    @rpc("CheckCalibration")
    async def check_calibration(self, context: Context, args: CheckCalibrationArgs) -> CalibrationCheck:
        """Compare a measured pose, or the pose in the open scene, with a record."""
        record = await self._calibration_records.get(args.id)
        pose = self._present(record) if isinstance(args.pose, Unset) else args.pose
        return check_against(record, pose, distance_limit=args.distance_limit, angle_limit=args.angle_limit)

    def _present(self, record: CalibrationRecord) -> Pose:
        """Return where the object of a record is in the open scene.

        Raise RequestRefused or NotFound if that is impossible.
        """
        if record.parent != "world":
            raise RequestRefused(
                "The calibration is stated in the frame of {parent}: give a pose in that.", parent=record.parent
            )
        self._session.require_scene_open()
        found = self._session.document.scene_object(record.object_id)
        if isinstance(found.pose, Unset):
            raise RequestRefused("{name} has no pose.", name=found.name)
        return found.pose
