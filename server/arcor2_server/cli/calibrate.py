"""`arcor2-hw calibrate`: find the poses of cameras and robots, from files or on a running server."""

import math
from pathlib import Path
from typing import Annotated, Any

import msgspec
from cyclopts import App, Parameter
from msgspec import field
from rich.table import Table

from arcor2_hw.calibration.camera_results import CameraPose, HandEyeSample, IntrinsicsOptions, Mounting, PoseMethod
from arcor2_hw.calibration.configuration import read_configuration
from arcor2_hw.calibration.layout import CharucoBoard, Layout
from arcor2_hw.calibration.results import RobotPose, TouchedOrientation
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
        "Find out where cameras and robots stand, from pictures and touched points in files; `online` does it on a "
        "running server."
    ),
)
app.command(
    "arcor2_server.cli.calibrate_online:app", name="online", help="On the scene that a running server has in operation."
)

Lens = Annotated[
    Path,
    Parameter(help="YAML or JSON: fx, fy, cx, cy in pixels, dist_coefs; `calibrate intrinsics -o` writes it."),
]
AsJson = Annotated[bool, Parameter(help="Print the whole result as JSON.", negative="")]
Save = Annotated[Path | None, Parameter(help="A folder: pictures of how well it fits are written there.")]
Output = Annotated[Path | None, Parameter(name=["--output", "-o"], help="Write what was found to this file, as JSON.")]


# ------------------------------------------------------------------------------------------------ camera
@app.command
def camera(
    *pictures: Annotated[Path, Parameter(help="Pictures that the camera took from one and the same place.")],
    lens: Lens,
    markers: Annotated[Path, Parameter(help="Which markers stand where: marker_size, and by id a pose (YAML).")],
    method: Annotated[
        PoseMethod | None, Parameter(help="joint: all corners as one problem; averaged: one pose for each marker.")
    ] = None,
    near: Annotated[
        Path | None, Parameter(help="A pose (YAML) where the camera roughly is: chooses between two answers.")
    ] = None,
    above: Annotated[float | None, Parameter(help="The least height of the camera above the origin, m.")] = None,
    json: AsJson = False,
    save: Save = None,
    output: Output = None,
) -> int:
    """Find where a camera stands, from a picture of markers whose places are known.

    Tells the pose, how well it is known, and how well each marker fits. Refuses (status 19) rather than guess: a
    picture that is not sharp, no marker, one marker seen from the front, a marker that is not where it is said to be.
    """

    async def work() -> None:
        if not pictures:
            raise InvalidData("Name at least one picture.")
        configuration = read_configuration(markers)
        options = configuration.options
        if method is not None:
            options = msgspec.structs.replace(options, method=method)
        if near is not None:
            options = msgspec.structs.replace(options, expected=read_as(near, Pose))
        if above is not None:
            options = msgspec.structs.replace(options, lowest=above)
        parameters = read_as(lens, CameraParameters)
        files = [picture_of(path) for path in pictures]
        found = await compute(t.FindCameraPose(files, parameters, configuration.layout, options))
        if save is not None:
            drawn = await compute(t.DrawCameraPose(files[0], parameters, configuration.layout, found))
            write(save / f"{pictures[0].stem}-markers.png", drawn)
        _give(output, found.pose)
        if json:
            show_json(found)
        else:
            _show_camera(found)

    return calibrated("camera", work)


def _show_camera(found: CameraPose) -> None:
    out = console()
    out.print(f"[bold]{found.verdict}[/bold]")
    out.print(pose_table("the camera", found.pose))
    deviation, angle = 1e3 * found.position_deviation, math.degrees(found.orientation_deviation)
    out.print(f"known to {deviation:.2f} mm and {angle:.3f}° (standard deviation), residual {found.residual:.2f} px")
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
            "yes" if one.used else "[red]no: it is not where it is said to be",
        )
    out.print(table)


# ------------------------------------------------------------------------------------------------ robot
@app.command
def robot(
    *depth: Annotated[Path, Parameter(help="Depth pictures (PNG, 16 bit, mm) taken while the robot stood still.")],
    model: Annotated[Path, Parameter(help="The robot's URDF: a file, a folder, or a zip archive with its meshes.")],
    joints: Annotated[Path, Parameter(help="The joints meanwhile (YAML): a list of name and value, rad or m.")],
    lens: Lens,
    camera: Annotated[Path, Parameter(help="The pose of the camera (YAML), as `calibrate camera -o` writes it.")],
    assumed: Annotated[Path, Parameter(help="Where the robot is taken to stand (YAML): a pose.")],
    within: Annotated[float, Parameter(help="By how much that may be off, m.")] = 0.08,
    turned: Annotated[float, Parameter(help="And turned, degrees.")] = 8.0,
    json: AsJson = False,
    output: Output = None,
) -> int:
    """Find where a robot stands, from what a depth camera of known pose sees of it.

    Refuses (status 19) when the robot is not found, or the view leaves a direction open.
    """

    async def work() -> None:
        described = RobotSource(StoredFile(str(model.absolute()), model.name), read_as(assumed, Pose))
        found = await compute(
            t.FindRobotPose(
                described,
                read_as(joints, list[Joint]),
                [picture_of(path) for path in depth],
                read_as(lens, CameraParameters),
                read_as(camera, Pose),
                within,
                math.radians(turned),
            )
        )
        _give(output, found.pose)
        if json:
            show_json(found)
        else:
            _show_robot(found)

    return calibrated("robot", work)


def _show_robot(found: RobotPose) -> None:
    out = console()
    out.print(f"[bold]{found.verdict}[/bold]")
    out.print(pose_table("the robot", found.pose))
    deviation, angle = 1e3 * found.position_deviation, math.degrees(found.orientation_deviation)
    out.print(f"known to {deviation:.2f} mm and {angle:.3f}° (standard deviation)")
    out.print(f"{found.fitness:.0%} of what can be seen of it is there, residual {1e3 * found.residual:.2f} mm")
    out.print(f"{1e3 * found.moved:.1f} mm and {math.degrees(found.turned):.2f}° from where it was taken to stand")


# ------------------------------------------------------------------------------------------------ hand-eye
class Station(Data, frozen=True):
    """One station of a hand-eye calibration: the file of a picture, and where the flange was meanwhile."""

    picture: str
    flange: Pose


@app.command(name="hand-eye")
def hand_eye(
    stations: Annotated[
        Path,
        Parameter(help="YAML: a list of picture (a file beside it) and flange (a pose in the base frame)."),
    ],
    *,
    lens: Lens,
    target: Annotated[Path, Parameter(help="The markers or boards (YAML), their poses in the target's own frame.")],
    mounting: Annotated[
        Mounting, Parameter(help="eye_in_hand: the robot carries the camera; eye_to_hand: it carries the target.")
    ],
    json: AsJson = False,
    save: Save = None,
    output: Output = None,
) -> int:
    """Find where a camera sits on a robot's flange, or beside the robot, from pictures of one target.

    Ten stations or more are good, with the flange turned about two axes at least in between. Refuses (status 19) when
    the turns do not determine the result.
    """

    async def work() -> None:
        listed = read_as(stations, list[Station])
        samples = [HandEyeSample(each.flange, picture_of(stations.parent / each.picture)) for each in listed]
        seen = read_as(target, Layout)
        found = await compute(t.FindHandEye(samples, read_as(lens, CameraParameters), seen, mounting))
        if save is not None:
            write(save / "hand-eye.png", found.picture)
        _give(output, found.pose)
        if json:
            show_json(msgspec.structs.replace(found, picture=b""))
            return
        out = console()
        out.print(f"[bold]{found.verdict}[/bold]")
        where = "the camera on the flange" if mounting == "eye_in_hand" else "the camera in the robot's base frame"
        out.print(pose_table(where, found.pose))
        deviation, angle = 1e3 * found.position_deviation, math.degrees(found.orientation_deviation)
        out.print(f"known to {deviation:.2f} mm and {angle:.3f}°, residual {found.residual:.2f} px")
        table = Table("station", "corners", "residual", "worst", "", box=None, pad_edge=False)
        for one in found.samples:
            row = (str(one.corners), f"{one.residual:.2f} px", f"{one.largest:.2f} px")
            table.add_row(listed[one.sample].picture, *row, "" if one.used else f"[red]left out: {one.problem}")
        out.print(table)

    return calibrated("hand-eye", work)


# ------------------------------------------------------------------------------------------------ intrinsics
@app.command
def intrinsics(
    *pictures: Annotated[Path, Parameter(help="Pictures of a ChArUco board, 10 to 30, from all sides.")],
    board: Annotated[Path, Parameter(help="The board (YAML): columns, rows, square and marker in m, dictionary.")],
    coefficients: Annotated[int, Parameter(help="Numbers of the lens model: 4, 5, 8 or 12.")] = 5,
    json: AsJson = False,
    save: Save = None,
    output: Output = None,
) -> int:
    """Find focal lengths, centre and distortion of a camera's lens."""

    async def work() -> None:
        options = _lens_model(coefficients)
        files = [picture_of(path) for path in pictures]
        found = await compute(t.FindIntrinsics(files, read_as(board, CharucoBoard), options))
        if save is not None:
            write(save / "intrinsics.png", found.picture)
        _give(output, found.parameters)
        if json:
            show_json(msgspec.structs.replace(found, picture=b""))
            return
        out = console()
        out.print(f"[bold]{found.verdict}[/bold]")
        names = ("fx", "fy", "cx", "cy")
        for name, deviation in zip(names, found.deviations, strict=True):
            out.print(f"{name} {getattr(found.parameters, name):.2f} px, known to {deviation:.2f} px")
        out.print(f"distortion {', '.join(f'{value:.5f}' for value in found.parameters.dist_coefs)}")
        out.print(f"residual {found.residual:.2f} px, {found.coverage:.0%} of the picture covered")
        for one in found.views:
            if not one.used:
                out.print(f"[red]left out: {pictures[one.view]}: {one.problem}")

    return calibrated("intrinsics", work)


def _lens_model(coefficients: int) -> IntrinsicsOptions:
    try:
        return msgspec.convert({"coefficients": coefficients}, IntrinsicsOptions)
    except msgspec.ValidationError:
        raise Failed(ExitStatus.USAGE, f"a lens has 4, 5, 8 or 12 coefficients, not {coefficients}") from None


# ------------------------------------------------------------------------------------------------ touch
class Touched(Data, frozen=True, forbid_unknown_fields=True):
    """What was touched; which fields are needed depends on the method."""

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
    points: Annotated[Path, Parameter(help="YAML with what was touched, m; see the how-to on calibration.")],
    *,
    json: AsJson = False,
    output: Output = None,
) -> int:
    """Find a frame from touched points, or a tool's tip or orientation from how the flange stood.

    By what is in the file: known and touched (3 points or more) or origin, on_x and in_plane give a frame; flanges (4
    poses or more with the tip on one point) give the tip; orientations, or flange, tip, along_z and on_x, give the
    tool's orientation.
    """

    async def work() -> None:
        found: Any = await compute(_touch_task(read_as(points, Touched), points))
        pose = getattr(found, "pose", None)
        if pose is None:
            pose = Pose(getattr(found, "position", Position()), getattr(found, "orientation", Orientation()))
        _give(output, pose)
        if json:
            show_json(found)
            return
        out = console()
        out.print(f"[bold]{found.verdict}[/bold]")
        out.print(pose_table("found", pose))
        angle = isinstance(found, TouchedOrientation)
        for number, residual in enumerate(found.residuals, 1):
            off = f"{math.degrees(residual):.2f}°" if angle else f"{1e3 * residual:.2f} mm"
            out.print(f"{number}: {off} off")

    return calibrated("touch", work)


def _touch_task(given: Touched, path: Path) -> Any:
    match given:
        case Touched(known=[_, *_], touched=[_, *_]):
            return t.FrameByPoints(given.known, given.touched)
        case Touched(flanges=[_, *_]):
            return t.TipByTouches(given.flanges)
        case Touched(orientations=[_, *_]):
            return t.OrientationByAlignment(given.orientations, given.reference or Orientation())
        case Touched(
            flange=Orientation() as flange, tip=Position() as tip, along_z=Position() as z, on_x=Position() as x
        ):
            return t.OrientationByPoints(flange, tip, z, x)
        case Touched(origin=Position() as origin, on_x=Position() as x):
            return t.FrameByAxes(origin, x, given.in_plane)
    raise InvalidData(
        "{path} names no method: it needs known and touched, or origin, on_x and in_plane, or flanges, or "
        "orientations, or flange, tip, along_z and on_x.",
        path=path,
    )


def _give(output: Path | None, what: Any) -> None:
    if output is not None:
        write(output, msgspec.json.format(msgspec.json.encode(what)))
