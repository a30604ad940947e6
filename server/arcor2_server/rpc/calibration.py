"""Requests that find out where cameras and robots stand (protocol, 7.1, 7.2, 7.5)."""

from collections.abc import Awaitable, Callable
from typing import Final

import msgspec
import structlog
from msgspec.structs import replace

from arcor2_hw.data.base import UNSET, Unset
from arcor2_hw.data.camera import CameraParameters, EstimatedPose, MarkerCorners
from arcor2_hw.data.events import ChangeType, ProcessStateData, ProcessStateEnum
from arcor2_hw.data.geometry import Pose
from arcor2_hw.data.rpc import CalibrateCameraArgs, CalibrateRobotArgs, GetCameraPoseArgs, MarkersCornersArgs
from arcor2_hw.data.scene import SceneObject
from arcor2_hw.exceptions import Arcor2Error, InvalidData
from arcor2_server.calibration import RobotView
from arcor2_server.cell.motion import require_not_moving
from arcor2_server.rpc.cameras import PICTURE_WITHIN, camera_parameters, require_camera
from arcor2_server.rpc.editing import require_held
from arcor2_server.rpc.registry import Context, RequestRefused, make_event, rpc
from arcor2_server.services import Services
from arcor2_server.session.changes import Kind

log = structlog.get_logger(__name__)

CAMERA_CALIBRATION: Final = "CameraCalibration"
ROBOT_CALIBRATION: Final = "RobotCalibration"
TO_CALIBRATION_POSE: Final = "move_to_calibration_pose"


# ------------------------------------------------------------------------------------------------ given pictures
def _file(image: str) -> bytes:
    """Give the picture's file, whose bytes came as one character each."""
    try:
        data = image.encode("latin-1")
    except UnicodeEncodeError:
        raise InvalidData("The image is no picture's bytes: it has characters beyond 255.") from None
    if not data:
        raise InvalidData("The image is empty.")
    return data


@rpc("GetCameraPose")
async def get_camera_pose(context: Context, args: GetCameraPoseArgs) -> EstimatedPose:
    """Give where a camera stands by the markers in its picture."""
    calibration = context.services.calibration
    return await calibration.camera_pose(args.camera_parameters, _file(args.image), inverse=args.inverse)


@rpc("MarkersCorners")
async def markers_corners(context: Context, args: MarkersCornersArgs) -> list[MarkerCorners]:
    """Give where markers are in a picture."""
    return await context.services.calibration.marker_corners(args.camera_parameters, _file(args.image))


# ------------------------------------------------------------------------------------------------ objects of the scene
@rpc("CalibrateCamera")
async def calibrate_camera(context: Context, args: CalibrateCameraArgs) -> None:
    """Put a camera where its picture says that it stands; ProcessState tells how it goes."""
    services = context.services
    services.session.require_scene_open()
    services.cell.require_online()
    camera = require_camera(services, args.id)
    parameters = await camera_parameters(services, camera)
    require_held(context, args.id)
    services.calibrations.begin(camera.id, camera.name)

    async def find() -> Pose:
        image = await _picture(services, camera, "color_image")
        return (await services.calibration.camera_pose(parameters, image)).pose

    _begin(context, camera, CAMERA_CALIBRATION, find)


@rpc("CalibrateRobot")
async def calibrate_robot(context: Context, args: CalibrateRobotArgs) -> None:
    """Put a robot where a camera sees it; ProcessState tells how it goes."""
    services = context.services
    services.session.require_scene_open()
    services.cell.require_online()
    robot = services.cell.robot(args.robot_id)
    camera = _camera(services, args)
    require_held(context, args.robot_id)
    require_not_moving(services, robot.id)
    services.cell.arm(robot.id, None)
    meta = services.types.robot_meta(robot.type)
    urdf = meta.urdf_package_filename
    if isinstance(urdf, Unset):
        raise RequestRefused(f"{robot.name} has no model (URDF) by which a camera could find it.")
    user = context.user
    await services.locks.acquire(user, camera.id)
    try:
        parameters = await camera_parameters(services, camera)
        require_not_moving(services, robot.id)
        services.calibrations.begin(robot.id, robot.name)
    except BaseException:
        services.locks.release(user, camera.id)
        raise
    moves = args.move_to_calibration_pose and services.types.implements(robot.type, TO_CALIBRATION_POSE)
    if moves:
        services.cell.moving.add(robot.id)

    async def find() -> Pose:
        if moves:
            await services.cell.call(robot.id, TO_CALIBRATION_POSE, control=True)
        view = await _view(services, robot, camera, parameters, urdf)
        return await services.calibration.robot_pose(view, await _picture(services, camera, "depth_image"))

    def end() -> None:
        if moves:
            services.cell.moving.discard(robot.id)
        services.locks.release(user, camera.id)

    _begin(context, robot, ROBOT_CALIBRATION, find, end)


def _camera(services: Services, args: CalibrateRobotArgs) -> SceneObject:
    """Give the camera that is named, or the first one of the scene."""
    if not isinstance(args.camera_id, Unset):
        return require_camera(services, args.camera_id)
    for obj in services.session.require_scene().objects:
        if services.types.derives_from(obj.type, "Camera"):
            return obj
    raise RequestRefused("The scene has no camera that could see the robot.")


async def _view(
    services: Services, robot: SceneObject, camera: SceneObject, parameters: CameraParameters, urdf: str
) -> RobotView:
    if isinstance(robot.pose, Unset) or isinstance(camera.pose, Unset):
        raise RequestRefused(f"{robot.name} and {camera.name} need a pose from which to search.")
    joints = await services.cell.robot_joints(robot.id)
    return RobotView(joints, robot.pose, camera.pose, parameters, urdf)


async def _picture(services: Services, camera: SceneObject, method: str) -> bytes:
    """Take a picture; gives its file."""
    raw = await services.cell.call(camera.id, method, deadline=PICTURE_WITHIN)
    try:
        return _file(msgspec.json.decode(raw, type=str))
    except msgspec.MsgspecError:
        raise Arcor2Error(f"{camera.name} gave no picture.") from None


def _begin(
    context: Context,
    obj: SceneObject,
    process: str,
    find: Callable[[], Awaitable[Pose]],
    end: Callable[[], None] = lambda: None,
) -> None:
    """Answer, tell the start, find the pose, and tell how it ended."""
    services, user = context.services, context.user

    def tell(state: ProcessStateEnum, message: str = "") -> None:
        data = ProcessStateData(process, state, message or UNSET)
        services.hub.broadcast(make_event("ProcessState", data))

    async def whole() -> None:
        try:
            await _place(services, user, obj.id, await find())
        except Arcor2Error as error:
            log.info("calibration failed", process=process, object=obj.name, reason=str(error), detail=error.detail)
            tell(ProcessStateEnum.FAILED, str(error))
        except Exception as error:
            log.exception("calibration failed", process=process, object=obj.name)
            tell(ProcessStateEnum.FAILED, f"An error inside the server: {error}")
        else:
            tell(ProcessStateEnum.FINISHED)
        finally:
            services.calibrations.end(obj.id)
            end()

    context.emit("ProcessState", ProcessStateData(process, ProcessStateEnum.STARTED))
    services.cell.spawn(whole(), f"calibration of {obj.name}")


async def _place(services: Services, user: str, object_id: str, pose: Pose) -> None:
    """Give an object another pose, and the live one too, and tell everybody."""
    session = services.session
    await services.cell.object_pose_changed(object_id, pose)
    obj = replace(session.scene_object(object_id), pose=pose)
    await session.commit(user, [session.document.update(Kind.OBJECT, object_id, obj)])
    services.hub.broadcast(make_event("SceneObjectChanged", obj, ChangeType.UPDATE))
