"""Calibrations beyond the ARCOR2 protocol, over REST (docs/protocol.md)."""

import asyncio
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Any, Final

import msgspec
from msgspec import Meta, field
from msgspec.structs import replace

from arcor2_hw.calibration.camera_results import (
    CameraPose,
    HandEye,
    HandEyeOptions,
    HandEyeSample,
    Intrinsics,
    IntrinsicsOptions,
    LensCheck,
    Mounting,
    PoseOptions,
)
from arcor2_hw.calibration.configuration import CalibrationConfiguration
from arcor2_hw.calibration.layout import CharucoBoard, Layout
from arcor2_hw.calibration.records import CalibrationInput, CalibrationKind, CalibrationRecord
from arcor2_hw.calibration.results import RobotPose, TouchedFrame, TouchedOrientation, TouchedTip
from arcor2_hw.compute import calibration_tasks
from arcor2_hw.compute.calibration_tasks import states_of
from arcor2_hw.data.base import UNSET, Data, Unset
from arcor2_hw.data.camera import CameraParameters
from arcor2_hw.data.geometry import Orientation, Pose, Position
from arcor2_hw.data.robot import Joint
from arcor2_hw.data.role import Role
from arcor2_hw.exceptions import InvalidData
from arcor2_server.compute.workers import Compute
from arcor2_server.rest.calibration_records import RecordAs
from arcor2_server.rest.calibration_service import CALIBRATION, CalibrateRobotArgs, read_args
from arcor2_server.rest.operations import MIB, Binary, Upload, Uploads, operation
from arcor2_server.storage.calibrations import Calibrations
from arcor2_server.workspace.markers import Markers
from arcor2_server.workspace.robots import SceneRobots

MAX_PICTURES: Final = 256 * MIB
"""Maximum size of all pictures of a request, bytes."""
MAX_STATES: Final = 19
"""Maximum number of further joint states of a request."""
MAX_POINTS: Final = 1000
"""Maximum number of points of a request."""

Points = Annotated[list[Position], Meta(max_length=MAX_POINTS)]


# ------------------------------------------------------------------------------------------------ pictures
class LensArgs(Data, frozen=True):
    """Camera parameters. markers, options: by default the configured ones."""

    camera_parameters: CameraParameters
    markers: CalibrationConfiguration | Unset = UNSET
    options: PoseOptions | Unset = UNSET


class CameraArgs(LensArgs, frozen=True):
    """Camera parameters as for the check of the lens. record: whether to store the result."""

    record: RecordAs | Unset = UNSET


class CameraPictureArgs(Data, frozen=True):
    """Camera parameters, and the result of the calibration with this picture."""

    camera_parameters: CameraParameters
    result: CameraPose
    markers: CalibrationConfiguration | Unset = UNSET


class RobotArgs(CalibrateRobotArgs, frozen=True):
    """A robot seen by a camera. distance (m), angle (rad): maximum errors of its assumed pose.

    other_joints: joint values of further states, which check the joints and the model. The pictures are then an equal
    number for each state, in this order.
    """

    other_joints: Annotated[list[list[Joint]], Meta(max_length=MAX_STATES)] = field(default_factory=list)
    distance: Annotated[float, Meta(gt=0, le=1)] = 0.08
    angle: Annotated[float, Meta(gt=0, le=1)] = 0.14
    record: RecordAs | Unset = UNSET


class HandEyeArgs(Data, frozen=True):
    """flanges: poses of the flange in the base frame of the robot, one per picture. target: the calibration target."""

    flanges: list[Pose]
    camera_parameters: CameraParameters
    target: Layout
    mounting: Mounting
    options: HandEyeOptions = HandEyeOptions()
    record: RecordAs | Unset = UNSET


class IntrinsicsArgs(Data, frozen=True):
    """The board in the pictures."""

    board: CharucoBoard
    options: IntrinsicsOptions = IntrinsicsOptions()
    record: RecordAs | Unset = UNSET


async def _pictures(uploads: Uploads) -> list[bytes]:
    return [await asyncio.to_thread(file.read) for file in uploads.files]


_PICTURE_UPLOAD: Final[dict[str, Any]] = {"file": "image", "parts": ("args",), "limit": MAX_PICTURES, "plain": True}


# ------------------------------------------------------------------------------------------------ by touch
class FrameByAxesArgs(Data, frozen=True):
    """A frame's origin, a point on its +x axis, and points in its xy plane on the side of +y; m."""

    origin: Position
    on_x: Position
    in_plane: Points
    record: RecordAs | Unset = UNSET


class FrameByPointsArgs(Data, frozen=True):
    """Points in the frame to be found, and their touched positions, in the same order; m."""

    known: Points
    touched: Points
    record: RecordAs | Unset = UNSET


class TipArgs(Data, frozen=True):
    """Poses of the flange in the robot's base frame, with the tip on one point."""

    flanges: Annotated[list[Pose], Meta(max_length=MAX_POINTS)]
    record: RecordAs | Unset = UNSET


class AlignmentArgs(Data, frozen=True):
    """Orientations of the flange with the tool's axes along those of a reference."""

    flanges: Annotated[list[Orientation], Meta(max_length=MAX_POINTS)]
    reference: Orientation = field(default_factory=Orientation)
    record: RecordAs | Unset = UNSET


class DirectionsArgs(Data, frozen=True):
    """Positions of the tip at one flange orientation: at the start, moved along the tool's +z, and to its +x side."""

    flange: Orientation
    tip: Position
    along_z: Position
    on_x: Position
    record: RecordAs | Unset = UNSET


@dataclass(frozen=True, slots=True)
class CalibrationMethodOperations:
    """Calibrations beyond the ARCOR2 protocol, over REST (docs/protocol.md)."""

    _calibration_records: Calibrations
    _compute: Compute
    _markers: Markers
    _robots: SceneRobots

    # ------------------------------------------------------------------------------------------------ markers
    @operation("GET", "/api/calibration/markers", CALIBRATION, Role.OPERATOR, plain=True)
    async def get_markers(self) -> CalibrationConfiguration:
        """Return the poses of markers and boards in this workplace."""
        return self._markers.configuration

    @operation("PUT", "/api/calibration/markers", CALIBRATION, Role.TECHNICIAN, plain=True)
    async def put_markers(self, body: CalibrationConfiguration) -> None:
        """Replace the poses of markers and boards."""
        await self._markers.set(body)

    def _configured(self, given: CalibrationConfiguration | Unset) -> CalibrationConfiguration:
        return self._markers.configuration if isinstance(given, Unset) else given

    def _view(self, args: LensArgs) -> tuple[CalibrationConfiguration, PoseOptions]:
        """Return the markers and options of a request, by default the configured ones."""
        configuration = self._configured(args.markers)
        return configuration, configuration.options if isinstance(args.options, Unset) else args.options

    @operation("PUT", "/api/calibration/camera", CALIBRATION, Role.TECHNICIAN, **_PICTURE_UPLOAD)
    async def find_camera_pose(self, uploads: Uploads, person: str) -> CameraPose:
        """Return the pose of a camera from pictures of markers, with all errors."""
        args = read_args(uploads.fields["args"], CameraArgs)
        configuration, options = self._view(args)
        pictures = await _pictures(uploads)
        task = calibration_tasks.FindCameraPose(pictures, args.camera_parameters, configuration.layout, options)
        found = await self._compute.run(task)
        parameters = {"camera_parameters": args.camera_parameters, "markers": configuration, "options": options}
        kind = CalibrationKind.CAMERA_POSE
        await self._store(person, args, kind, found, "px", after=found.pose, pictures=pictures, parameters=parameters)
        return found

    @operation("PUT", "/api/calibration/lens", CALIBRATION, Role.TECHNICIAN, **_PICTURE_UPLOAD)
    async def check_lens(self, uploads: Uploads) -> LensCheck:
        """Return whether the focal length of a camera fits pictures of markers, and the one that fits best."""
        args = read_args(uploads.fields["args"], LensArgs)
        configuration, options = self._view(args)
        pictures = await _pictures(uploads)
        task = calibration_tasks.CheckLens(pictures, args.camera_parameters, configuration.layout, options)
        return await self._compute.run(task)

    @operation(
        "PUT",
        "/api/calibration/camera/picture",
        CALIBRATION,
        Role.TECHNICIAN,
        file="image",
        parts=("args",),
        limit=64 * MIB,
        media_type="image/png",
    )
    async def draw_camera_pose(self, upload: Upload) -> Binary:
        """Return the picture of a camera as PNG, with the markers drawn as expected from the camera's pose."""
        args = read_args(upload.fields["args"], CameraPictureArgs)
        picture = await asyncio.to_thread(upload.file.read)
        layout = self._configured(args.markers).layout
        drawn = await self._compute.run(
            calibration_tasks.DrawCameraPose(picture, args.camera_parameters, layout, args.result)
        )
        return Binary(drawn, "image/png", "camera-pose.png")

    @operation("PUT", "/api/calibration/robot", CALIBRATION, Role.TECHNICIAN, **_PICTURE_UPLOAD)
    async def find_robot_pose(self, uploads: Uploads, person: str) -> RobotPose:
        """Return the pose of a robot from depth pictures (16 bit, mm) of a camera with a known pose, with metrics."""
        args = read_args(uploads.fields["args"], RobotArgs)
        pictures = await _pictures(uploads)
        model = replace(self._robots.model_of_uri(args.urdf_uri), base=args.robot_pose)
        first, *others = states_of([args.robot_joints, *args.other_joints], pictures)
        found = await self._compute.run(
            calibration_tasks.FindRobotPose(
                model,
                first.joints,
                first.depth,
                args.camera_parameters,
                args.camera_pose,
                args.distance,
                args.angle,
                others,
            )
        )
        parameters = {"view": replace(args, record=UNSET)}
        kind = CalibrationKind.ROBOT_POSE
        await self._store(person, args, kind, found, after=found.pose, pictures=pictures, parameters=parameters)
        return found

    @operation("PUT", "/api/calibration/hand-eye", CALIBRATION, Role.TECHNICIAN, **_PICTURE_UPLOAD)
    async def find_hand_eye(self, uploads: Uploads, person: str) -> HandEye:
        """Return the pose of a camera mounted on the flange of a robot or next to the robot."""
        args = read_args(uploads.fields["args"], HandEyeArgs)
        pictures = await _pictures(uploads)
        if len(pictures) != len(args.flanges):
            raise InvalidData(
                "There are {count} pictures, but {other_count} poses of the flange.",
                count=len(pictures),
                other_count=len(args.flanges),
            )
        samples = [HandEyeSample(flange, picture) for flange, picture in zip(args.flanges, pictures, strict=True)]
        task = calibration_tasks.FindHandEye(samples, args.camera_parameters, args.target, args.mounting, args.options)
        found = await self._compute.run(task)
        await self._store(person, args, CalibrationKind.HAND_EYE, found, "px", after=found.pose, pictures=pictures)
        return found

    @operation("PUT", "/api/calibration/intrinsics", CALIBRATION, Role.TECHNICIAN, **_PICTURE_UPLOAD)
    async def find_intrinsics(self, uploads: Uploads, person: str) -> Intrinsics:
        """Return focal lengths, principal point and distortion of a camera from pictures of a ChArUco board."""
        args = read_args(uploads.fields["args"], IntrinsicsArgs)
        pictures = await _pictures(uploads)
        found = await self._compute.run(calibration_tasks.FindIntrinsics(pictures, args.board, args.options))
        await self._store(person, args, CalibrationKind.INTRINSICS, found, "px", pictures=pictures)
        return found

    @operation("PUT", "/api/calibration/touch/frame-by-axes", CALIBRATION, Role.TECHNICIAN, plain=True)
    async def frame_by_axes(self, body: FrameByAxesArgs, person: str) -> TouchedFrame:
        """Return a frame from three or more touched points: origin, x axis, xy plane."""
        found = await self._compute.run(calibration_tasks.FrameByAxes(body.origin, body.on_x, body.in_plane))
        await self._store(person, body, CalibrationKind.USER_FRAME, found, after=found.pose)
        return found

    @operation("PUT", "/api/calibration/touch/frame-by-points", CALIBRATION, Role.TECHNICIAN, plain=True)
    async def frame_by_points(self, body: FrameByPointsArgs, person: str) -> TouchedFrame:
        """Return a frame, such as a robot base, from three or more touched points with known positions in it."""
        found = await self._compute.run(calibration_tasks.FrameByPoints(body.known, body.touched))
        await self._store(person, body, CalibrationKind.BASE_FRAME, found, after=found.pose)
        return found

    @operation("PUT", "/api/calibration/touch/tip", CALIBRATION, Role.TECHNICIAN, plain=True)
    async def tip_by_touches(self, body: TipArgs, person: str) -> TouchedTip:
        """Return the position of a tool's tip on the flange, from one point touched in four or more orientations."""
        found = await self._compute.run(calibration_tasks.TipByTouches(body.flanges))
        await self._store(person, body, CalibrationKind.TOOL_TIP, found, after=Pose(found.position))
        return found

    @operation("PUT", "/api/calibration/touch/orientation-by-alignment", CALIBRATION, Role.TECHNICIAN, plain=True)
    async def orientation_by_alignment(self, body: AlignmentArgs, person: str) -> TouchedOrientation:
        """Return a tool's orientation on the flange, from aligning the tool with a reference."""
        found = await self._compute.run(calibration_tasks.OrientationByAlignment(body.flanges, body.reference))
        after = Pose(orientation=found.orientation)
        await self._store(person, body, CalibrationKind.TOOL_ORIENTATION, found, "rad", after=after)
        return found

    @operation("PUT", "/api/calibration/touch/orientation-by-points", CALIBRATION, Role.TECHNICIAN, plain=True)
    async def orientation_by_points(self, body: DirectionsArgs, person: str) -> TouchedOrientation:
        """Return a tool's orientation on the flange, from moving its tip along its +z axis and to its +x side."""
        found = await self._compute.run(
            calibration_tasks.OrientationByPoints(body.flange, body.tip, body.along_z, body.on_x)
        )
        after = Pose(orientation=found.orientation)
        await self._store(person, body, CalibrationKind.TOOL_ORIENTATION, found, "rad", after=after)
        return found

    async def _store(
        self,
        person: str,
        args: Any,
        kind: CalibrationKind,
        found: Any,
        unit: str = "m",
        *,
        after: Pose | Unset = UNSET,
        pictures: Sequence[bytes] = (),
        parameters: dict[str, Any] | None = None,
    ) -> None:
        """Store a record of a calibration if its arguments request it.

        Args:
            person: the user.
            args: the arguments; `record` states the object.
            kind: the kind of calibration.
            found: the result.
            unit: unit of its residual.
            after: its pose, if it has one.
            pictures: the pictures that it is computed from.
            parameters: its other inputs, by default the arguments.
        """
        record_as: RecordAs | Unset = args.record
        if isinstance(record_as, Unset):
            return
        result: dict[str, Any] = msgspec.to_builtins(found)
        result.pop("picture", None)  # the picture can be drawn again
        await self._calibration_records.put(
            CalibrationRecord(
                kind,
                person,
                record_as.object_id,
                record_as.object_name or record_as.object_id,
                record_as.parent,
                found.verdict,
                residual=found.residual,
                residual_unit=unit,
                inputs=[CalibrationInput.of(f"picture {number}", each) for number, each in enumerate(pictures, 1)],
                parameters=msgspec.to_builtins(parameters or {"args": replace(args, record=UNSET)}),
                result=result,
                key=getattr(found, "key", UNSET),
                values=getattr(found, "values", UNSET),
                before=record_as.before,
                after=after,
                applied=record_as.applied,
            )
        )
