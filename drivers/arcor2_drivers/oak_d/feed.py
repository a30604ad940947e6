"""Feeds: a depthai pipeline that ends in a host Sync and a queue, whichever source is behind it.

A camera gives its own colour and stereo nodes, a network source a host node that is fed from the stream: device_feed,
network_feed. These modules import depthai and are themselves imported only when a camera is connected.
"""

import contextlib
import datetime
from typing import Any, Final, NamedTuple, Protocol

import depthai as dai
import numpy as np
import numpy.typing as npt

from arcor2_hw.data.camera import CameraParameters
from arcor2_hw.data.device import Identity

MATCHED: Final = datetime.timedelta(milliseconds=17)
"""Colour and depth further apart are not of one instant: half a picture at 30 Hz."""
QUEUE: Final = 2
JPEG: Final = dai.ImgFrame.Type.BITSTREAM


class Shot(NamedTuple):
    """Colour and depth of one instant as depthai has them; `monotonic` in s on this computer's clock."""

    color: dai.ImgFrame
    depth: dai.ImgFrame
    monotonic: float

    @property
    def number(self) -> int:
        """Return the number that the source gave it."""
        return int(self.color.getSequenceNum())

    @property
    def exposure(self) -> float | None:
        """Return the exposure, s; None when the source does not tell."""
        seconds = self.color.getExposureTime().total_seconds()
        return seconds if seconds > 0.0 else None

    def depth_mm(self) -> npt.NDArray[np.uint16]:
        """Return the depth: height × width, mm; of the message's own memory."""
        data = np.asarray(self.depth.getData())
        return data.view("<u2").reshape(self.depth.getHeight(), self.depth.getWidth())

    def color_rgb(self) -> npt.NDArray[np.uint8]:
        """Return the colour as a copy: height × width × 3, R, G, B."""
        data = np.asarray(self.color.getData())
        if self.color.getType() == JPEG:
            import io

            from PIL import Image

            with Image.open(io.BytesIO(data.tobytes())) as picture:
                return np.asarray(picture.convert("RGB"))
        bgr = data.reshape(self.color.getHeight(), self.color.getWidth(), 3)
        return np.ascontiguousarray(bgr[:, :, ::-1])


class Feed(Protocol):
    """Where pictures come from."""

    identity: Identity
    parameters: CameraParameters
    size: tuple[int, int]
    depth_range: tuple[float, float]

    def next(self, timeout: float) -> Shot | None:
        """Wait for the next picture; None when none came. Raises what the source was lost by."""

    def temperature(self) -> float | None:
        """Return the temperature of the chip, deg C; None when it is not told."""

    def set_exposure(self, exposure: float | None, timeout: float) -> None:
        """Set the exposure, s, None for automatic. Raises Refused, DeviceTimeout, ConnectionLost."""

    def close(self) -> None:
        """Close; does nothing when closed."""


class Pipeline:
    """The common end of every pipeline: what comes out has colour and depth of one instant."""

    def __init__(self, pipeline: dai.Pipeline, color: dai.Node.Output, depth: dai.Node.Output) -> None:
        self._pipeline = pipeline
        sync = pipeline.create(dai.node.Sync)
        sync.setRunOnHost(True)
        sync.setSyncThreshold(MATCHED)
        color.link(sync.inputs["color"])
        depth.link(sync.inputs["depth"])
        self._queue = sync.out.createOutputQueue(QUEUE, False)

    def start(self) -> None:
        """Start it."""
        self._pipeline.start()

    def next(self, timeout: float) -> Shot | None:
        """Wait for the next picture; None when none came."""
        try:
            group: Any = self._queue.get(datetime.timedelta(seconds=timeout))
        except RuntimeError:  # the queue was closed
            return None
        if group is None:
            return None
        color, depth = group["color"], group["depth"]
        return Shot(color, depth, color.getTimestamp().total_seconds())

    def close(self) -> None:
        """Stop it; harmless when it was stopped."""
        with contextlib.suppress(RuntimeError):  # it was closed by its device
            self._pipeline.stop()
            self._pipeline.wait()
