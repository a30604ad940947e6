"""A scene with a camera that sees a robot and markers."""

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

import httpx
import msgspec

from arcor2_hw.client import Client
from arcor2_hw.data.geometry import Pose, Position
from arcor2_hw.data.parameter import Parameter
from tests.e2e.harness import Cell
from tests.e2e.workplace_with_camera import CAMERA, MARKERS, ROBOT, SIZE, Q, pose, rotated_about_z, visible_things

SCENE = "by pictures"
NAMES = {SCENE, "eye", "arm"}
"""Names of the scene and its objects."""


@asynccontextmanager
async def camera_of(cell: Cell, *, width: int = 1280, height: int = 720) -> AsyncIterator[None]:
    """Run a simulated camera in the workplace."""
    size = ("--width", f"{width}", "--height", f"{height}")
    await cell.start_fake("camera", "oak_d", *size, "--fps", "5")
    yield
    await cell.children.pop("camera").stop()


async def new_scene(cell: Cell, client: Client) -> dict[str, str]:
    """Open a new scene whose poses of camera and robot are wrong; return the ids of `scene`, `eye` and `arm`."""
    await cell.command_fake("camera", "scene", things=visible_things())
    await cell.command_fake("camera", "camera", pose=pose(CAMERA))
    await cell.command_fake("robot", "place", q=Q)
    await client.new_scene(SCENE)
    near = Pose(CAMERA.position + Position(0.1, -0.05, 0.08), CAMERA.orientation)
    wrong = Pose(ROBOT.position + Position(0.02, -0.015, 0.01), ROBOT.orientation * rotated_about_z(0.03))
    slow = [_setting("max_age", 5.0), _setting("frame_timeout", 10.0)]  # a busy machine renders slowly
    address = _setting("address", cell.at["camera"]["stream"])
    host = _setting("host", cell.robot_host)
    await client.add_object_to_scene(name="eye", type="OakD", pose=near, parameters=[address, *slow])
    await client.add_object_to_scene(name="arm", type="UR5e", pose=wrong, parameters=[host])
    await client.save_scene()
    scene = next(each for each in await client.list_scenes() if each.name == SCENE)
    objects = (await client.get_scene(scene.id)).objects
    return {"scene": scene.id} | {each.name: each.id for each in objects}


async def configure_markers(cell: Cell) -> None:
    """Configure the markers that the camera sees."""
    markers = [{"marker_id": n, "pose": {"position": {"x": x, "y": y}}} for n, (x, y) in MARKERS.items()]
    async with httpx.AsyncClient(timeout=60, base_url=cell.url.replace("ws", "http", 1)) as rest:
        configured = await rest.put("/api/calibration/markers", json={"marker_size": SIZE, "markers": markers})
        assert configured.status_code == 200


def _setting(name: str, value: str | float) -> Parameter:
    return Parameter(name, "string" if isinstance(value, str) else "double", msgspec.json.encode(value).decode())
