"""Settings of an OAK-D."""

import dataclasses
import math
import re
from typing import Annotated, Final

from arcor2_hw.actions import StrEnum
from arcor2_hw.exceptions import OutOfRange
from arcor2_hw.objects import Settings
from arcor2_hw.objects.settings import Range

_NETWORK: Final = re.compile(r"(\[[0-9a-fA-F:.]+\]|[^:\[\]\s]+):(\d{1,5})")


class Resolution(StrEnum):
    """Size of colour and depth images, pixels."""

    HD = "1280x720"
    VGA = "640x480"
    SMALL = "640x360"


def size_of(resolution: Resolution) -> tuple[int, int]:
    """Return width and height, pixels."""
    width, height = resolution.value.split("x")
    return int(width), int(height)


class ColorCoding(StrEnum):
    """How a network source sends colour."""

    RAW = "bgr"
    JPEG = "jpeg"


@dataclasses.dataclass
class OakDSettings(Settings):
    """Which camera to use, and how.

    :param address: device id (MXID) or IP of the camera, host:port of a network source, or empty for the only camera
    :param resolution: size of the images; a network source determines its own
    :param fps: images per second, 1 to 60
    :param max_age: age from which on an image is too old, s
    :param frame_timeout: seconds without an image after which the camera counts as lost
    :param color_coding: how a network source sends colour: bgr, or jpeg over a slow network
    :param white_limit: part of the image (0 to 1) that may be white before it counts as overexposed
    """

    address: str = dataclasses.field(default="", metadata={"found_by": "oak"})
    resolution: Resolution = Resolution.HD
    fps: Annotated[float, Range(1.0, 60.0)] = 30.0
    max_age: float = 0.5
    frame_timeout: float = 1.0
    color_coding: ColorCoding = ColorCoding.RAW
    white_limit: float = 0.5

    def __post_init__(self) -> None:
        super().__post_init__()
        self.address = self.address.strip()
        if ":" in self.address and self.network is None:
            raise OutOfRange(
                "address must be a device id, an IP address or host:port, not {address!r}", address=self.address
            )
        if not (math.isfinite(self.max_age) and 1.0 / self.fps < self.max_age <= 10.0):
            raise OutOfRange("max_age must be more than one image ({fps:.3f} s) and at most 10 s", fps=1.0 / self.fps)
        if not (math.isfinite(self.frame_timeout) and 2.0 / self.fps < self.frame_timeout <= 10.0):
            raise OutOfRange(
                "frame_timeout must be more than two images ({fps:.3f} s) and at most 10 s", fps=2.0 / self.fps
            )
        if not 0.0 < self.white_limit <= 1.0:
            raise OutOfRange(
                "white_limit must be above 0 and at most 1, not {white_limit!r}", white_limit=self.white_limit
            )

    @property
    def network(self) -> tuple[str, int] | None:
        """Return host and port of a network source, None for a camera."""
        found = _NETWORK.fullmatch(self.address)
        if found is None or not 0 < int(found[2]) < 65536:
            return None
        return found[1].strip("[]"), int(found[2])

    @property
    def size(self) -> tuple[int, int]:
        """Return width and height, pixels."""
        return size_of(self.resolution)
