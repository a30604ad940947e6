"""Feeds: sources of images, each a depthai pipeline that ends in a Sync node on the host and a queue.

device_feed builds the pipeline from the nodes of a camera, network_feed from a host node that reads a network stream.
These modules import depthai; they are imported only when a camera is connected.
"""

import contextlib
import datetime
from typing import Any, Final, NamedTuple, Protocol

import depthai as dai
import numpy as np
import numpy.typing as npt

from arcor2_hw.data.camera import CameraParameters
from arcor2_hw.data.device import Identity

SYNC_THRESHOLD: Final = datetime.timedelta(milliseconds=17)
"""Longest time between colour and depth images of one instant: half a period at 30 Hz."""
QUEUE_SIZE: Final = 2
JPEG: Final = dai.ImgFrame.Type.BITSTREAM


class ImagePair(NamedTuple):
    """Colour and depth images of one instant, taken at `monotonic` (this computer's clock, s)."""

    color: dai.ImgFrame
    depth: dai.ImgFrame
    monotonic: float

    @property
    def exposure(self) -> float | None:
        """Return the exposure time, s; None when the source does not report it."""
        seconds = self.color.getExposureTime().total_seconds()
        return seconds if seconds > 0.0 else None

    def depth_mm(self) -> npt.NDArray[np.uint16]:
        """Return the depth image: height × width, mm. It shares the memory of the message."""
        data = np.asarray(self.depth.getData())
        return data.view("<u2").reshape(self.depth.getHeight(), self.depth.getWidth())

    def color_rgb(self) -> npt.NDArray[np.uint8]:
        """Return a copy of the colour image: height × width × 3, R, G, B."""
        data = np.asarray(self.color.getData())
        if self.color.getType() == JPEG:
            import io

            from PIL import Image

            with Image.open(io.BytesIO(data.tobytes())) as image:
                return np.asarray(image.convert("RGB"))
        bgr = data.reshape(self.color.getHeight(), self.color.getWidth(), 3)
        return np.ascontiguousarray(bgr[:, :, ::-1])


class Feed(Protocol):
    """A source of images."""

    identity: Identity
    parameters: CameraParameters
    size: tuple[int, int]
    depth_range: tuple[float, float]

    def next(self, timeout: float) -> ImagePair | None:
        """Return the next image; None when none came within `timeout` s. Raises DeviceError when the source is lost."""

    def temperature(self) -> float | None:
        """Return the temperature of the chip, °C; None when unknown."""

    def set_exposure(self, exposure: float | None, timeout: float) -> None:
        """Set the exposure time, s; None: automatic. Raises Refused, DeviceTimeout, ConnectionLost."""

    def close(self) -> None:
        """Close; does nothing when closed."""


class Pipeline:
    """The end of every pipeline: it pairs colour and depth images of one instant."""

    def __init__(self, pipeline: dai.Pipeline, color: dai.Node.Output, depth: dai.Node.Output) -> None:
        self._pipeline = pipeline
        sync = pipeline.create(dai.node.Sync)
        sync.setRunOnHost(True)
        sync.setSyncThreshold(SYNC_THRESHOLD)
        color.link(sync.inputs["color"])
        depth.link(sync.inputs["depth"])
        self._queue = sync.out.createOutputQueue(QUEUE_SIZE, False)

    def start(self) -> None:
        """Start the pipeline."""
        self._pipeline.start()

    def next(self, timeout: float) -> ImagePair | None:
        """Return the next image; None when none came within `timeout` s, or after `close`."""
        try:
            group: Any = self._queue.get(datetime.timedelta(seconds=timeout))
        except RuntimeError:  # the queue was closed
            return None
        if group is None:
            return None
        color, depth = group["color"], group["depth"]
        return ImagePair(color, depth, color.getTimestamp().total_seconds())

    def close(self) -> None:
        """Stop the pipeline; does nothing when stopped."""
        with contextlib.suppress(RuntimeError):  # its device has closed it
            self._pipeline.stop()
            self._pipeline.wait()
