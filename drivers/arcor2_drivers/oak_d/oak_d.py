"""The object type of a Luxonis OAK-D camera: colour and aligned depth images of one instant."""

import datetime
import time
from typing import TYPE_CHECKING, ClassVar, Final

from arcor2_hw.actions import action
from arcor2_hw.data.device import Identity, LossReaction
from arcor2_hw.data.geometry import Pose
from arcor2_hw.data.object_type import Models
from arcor2_hw.exceptions import DeviceFault, NoDepth, OutOfRange, Overexposed
from arcor2_hw.objects import Camera
from arcor2_hw.objects.camera import Mode
from arcor2_hw.objects.frame import Frame, PictureNote
from arcor2_hw.objects.generic import DEFAULT_CONNECT_TIMEOUT

from .image_stream import EXPOSURE_TIMEOUT, ImageStream
from .settings import OakDSettings, Resolution, size_of

if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt
    from PIL import Image

    from .feed import ImagePair

MIN_EXPOSURE_TIME: Final = 0.00001
MAX_EXPOSURE_TIME: Final = 0.033
"""Longest exposure time of the colour sensor at 30 Hz, s."""
WHITE: Final = 250
"""Smallest of R, G and B from which a pixel counts as white."""
BLACK: Final = 10.0
"""Mean brightness below which an image counts as black."""
MIN_DEPTH: Final = 0.02
"""Smallest fraction of pixels with valid depth."""
SAMPLE_STEP: Final = 4
"""Step of rows and columns at which an image is checked."""
MAX_AVERAGED: Final = 100


class OakD(ImageStream, Camera):
    """An OAK-D camera: colour with depth in the same view, over USB, Ethernet or a network source."""

    _ABSTRACT = False
    display_name = "Luxonis OAK-D"
    loss_reaction: ClassVar[LossReaction] = LossReaction.holds()  # it has no moving parts

    def __init__(
        self,
        obj_id: str,
        name: str,
        pose: Pose,
        collision_model: Models | None = None,
        settings: OakDSettings | None = None,
    ) -> None:
        super().__init__(obj_id, name, pose, collision_model, settings)
        self.use_camera(settings or OakDSettings())

    # -------------------------------------------------------------------------------- connection
    def connect(self, timeout: float = DEFAULT_CONNECT_TIMEOUT) -> None:
        """Open the camera and receive its first image within `timeout` s; see ImageStream.connect."""
        super().connect(timeout)
        self.color_camera_params = self.feed.parameters

    def disconnect(self) -> None:
        """Stop receiving images; does nothing when stopped."""
        super().disconnect()
        self.color_camera_params = None

    def identify(self) -> Identity:
        """Return the identity that the camera reported."""
        return self.feed.identity

    # -------------------------------------------------------------------------------- camera
    def capture(self) -> Frame:
        """Return the newest images. Raises Stale when they are older than `max_age` of the settings."""
        return self._frame(self.newest(self._config.max_age))

    def trigger(self) -> Frame:
        """Return the first images whose exposure starts after this call. Raises Stale when none come in time."""
        return self._frame(self._after_now())

    def distortion_model(self) -> str:
        """Return the lens model: "none", or "opencv" with the number of its coefficients."""
        coefficients = self.feed.parameters.dist_coefs
        return f"opencv {len(coefficients)}" if any(coefficients) else "none"

    def depth_range(self) -> tuple[float, float]:
        """Return the minimum and maximum depth that can be measured, m."""
        return self.feed.depth_range

    def modes(self) -> list[Mode]:
        """Return the available image sizes; for a network source, the size that it sends."""
        if self._config.network is not None:
            return [Mode(*self.feed.size, self._config.fps)]
        sizes = [size_of(each) for each in Resolution]
        return [Mode(width, height, self._config.fps) for width, height in sizes]

    def set_exposure(self, exposure: float | None) -> None:
        """Set the exposure time, s; None: automatic. Raises OutOfRange, Refused, DeviceTimeout."""
        if exposure is not None and not MIN_EXPOSURE_TIME <= exposure <= MAX_EXPOSURE_TIME:
            raise OutOfRange(
                "{device}: exposure must be {shortest_exposure:g} to {longest_exposure:g} s, not {exposure:g} s",
                device=self.who,
                shortest_exposure=MIN_EXPOSURE_TIME,
                longest_exposure=MAX_EXPOSURE_TIME,
                exposure=exposure,
            )
        self.feed.set_exposure(exposure, EXPOSURE_TIMEOUT)
        self._exposure = exposure  # set again after a reconnect

    def stop(self) -> None:
        """End the calls that wait for an image, with Cancelled; the camera continues to capture images."""
        self.stop_waiting()

    # -------------------------------------------------------------------------------- actions
    @action(again="safe")
    def color_image(self, *, an: str | None = None) -> "Image.Image":
        """Capture a colour image whose exposure starts after the start of the action."""
        from PIL import Image

        shot = self._after_now()
        color = shot.color_rgb()
        self._check_light(color, shot)
        return self._note(shot).put_on(Image.fromarray(color))

    @action(again="safe")
    def depth_image(self, averaged_frames: int = 1, *, an: str | None = None) -> "Image.Image":
        """Capture a depth image: 16 bit, mm, 0 = invalid, in the view of the colour camera.

        :param averaged_frames: number of frames to average
        """
        from PIL import Image

        if not 1 <= averaged_frames <= MAX_AVERAGED:
            raise OutOfRange(
                "{device}: averaged_frames must be 1 to {most_averaged}", device=self.who, most_averaged=MAX_AVERAGED
            )
        assert 1 <= averaged_frames <= 100
        shot = self._after_now()
        depth = shot.depth_mm()
        if averaged_frames > 1:
            depth, shot = self._averaged(shot, averaged_frames)
        self._check_depth(depth)
        return self._note(shot).put_on(Image.fromarray(depth))

    @action
    def fix_exposure(self, exposure: float, *, an: str | None = None) -> None:
        """Set a fixed exposure time.

        :param exposure: seconds, 0.00001 to 0.033
        """
        self.set_exposure(exposure)

    @action
    def auto_exposure(self, *, an: str | None = None) -> None:
        """Let the camera set the exposure time."""
        self.set_exposure(None)

    # -------------------------------------------------------------------------------- images
    def _after_now(self) -> "ImagePair":
        """Return an image whose exposure starts after this call."""
        began = time.monotonic()
        newest = self.newest(self._config.frame_timeout + self._config.max_age)
        exposure = MAX_EXPOSURE_TIME if newest.exposure is None else newest.exposure
        return self.next_after(began + exposure, self._config.frame_timeout)

    def _note(self, shot: "ImagePair") -> PictureNote:
        taken = datetime.datetime.now(datetime.UTC) - datetime.timedelta(seconds=time.monotonic() - shot.monotonic)
        return PictureNote(self.feed.parameters, self.pose, taken.isoformat(timespec="microseconds"), self.name)

    def _frame(self, shot: "ImagePair") -> Frame:
        depth = shot.depth_mm().copy()
        return Frame(shot.color_rgb(), depth if depth.any() else None, self._note(shot), shot.monotonic, shot.exposure)

    def _averaged(self, shot: "ImagePair", count: int) -> "tuple[npt.NDArray[np.uint16], ImagePair]":
        """Return the mean of the valid depths of each pixel over `count` frames, and the last frame."""
        import numpy as np

        first = shot.depth_mm()
        total, valid = first.astype(np.uint32), (first > 0).astype(np.uint32)
        for _ in range(count - 1):
            shot = self.next_after(shot.monotonic, self._config.frame_timeout)
            depth = shot.depth_mm()
            total += depth
            valid += depth > 0
        mean = (total + valid // 2) // np.maximum(valid, 1)
        # Pixels at edges flicker: use only those that are valid in at least half of the frames.
        return np.where(2 * valid >= count, mean, 0).astype(np.uint16), shot

    def _check_light(self, color: "npt.NDArray[np.uint8]", shot: "ImagePair") -> None:
        sample = color[::SAMPLE_STEP, ::SAMPLE_STEP]
        white = float((sample.min(axis=2) >= WHITE).mean())
        if white > self._config.white_limit:
            if shot.exposure is None:
                raise Overexposed("{device}: {white:.0%} of the image is white", device=self.who, white=white)
            raise Overexposed(
                "{device}: {white:.0%} of the image is white with an exposure of {exposure:g} ms",
                device=self.who,
                white=white,
                exposure=shot.exposure * 1e3,
            )
        if (mean := float(sample.mean())) < BLACK:
            raise DeviceFault(
                "{device}: the image is black. Check that the lens is not covered and the light is on.",
                f"mean brightness {mean:.1f} of 255",
                "dark",
                device=self.who,
            )

    def _check_depth(self, depth: "npt.NDArray[np.uint16]") -> None:
        valid = float((depth[::SAMPLE_STEP, ::SAMPLE_STEP] > 0).mean())
        if valid < MIN_DEPTH:
            near, far = self.depth_range()
            raise NoDepth(
                "{device}: only {valid:.1%} of the image has valid depth. Check that the lens is not covered, that "
                "stereo is on, and that objects are {near:g} to {far:g} m away.",
                device=self.who,
                valid=valid,
                near=near,
                far=far,
            )
