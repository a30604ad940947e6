"""Camera: colour and depth pictures."""

import abc
from typing import TYPE_CHECKING, ClassVar, NamedTuple

from arcor2_hw.actions import action
from arcor2_hw.data.camera import CameraParameters
from arcor2_hw.data.geometry import Pose
from arcor2_hw.data.object_type import Models
from arcor2_hw.exceptions import Arcor2NotImplemented, NoDepth
from arcor2_hw.objects.frame import Frame, cloud
from arcor2_hw.objects.generic import CollisionObject
from arcor2_hw.objects.settings import Settings

if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt
    from PIL import Image


class Mode(NamedTuple):
    """A size of pictures, pixels, and their rate, Hz."""

    width: int
    height: int
    fps: float


class Camera(CollisionObject):
    """A camera. Its pose is the optical frame: x right, y down, z forward.

    `max_age`: a picture older than that (s) is an error, not a picture.
    """

    category: ClassVar[str] = "Cameras"
    icon: ClassVar[str] = "camera"
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

    # -------------------------------------------------------------------------------- optional hooks
    def capture(self) -> Frame:
        """Give the newest colour and depth, of one instant. Raises Stale when it is older than `max_age`."""
        raise Arcor2NotImplemented("capture")

    def trigger(self) -> Frame:
        """Give colour and depth of an instant after this call."""
        raise Arcor2NotImplemented("trigger")

    def point_cloud(self, frame: Frame) -> "npt.NDArray[np.float32]":
        """Give the points of a frame, m, in the optical frame: height × width × 3, NaN where depth is invalid.

        Raises NoDepth for a frame without depth.
        """
        if frame.depth is None:
            raise NoDepth(f"{self.name}: the frame has no depth")
        return cloud(frame.depth, frame.note.parameters)

    def depth_range(self) -> tuple[float, float]:
        """Give the nearest and the farthest depth that is measured, m."""
        raise Arcor2NotImplemented("depth_range")

    def set_exposure(self, exposure: float | None) -> None:
        """Set the exposure, s; None leaves it to the camera."""
        raise Arcor2NotImplemented("set_exposure")

    def modes(self) -> list[Mode]:
        """Give the modes that it can be set to."""
        raise Arcor2NotImplemented("modes")

    def illumination(self, on: bool) -> None:
        """Switch its light."""
        raise Arcor2NotImplemented("illumination")
