"""Camera: colour and depth images."""

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
    """An image size in pixels, and its frame rate, Hz."""

    width: int
    height: int
    fps: float


class Camera(CollisionObject):
    """A camera. Its pose is that of the optical frame: x right, y down, z forward.

    Attributes:
        max_age: Maximum age of an image, s; an older one raises Stale.
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
    @action(again="safe")
    def color_image(self, *, an: str | None = None) -> "Image.Image":
        """Capture a colour image."""

    @action(again="safe")
    def depth_image(self, averaged_frames: int = 1, *, an: str | None = None) -> "Image.Image":
        """Capture a depth image: 16 bit, mm, 0 = invalid, in the view of the colour camera.

        :param averaged_frames: number of frames to average
        """
        raise Arcor2NotImplemented("depth_image")

    # -------------------------------------------------------------------------------- optional hooks
    def capture(self) -> Frame:
        """Return the newest colour and depth images of one instant.

        Raises:
            Stale: They are older than `max_age`.
        """
        raise Arcor2NotImplemented("capture")

    def trigger(self) -> Frame:
        """Capture colour and depth images after this call, and return them."""
        raise Arcor2NotImplemented("trigger")

    def point_cloud(self, frame: Frame) -> "npt.NDArray[np.float32]":
        """Return the points of a frame in the optical frame, m: height × width × 3, NaN where depth is invalid.

        Raises:
            NoDepth: The frame has no depth image.
        """
        if frame.depth is None:
            raise NoDepth("{name}: the frame has no depth", name=self.name)
        return cloud(frame.depth, frame.note.parameters)

    def depth_range(self) -> tuple[float, float]:
        """Return the minimum and maximum depth that can be measured, m."""
        raise Arcor2NotImplemented("depth_range")

    def set_exposure(self, exposure: float | None) -> None:
        """Set the exposure time, s; None: automatic."""
        raise Arcor2NotImplemented("set_exposure")

    def modes(self) -> list[Mode]:
        """Return the supported modes."""
        raise Arcor2NotImplemented("modes")

    def illumination(self, on: bool) -> None:
        """Switch the illumination on or off."""
        raise Arcor2NotImplemented("illumination")
