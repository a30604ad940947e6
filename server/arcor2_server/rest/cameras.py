"""Pictures of cameras over REST."""

from dataclasses import dataclass

from arcor2_hw.data.role import Role
from arcor2_server.documents import Session
from arcor2_server.online.cameras import Cameras
from arcor2_server.online.online_scene import OnlineScene
from arcor2_server.rest.general import SERVER
from arcor2_server.rest.operations import Binary, operation


@dataclass(frozen=True, slots=True)
class CameraOperations:
    """Pictures of cameras over REST."""

    _session: Session
    _online: OnlineScene
    _cameras: Cameras

    @operation("GET", "/api/cameras/{object_id}/picture", SERVER, Role.OPERATOR, media_type="image/jpeg")
    async def take_picture(self, object_id: str) -> Binary:
        """Take a picture with a camera of the online scene. It needs no lock, since it only observes."""
        self._session.require_scene_open()
        self._online.require_online()
        camera = self._cameras.require_camera(object_id)
        self._online.board.require_not_failed(object_id)
        return Binary(await self._cameras.take_picture(camera, "color_image"), "image/jpeg", "picture.jpg")
