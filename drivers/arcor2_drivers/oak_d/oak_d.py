"""An OAK-D camera as an object type: colour and aligned depth of one instant, never an old one."""

import datetime
import time
from typing import TYPE_CHECKING, ClassVar, Final

from arcor2_hw.actions import action
from arcor2_hw.data.camera import CameraParameters
from arcor2_hw.data.device import Alarm, Connection, Health, Identity, LossReaction
from arcor2_hw.data.geometry import Pose
from arcor2_hw.data.object_type import Models
from arcor2_hw.exceptions import DeviceFault, NoDepth, OutOfRange, Overexposed
from arcor2_hw.objects import Camera
from arcor2_hw.objects.camera import Mode
from arcor2_hw.objects.frame import Frame, PictureNote
from arcor2_hw.objects.generic import DEFAULT_CONNECT_TIMEOUT

from .observed import Observed
from .settings import OakDSettings, Resolution, size_of

if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt
    from PIL import Image

    from .feed import Shot

SHORTEST: Final = 0.00001
LONGEST: Final = 0.033
"""s; the colour sensor's limits at 30 Hz."""
WHITE: Final = 250
BLACK: Final = 10.0
"""Mean of a picture below which nothing can be seen in it."""
LEAST_DEPTH: Final = 0.02
"""Part of the picture that has to have a depth."""
EVERY: Final = 4
"""Of rows and columns, enough to judge a picture by."""
MOST_AVERAGED: Final = 100


class OakD(Camera):
    """An OAK-D camera: colour with depth in the same view, over USB, Ethernet or a network source."""

    _ABSTRACT = False
    loss_reaction: ClassVar[LossReaction] = LossReaction.holds()  # nothing of it moves

    def __init__(
        self,
        obj_id: str,
        name: str,
        pose: Pose,
        collision_model: Models | None = None,
        settings: OakDSettings | None = None,
    ) -> None:
        super().__init__(obj_id, name, pose, collision_model, settings)
        self._given = settings or OakDSettings()
        self._observed = Observed(name, self._given)

    # -------------------------------------------------------------------------------- connection
    def connect(self, timeout: float = DEFAULT_CONNECT_TIMEOUT) -> None:
        """Find the camera, start it and take its first picture, within `timeout` s.

        Raises NotConnected when it is not there, is used by another, or depthai is not installed; DeviceTimeout;
        DeviceFault for a calibration or a stream that makes no sense.
        """
        self._observed.connect(timeout)
        self.color_camera_params = self._observed.feed.parameters

    def disconnect(self) -> None:
        """Stop taking pictures; does nothing when stopped."""
        self._observed.disconnect()
        self.color_camera_params = None

    @property
    def connection(self) -> Connection:
        """Return the state of the connection."""
        return self._observed.observing.state

    @property
    def health(self) -> Health:
        """Return failure when it is lost or repeats an old picture, off_spec when it is too hot."""
        return self._observed.health()

    def alarms(self) -> list[Alarm]:
        """Return what a person should deal with: hot, frozen; each ends with its cause."""
        return self._observed.alarms()

    def identify(self) -> Identity:
        """Return who the camera said it is."""
        return self._observed.feed.identity

    @property
    def pictures_taken(self) -> int:
        """Return how many pictures have come since the object was made."""
        return self._observed.taken

    @property
    def latency(self) -> float:
        """Return how old the newest picture was when it came, s. Raises NotConnected, ConnectionLost."""
        return self._observed.latency

    # -------------------------------------------------------------------------------- camera
    def capture(self) -> Frame:
        """Return the newest colour and depth. Raises Stale when they are older than `max_age` of the settings."""
        return self._frame(self._observed.newest(self._given.max_age))

    def trigger(self) -> Frame:
        """Return colour and depth whose exposure began after this call. Raises Stale when none come in time."""
        return self._frame(self._after_now())

    def distortion_model(self) -> str:
        """Return the model of the lens that the parameters are of: none, or OpenCV's by its number of coefficients."""
        coefficients = self._parameters().dist_coefs
        return f"opencv {len(coefficients)}" if any(coefficients) else "none"

    def depth_range(self) -> tuple[float, float]:
        """Return the nearest and the farthest depth that is measured, m."""
        return self._observed.feed.depth_range

    def modes(self) -> list[Mode]:
        """Return the sizes that the settings can ask for; for a network source what it sends."""
        if self._given.network is not None:
            return [Mode(*self._observed.feed.size, self._given.fps)]
        sizes = [size_of(each) for each in Resolution]
        return [Mode(width, height, self._given.fps) for width, height in sizes]

    def set_exposure(self, exposure: float | None) -> None:
        """Set the exposure, s; None leaves it to the camera. Raises OutOfRange, Refused, DeviceTimeout."""
        if exposure is not None and not SHORTEST <= exposure <= LONGEST:
            raise OutOfRange(
                "{device}: exposure must be {shortest:g} to {longest:g} s, not {exposure:g} s",
                device=self._observed.who,
                shortest=SHORTEST,
                longest=LONGEST,
                exposure=exposure,
            )
        self._observed.set_exposure(exposure)

    def stop(self) -> None:
        """End what waits for a picture, which then raises Cancelled; the camera keeps taking pictures."""
        self._observed.stop_waiting()

    # -------------------------------------------------------------------------------- actions
    @action
    def color_image(self, *, an: str | None = None) -> "Image.Image":
        """Take a colour picture; what is seen in it was there when the action began or later."""
        from PIL import Image

        shot = self._after_now()
        color = shot.color_rgb()
        self._check_light(color, shot)
        return self._note(shot).put_on(Image.fromarray(color))

    @action
    def depth_image(self, averaged_frames: int = 1, *, an: str | None = None) -> "Image.Image":
        """Take a depth picture: 16 bit, mm, 0 = invalid, in the colour camera's view.

        :param averaged_frames: how many frames are averaged
        """
        from PIL import Image

        if not 1 <= averaged_frames <= MOST_AVERAGED:
            raise OutOfRange(
                "{device}: averaged_frames must be 1 to {most_averaged}",
                device=self._observed.who,
                most_averaged=MOST_AVERAGED,
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
        """Set how long each picture is exposed.

        :param exposure: seconds, 0.00001 to 0.033
        """
        self.set_exposure(exposure)

    @action
    def auto_exposure(self, *, an: str | None = None) -> None:
        """Leave the exposure to the camera."""
        self.set_exposure(None)

    # -------------------------------------------------------------------------------- pictures
    def _parameters(self) -> CameraParameters:
        return self._observed.feed.parameters

    def _after_now(self) -> "Shot":
        """Wait for a picture that shows nothing of before the call: its exposure began after it."""
        began = time.monotonic()
        exposure = LONGEST
        newest = self._observed.newest(self._given.frame_timeout + self._given.max_age)
        if newest.exposure is not None:
            exposure = newest.exposure
        return self._observed.after(began + exposure, self._given.frame_timeout)

    def _note(self, shot: "Shot") -> PictureNote:
        taken = datetime.datetime.now(datetime.UTC) - datetime.timedelta(seconds=time.monotonic() - shot.monotonic)
        return PictureNote(self._parameters(), self.pose, taken.isoformat(timespec="microseconds"), self.name)

    def _frame(self, shot: "Shot") -> Frame:
        depth = shot.depth_mm().copy()
        return Frame(shot.color_rgb(), depth if depth.any() else None, self._note(shot), shot.monotonic, shot.exposure)

    def _averaged(self, shot: "Shot", count: int) -> "tuple[npt.NDArray[np.uint16], Shot]":
        """Return the mean of `count` frames, of each pixel where it was valid, and the last of them."""
        import numpy as np

        first = shot.depth_mm()
        total, valid = first.astype(np.uint32), (first > 0).astype(np.uint32)
        for _ in range(count - 1):
            shot = self._observed.after(shot.monotonic, self._given.frame_timeout)
            depth = shot.depth_mm()
            total += depth
            valid += depth > 0
        mean = (total + valid // 2) // np.maximum(valid, 1)
        # Half of the frames have to agree that there is something, or what flickers at an edge becomes a surface.
        return np.where(2 * valid >= count, mean, 0).astype(np.uint16), shot

    def _check_light(self, color: "npt.NDArray[np.uint8]", shot: "Shot") -> None:
        looked_at = color[::EVERY, ::EVERY]
        white = float((looked_at.min(axis=2) >= WHITE).mean())
        if white > self._given.white_limit:
            exposed = "" if shot.exposure is None else f" with an exposure of {shot.exposure * 1e3:g} ms"
            raise Overexposed(
                "{device}: {white:.0%} of the picture are white{exposed}",
                device=self._observed.who,
                white=white,
                exposed=exposed,
            )
        if (mean := float(looked_at.mean())) < BLACK:
            raise DeviceFault(
                "{device}: the picture is black: the lens is covered, or there is no light",
                f"mean {mean:.1f} of 255",
                "dark",
                device=self._observed.who,
            )

    def _check_depth(self, depth: "npt.NDArray[np.uint16]") -> None:
        valid = float((depth[::EVERY, ::EVERY] > 0).mean())
        if valid < LEAST_DEPTH:
            near, far = self.depth_range()
            raise NoDepth(
                "{device}: {valid:.1%} of the picture have a depth: the lens is covered, stereo "
                "is off, or nothing is within {near:g} and {far:g} m",
                device=self._observed.who,
                valid=valid,
                near=near,
                far=far,
            )
