"""Requests about records of calibrations: listed, and compared with where something is now (docs/protocol.md)."""

import msgspec

from arcor2_hw.calibration.records import check_against
from arcor2_hw.data.base import Unset
from arcor2_hw.data.calibration import CalibrationCheck, CalibrationRecord
from arcor2_hw.data.geometry import Pose
from arcor2_hw.data.rpc import CheckCalibrationArgs, ListCalibrationsArgs, ListCalibrationsData
from arcor2_server.errors import RequestRefused
from arcor2_server.rpc.registry import Context, rpc
from arcor2_server.services import Services


@rpc("ListCalibrations")
async def list_calibrations(context: Context, args: ListCalibrationsArgs) -> ListCalibrationsData:
    """Give the newest records of calibrations."""
    given = {name: value for name, value in msgspec.structs.asdict(args).items() if not isinstance(value, Unset)}
    return ListCalibrationsData(await context.services.calibration_records.find(**given))


@rpc("CheckCalibration")
async def check_calibration(context: Context, args: CheckCalibrationArgs) -> CalibrationCheck:
    """Compare a pose measured now, or the one in the open scene, with that of a record."""
    record = await context.services.calibration_records.get(args.id)
    pose = _present(context.services, record) if isinstance(args.pose, Unset) else args.pose
    return check_against(record, pose, distance_limit=args.distance_limit, angle_limit=args.angle_limit)


def _present(services: Services, record: CalibrationRecord) -> Pose:
    """Give where the object of a record is in the open scene. RequestRefused, NotFound."""
    if record.parent != "world":
        raise RequestRefused(f"The calibration is stated in the frame of {record.parent}: give a pose in that.")
    services.session.require_scene_open()
    found = services.session.scene_object(record.object_id)
    if isinstance(found.pose, Unset):
        raise RequestRefused(f"{found.name} has no pose.")
    return found.pose
