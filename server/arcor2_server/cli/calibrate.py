"""`arcor2-hw calibrate`: compute the poses of cameras, robots and tools from files, or on a running server."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import msgspec
from cyclopts import App, Parameter
from msgspec import field
from rich.console import Console
from rich.table import Table

from arcor2_hw.calibration.camera_results import (
    CameraPose,
    HandEyeSample,
    IntrinsicsOptions,
    LensState,
    Mounting,
    PoseMethod,
    PoseOptions,
)
from arcor2_hw.calibration.configuration import read_configuration
from arcor2_hw.calibration.layout import CharucoBoard, Layout
from arcor2_hw.calibration.results import TouchedOrientation
from arcor2_hw.collision.description import RobotSource, StoredFile
from arcor2_hw.compute import calibration_tasks as t
from arcor2_hw.data.base import Data
from arcor2_hw.data.camera import CameraParameters
from arcor2_hw.data.geometry import Orientation, Pose, Position
from arcor2_hw.data.robot import Joint
from arcor2_hw.exceptions import InvalidData
from arcor2_server.cli.calibration_files import (
    calibrated,
    compute,
    picture_of,
    pose_table,
    read_as,
    show_json,
    write,
)
from arcor2_server.cli.exit_status import ExitStatus
from arcor2_server.cli.server_connection import Failed
from arcor2_server.cli.tables import console

app = App(
    name="calibrate",
    help=(
        "Calibrate the poses of cameras, robots and tools.\n\n"
        "The input is pictures and touched points in files. `online` calibrates devices of a running server."
    ),
)
app.command(
    "arcor2_server.cli.calibrate_online:app", name="online", help="Calibrate devices of the online scene of a server."
)

Lens = Annotated[
    Path,
    Parameter(help="YAML or JSON file with fx, fy, cx, cy in pixels and dist_coefs, as `calibrate intrinsics` writes."),
]
AsJson = Annotated[bool, Parameter(help="Print the complete result as JSON.", negative="")]
Save = Annotated[Path | None, Parameter(help="Write pictures that show the quality of the result to this folder.")]
Output = Annotated[Path | None, Parameter(name=["--output", "-o"], help="Write the result to this file as JSON.")]


# ------------------------------------------------------------------------------------------------ camera
ViewPictures = Annotated[Path, Parameter(help="Pictures taken by the camera from the same pose.")]


@Parameter(name="*")
@dataclass(frozen=True)
class MarkerView:
    """A camera's view of markers with known poses."""

    lens: Lens
    markers: Annotated[Path, Parameter(help="YAML file with marker_size and the pose of each marker by id.")]
    near: Annotated[
        Path | None, Parameter(help="YAML file with the approximate camera pose, to choose between two solutions.")
    ] = None
    above: Annotated[float | None, Parameter(help="Minimum height of the camera above the origin, m.")] = None

    def read(self, pictures: Sequence[Path]) -> tuple[list[bytes], CameraParameters, Layout, PoseOptions]:
        """Return the content of the files. Raise NotFound or InvalidData if one cannot be read."""
        if not pictures:
            raise InvalidData("Specify at least one picture.")
        configuration = read_configuration(self.markers)
        options = configuration.options
        if self.near is not None:
            options = msgspec.structs.replace(options, expected=read_as(self.near, Pose))
        if self.above is not None:
            options = msgspec.structs.replace(options, lowest=self.above)
        files = [picture_of(path) for path in pictures]
        return files, read_as(self.lens, CameraParameters), configuration.layout, options


@app.command
def camera(
    *pictures: ViewPictures,
    view: MarkerView,
    method: Annotated[
        PoseMethod | None,
        Parameter(help="joint: solve for all corners together; averaged: average the poses from single markers."),
    ] = None,
    json: AsJson = False,
    save: Save = None,
    output: Output = None,
) -> int:
    """Compute the pose of a camera from pictures of markers with known poses.

    Prints the pose, its standard deviation and the residual of each marker. Fails with status 19 if the result is not
    reliable: a blurred picture, no marker, a single marker seen from the front, or a marker that is not at its pose.
    """

    async def work() -> None:
        files, parameters, layout, options = view.read(pictures)
        if method is not None:
            options = msgspec.structs.replace(options, method=method)
        found = await compute(t.FindCameraPose(files, parameters, layout, options))
        if save is not None:
            drawn = await compute(t.DrawCameraPose(files[0], parameters, layout, found))
            write(save / f"{pictures[0].stem}-markers.png", drawn)
        if out := _report(found, found.pose, output, json):
            _show_camera(found, out)

    return calibrated("camera", work)


def _show_camera(found: CameraPose, out: Console) -> None:
    out.print(pose_table("camera", found.pose))
    out.print(f"standard deviation {_deviation(found)}, residual {found.residual:.2f} px")
    columns = ("marker", "picture", "residual", "worst corner", "distance", "seen at", "used")
    table = Table(*columns, box=None, pad_edge=False)
    for one in found.markers:
        table.add_row(
            one.name,
            str(one.picture + 1),
            f"{one.residual:.2f} px",
            f"{one.largest:.2f} px",
            f"{one.distance:.3f} m",
            f"{math.degrees(one.angle):.0f}°",
            "yes" if one.used else "[red]no: it is not at its stated pose",
        )
    out.print(table)


@app.command
def check_lens(*pictures: ViewPictures, view: MarkerView, json: AsJson = False, output: Output = None) -> int:
    """Check the focal length of a camera by pictures of markers with known poses.

    Prints whether the markers confirm it, and the focal length that fits best; -o writes parameters with that one.
    Fails with status 19 if the markers contradict the given focal length.
    """

    async def work() -> ExitStatus:
        found = await compute(t.CheckLens(*view.read(pictures)))
        if out := _report(found, found.parameters, output, json):
            out.print(f"fx {found.parameters.fx:.1f} px, fy {found.parameters.fy:.1f} px fit best")
            out.print(f"that is {found.factor:.4f} ± {found.deviation:.4f} of the given focal length")
            out.print(f"residual {found.misfit:.1f} times the noise of corners")
        return ExitStatus.CALIBRATION_REFUSED if found.state is LensState.CONTRADICTED else ExitStatus.OK

    return calibrated("check-lens", work)


# ------------------------------------------------------------------------------------------------ robot
@app.command
def robot(
    *depth: Annotated[Path, Parameter(help="Depth pictures (PNG, 16 bit, mm) taken while the robot did not move.")],
    model: Annotated[Path, Parameter(help="URDF of the robot: a file, a folder, or a zip archive with its meshes.")],
    joints: Annotated[
        list[Path],
        Parameter(
            help="YAML file with a list of joint names and values during the pictures. Repeat it for several joint "
            "states, which check the joints and the model; each has an equal number of the pictures, in this order."
        ),
    ],
    lens: Lens,
    camera: Annotated[Path, Parameter(help="YAML file with the camera pose, as `calibrate camera -o` writes.")],
    assumed: Annotated[Path, Parameter(help="YAML file with the approximate pose of the robot.")],
    within: Annotated[float, Parameter(help="Maximum position error of the approximate pose, m.")] = 0.08,
    turned: Annotated[float, Parameter(help="Maximum angle error of the approximate pose, degrees.")] = 8.0,
    json: AsJson = False,
    output: Output = None,
) -> int:
    """Compute the pose of a robot from depth pictures of a camera with known pose.

    Fails with status 19 if the robot is not found, or if the view does not determine its pose.
    """

    async def work() -> None:
        described = RobotSource(StoredFile(str(model.absolute()), model.name), read_as(assumed, Pose))
        pictures = [picture_of(path) for path in depth]
        first, *others = t.states_of([read_as(path, list[Joint]) for path in joints], pictures)
        found = await compute(
            t.FindRobotPose(
                described,
                first.joints,
                first.depth,
                read_as(lens, CameraParameters),
                read_as(camera, Pose),
                within,
                math.radians(turned),
                others,
            )
        )
        if out := _report(found, found.pose, output, json):
            out.print(pose_table("robot", found.pose))
            out.print(f"standard deviation {_deviation(found)}")
            out.print(f"{found.fitness:.0%} of the visible surface matches, residual {1e3 * found.residual:.2f} mm")
            turned_by = math.degrees(found.turned)
            out.print(f"{1e3 * found.moved:.1f} mm and {turned_by:.2f}° from the approximate pose")

    return calibrated("robot", work)


# ------------------------------------------------------------------------------------------------ hand-eye
class Station(Data, frozen=True):
    """A station of a hand-eye calibration: the file of a picture, and the flange pose during the picture."""

    picture: str
    flange: Pose


@app.command(name="hand-eye")
def hand_eye(
    stations: Annotated[
        Path,
        Parameter(help="YAML file with a list of picture (file in the same folder) and flange (pose in base frame)."),
    ],
    *,
    lens: Lens,
    target: Annotated[Path, Parameter(help="YAML file with the markers or boards and their poses in the target.")],
    mounting: Annotated[
        Mounting, Parameter(help="eye_in_hand: the robot carries the camera; eye_to_hand: it carries the target.")
    ],
    json: AsJson = False,
    save: Save = None,
    output: Output = None,
) -> int:
    """Compute the pose of a camera on the flange or next to the robot, from pictures of one target.

    Use at least ten stations and rotate the flange about at least two axes between them. Fails with status 19 if the
    rotations do not determine the result.
    """

    async def work() -> None:
        listed = read_as(stations, list[Station])
        samples = [HandEyeSample(each.flange, picture_of(stations.parent / each.picture)) for each in listed]
        seen = read_as(target, Layout)
        found = await compute(t.FindHandEye(samples, read_as(lens, CameraParameters), seen, mounting))
        if save is not None:
            write(save / "hand-eye.png", found.picture)
        if (out := _report(msgspec.structs.replace(found, picture=b""), found.pose, output, json)) is None:
            return
        frame = "flange" if mounting == "eye_in_hand" else "robot base"
        out.print(pose_table(f"camera in the {frame} frame", found.pose))
        out.print(f"standard deviation {_deviation(found)}, residual {found.residual:.2f} px")
        table = Table("station", "corners", "residual", "worst", "", box=None, pad_edge=False)
        for one in found.samples:
            row = (str(one.corners), f"{one.residual:.2f} px", f"{one.largest:.2f} px")
            table.add_row(listed[one.sample].picture, *row, "" if one.used else f"[red]not used: {one.problem}")
        out.print(table)

    return calibrated("hand-eye", work)


# ------------------------------------------------------------------------------------------------ intrinsics
@app.command
def intrinsics(
    *pictures: Annotated[Path, Parameter(help="10 to 30 pictures of a ChArUco board from all sides.")],
    board: Annotated[Path, Parameter(help="YAML file with columns, rows, square (m), marker (m) and dictionary.")],
    coefficients: Annotated[int, Parameter(help="Number of distortion coefficients: 4, 5, 8 or 12.")] = 5,
    json: AsJson = False,
    save: Save = None,
    output: Output = None,
) -> int:
    """Compute focal lengths, principal point and distortion of a camera."""

    async def work() -> None:
        options = _lens_model(coefficients)
        files = [picture_of(path) for path in pictures]
        found = await compute(t.FindIntrinsics(files, read_as(board, CharucoBoard), options))
        if save is not None:
            write(save / "intrinsics.png", found.picture)
        if (out := _report(msgspec.structs.replace(found, picture=b""), found.parameters, output, json)) is None:
            return
        names = ("fx", "fy", "cx", "cy")
        for name, deviation in zip(names, found.deviations, strict=True):
            out.print(f"{name} {getattr(found.parameters, name):.2f} px, standard deviation {deviation:.2f} px")
        out.print(f"distortion {', '.join(f'{value:.5f}' for value in found.parameters.dist_coefs)}")
        out.print(f"residual {found.residual:.2f} px, {found.coverage:.0%} of the picture covered")
        for one in found.views:
            if not one.used:
                out.print(f"[red]not used: {pictures[one.view]}: {one.problem}")

    return calibrated("intrinsics", work)


def _lens_model(coefficients: int) -> IntrinsicsOptions:
    try:
        return msgspec.convert({"coefficients": coefficients}, IntrinsicsOptions)
    except msgspec.ValidationError:
        raise Failed(ExitStatus.USAGE, f"--coefficients must be 4, 5, 8 or 12, not {coefficients}") from None


# ------------------------------------------------------------------------------------------------ touch
class TouchedPoints(Data, frozen=True, forbid_unknown_fields=True):
    """The touched points and flange poses. The method determines which fields are needed."""

    origin: Position | None = None
    on_x: Position | None = None
    in_plane: list[Position] = field(default_factory=list)
    known: list[Position] = field(default_factory=list)
    touched: list[Position] = field(default_factory=list)
    flanges: list[Pose] = field(default_factory=list)
    orientations: list[Orientation] = field(default_factory=list)
    reference: Orientation | None = None
    flange: Orientation | None = None
    tip: Position | None = None
    along_z: Position | None = None


@app.command
def touch(
    points: Annotated[Path, Parameter(help="YAML file with the touched points, m; see the how-to on calibration.")],
    *,
    json: AsJson = False,
    output: Output = None,
) -> int:
    """Compute a frame from touched points, or the tip or orientation of a tool from flange poses.

    The fields in the file select the method. Frame: known and touched (at least 3 points), or origin, on_x and
    in_plane. Tool tip: flanges (at least 4 poses with the tip at the same point). Tool orientation: orientations, or
    flange, tip, along_z and on_x.
    """

    async def work() -> None:
        found: Any = await compute(_touch_task(read_as(points, TouchedPoints), points))
        pose = getattr(found, "pose", None)
        if pose is None:
            pose = Pose(getattr(found, "position", Position()), getattr(found, "orientation", Orientation()))
        if (out := _report(found, pose, output, json)) is None:
            return
        out.print(pose_table("result", pose))
        angle = isinstance(found, TouchedOrientation)
        for number, residual in enumerate(found.residuals, 1):
            value = f"{math.degrees(residual):.2f}°" if angle else f"{1e3 * residual:.2f} mm"
            out.print(f"{number}: residual {value}")

    return calibrated("touch", work)


def _touch_task(given: TouchedPoints, path: Path) -> Any:
    match given:
        case TouchedPoints(known=[_, *_], touched=[_, *_]):
            return t.FrameByPoints(given.known, given.touched)
        case TouchedPoints(flanges=[_, *_]):
            return t.TipByTouches(given.flanges)
        case TouchedPoints(orientations=[_, *_]):
            return t.OrientationByAlignment(given.orientations, given.reference or Orientation())
        case TouchedPoints(
            flange=Orientation() as flange, tip=Position() as tip, along_z=Position() as z, on_x=Position() as x
        ):
            return t.OrientationByPoints(flange, tip, z, x)
        case TouchedPoints(origin=Position() as origin, on_x=Position() as x):
            return t.FrameByAxes(origin, x, given.in_plane)
    raise InvalidData(
        "{path} lacks the fields of a method: known and touched, or origin, on_x and in_plane, or flanges, or "
        "orientations, or flange, tip, along_z and on_x.",
        path=path,
    )


def _report(found: Any, result: Any, output: Path | None, json: bool) -> Console | None:
    """Write the result to a file if requested, and print the verdict; with `json`, print everything as JSON instead.

    Returns:
        The console for details, None for JSON.
    """
    if output is not None:
        write(output, msgspec.json.format(msgspec.json.encode(result)))
    if json:
        show_json(found)
        return None
    out = console()
    out.print(f"[bold]{found.verdict}[/bold]")
    return out


def _deviation(found: Any) -> str:
    """Return the standard deviations of a pose."""
    return f"{1e3 * found.position_deviation:.2f} mm and {math.degrees(found.orientation_deviation):.3f}°"
