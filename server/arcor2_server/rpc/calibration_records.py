"""Requests about calibration records (docs/protocol.md)."""

from dataclasses import dataclass

from arcor2_hw.calibration.records import check_against
from arcor2_hw.data.base import Unset
from arcor2_hw.data.calibration import CalibrationCheck, CalibrationRecord
from arcor2_hw.data.geometry import Pose
from arcor2_hw.data.rpc import CheckCalibrationArgs, ListCalibrationsArgs, ListCalibrationsData
from arcor2_server.documents import Session
from arcor2_server.errors import RequestRefused
from arcor2_server.rpc.registry import Context, rpc
from arcor2_server.storage.calibrations import Calibrations


@dataclass(frozen=True, slots=True)
class CalibrationRecordRequests:
    """Requests about calibration records (docs/protocol.md)."""

    _session: Session
    _calibration_records: Calibrations

    @rpc("ListCalibrations")
    async def list_calibrations(self, context: Context, args: ListCalibrationsArgs) -> ListCalibrationsData:
        """Return the newest calibration records."""
        return ListCalibrationsData(await self._calibration_records.find(args))

    @rpc("CheckCalibration")
    async def check_calibration(self, context: Context, args: CheckCalibrationArgs) -> CalibrationCheck:
        """Compare a record with a measured pose, by default with the pose in the open scene."""
        record = await self._calibration_records.get(args.id)
        pose = self._present_pose(record) if isinstance(args.pose, Unset) else args.pose
        return check_against(record, pose, distance_limit=args.distance_limit, angle_limit=args.angle_limit)

    def _present_pose(self, record: CalibrationRecord) -> Pose:
        """Return the pose of the object of a record in the open scene.

        Raises:
            NotFound: the scene has no such object.
            RequestRefused: no scene is open, the object has no pose, or the record is not in the world frame.
        """
        if record.parent != "world":
            raise RequestRefused(
                "The calibration is stated in the frame of {parent}. Give a pose in this frame.", parent=record.parent
            )
        self._session.require_scene_open()
        found = self._session.document.scene_object(record.object_id)
        if isinstance(found.pose, Unset):
            raise RequestRefused("{name} has no pose.", name=found.name)
        return found.pose
