"""NetworkFeed: images of a network source, by a depthai pipeline without a device."""

import datetime
import time
from typing import Any, Final

import depthai as dai
import numpy as np

from arcor2_hw.data.device import Identity
from arcor2_hw.exceptions import DeviceError, DeviceFault
from arcor2_hw.messages import Message

from .calibration import handler_of, parameters
from .feed import JPEG, ImagePair, Pipeline
from .network import NetworkSource
from .settings import OakDSettings
from .stream import Status

CHECK_PERIOD: Final = 0.1
"""Time between checks for a failed source while waiting for an image, s."""


class _StreamNode(dai.node.ThreadedHostNode):
    """The node that reads frames from the stream. It runs on a thread of depthai: do not log there."""

    def __init__(self) -> None:
        super().__init__()
        self.color = self.createOutput()
        self.depth = self.createOutput()
        self.source: NetworkSource
        self.first_timeout = self.timeout = 1.0
        self.failure: BaseException | None = None

    def run(self) -> None:
        """Send frames until the pipeline stops."""
        source = self.source
        size = (source.hello.width, source.hello.height)
        no_depth = np.zeros(size[0] * size[1] * 2, np.uint8)
        timeout = self.first_timeout
        try:
            while self.isRunning():
                frame = source.next_frame(timeout)
                timeout = self.timeout
                kind = dai.ImgFrame.Type.BGR888i if frame.header.color == "bgr" else JPEG
                exposure = frame.header.exposure
                stamp, number = datetime.timedelta(seconds=frame.monotonic), frame.header.number
                self.color.send(_image(frame.color, kind, size, stamp, number, exposure))
                depth = frame.depth if len(frame.depth) else no_depth
                self.depth.send(_image(depth, dai.ImgFrame.Type.RAW16, size, stamp, number, exposure))
        except BaseException as e:  # noqa: BLE001 - raised by the thread that waits for images
            self.failure = e


def _image(
    data: Any, kind: Any, size: tuple[int, int], stamp: datetime.timedelta, number: int, exposure: float | None
) -> dai.ImgFrame:
    image = dai.ImgFrame()
    pixels: Any = np.frombuffer(data, np.uint8)
    image.setData(pixels)
    image.setType(kind)
    image.setWidth(size[0])
    image.setHeight(size[1])
    image.setTimestamp(stamp)
    image.setSequenceNum(number)
    image.cam.exposureTimeUs = 0 if exposure is None else round(exposure * 1e6)
    return image


class NetworkFeed:
    """A network source; see NetworkSource for the connection."""

    def __init__(self, who: str | Message, name: str, settings: OakDSettings, timeout: float) -> None:
        deadline = time.monotonic() + timeout
        assert settings.network is not None
        self.who = who
        self._status: Status | None = None
        self._source = NetworkSource(who, *settings.network, str(settings.color_coding), self._on_status)
        self._pipeline: Pipeline | None = None
        try:
            self._source.open(deadline)
            hello = self._source.hello
            self.identity = Identity(hello.vendor, hello.model, hello.serial, hello.firmware)
            self.size, self.depth_range = (hello.width, hello.height), hello.depth_range
            self.parameters = parameters(who, handler_of(who, self._source.eeprom), *self.size, undistorted=False)
            pipeline = dai.Pipeline(createImplicitDevice=False)
            self._node = pipeline.create(_StreamNode)
            self._node.source, self._node.timeout = self._source, settings.frame_timeout
            self._pipeline = Pipeline(pipeline, self._node.color, self._node.depth)
            self._source.start(name)
            self._node.first_timeout = max(deadline - time.monotonic(), 0.001)
            self._pipeline.start()
        except BaseException:
            self.close()
            raise

    def _on_status(self, status: Status) -> None:
        self._status = status

    def next(self, timeout: float) -> ImagePair | None:
        """Return the next image; None when none came within `timeout` s. Raises DeviceError when the source is lost."""
        until = time.monotonic() + timeout
        while self._pipeline is not None:
            shot = self._pipeline.next(min(CHECK_PERIOD, max(until - time.monotonic(), 0.0)))
            if shot is not None:
                return shot
            error = self._node.failure
            if isinstance(error, DeviceError):
                raise error
            if error is not None:
                raise DeviceFault(
                    "{device}: {type}: {reason}", device=self.who, type=type(error).__name__, reason=error
                ) from error
            if time.monotonic() >= until:
                break
        return None

    def temperature(self) -> float | None:
        """Return the temperature that the source reported last, °C; None before the first report."""
        return None if self._status is None else self._status.temperature

    def set_exposure(self, exposure: float | None, timeout: float) -> None:
        """Set the exposure time, s; None: automatic. Raises Refused, DeviceTimeout, ConnectionLost."""
        self._source.set_exposure(exposure, timeout)

    def close(self) -> None:
        """Close; does nothing when closed."""
        self._source.close()
        pipeline, self._pipeline = self._pipeline, None
        if pipeline is not None:
            pipeline.close()
