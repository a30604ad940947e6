"""Requests that calibrate cameras and robots (protocol, 7.1, 7.2, 7.5)."""

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
from arcor2_server.collaboration.locks import Locks
from arcor2_server.collaboration.tasks import Tasks
from arcor2_server.compute.process import ProgressCallback
from arcor2_server.documents import Session
from arcor2_server.documents.changes import Kind
from arcor2_server.errors import RequestRefused
from arcor2_server.events import EventHub, make_event
from arcor2_server.object_types.registry import ObjectTypes
from arcor2_server.online.cameras import Cameras
from arcor2_server.online.motion import RobotMotion
from arcor2_server.online.online_scene import OnlineScene
from arcor2_server.rpc.cameras import PICTURE_WITHIN
from arcor2_server.rpc.editing import Editing
from arcor2_server.rpc.registry import Context, rpc
from arcor2_server.storage.calibrations import Calibrations
from arcor2_server.workspace.calibration import Calibration, RobotView, RunningCalibrations
from arcor2_server.workspace.markers import Markers
from arcor2_server.workspace.robot_models import RobotModels
from arcor2_server.workspace.robots import SceneRobots

log = structlog.get_logger(__name__)

CAMERA_CALIBRATION: Final = "CameraCalibration"
ROBOT_CALIBRATION: Final = "RobotCalibration"
TO_CALIBRATION_POSE: Final = "move_to_calibration_pose"
PICTURES: Final = 3
"""Pictures of a camera that is calibrated: the mean of a few halves the noise of one."""
STILL: Final = 0.002
"""rad or m: a joint that changed by more while the picture was taken has moved."""
DEPTH_FRAMES: Final = 10
"""Number of frames that a camera averages into one depth picture."""


# ------------------------------------------------------------------------------------------------ given pictures
def _file(image: str) -> bytes:
    """Return the file of a picture whose bytes were sent as one character each."""
    try:
        data = image.encode("latin-1")
    except UnicodeEncodeError:
        raise InvalidData("The image is no picture's bytes: it has characters beyond 255.") from None
    if not data:
        raise InvalidData("The image is empty.")
    return data


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


Find = Callable[[ProgressCallback], Awaitable[Outcome]]


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


class CalibrationRequests:
    """Requests that find out where cameras and robots stand (protocol, 7.1, 7.2, 7.5)."""

    def __init__(
        self,
        hub: EventHub,
        locks: Locks,
        types: ObjectTypes,
        session: Session,
        online: OnlineScene,
        calibration: Calibration,
        calibration_records: Calibrations,
        markers: Markers,
        running_calibrations: RunningCalibrations,
        tasks: Tasks,
        robots: SceneRobots,
        robot_models: RobotModels,
        motion: RobotMotion,
        editing: Editing,
        cameras: Cameras,
    ) -> None:
        self._hub = hub
        self._locks = locks
        self._types = types
        self._session = session
        self._online = online
        self._calibration = calibration
        self._calibration_records = calibration_records
        self._markers = markers
        self._running_calibrations = running_calibrations
        self._tasks = tasks
        self._robots = robots
        self._robot_models = robot_models
        self._motion = motion
        self._editing = editing
        self._cameras = cameras

    @rpc("GetCameraPose")
    async def get_camera_pose(self, context: Context, args: GetCameraPoseArgs) -> EstimatedPose:
        """Return the pose of a camera from the markers in its picture."""
        found = await self._calibration.camera(args.camera_parameters, [_file(args.image)])
        return found.estimated(inverse=args.inverse)

    @rpc("MarkersCorners")
    async def markers_corners(self, context: Context, args: MarkersCornersArgs) -> list[MarkerCorners]:
        """Return where markers are in a picture."""
        return await self._calibration.markers(args.camera_parameters, _file(args.image))

    @rpc("CalibrateCamera")
    async def calibrate_camera(self, context: Context, args: CalibrateCameraArgs) -> None:
        """Move a camera to the pose computed from its picture; ProcessState reports the progress."""
        self._session.require_scene_open()
        self._online.require_online()
        camera = self._cameras.require_camera(args.id)
        parameters = await self._cameras.camera_parameters(camera)
        self._editing.require_held(context, args.id)
        self._running_calibrations.begin(camera.id, camera.name)

        async def find(on_progress: ProgressCallback) -> Outcome:
            pictures = []
            for number in range(PICTURES):
                on_progress(0.1 * number, f"taking picture {number + 1} of {PICTURES}")
                pictures.append(await self._picture(camera, "color_image"))
            on_progress(0.1 * PICTURES, "looking for the markers")
            expected = None if isinstance(camera.pose, Unset) else camera.pose
            found = await self._calibration.camera(parameters, pictures, expected=expected)
            return Outcome(
                CalibrationKind.CAMERA_POSE,
                found.pose,
                found.verdict,
                found.residual,
                "px",
                [CalibrationInput.of(f"picture {number}", each) for number, each in enumerate(pictures, 1)],
                {
                    "camera_parameters": msgspec.to_builtins(parameters),
                    "markers": msgspec.to_builtins(self._markers.configuration),
                },
                msgspec.to_builtins(found),
            )

        self._begin(context, camera, CAMERA_CALIBRATION, find)

    @rpc("CalibrateRobot")
    async def calibrate_robot(self, context: Context, args: CalibrateRobotArgs) -> None:
        """Put a robot where a camera sees it; ProcessState tells how it goes."""
        self._session.require_scene_open()
        self._online.require_online()
        robot = self._online.robot(args.robot_id)
        camera = self._camera(args)
        self._editing.require_held(context, args.robot_id)
        self._motion.require_not_moving(robot.id)
        self._online.arm(robot.id, None)
        model = self._robot_models.require(robot, "to find it with a camera")
        user = context.user
        await self._locks.acquire(user, camera.id)
        try:
            parameters = await self._cameras.camera_parameters(camera)
            self._motion.require_not_moving(robot.id)
            self._running_calibrations.begin(robot.id, robot.name)
        except BaseException:
            self._locks.release(user, camera.id)
            raise
        moves = args.move_to_calibration_pose and self._types.implements(robot.type, TO_CALIBRATION_POSE)
        if moves:
            self._online.moving.add(robot.id)

        async def find(on_progress: ProgressCallback) -> Outcome:
            if moves:
                on_progress(0.0, f"{robot.name} moves to where it is seen well")
                await self._online.call(robot.id, TO_CALIBRATION_POSE, control=True, requested_at=context.received_at)
            return await self._seen(robot, camera, parameters, model, on_progress)

        def end() -> None:
            if moves:
                self._online.moving.discard(robot.id)
            self._locks.release(user, camera.id)

        self._begin(context, robot, ROBOT_CALIBRATION, find, end)

    async def _seen(
        self,
        robot: SceneObject,
        camera: SceneObject,
        parameters: CameraParameters,
        model: RobotSource,
        on_progress: ProgressCallback,
    ) -> Outcome:
        """Take a depth picture and find the robot in it."""
        view = await self._view(robot, camera, parameters)
        on_progress(0.2, f"{camera.name} takes a depth picture")
        depth = await self._picture(camera, "depth_image", averaged_frames=DEPTH_FRAMES)
        after = await self._online.robot_joints(robot.id)
        if any(abs(one.value - other.value) > STILL for one, other in zip(view.robot_joints, after, strict=False)):
            raise RequestRefused("{name} moved while the picture was taken.", name=robot.name)
        found = await self._calibration.robot(
            model, view, [depth], on_progress=lambda share, text: on_progress(0.3 + 0.7 * share, text)
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

    def _camera(self, args: CalibrateRobotArgs) -> SceneObject:
        """Return the camera that is named, or the first one of the scene."""
        if not isinstance(args.camera_id, Unset):
            return self._cameras.require_camera(args.camera_id)
        for obj in self._session.require_scene().objects:
            if self._types.derives_from(obj.type, "Camera"):
                return obj
        raise RequestRefused("The scene has no camera that could see the robot.")

    async def _view(self, robot: SceneObject, camera: SceneObject, parameters: CameraParameters) -> RobotView:
        if isinstance(robot.pose, Unset) or isinstance(camera.pose, Unset):
            raise RequestRefused(
                "{name} and {camera_name} need a pose from which to search.", name=robot.name, camera_name=camera.name
            )
        joints = await self._online.robot_joints(robot.id)
        return RobotView(joints, robot.pose, camera.pose, parameters)

    async def _picture(self, camera: SceneObject, method: str, **arguments: int) -> bytes:
        """Take a picture; return its file."""
        raw = await self._online.call(camera.id, method, arguments, deadline=PICTURE_WITHIN)
        try:
            return _file(msgspec.json.decode(raw, type=str))
        except msgspec.MsgspecError:
            raise Arcor2Error("{name} gave no picture.", name=camera.name) from None

    def _begin(
        self, context: Context, obj: SceneObject, process: str, find: Find, end: Callable[[], None] = lambda: None
    ) -> None:
        """Answer, publish the start, compute the pose, store a record, and publish the end."""
        user = context.user

        def emit_changes(state: ProcessStateEnum, message: str = "") -> None:
            data = ProcessStateData(process, state, message or UNSET)
            self._hub.broadcast(make_event("ProcessState", data))

        async def whole() -> None:
            verdict = ""
            try:
                with self._tasks.running(TaskKind.CALIBRATION, f"Calibration of {obj.name}", user) as task:
                    outcome = await find(task.at)
                    await self._place(user, obj.id, outcome.pose)
                    await self._calibration_records.put(_record(obj, user, outcome))
                    verdict = outcome.verdict
                    task.at(1.0, verdict)
            except Arcor2Error as error:
                log.info("calibration failed", process=process, object=obj.name, reason=str(error), detail=error.detail)
                emit_changes(ProcessStateEnum.FAILED, str(error))
            except Exception as error:
                log.exception("calibration failed", process=process, object=obj.name)
                emit_changes(ProcessStateEnum.FAILED, f"An error inside the server: {error}")
            else:
                emit_changes(ProcessStateEnum.FINISHED, verdict)
            finally:
                self._running_calibrations.end(obj.id)
                end()

        context.emit("ProcessState", ProcessStateData(process, ProcessStateEnum.STARTED))
        self._online.spawn(whole(), f"calibration of {obj.name}")

    async def _place(self, user: str, object_id: str, pose: Pose) -> None:
        """Set the pose of an object and of its live instance, and publish the change."""
        session = self._session
        await self._online.object_pose_changed(object_id, pose)
        obj = replace(session.document.scene_object(object_id), pose=pose)
        await session.commit(user, [session.document.update(Kind.OBJECT, object_id, obj)])
        self._hub.broadcast(make_event("SceneObjectChanged", obj, ChangeType.UPDATE))
