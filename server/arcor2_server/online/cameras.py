"""Access to the cameras of the online scene."""

from typing import Final

import msgspec

from arcor2_hw.data.camera import CameraParameters
from arcor2_hw.data.scene import SceneObject
from arcor2_hw.exceptions import Arcor2Error, InvalidData
from arcor2_server.documents import Session
from arcor2_server.errors import RequestRefused
from arcor2_server.hosts.session import READ_TIMEOUT
from arcor2_server.object_types.registry import ObjectTypes
from arcor2_server.online.online_scene import OnlineScene

PICTURE_TIMEOUT: Final = 15.0
"""Time limit for taking a picture, s. A long exposure or an average of many frames takes a while."""


def picture_file(image: str) -> bytes:
    """Return the picture file that was sent as a string with one character per byte. Raise InvalidData if invalid."""
    try:
        data = image.encode("latin-1")
    except UnicodeEncodeError:
        raise InvalidData("The image is not a picture file: it has characters above 255.") from None
    if not data:
        raise InvalidData("The image is empty.")
    return data


class Cameras:
    """Access to the cameras of the online scene."""

    def __init__(self, types: ObjectTypes, session: Session, online: OnlineScene) -> None:
        self._types = types
        self._session = session
        self._online = online

    def require_camera(self, object_id: str) -> SceneObject:
        """Return a camera of the open scene.

        Raises:
            NotFound: the scene has no such object.
            RequestRefused: the object is not a camera.
        """
        found = self._session.document.scene_object(object_id)
        if not self._types.derives_from(found.type, "Camera"):
            raise RequestRefused("{name} is not a camera.", name=found.name)
        return found

    async def camera_parameters(self, camera: SceneObject) -> CameraParameters:
        """Return the intrinsics of an online camera. Raise RequestRefused if it has none."""
        raw = await self._online.call(camera.id, "color_camera_params", deadline=READ_TIMEOUT)
        if not raw:
            raise RequestRefused("{name} has no camera parameters.", name=camera.name)
        try:
            return msgspec.json.decode(raw, type=CameraParameters)
        except msgspec.MsgspecError as error:
            raise Arcor2Error("{name} returned no camera parameters.", str(error), name=camera.name) from error

    async def take_picture(self, camera: SceneObject, method: str, **arguments: int) -> bytes:
        """Take a picture by a method of the camera; return its file."""
        raw = await self._online.call(camera.id, method, arguments, deadline=PICTURE_TIMEOUT)
        try:
            return picture_file(msgspec.json.decode(raw, type=str))
        except msgspec.MsgspecError:
            raise Arcor2Error("{name} returned no picture.", name=camera.name) from None
