"""Requests to cameras of the scene that is online (protocol, 7.2)."""

from typing import Final

import msgspec
from msgspec import Raw

from arcor2_hw.data.camera import CameraParameters
from arcor2_hw.data.rpc import CameraColorImageArgs, CameraColorParametersArgs
from arcor2_hw.data.scene import SceneObject
from arcor2_hw.exceptions import Arcor2Error
from arcor2_server.errors import RequestRefused
from arcor2_server.online.online_scene import OBSERVE_WITHIN
from arcor2_server.rpc.editing import require_held
from arcor2_server.rpc.registry import Context, rpc
from arcor2_server.services import Services

PICTURE_WITHIN: Final = 15.0
"""Seconds for a picture: a long exposure, or an average of many, takes a while."""


def require_camera(services: Services, object_id: str) -> SceneObject:
    """Give a camera of the open scene; NotFound, RequestRefused when it is none."""
    found = services.session.scene_object(object_id)
    if not services.types.derives_from(found.type, "Camera"):
        raise RequestRefused(f"{found.name} is not a camera.")
    return found


async def camera_parameters(services: Services, camera: SceneObject) -> CameraParameters:
    """Give the intrinsics that a live camera has; RequestRefused when it has none."""
    raw = await services.cell.call(camera.id, "color_camera_params", deadline=OBSERVE_WITHIN)
    if not raw:
        raise RequestRefused(f"{camera.name} does not know its parameters.")
    try:
        return msgspec.json.decode(raw, type=CameraParameters)
    except msgspec.MsgspecError as error:
        raise Arcor2Error(f"{camera.name} gave no parameters of a camera.", str(error)) from error


def _require_ready(context: Context, object_id: str) -> SceneObject:
    services = context.services
    services.session.require_scene_open()
    require_held(context, object_id)
    services.cell.require_online()
    return require_camera(services, object_id)


@rpc("CameraColorImage")
async def camera_color_image(context: Context, args: CameraColorImageArgs) -> Raw:
    """Take a colour picture; the answer is a JPEG's bytes, one character each."""
    camera = _require_ready(context, args.id)
    # It comes as JSON text already: up to a megabyte is not read and written again.
    return Raw(await context.services.cell.call(camera.id, "color_image", deadline=PICTURE_WITHIN))


@rpc("CameraColorParameters")
async def camera_color_parameters(context: Context, args: CameraColorParametersArgs) -> CameraParameters:
    """Give the intrinsics of the colour camera."""
    return await camera_parameters(context.services, _require_ready(context, args.id))
