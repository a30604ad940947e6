"""DeviceFeed: images of a camera on USB or Ethernet by depthai's camera and stereo nodes. Not tested on a device."""

import contextlib
import socket
import threading
import time
from typing import Final

import depthai as dai

from arcor2_hw.data.device import Identity
from arcor2_hw.exceptions import ConnectionLost, DeviceFault, DeviceTimeout, NotConnected, Refused
from arcor2_hw.messages import Message

from .calibration import parameters
from .feed import ImagePair, Pipeline
from .settings import OakDSettings

POE_PORT: Final = 11490
"""TCP port on which PoE cameras accept a host (assumed from the XLink protocol)."""
MONO_SIZE: Final = (640, 400)
"""Size of the images of the stereo pair, pixels."""
DEPTH_RANGE: Final = (0.35, 10.0)
"""Depth range of an OAK-D with a baseline of 75 mm and extended disparity, m (assumed)."""
ISO: Final = 400
"""Sensor sensitivity while the exposure time is set manually."""


def find(who: str | Message, address: str, timeout: float) -> dai.DeviceInfo:
    """Return the camera with an address. Raises NotConnected.

    Opening a missing camera takes depthai 11.5 s, so this function searches first.
    """
    found = dai.Device.getAllAvailableDevices()
    matching = [info for info in found if address in ("", info.getDeviceId(), info.name)]
    if len(matching) > 1:
        raise NotConnected(
            "{device}: {count} cameras found. Set address to the device id of one.",
            _listed(found),
            device=who,
            count=len(matching),
        )
    if matching:
        return matching[0]
    if _is_ip(address):  # the search does not find cameras behind a router
        try:
            socket.create_connection((address, POE_PORT), timeout).close()
        except OSError as e:
            raise NotConnected("{device} cannot be reached", str(e), device=who) from e
        return dai.DeviceInfo(address)
    raise NotConnected(
        "{device} was not found. Check the cable, and that no other program uses the camera.",
        _listed(found),
        device=who,
    )


def _listed(found: list[dai.DeviceInfo]) -> str:
    return "found: " + (", ".join(f"{info.getDeviceId()} ({info.name})" for info in found) or "none")


def _is_ip(address: str) -> bool:
    parts = address.split(".")
    return len(parts) == 4 and all(part.isdigit() and int(part) < 256 for part in parts)


def boot(who: str | Message, info: dai.DeviceInfo, timeout: float) -> dai.Device:
    """Open a camera. One that starts only after `timeout` s is closed again. Raises DeviceTimeout, NotConnected."""
    result: list[dai.Device | BaseException] = []
    late = threading.Event()

    def run() -> None:
        try:
            device = dai.Device(info)
        except BaseException as e:  # noqa: BLE001 - raised by the waiting thread
            result.append(e)
            return
        result.append(device)
        if late.is_set():
            device.close()

    thread = threading.Thread(target=run, name=f"booting {who}", daemon=True)
    thread.start()
    thread.join(timeout)
    if not result:
        late.set()
        raise DeviceTimeout("{device} did not start within {timeout:.1f} s", device=who, timeout=timeout)
    if isinstance(result[0], BaseException):
        raise NotConnected(
            "{device} cannot be opened. Check that no other program uses the camera.", str(result[0]), device=who
        ) from result[0]
    return result[0]


class DeviceFeed:
    """A camera on USB or Ethernet. The camera undistorts the colour image and aligns the depth image to it."""

    def __init__(self, who: str | Message, settings: OakDSettings, timeout: float) -> None:
        deadline = time.monotonic() + timeout
        self.who = who
        info = find(who, settings.address, timeout)
        self._device = boot(who, info, max(deadline - time.monotonic(), 0.1))
        self._pipeline: Pipeline | None = None
        try:
            self.size, self.depth_range = settings.size, DEPTH_RANGE
            pipeline = dai.Pipeline(self._device)
            sockets = dai.CameraBoardSocket
            camera = pipeline.create(dai.node.Camera).build(sockets.CAM_A)
            color = camera.requestOutput(
                self.size, dai.ImgFrame.Type.BGR888i, fps=settings.fps, enableUndistortion=True
            )
            left, right = (
                pipeline.create(dai.node.Camera).build(each).requestOutput(MONO_SIZE, fps=settings.fps)
                for each in (sockets.CAM_B, sockets.CAM_C)
            )
            stereo = pipeline.create(dai.node.StereoDepth).build(left, right)
            stereo.setLeftRightCheck(True)
            stereo.setExtendedDisparity(True)
            depth = stereo.depth
            if self._device.getPlatform() == dai.Platform.RVC4:  # this one has a separate node for alignment
                align = pipeline.create(dai.node.ImageAlign)
                stereo.depth.link(align.input)
                color.link(align.inputAlignTo)
                depth = align.outputAligned
            else:
                color.link(stereo.inputAlignTo)
            self._control = camera.inputControl.createInputQueue()
            self._pipeline = Pipeline(pipeline, color, depth)
            self.parameters = parameters(who, self._device.readCalibration(), *self.size, undistorted=True)
            model = str(self._device.getDeviceName())
            self.identity = Identity("Luxonis", model, self._device.getDeviceId(), f"depthai {dai.__version__}")
            self._pipeline.start()
        except RuntimeError as e:
            self.close()
            raise DeviceFault("{device}: the pipeline cannot be created", str(e), "pipeline", device=who) from e
        except BaseException:
            self.close()
            raise

    def next(self, timeout: float) -> ImagePair | None:
        """Return the next image; None when none came within `timeout` s. Raises ConnectionLost."""
        shot = None if self._pipeline is None else self._pipeline.next(timeout)
        if shot is None and self._device.isClosed():
            raise ConnectionLost("{device}: the connection was lost", device=self.who)
        return shot

    def temperature(self) -> float | None:
        """Return the mean temperature of the chip, °C. Raises ConnectionLost."""
        try:
            return float(self._device.getChipTemperature().average)
        except RuntimeError as e:
            raise ConnectionLost("{device}: the connection was lost", str(e), device=self.who) from e

    def set_exposure(self, exposure: float | None, timeout: float) -> None:
        """Set the exposure time, s; None: automatic. The camera does not confirm it. Raises Refused."""
        control = dai.CameraControl()
        if exposure is None:
            control.setAutoExposureEnable()
        else:
            control.setManualExposure(round(exposure * 1e6), ISO)
        try:
            self._control.send(control)
        except RuntimeError as e:
            raise Refused("{device} rejected the exposure", str(e), device=self.who) from e

    def close(self) -> None:
        """Close; does nothing when closed."""
        pipeline, self._pipeline = self._pipeline, None
        if pipeline is not None:
            pipeline.close()
        with contextlib.suppress(RuntimeError):
            self._device.close()
