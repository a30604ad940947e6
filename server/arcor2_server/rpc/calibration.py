"""Requests that calibrate cameras and robots (protocol, 7.1, 7.2, 7.5)."""

from dataclasses import dataclass

from arcor2_hw.data.camera import EstimatedPose, MarkerCorners
from arcor2_hw.data.events import ProcessStateData, ProcessStateEnum
from arcor2_hw.data.rpc import CalibrateCameraArgs, CalibrateRobotArgs, GetCameraPoseArgs, MarkersCornersArgs
from arcor2_server.documents import Session
from arcor2_server.online.cameras import picture_file
from arcor2_server.online.online_scene import OnlineScene
from arcor2_server.online.scene_calibration import CAMERA_CALIBRATION, ROBOT_CALIBRATION, SceneCalibration
from arcor2_server.rpc.registry import Context, rpc
from arcor2_server.workspace.calibration import Calibration


@dataclass(frozen=True, slots=True)
class CalibrationRequests:
    """Requests that calibrate cameras and robots (protocol, 7.1, 7.2, 7.5)."""

    _session: Session
    _online: OnlineScene
    _calibration: Calibration
    _scene_calibration: SceneCalibration

    @rpc("GetCameraPose")
    async def get_camera_pose(self, context: Context, args: GetCameraPoseArgs) -> EstimatedPose:
        """Return the pose of a camera from the markers in a picture."""
        found = await self._calibration.camera(args.camera_parameters, [picture_file(args.image)])
        return found.estimated(inverse=args.inverse)

    @rpc("MarkersCorners")
    async def markers_corners(self, context: Context, args: MarkersCornersArgs) -> list[MarkerCorners]:
        """Return the corners of the markers in a picture."""
        return await self._calibration.markers(args.camera_parameters, picture_file(args.image))

    @rpc("CalibrateCamera")
    async def calibrate_camera(self, context: Context, args: CalibrateCameraArgs) -> None:
        """Set the pose of a camera from pictures of markers. ProcessState reports the progress."""
        self._session.require_scene_open()
        self._online.require_online()
        await self._scene_calibration.start_camera(context.user, args.id)
        context.emit("ProcessState", ProcessStateData(CAMERA_CALIBRATION, ProcessStateEnum.STARTED))

    @rpc("CalibrateRobot")
    async def calibrate_robot(self, context: Context, args: CalibrateRobotArgs) -> None:
        """Set the pose of a robot from a depth picture. ProcessState reports the progress."""
        self._session.require_scene_open()
        self._online.require_online()
        await self._scene_calibration.start_robot(
            context.user,
            args.robot_id,
            args.camera_id,
            move=args.move_to_calibration_pose,
            requested_at=context.received_at,
        )
        context.emit("ProcessState", ProcessStateData(ROBOT_CALIBRATION, ProcessStateEnum.STARTED))
