"""Requests to cameras of the online scene (protocol, 7.2)."""

from typing import Final

from msgspec import Raw

from arcor2_hw.data.camera import CameraParameters
from arcor2_hw.data.rpc import CameraColorImageArgs, CameraColorParametersArgs
from arcor2_hw.data.scene import SceneObject
from arcor2_server.documents import Session
from arcor2_server.online.cameras import Cameras
from arcor2_server.online.online_scene import OnlineScene
from arcor2_server.rpc.editing import Editing
from arcor2_server.rpc.registry import Context, rpc

PICTURE_WITHIN: Final = 15.0
"""Seconds for a picture: a long exposure, or an average of many, takes a while."""


class CameraRequests:
    """Requests to cameras of the scene that is online (protocol, 7.2)."""

    def __init__(self, session: Session, online: OnlineScene, editing: Editing, cameras: Cameras) -> None:
        self._session = session
        self._online = online
        self._editing = editing
        self._cameras = cameras

    def _require_ready(self, context: Context, object_id: str) -> SceneObject:
        self._session.require_scene_open()
        self._editing.require_held(context, object_id)
        self._online.require_online()
        return self._cameras.require_camera(object_id)

    @rpc("CameraColorImage")
    async def camera_color_image(self, context: Context, args: CameraColorImageArgs) -> Raw:
        """Take a colour picture; the answer is a JPEG's bytes, one character each."""
        camera = self._require_ready(context, args.id)
        # It comes as JSON text already: up to a megabyte is not read and written again.
        return Raw(await self._online.call(camera.id, "color_image", deadline=PICTURE_WITHIN))

    @rpc("CameraColorParameters")
    async def camera_color_parameters(self, context: Context, args: CameraColorParametersArgs) -> CameraParameters:
        """Return the intrinsics of the colour camera."""
        return await self._cameras.camera_parameters(self._require_ready(context, args.id))
