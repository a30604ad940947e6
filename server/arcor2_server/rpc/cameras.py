"""Requests to cameras of the online scene (protocol, 7.2)."""

from dataclasses import dataclass

from msgspec import Raw

from arcor2_hw.data.camera import CameraParameters
from arcor2_hw.data.rpc import CameraColorImageArgs, CameraColorParametersArgs
from arcor2_hw.data.scene import SceneObject
from arcor2_server.documents import Session
from arcor2_server.online.cameras import PICTURE_TIMEOUT, Cameras
from arcor2_server.online.online_scene import OnlineScene
from arcor2_server.rpc.editing import Editing
from arcor2_server.rpc.registry import Context, rpc


@dataclass(frozen=True, slots=True)
class CameraRequests:
    """Requests to cameras of the online scene (protocol, 7.2)."""

    _session: Session
    _online: OnlineScene
    _editing: Editing
    _cameras: Cameras

    def _require_camera(self, context: Context, object_id: str) -> SceneObject:
        """Return an online camera that the caller has locked. Raise RequestRefused or NotFound if it is none."""
        self._session.require_scene_open()
        self._editing.require_locked(context, object_id)
        self._online.require_online()
        return self._cameras.require_camera(object_id)

    @rpc("CameraColorImage")
    async def camera_color_image(self, context: Context, args: CameraColorImageArgs) -> Raw:
        """Take a colour picture; return a JPEG file as a string with one character per byte."""
        camera = self._require_camera(context, args.id)
        # The result is JSON already. It is not decoded, since it can have a megabyte.
        return Raw(await self._online.call(camera.id, "color_image", deadline=PICTURE_TIMEOUT))

    @rpc("CameraColorParameters")
    async def camera_color_parameters(self, context: Context, args: CameraColorParametersArgs) -> CameraParameters:
        """Return the intrinsics of the colour camera."""
        return await self._cameras.camera_parameters(self._require_camera(context, args.id))
