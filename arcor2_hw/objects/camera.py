"""Camera: colour and depth pictures."""

import abc
from typing import TYPE_CHECKING, ClassVar

from arcor2_hw.actions import action
from arcor2_hw.data.camera import CameraParameters
from arcor2_hw.data.geometry import Pose
from arcor2_hw.data.object_type import Models
from arcor2_hw.exceptions import Arcor2NotImplemented
from arcor2_hw.objects.generic import CollisionObject
from arcor2_hw.objects.settings import Settings

if TYPE_CHECKING:
    from PIL import Image


class Camera(CollisionObject):
    """A camera. Its pose is the optical frame: x right, y down, z forward.

    `max_age`: a picture older than that (s) is an error, not a picture.
    """

    max_age: ClassVar[float] = 0.5

    def __init__(
        self,
        obj_id: str,
        name: str,
        pose: Pose,
        collision_model: Models | None = None,
        settings: Settings | None = None,
    ) -> None:
        super().__init__(obj_id, name, pose, collision_model, settings)
        self.color_camera_params: CameraParameters | None = None

    @abc.abstractmethod
    @action
    def color_image(self, *, an: str | None = None) -> "Image.Image":
        """Take a colour picture."""

    @action
    def depth_image(self, averaged_frames: int = 1, *, an: str | None = None) -> "Image.Image":
        """Take a depth picture: 16 bit, mm, 0 = invalid, in the colour camera's view.

        :param averaged_frames: how many frames are averaged
        """
        raise Arcor2NotImplemented("depth_image")
