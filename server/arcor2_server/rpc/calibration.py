"""Requests that find out where cameras and robots stand (protocol, 7.1, 7.2, 7.5)."""

from collections.abc import Awaitable, Callable
from typing import Any, Final

import msgspec
import structlog
from msgspec.structs import replace

from arcor2_hw.calibration.records import CalibrationInput, CalibrationKind, CalibrationRecord
from arcor2_hw.collision.description import RobotSource
from arcor2_hw.data.base import UNSET, Data, Unset
from arcor2_hw.data.camera import CameraParameters, EstimatedPose, MarkerCorners
from arcor2_hw.data.editor import TaskKind
from arcor2_hw.data.events import ChangeType, ProcessStateData, ProcessStateEnum
from arcor2_hw.data.geometry import Pose
from arcor2_hw.data.rpc import CalibrateCameraArgs, CalibrateRobotArgs, GetCameraPoseArgs, MarkersCornersArgs
from arcor2_hw.data.scene import SceneObject
from arcor2_hw.exceptions import Arcor2Error, InvalidData
from arcor2_server.compute.calibration import RobotView
from arcor2_server.compute.process import Told
from arcor2_server.documents.changes import Kind
from arcor2_server.errors import RequestRefused
from arcor2_server.events import make_event
from arcor2_server.online.motion import require_not_moving
from arcor2_server.rpc.cameras import PICTURE_WITHIN, camera_parameters, require_camera
from arcor2_server.rpc.editing import require_held
from arcor2_server.rpc.registry import Context, rpc
from arcor2_server.services import Services
from arcor2_server.workspace.robot_models import model_of

log = structlog.get_logger(__name__)

CAMERA_CALIBRATION: Final = "CameraCalibration"
ROBOT_CALIBRATION: Final = "RobotCalibration"
TO_CALIBRATION_POSE: Final = "move_to_calibration_pose"
PICTURES: Final = 3
"""Pictures of a camera that is calibrated: the mean of a few halves the noise of one."""
STILL: Final = 0.002
"""rad or m: a joint that changed by more while the picture was taken has moved."""
DEPTH_FRAMES: Final = 10
"""Frames of which a camera gives the mean as one depth picture."""


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
    found = await context.services.calibration.camera(args.camera_parameters, [_file(args.image)])
    return found.estimated(inverse=args.inverse)


@rpc("MarkersCorners")
async def markers_corners(context: Context, args: MarkersCornersArgs) -> list[MarkerCorners]:
    """Give where markers are in a picture."""
    return await context.services.calibration.markers(args.camera_parameters, _file(args.image))


# ------------------------------------------------------------------------------------------------ objects of the scene
class Outcome(Data, frozen=True):
    """What a calibration found out, and from what."""

    kind: CalibrationKind
    pose: Pose
    verdict: str
    residual: float
    unit: str
    inputs: list[CalibrationInput]
    parameters: dict[str, Any]
    result: dict[str, Any]


Find = Callable[[Told], Awaitable[Outcome]]


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

    async def find(told: Told) -> Outcome:
        pictures = []
        for number in range(PICTURES):
            told(0.1 * number, f"taking picture {number + 1} of {PICTURES}")
            pictures.append(await _picture(services, camera, "color_image"))
        told(0.1 * PICTURES, "looking for the markers")
        expected = None if isinstance(camera.pose, Unset) else camera.pose
        found = await services.calibration.camera(parameters, pictures, expected=expected)
        return Outcome(
            CalibrationKind.CAMERA_POSE,
            found.pose,
            found.verdict,
            found.residual,
            "px",
            [CalibrationInput.of(f"picture {number}", each) for number, each in enumerate(pictures, 1)],
            {
                "camera_parameters": msgspec.to_builtins(parameters),
                "markers": msgspec.to_builtins(services.markers.configuration),
            },
            msgspec.to_builtins(found),
        )

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
    model = model_of(services, robot, "by which a camera could find it")
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

    async def find(told: Told) -> Outcome:
        if moves:
            told(0.0, f"{robot.name} moves to where it is seen well")
            await services.cell.call(robot.id, TO_CALIBRATION_POSE, control=True, requested_at=context.received_at)
        return await _seen(services, robot, camera, parameters, model, told)

    def end() -> None:
        if moves:
            services.cell.moving.discard(robot.id)
        services.locks.release(user, camera.id)

    _begin(context, robot, ROBOT_CALIBRATION, find, end)


async def _seen(
    services: Services,
    robot: SceneObject,
    camera: SceneObject,
    parameters: CameraParameters,
    model: RobotSource,
    told: Told,
) -> Outcome:
    """Take a depth picture and find the robot in it."""
    view = await _view(services, robot, camera, parameters)
    told(0.2, f"{camera.name} takes a depth picture")
    depth = await _picture(services, camera, "depth_image", averaged_frames=DEPTH_FRAMES)
    after = await services.cell.robot_joints(robot.id)
    if any(abs(one.value - other.value) > STILL for one, other in zip(view.robot_joints, after, strict=False)):
        raise RequestRefused(f"{robot.name} moved while the picture was taken.")
    found = await services.calibration.robot(
        model, view, [depth], told=lambda share, text: told(0.3 + 0.7 * share, text)
    )
    return Outcome(
        CalibrationKind.ROBOT_POSE,
        found.pose,
        found.verdict,
        found.residual,
        "m",
        [CalibrationInput.of("depth picture", depth), CalibrationInput("model", "", 0, model.urdf.name)],
        {"view": msgspec.to_builtins(view), "camera_id": camera.id, "camera_name": camera.name},
        msgspec.to_builtins(found),
    )


def _camera(services: Services, args: CalibrateRobotArgs) -> SceneObject:
    """Give the camera that is named, or the first one of the scene."""
    if not isinstance(args.camera_id, Unset):
        return require_camera(services, args.camera_id)
    for obj in services.session.require_scene().objects:
        if services.types.derives_from(obj.type, "Camera"):
            return obj
    raise RequestRefused("The scene has no camera that could see the robot.")


async def _view(services: Services, robot: SceneObject, camera: SceneObject, parameters: CameraParameters) -> RobotView:
    if isinstance(robot.pose, Unset) or isinstance(camera.pose, Unset):
        raise RequestRefused(f"{robot.name} and {camera.name} need a pose from which to search.")
    joints = await services.cell.robot_joints(robot.id)
    return RobotView(joints, robot.pose, camera.pose, parameters)


async def _picture(services: Services, camera: SceneObject, method: str, **arguments: int) -> bytes:
    """Take a picture; gives its file."""
    raw = await services.cell.call(camera.id, method, arguments, deadline=PICTURE_WITHIN)
    try:
        return _file(msgspec.json.decode(raw, type=str))
    except msgspec.MsgspecError:
        raise Arcor2Error(f"{camera.name} gave no picture.") from None


def _begin(
    context: Context, obj: SceneObject, process: str, find: Find, end: Callable[[], None] = lambda: None
) -> None:
    """Answer, tell the start, find the pose, keep a record, and tell how it ended."""
    services, user = context.services, context.user

    def tell(state: ProcessStateEnum, message: str = "") -> None:
        data = ProcessStateData(process, state, message or UNSET)
        services.hub.broadcast(make_event("ProcessState", data))

    async def whole() -> None:
        verdict = ""
        try:
            with services.tasks.running(TaskKind.CALIBRATION, f"Calibration of {obj.name}", user) as task:
                outcome = await find(task.at)
                await _place(services, user, obj.id, outcome.pose)
                await services.calibration_records.put(_record(obj, user, outcome))
                verdict = outcome.verdict
                task.at(1.0, verdict)
        except Arcor2Error as error:
            log.info("calibration failed", process=process, object=obj.name, reason=str(error), detail=error.detail)
            tell(ProcessStateEnum.FAILED, str(error))
        except Exception as error:
            log.exception("calibration failed", process=process, object=obj.name)
            tell(ProcessStateEnum.FAILED, f"An error inside the server: {error}")
        else:
            tell(ProcessStateEnum.FINISHED, verdict)
        finally:
            services.calibrations.end(obj.id)
            end()

    context.emit("ProcessState", ProcessStateData(process, ProcessStateEnum.STARTED))
    services.cell.spawn(whole(), f"calibration of {obj.name}")


def _record(obj: SceneObject, user: str, outcome: Outcome) -> CalibrationRecord:
    return CalibrationRecord(
        outcome.kind,
        user,
        obj.id,
        obj.name,
        "world",
        outcome.verdict,
        residual=outcome.residual,
        residual_unit=outcome.unit,
        inputs=outcome.inputs,
        parameters=outcome.parameters,
        result=outcome.result,
        before=obj.pose,
        after=outcome.pose,
    )


async def _place(services: Services, user: str, object_id: str, pose: Pose) -> None:
    """Give an object another pose, and the live one too, and tell everybody."""
    session = services.session
    await services.cell.object_pose_changed(object_id, pose)
    obj = replace(session.scene_object(object_id), pose=pose)
    await session.commit(user, [session.document.update(Kind.OBJECT, object_id, obj)])
    services.hub.broadcast(make_event("SceneObjectChanged", obj, ChangeType.UPDATE))
