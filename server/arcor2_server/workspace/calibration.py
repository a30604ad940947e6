"""Calibration of cameras and robots from pictures, computed by the compute worker."""

from msgspec.structs import replace

from arcor2_hw.calibration.camera_results import CameraPose
from arcor2_hw.calibration.refusals import CalibrationRefused, Reason
from arcor2_hw.calibration.results import RobotPose
from arcor2_hw.collision.description import RobotSource
from arcor2_hw.compute.calibration_tasks import FindCameraPose, FindMarkers, FindRobotPose
from arcor2_hw.data.base import Data
from arcor2_hw.data.camera import CameraParameters, MarkerCorners
from arcor2_hw.data.geometry import Pose
from arcor2_hw.data.robot import Joint
from arcor2_hw.messages import Message
from arcor2_server.compute.process import ProgressCallback
from arcor2_server.compute.workers import Compute
from arcor2_server.workspace.markers import Markers

EXPECTED_POSE_DEVIATION = (0.3, 0.5)
"""Standard deviations of the pose that a camera has in the scene, m and rad, to choose between two solutions."""


class RobotView(Data, frozen=True):
    """A robot seen by a camera with a known pose. `robot_pose`: the assumed pose of the robot."""

    robot_joints: list[Joint]
    robot_pose: Pose
    camera_pose: Pose
    camera_parameters: CameraParameters


class Calibration:
    """Computes poses from picture files in the compute worker, with the configured markers.

    `on_progress` is called with the progress. Methods raise InvalidData for a file that is not a picture,
    CalibrationRefused if the pictures do not determine a pose, NotInstalled, ComputeStopped and ComputeTimeout.
    """

    def __init__(self, compute: Compute, markers: Markers) -> None:
        self._compute = compute
        self._markers = markers

    async def camera(
        self,
        parameters: CameraParameters,
        pictures: list[bytes],
        *,
        expected: Pose | None = None,
        on_progress: ProgressCallback | None = None,
    ) -> CameraPose:
        """Return the pose of a camera that sees the configured markers.

        `expected` is its approximate pose, used only if the markers alone allow two solutions.
        """
        configuration = self._markers.configuration
        if not configuration.markers and not configuration.boards:
            raise CalibrationRefused(
                "No markers are configured. Set their poses (serve --markers, or PUT /api/calibration/markers).",
                reason=Reason.NO_MARKER,
            )
        task = FindCameraPose(pictures, parameters, configuration.layout, configuration.options)
        run = self._compute.run
        try:
            return await run(task, on_progress=on_progress)
        except CalibrationRefused as error:
            if expected is None or error.reason != Reason.AMBIGUOUS:
                raise
        distance, angle = EXPECTED_POSE_DEVIATION
        hinted = replace(task.options, expected=expected, expected_position=distance, expected_orientation=angle)
        found = await run(replace(task, options=hinted), on_progress=on_progress)
        chosen = Message.of("Of two solutions, the one near the present pose was chosen.")
        verdict = Message.joined([found.as_message(found.verdict), chosen])
        return replace(found, verdict=verdict.text, **verdict.translation())

    async def markers(self, parameters: CameraParameters, picture: bytes) -> list[MarkerCorners]:
        """Return the corners of every marker in the picture."""
        dictionary = self._markers.configuration.dictionary
        return await self._compute.run(FindMarkers(picture, parameters, dictionary))

    async def robot(
        self, model: RobotSource, view: RobotView, depth: list[bytes], *, on_progress: ProgressCallback | None = None
    ) -> RobotPose:
        """Return the pose of a robot in the world, from depth pictures (16 bit, mm)."""
        placed = replace(model, base=view.robot_pose)
        task = FindRobotPose(placed, view.robot_joints, depth, view.camera_parameters, view.camera_pose)
        return await self._compute.run(task, on_progress=on_progress)
