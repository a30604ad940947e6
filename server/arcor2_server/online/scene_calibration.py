"""Calibration of the cameras and robots of the online scene."""

import functools
from collections.abc import Awaitable, Callable
from dataclasses import dataclass, field
from typing import Final

import msgspec
import structlog
from msgspec.structs import replace

from arcor2_hw.calibration.records import CalibrationInput, CalibrationKind, CalibrationRecord
from arcor2_hw.collision.description import RobotSource
from arcor2_hw.data.base import Unset
from arcor2_hw.data.camera import CameraParameters
from arcor2_hw.data.editor import TaskKind
from arcor2_hw.data.events import ChangeType, ProcessStateData, ProcessStateEnum
from arcor2_hw.data.geometry import Pose
from arcor2_hw.data.scene import SceneObject
from arcor2_hw.exceptions import Arcor2Error
from arcor2_hw.messages import Message
from arcor2_server.collaboration.locks import Locks
from arcor2_server.collaboration.tasks import Tasks
from arcor2_server.documents import Session
from arcor2_server.documents.changes import Kind
from arcor2_server.errors import RequestRefused
from arcor2_server.events import EventHub, make_event
from arcor2_server.object_types.registry import ObjectTypes
from arcor2_server.online.cameras import Cameras
from arcor2_server.online.motion import RobotMotion
from arcor2_server.online.online_scene import OnlineScene
from arcor2_server.storage.calibrations import Calibrations
from arcor2_server.workspace.calibration import Calibration, RobotView
from arcor2_server.workspace.markers import Markers
from arcor2_server.workspace.robot_models import RobotModels

log = structlog.get_logger(__name__)

CAMERA_CALIBRATION: Final = "CameraCalibration"
"""Name of the camera calibration in ProcessState events."""
ROBOT_CALIBRATION: Final = "RobotCalibration"
"""Name of the robot calibration in ProcessState events."""
MOVE_METHOD: Final = "move_to_calibration_pose"
"""Method of robots that have a pose in which they are well visible for a camera."""
PICTURES: Final = 3
"""Number of pictures for a camera calibration. Averaging reduces the noise of a single picture."""
DEPTH_FRAMES: Final = 10
"""Number of frames that the camera averages into one depth picture."""
STANDSTILL: Final = 0.002
"""Maximum change of a joint while a picture is taken, rad or m."""

Report = Callable[[float, str | Message], None]
Find = Callable[[Report], Awaitable[tuple[Pose, CalibrationRecord]]]
"""Measures an object; returns its pose and the record of the calibration."""


@dataclass(frozen=True, slots=True)
class SceneCalibration:
    """Calibrates the cameras and robots of the online scene, each at most once at a time.

    A calibration continues in the background after the request. It sets the pose of the object and stores a record;
    ProcessState reports its end.
    """

    _hub: EventHub
    _locks: Locks
    _types: ObjectTypes
    _session: Session
    _online: OnlineScene
    _calibration: Calibration
    _records: Calibrations
    _markers: Markers
    _tasks: Tasks
    _robot_models: RobotModels
    _motion: RobotMotion
    _cameras: Cameras
    _running: set[str] = field(init=False, default_factory=set)

    # ------------------------------------------------------------------------------------------------ cameras
    async def start_camera(self, user: str, camera_id: str) -> None:
        """Start to find the pose of a camera from pictures of markers.

        Raises:
            NotFound: the scene has no such object.
            RequestRefused: it is not a camera, or is being calibrated, or the user has not locked it.
        """
        camera = self._cameras.require_camera(camera_id)
        parameters = await self._cameras.camera_parameters(camera)
        self._locks.require_held(user, camera_id)
        self._require_idle(camera)
        find = functools.partial(self._find_camera, user, camera, parameters)
        self._start(user, camera, CAMERA_CALIBRATION, find)

    async def _find_camera(
        self, user: str, camera: SceneObject, parameters: CameraParameters, on_progress: Report
    ) -> tuple[Pose, CalibrationRecord]:
        pictures = []
        for number in range(PICTURES):
            on_progress(
                0.1 * number, Message.of("taking picture {number} of {count}", number=number + 1, count=PICTURES)
            )
            pictures.append(await self._cameras.take_picture(camera, "color_image"))
        on_progress(0.1 * PICTURES, Message.of("looking for the markers"))
        expected = None if isinstance(camera.pose, Unset) else camera.pose
        found = await self._calibration.camera(parameters, pictures, expected=expected)
        return found.pose, CalibrationRecord(
            CalibrationKind.CAMERA_POSE,
            user,
            camera.id,
            camera.name,
            "world",
            found.verdict,
            residual=found.residual,
            residual_unit="px",
            inputs=[CalibrationInput.of(f"picture {number}", each) for number, each in enumerate(pictures, 1)],
            parameters={
                "camera_parameters": msgspec.to_builtins(parameters),
                "markers": msgspec.to_builtins(self._markers.configuration),
            },
            result=msgspec.to_builtins(found),
            key=found.key,
            values=found.values,
            before=camera.pose,
            after=found.pose,
        )

    # ------------------------------------------------------------------------------------------------ robots
    async def start_robot(
        self, user: str, robot_id: str, camera_id: str | Unset, *, move: bool, requested_at: float
    ) -> None:
        """Start to find the pose of a robot from a depth picture.

        Args:
            user: the user, who must hold the lock of the robot.
            robot_id: the robot.
            camera_id: the camera, which is locked during the calibration; the first camera of the scene if unset.
            move: whether the robot first moves to its calibration pose, if it has one.
            requested_at: time of the request, s of the monotonic clock.

        Raises:
            NotFound: the scene has no such object.
            RequestRefused: an object is not of the needed kind, the robot has no model, moves or is being calibrated,
                or a lock is missing.
        """
        robot = self._online.robot(robot_id)
        camera = self._camera(camera_id)
        self._locks.require_held(user, robot_id)
        self._motion.require_not_moving(robot.id)
        self._online.arm(robot.id, None)
        model = self._robot_models.require(robot, "to find it with a camera")
        await self._locks.acquire(user, camera.id)
        try:
            parameters = await self._cameras.camera_parameters(camera)
            self._motion.require_not_moving(robot.id)
            self._require_idle(robot)
        except BaseException:
            self._locks.release(user, camera.id)
            raise
        moves = move and self._types.implements(robot.type, MOVE_METHOD)
        if moves:
            self._online.moving.add(robot.id)

        async def find(on_progress: Report) -> tuple[Pose, CalibrationRecord]:
            if moves:
                on_progress(0.0, Message.of("{robot} moves to its calibration pose", robot=robot.name))
                await self._online.call(robot.id, MOVE_METHOD, control=True, requested_at=requested_at)
            return await self._find_robot(user, robot, camera, parameters, model, on_progress)

        def end() -> None:
            if moves:
                self._online.moving.discard(robot.id)
            self._locks.release(user, camera.id)

        self._start(user, robot, ROBOT_CALIBRATION, find, end)

    def _camera(self, camera_id: str | Unset) -> SceneObject:
        if not isinstance(camera_id, Unset):
            return self._cameras.require_camera(camera_id)
        for obj in self._session.require_scene().objects:
            if self._types.derives_from(obj.type, "Camera"):
                return obj
        raise RequestRefused("The scene has no camera.")

    async def _find_robot(
        self,
        user: str,
        robot: SceneObject,
        camera: SceneObject,
        parameters: CameraParameters,
        model: RobotSource,
        on_progress: Report,
    ) -> tuple[Pose, CalibrationRecord]:
        if isinstance(robot.pose, Unset) or isinstance(camera.pose, Unset):
            raise RequestRefused(
                "{name} and {camera_name} need a pose, where the search starts.",
                name=robot.name,
                camera_name=camera.name,
            )
        joints = await self._online.robot_joints(robot.id)
        view = RobotView(joints, robot.pose, camera.pose, parameters)
        on_progress(0.2, Message.of("{camera} takes a depth picture", camera=camera.name))
        depth = await self._cameras.take_picture(camera, "depth_image", averaged_frames=DEPTH_FRAMES)
        after = await self._online.robot_joints(robot.id)
        if any(abs(one.value - other.value) > STANDSTILL for one, other in zip(joints, after, strict=False)):
            raise RequestRefused("{name} moved while the picture was taken.", name=robot.name)
        found = await self._calibration.robot(
            model, view, [depth], on_progress=lambda share, text: on_progress(0.3 + 0.7 * share, text)
        )
        return found.pose, CalibrationRecord(
            CalibrationKind.ROBOT_POSE,
            user,
            robot.id,
            robot.name,
            "world",
            found.verdict,
            residual=found.residual,
            inputs=[CalibrationInput.of("depth picture", depth), CalibrationInput("model", "", 0, model.urdf.name)],
            parameters={"view": msgspec.to_builtins(view), "camera_id": camera.id, "camera_name": camera.name},
            result=msgspec.to_builtins(found),
            key=found.key,
            values=found.values,
            before=robot.pose,
            after=found.pose,
        )

    # ------------------------------------------------------------------------------------------------ both
    def _require_idle(self, obj: SceneObject) -> None:
        if obj.id in self._running:
            raise RequestRefused("{name} is being calibrated already.", name=obj.name)

    def _start(
        self, user: str, obj: SceneObject, process: str, find: Find, end: Callable[[], None] = lambda: None
    ) -> None:
        """Run a calibration in the background; call `end` afterwards in any case."""

        def publish(state: ProcessStateEnum, message: Message | None = None) -> None:
            data = ProcessStateData(process, state)
            if message is not None:
                data = ProcessStateData(process, state, message.text, **message.translation())
            self._hub.broadcast(make_event("ProcessState", data))

        async def run() -> None:
            verdict: Message | None = None
            try:
                with self._tasks.running(
                    TaskKind.CALIBRATION, Message.of("Calibration of {name}", name=obj.name), user
                ) as task:
                    pose, record = await find(task.at)
                    await self._set_pose(user, obj.id, pose)
                    await self._records.put(record)
                    verdict = record.as_message(record.verdict)
                    task.at(1.0, verdict)
            except Arcor2Error as error:
                log.info("calibration failed", process=process, object=obj.name, reason=str(error), detail=error.detail)
                publish(ProcessStateEnum.FAILED, error.message)
            except Exception as error:
                log.exception("calibration failed", process=process, object=obj.name)
                message = Message.of("An error inside the server: {reason}", reason=error)
                publish(ProcessStateEnum.FAILED, message)
            else:
                publish(ProcessStateEnum.FINISHED, verdict)
            finally:
                self._running.discard(obj.id)
                end()

        self._running.add(obj.id)
        self._online.background.spawn(run(), f"calibration of {obj.name}")

    async def _set_pose(self, user: str, object_id: str, pose: Pose) -> None:
        """Set the pose of an object and of its device, and publish the change."""
        session = self._session
        await self._online.object_pose_changed(object_id, pose)
        obj = replace(session.document.scene_object(object_id), pose=pose)
        await session.commit(user, [session.document.update(Kind.OBJECT, object_id, obj)])
        self._hub.broadcast(make_event("SceneObjectChanged", obj, ChangeType.UPDATE))
