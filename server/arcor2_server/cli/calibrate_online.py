"""`arcor2-hw calibrate online`: calibrate cameras and robots of the online scene of a running server."""

import asyncio
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Annotated, Final
from urllib.parse import quote

from cyclopts import App, Parameter
from rich.markup import escape
from rich.table import Table

from arcor2_hw.calibration.configuration import read_configuration
from arcor2_hw.calibration.records import CalibrationCheck, CalibrationRecord
from arcor2_hw.client import Client
from arcor2_hw.data.base import UNSET, Unset
from arcor2_hw.data.geometry import Pose
from arcor2_hw.data.scene import Scene, SceneObject
from arcor2_hw.exceptions import Conflict, ConnectionLost, DeviceTimeout, InvalidData, NotFound
from arcor2_server.cli.calibration_files import calibrated, pose_table, progress, read_as
from arcor2_server.cli.exit_status import ExitStatus
from arcor2_server.cli.server_connection import HERE, Failed, Server
from arcor2_server.cli.tables import console

app = App(name="online", help="Calibrate devices of the online scene of a server.")

USER: Final = "calibrate"
"""The user name of the command, which its locks show."""
CALIBRATION_TIMEOUT: Final = 180.0
"""Time limit for a calibration, s; the robot may have to move first."""
GREETING_TIMEOUT: Final = 5.0
"""Time limit for the event with the open document, s."""

Name = Annotated[str, Parameter(help="Name of the object in the scene.")]


@app.command
def camera(name: Name, *, server: Server = HERE) -> int:
    """Calibrate the pose of a camera of the scene from markers in its view."""

    async def work() -> None:
        async with server.client() as client:
            scene = await _open_scene(client)
            found = _named(scene, name)
            await _calibrate(client, found, "CameraCalibration", lambda: client.calibrate_camera(found.id))

    return calibrated("online camera", work)


@app.command
def robot(
    name: Name,
    *,
    camera: Annotated[str, Parameter(help="Name of the depth camera. The default is the first of the scene.")] = "",
    move: Annotated[bool, Parameter(help="Move the robot to its calibration pose first, if it has one.")] = False,
    server: Server = HERE,
) -> int:
    """Calibrate the pose of a robot of the scene with a depth camera of the scene."""

    async def work() -> None:
        async with server.client() as client:
            scene = await _open_scene(client)
            found = _named(scene, name)
            seen_by = _named(scene, camera).id if camera else UNSET
            await _calibrate(
                client,
                found,
                "RobotCalibration",
                lambda: client.calibrate_robot(found.id, camera_id=seen_by, move_to_calibration_pose=move),
            )

    return calibrated("online robot", work)


@app.command
def markers(
    file: Annotated[Path, Parameter(help="YAML file with the poses of the markers.")], *, server: Server = HERE
) -> int:
    """Store the poses of the markers on a server."""

    async def work() -> None:
        configuration = read_configuration(file)
        async with server.rest() as rest:
            await rest.request("PUT", "/api/calibration/markers", body=configuration)
        console().print(f"Stored {len(configuration.markers)} markers and {len(configuration.boards)} boards.")

    return calibrated("online markers", work)


@app.command
def records(
    name: Annotated[str, Parameter(help="Show only calibrations of the object with this name.")] = "",
    *,
    limit: Annotated[int, Parameter(help="Maximum number of calibrations, newest first.")] = 20,
    server: Server = HERE,
) -> int:
    """List past calibrations with date, user and quality."""

    async def work() -> None:
        async with server.rest() as rest:
            query = {"limit": 1000 if name else limit}
            found: list[CalibrationRecord] = await rest.request(
                "GET", "/api/calibrations", list[CalibrationRecord], params=query
            )
        _show([one for one in found if name in ("", one.object_name)][:limit])

    return calibrated("online records", work)


@app.command
def check(
    name: Name,
    *,
    pose: Annotated[
        Path | None, Parameter(help="YAML file with the pose to compare. The default is the pose in the open scene.")
    ] = None,
    record: Annotated[
        str, Parameter(help="Id of the calibration. The default is the newest calibration with a pose.")
    ] = "",
    distance: Annotated[float, Parameter(help="Maximum position difference, m.")] = 0.002,
    angle: Annotated[float, Parameter(help="Maximum angle difference, rad.")] = 0.0035,
    server: Server = HERE,
) -> int:
    """Compare the pose of an object with the pose from a calibration. The exit status is 15 if they differ.

    A pose is {position: {x, y, z}, orientation: {x, y, z, w}}, in m, in the frame of the calibration.
    """

    async def work() -> None:
        given = None if pose is None else read_as(pose, Pose)
        async with server.client() as client:
            chosen = await _record(client, name, record)
            present = given or await _present_pose(client, chosen)
            body = {"pose": present, "distance_limit": distance, "angle_limit": angle}
            path = f"/api/calibrations/{quote(chosen.id, safe='')}/check"
            result: CalibrationCheck = await client.rest.request("PUT", path, CalibrationCheck, body=body)
        if not result.passed:
            raise Failed(ExitStatus.DIFFERENT, result.verdict)
        console().print(escape(result.verdict), soft_wrap=True)

    return calibrated("online check", work)


async def _record(client: Client, name: str, key: str) -> CalibrationRecord:
    """Return the calibration with an id; without an id, the newest one of the object that has a pose.

    Raises:
        NotFound: the calibration does not exist.
        InvalidData: it belongs to another object.
    """
    if key:
        path = f"/api/calibrations/{quote(key, safe='')}"
        found: CalibrationRecord = await client.rest.request("GET", path, CalibrationRecord)
        if found.object_name != name:
            raise InvalidData(
                "The calibration {key} belongs to {object_name}, not to {name}.",
                key=key,
                object_name=found.object_name,
                name=name,
            )
        return found
    listed: list[CalibrationRecord] = await client.rest.request(
        "GET", "/api/calibrations", list[CalibrationRecord], params={"limit": 1000}
    )
    for one in listed:
        if one.object_name == name and not isinstance(one.after, Unset):
            return one
    raise NotFound("{name!r} has no calibration with a pose.", name=name)


async def _present_pose(client: Client, record: CalibrationRecord) -> Pose:
    """Return the pose of the object of a calibration in the open scene.

    Raises:
        Conflict: no scene is open.
        NotFound: the scene does not contain the object.
        InvalidData: the calibration is not in world coordinates.
    """
    if record.parent != "world":
        raise InvalidData(
            "The calibration {id} is in the frame of {parent}. Specify a pose in this frame with --pose.",
            id=record.id,
            parent=record.parent,
        )
    scene = await _open_scene(client)
    found = next((each for each in scene.objects if each.id == record.object_id), None)
    if found is None or isinstance(found.pose, Unset):
        raise NotFound(
            "{object_name} of the calibration {id} is not in the scene {name}.",
            object_name=record.object_name,
            id=record.id,
            name=scene.name,
        )
    return found.pose


def _show(found: list[CalibrationRecord]) -> None:
    table = Table("date", "object", "kind", "by", "residual", "moved", "verdict", "id", box=None, pad_edge=False)
    for one in found:
        residual = ""
        if not isinstance(one.residual, Unset):
            number = 1e3 * one.residual if one.residual_unit == "m" else one.residual
            residual = f"{number:.2f} {'mm' if one.residual_unit == 'm' else one.residual_unit}"
        moved = ""
        if not isinstance(one.before, Unset) and not isinstance(one.after, Unset):
            moved = f"{1e3 * one.before.position.distance_to(one.after.position):.1f} mm"
        table.add_row(one.date[:19], one.object_name, one.kind.value, one.person, residual, moved, one.verdict, one.id)
    console().print(table if found else "There are no calibrations.")


# ------------------------------------------------------------------------------------------------ events
async def _open_scene(client: Client) -> Scene:
    """Return the open scene. Raise Conflict if no scene is open."""
    try:
        async with asyncio.timeout(GREETING_TIMEOUT):
            async for event in client.events():
                match event.event:
                    case "OpenScene" | "OpenProject":
                        scene: Scene = event.data.scene
                        return scene
                    case "ShowMainScreen":
                        break
    except TimeoutError:
        pass
    raise Conflict("No scene is open on the server. Open and start one.")


def _named(scene: Scene, name: str) -> SceneObject:
    for each in scene.objects:
        if each.name == name:
            return each
    raise NotFound(
        "The scene {name} has no object {other_name!r}; it has {objects}.",
        name=scene.name,
        other_name=name,
        objects=", ".join(o.name for o in scene.objects),
    )


async def _calibrate(client: Client, found: SceneObject, process: str, start: Callable[[], Awaitable[None]]) -> None:
    """Lock an object, start its calibration, wait for the end, and print the result."""
    await client.register_user(USER)
    await client.subscribe_events({"TaskState"})
    await client.write_lock(found.id)
    try:
        await start()
        verdict, pose = await _wait_for_end(client, found, process)
    finally:
        await client.write_unlock(found.id)
    out = console()
    out.print(f"[bold]{verdict or 'done'}[/bold]")
    if pose is not None:
        out.print(pose_table(found.name, pose))


async def _wait_for_end(client: Client, found: SceneObject, process: str) -> tuple[str, Pose | None]:
    """Return the verdict of a calibration, and the new pose if it was published. Raise Failed if it failed."""
    title = f"Calibration of {found.name}"
    pose: Pose | None = None
    try:
        async with asyncio.timeout(CALIBRATION_TIMEOUT):
            with progress(title) as on_progress:
                async for event in client.events():
                    if event.event == "TaskState" and event.data.title == title:
                        share = 0.0 if isinstance(event.data.progress, Unset) else event.data.progress
                        on_progress(share, "" if isinstance(event.data.message, Unset) else event.data.message)
                    elif event.event == "SceneObjectChanged" and event.data.id == found.id:
                        pose = event.data.pose
                    elif event.event == "ProcessState" and event.data.id == process:
                        message = "" if isinstance(event.data.message, Unset) else event.data.message
                        if event.data.state == "failed":
                            raise Failed(ExitStatus.CALIBRATION_REFUSED, message)
                        if event.data.state == "finished":
                            return message, pose
    except TimeoutError:
        raise DeviceTimeout("The calibration did not end within {limit:g} s.", limit=CALIBRATION_TIMEOUT) from None
    raise ConnectionLost("The connection to {url} broke.", url=client.url)
