"""Feeds: a depthai pipeline that ends in a host Sync and a queue, whichever source is behind it.

A camera gives its own colour and stereo nodes, a network source a host node that is fed from the stream. This module
imports depthai and is itself imported only when a camera is connected.
"""

import contextlib
import datetime
import os
import threading
import time
from typing import Any, Final, NamedTuple, Protocol

os.environ.setdefault("DEPTHAI_LEVEL", "error")  # it warns of USB that a container or a server may well lack

import depthai as dai
import numpy as np
import numpy.typing as npt

from arcor2_hw.data.camera import CameraParameters
from arcor2_hw.data.device import Identity
from arcor2_hw.exceptions import (
    ConnectionLost,
    DeviceError,
    DeviceFault,
    DeviceTimeout,
    NotConnected,
    Refused,
)

from .calibration import BadCalibration, handler_of, parameters
from .network import NetworkSource
from .settings import OakDSettings
from .stream import Status

MATCHED: Final = datetime.timedelta(milliseconds=17)
"""Colour and depth further apart are not of one instant: half a picture at 30 Hz."""
QUEUE: Final = 2
LOOK: Final = 0.1
"""s after which somebody who waits for a picture looks whether the source has failed."""
POE_PORT: Final = 11490
"""TCP port on which PoE cameras take a host (from general knowledge of XLink)."""
MONO_SIZE: Final = (640, 400)
DEPTH_RANGE: Final = (0.35, 10.0)
"""m, of the OAK-D's 75 mm base with extended disparity (from general knowledge of the camera)."""
ISO: Final = 400
JPEG: Final = dai.ImgFrame.Type.BITSTREAM


class Shot(NamedTuple):
    """Colour and depth of one instant as depthai has them; `monotonic` in s on this computer's clock."""

    color: dai.ImgFrame
    depth: dai.ImgFrame
    monotonic: float

    @property
    def number(self) -> int:
        """Give the number that the source gave it."""
        return int(self.color.getSequenceNum())

    @property
    def exposure(self) -> float | None:
        """Give the exposure, s; None when the source does not tell."""
        seconds = self.color.getExposureTime().total_seconds()
        return seconds if seconds > 0.0 else None

    def depth_mm(self) -> npt.NDArray[np.uint16]:
        """Give the depth: height × width, mm; of the message's own memory."""
        data = np.asarray(self.depth.getData())
        return data.view("<u2").reshape(self.depth.getHeight(), self.depth.getWidth())

    def color_rgb(self) -> npt.NDArray[np.uint8]:
        """Give the colour as a copy: height × width × 3, R, G, B."""
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
        """Give the temperature of the chip, deg C; None when it is not told."""

    def set_exposure(self, exposure: float | None, timeout: float) -> None:
        """Set the exposure, s, None for automatic. Raises Refused, DeviceTimeout, ConnectionLost."""

    def close(self) -> None:
        """Close; harmless when closed."""


class _Pipeline:
    """The common end of every pipeline."""

    def __init__(self, pipeline: dai.Pipeline, color: dai.Node.Output, depth: dai.Node.Output) -> None:
        self._pipeline = pipeline
        sync = pipeline.create(dai.node.Sync)
        sync.setRunOnHost(True)
        sync.setSyncThreshold(MATCHED)
        color.link(sync.inputs["color"])
        depth.link(sync.inputs["depth"])
        self._queue = sync.out.createOutputQueue(QUEUE, False)

    def start(self) -> None:
        self._pipeline.start()

    def next(self, timeout: float) -> Shot | None:
        try:
            group: Any = self._queue.get(datetime.timedelta(seconds=timeout))
        except RuntimeError:  # the queue was closed
            return None
        if group is None:
            return None
        color, depth = group["color"], group["depth"]
        return Shot(color, depth, color.getTimestamp().total_seconds())

    def close(self) -> None:
        with contextlib.suppress(RuntimeError):  # it was closed by its device
            self._pipeline.stop()
            self._pipeline.wait()


# -------------------------------------------------------------------------------------------------- network source
class _Network(dai.node.ThreadedHostNode):
    """The node that takes frames from the stream. Its thread is depthai's: no logging there, nothing that counts it."""

    def __init__(self) -> None:
        super().__init__()
        self.color = self.createOutput()
        self.depth = self.createOutput()
        self.source: NetworkSource
        self.first_within = self.timeout = 1.0
        self.failure: BaseException | None = None

    def run(self) -> None:
        """Take frames until told to end."""
        source = self.source
        size = (source.hello.width, source.hello.height)
        nothing = np.zeros(size[0] * size[1] * 2, np.uint8)
        timeout = self.first_within
        try:
            while self.isRunning():
                frame = source.next_frame(timeout)
                timeout = self.timeout
                kind = dai.ImgFrame.Type.BGR888i if frame.header.color == "bgr" else JPEG
                exposure = frame.header.exposure
                stamp, number = datetime.timedelta(seconds=frame.monotonic), frame.header.number
                self.color.send(_image(frame.color, kind, size, stamp, number, exposure))
                depth = frame.depth if len(frame.depth) else nothing
                self.depth.send(_image(depth, dai.ImgFrame.Type.RAW16, size, stamp, number, exposure))
        except BaseException as e:  # noqa: BLE001 - told to the thread that waits for pictures
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
    """A network source."""

    def __init__(self, who: str, name: str, settings: OakDSettings, timeout: float) -> None:
        deadline = time.monotonic() + timeout
        assert settings.network is not None
        self.who = who
        self._told: Status | None = None
        self._source = NetworkSource(who, *settings.network, str(settings.color_coding), self._status)
        self._pipeline: _Pipeline | None = None
        try:
            self._source.open(deadline)
            hello = self._source.hello
            self.identity = Identity(hello.vendor, hello.model, hello.serial, hello.firmware)
            self.size, self.depth_range = (hello.width, hello.height), hello.depth_range
            self.parameters = parameters(handler_of(self._source.eeprom), *self.size, undistorted=False)
            pipeline = dai.Pipeline(createImplicitDevice=False)
            self._node = pipeline.create(_Network)
            self._node.source, self._node.timeout = self._source, settings.frame_timeout
            self._pipeline = _Pipeline(pipeline, self._node.color, self._node.depth)
            self._source.start(name)
            self._node.first_within = max(deadline - time.monotonic(), 0.001)
            self._pipeline.start()
        except BadCalibration as e:
            self.close()
            raise DeviceFault(f"{who}: {e}", "", "calibration") from e
        except BaseException:
            self.close()
            raise

    def _status(self, status: Status) -> None:
        self._told = status

    def next(self, timeout: float) -> Shot | None:
        """Wait for the next picture; None when none came. Raises what the source was lost by."""
        until = time.monotonic() + timeout
        while self._pipeline is not None:
            shot = self._pipeline.next(min(LOOK, max(until - time.monotonic(), 0.0)))
            if shot is not None:
                return shot
            error = self._node.failure
            if isinstance(error, DeviceError):
                raise error
            if error is not None:
                raise DeviceFault(f"{self.who}: {type(error).__name__}: {error}") from error
            if time.monotonic() >= until:
                break
        return None

    def temperature(self) -> float | None:
        """Give the temperature that the source told last, deg C."""
        return None if self._told is None else self._told.temperature

    def set_exposure(self, exposure: float | None, timeout: float) -> None:
        """Set the exposure, s, None for automatic. Raises Refused, DeviceTimeout, ConnectionLost."""
        self._source.set_exposure(exposure, timeout)

    def close(self) -> None:
        """Close; harmless when closed."""
        self._source.close()
        pipeline, self._pipeline = self._pipeline, None
        if pipeline is not None:
            pipeline.close()


# -------------------------------------------------------------------------------------------------- camera
def find(who: str, address: str, timeout: float) -> dai.DeviceInfo:
    """Look for the camera before it is opened: opening one that is not there takes 11.5 s. Raises NotConnected."""
    found = dai.Device.getAllAvailableDevices()
    matching = [info for info in found if address in ("", info.getDeviceId(), info.name)]
    if len(matching) > 1:
        raise NotConnected(f"{who}: there are {len(matching)} cameras; give the device id of one", _listed(found))
    if matching:
        return matching[0]
    if _is_ip(address):  # beyond a router it does not answer to the search
        import socket

        try:
            socket.create_connection((address, POE_PORT), timeout).close()
        except OSError as e:
            raise NotConnected(f"{who} cannot be reached", str(e)) from e
        return dai.DeviceInfo(address)
    raise NotConnected(f"{who} is not there: is it plugged in, and free?", _listed(found))


def _listed(found: list[dai.DeviceInfo]) -> str:
    return "found: " + (", ".join(f"{info.getDeviceId()} ({info.name})" for info in found) or "none")


def _is_ip(address: str) -> bool:
    parts = address.split(".")
    return len(parts) == 4 and all(part.isdigit() and int(part) < 256 for part in parts)


def boot(who: str, info: dai.DeviceInfo, timeout: float) -> dai.Device:
    """Open a camera within `timeout` s; one that comes up later is closed again. Raises DeviceTimeout, NotConnected."""
    box: list[dai.Device | BaseException] = []
    late = threading.Event()

    def run() -> None:
        try:
            device = dai.Device(info)
        except BaseException as e:  # noqa: BLE001 - told to who waits
            box.append(e)
            return
        box.append(device)
        if late.is_set():
            device.close()

    thread = threading.Thread(target=run, name=f"booting {who}", daemon=True)
    thread.start()
    thread.join(timeout)
    if not box:
        late.set()
        raise DeviceTimeout(f"{who} has not started within {timeout:.1f} s")
    if isinstance(box[0], BaseException):
        raise NotConnected(f"{who} cannot be opened; another program may use it", str(box[0])) from box[0]
    return box[0]


class DeviceFeed:
    """A camera on USB or the network. Colour is undistorted on the camera, and depth aligned to that."""

    def __init__(self, who: str, name: str, settings: OakDSettings, timeout: float) -> None:
        deadline = time.monotonic() + timeout
        self.who = who
        info = find(who, settings.address, timeout)
        self._device = boot(who, info, max(deadline - time.monotonic(), 0.1))
        self._pipeline: _Pipeline | None = None
        try:
            self.size, self.depth_range = settings.size, DEPTH_RANGE
            pipeline = dai.Pipeline(self._device)
            sockets = dai.CameraBoardSocket
            camera = pipeline.create(dai.node.Camera).build(sockets.CAM_A)
            color = camera.requestOutput(
                self.size, dai.ImgFrame.Type.BGR888i, fps=settings.fps, enableUndistortion=True
            )
            left, right = (
                pipeline.create(dai.node.Camera).build(socket).requestOutput(MONO_SIZE, fps=settings.fps)
                for socket in (sockets.CAM_B, sockets.CAM_C)
            )
            stereo = pipeline.create(dai.node.StereoDepth).build(left, right)
            stereo.setLeftRightCheck(True)
            stereo.setExtendedDisparity(True)
            depth = stereo.depth
            if self._device.getPlatform() == dai.Platform.RVC4:  # aligns in a node of its own
                align = pipeline.create(dai.node.ImageAlign)
                stereo.depth.link(align.input)
                color.link(align.inputAlignTo)
                depth = align.outputAligned
            else:
                color.link(stereo.inputAlignTo)
            self._control = camera.inputControl.createInputQueue()
            self._pipeline = _Pipeline(pipeline, color, depth)
            self.parameters = parameters(self._device.readCalibration(), *self.size, undistorted=True)
            model = str(self._device.getDeviceName())
            self.identity = Identity("Luxonis", model, self._device.getDeviceId(), f"depthai {dai.__version__}")
            self._pipeline.start()
        except BadCalibration as e:
            self.close()
            raise DeviceFault(f"{who}: {e}", "", "calibration") from e
        except RuntimeError as e:
            self.close()
            raise DeviceFault(f"{who} cannot be set up", str(e), "pipeline") from e
        except BaseException:
            self.close()
            raise

    def next(self, timeout: float) -> Shot | None:
        """Wait for the next picture; None when none came. Raises ConnectionLost."""
        shot = None if self._pipeline is None else self._pipeline.next(timeout)
        if shot is None and self._device.isClosed():
            raise ConnectionLost(f"{self.who}: the connection was lost")
        return shot

    def temperature(self) -> float | None:
        """Give the mean temperature of the chip, deg C. Raises ConnectionLost."""
        try:
            return float(self._device.getChipTemperature().average)
        except RuntimeError as e:
            raise ConnectionLost(f"{self.who}: the connection was lost", str(e)) from e

    def set_exposure(self, exposure: float | None, timeout: float) -> None:
        """Set the exposure, s, None for automatic; the camera does not confirm it. Raises Refused."""
        control = dai.CameraControl()
        if exposure is None:
            control.setAutoExposureEnable()
        else:
            control.setManualExposure(round(exposure * 1e6), ISO)
        try:
            self._control.send(control)
        except RuntimeError as e:
            raise Refused(f"{self.who} does not take the exposure", str(e)) from e

    def close(self) -> None:
        """Close; harmless when closed."""
        pipeline, self._pipeline = self._pipeline, None
        if pipeline is not None:
            pipeline.close()
        with contextlib.suppress(RuntimeError):
            self._device.close()


def open_feed(who: str, name: str, settings: OakDSettings, timeout: float) -> Feed:
    """Open the source that the settings name. Raises NotConnected, DeviceTimeout, DeviceFault."""
    kind = DeviceFeed if settings.network is None else NetworkFeed
    return kind(who, name, settings, timeout)
