"""ImageStream: a thread receives every image of a camera and stores the newest. A mixin of object types."""

import atexit
import os
import threading
import time
from collections.abc import Callable, Mapping
from functools import partial
from typing import TYPE_CHECKING, ClassVar, Final

from arcor2_hw.data.device import Health, Severity
from arcor2_hw.exceptions import DeviceError, DeviceTimeout, NotConnected, Refused, Stale
from arcor2_hw.messages import Message, device_at
from arcor2_hw.objects.conditions import conditions_of
from arcor2_hw.objects.connected import AlarmText, Connected
from arcor2_hw.objects.generic import DEFAULT_CONNECT_TIMEOUT

from .settings import OakDSettings

if TYPE_CHECKING:
    from .feed import Feed, ImagePair

RECEIVE_TIMEOUT: Final = 0.1
"""Longest time the thread waits for an image before it checks whether it should end, s."""
CHECK_PERIOD: Final = 0.5
"""Time between checks of the temperature and of frozen images, s."""
HOT: Final = 90.0
"""Chip temperature that raises an alarm, °C. The chip switches itself off at 105 °C (assumed from the Myriad X)."""
EXPOSURE_TIMEOUT: Final = 3.0


class ImageStream(Connected):
    """A connection that receives images. A driver calls `use_camera` in `__init__`."""

    ALARMS: ClassVar[Mapping[str, AlarmText]] = {
        "hot": AlarmText("the camera is too hot", "improve its ventilation, or mount it on metal", Severity.WARNING),
        "frozen": AlarmText(
            "the camera repeats an old image",
            "go offline and online again; if that does not help, switch it off and on",
        ),
    }
    images_received: int = 0
    """Number of images received since the object was created."""

    def use_camera(self, settings: OakDSettings) -> None:
        """Prepare the connection; nothing is opened yet."""
        self.keep_connection(device_at(self.name, settings.address or Message.of("the only camera")))
        self._config = settings
        self._feed: Feed | None = None
        self._newest: ImagePair | None = None
        self._received_at = 0.0
        self._new_image = threading.Condition()
        self._exposure: float | None = None

    # -------------------------------------------------------------------------------- connection
    def connect(self, timeout: float = DEFAULT_CONNECT_TIMEOUT) -> None:
        """Open the camera and receive its first image within `timeout` s.

        Raises:
            NotConnected: The camera is missing or used by another program, or depthai is not installed.
            DeviceTimeout: The camera sent no image in time.
            DeviceFault: The calibration or the stream is invalid.
        """
        super().connect(timeout)
        # depthai crashes the process if a pipeline still exists when the interpreter ends.
        atexit.unregister(self.disconnect)
        atexit.register(self.disconnect)

    def disconnect(self) -> None:
        """Stop receiving images; does nothing when stopped."""
        atexit.unregister(self.disconnect)
        super().disconnect()
        self._newest = None
        self._exposure = None
        conditions_of(self).clear()
        self._wake()

    def condition(self) -> Health:
        """Return failure when the camera repeats an old image, off_spec when it is too hot."""
        if "frozen" in conditions_of(self):
            return Health.FAILURE
        return Health.OFF_SPEC if conditions_of(self) else Health.NORMAL

    def stop_waiting(self) -> None:
        """End the calls that wait for an image, with Cancelled."""
        super().stop_waiting()
        self._wake()

    # -------------------------------------------------------------------------------- images
    @property
    def feed(self) -> "Feed":
        """Return the feed. Raises NotConnected, ConnectionLost."""
        self.observing.check()
        feed = self._feed
        if feed is None:
            raise NotConnected("{device} is not connected", device=self.who)
        return feed

    @property
    def latency(self) -> float:
        """Return the age of the newest image at its arrival, s. Raises NotConnected, ConnectionLost."""
        self.observing.check()
        newest = self._newest
        return float("inf") if newest is None else self._received_at - newest.monotonic

    def newest(self, max_age: float) -> "ImagePair":
        """Return the newest image. Raises Stale when it is older than `max_age` s, NotConnected, ConnectionLost."""
        self.observing.check()
        shot = self._newest
        age = float("inf") if shot is None else time.monotonic() - shot.monotonic
        if shot is None or age > max_age:
            raise Stale(
                "{device}: the newest image is {age:.2f} s old, at most {max_age:g} s are allowed",
                device=self.who,
                age=age,
                max_age=max_age,
            )
        return shot

    def next_after(self, moment: float, timeout: float) -> "ImagePair":
        """Wait for the first image whose exposure ended after `moment` (monotonic, s).

        Raises:
            Stale: No such image came within `timeout` s.
            Cancelled: `stop_waiting` was called.
            ConnectionLost: The connection was lost.
        """
        deadline = time.monotonic() + timeout
        go_on = self.begin("waiting for an image")
        with self._new_image:
            while True:
                go_on()
                newest = self._newest
                if newest is not None and newest.monotonic > moment:
                    return newest
                if (left := deadline - time.monotonic()) <= 0.0:
                    break
                self._new_image.wait(left)
        age = (
            Message.of("never")
            if newest is None
            else Message.of("{age:.2f} s ago", age=time.monotonic() - newest.monotonic)
        )
        raise Stale(
            "{device} sent no new image within {timeout:g} s; the last was taken {age}",
            device=self.who,
            timeout=timeout,
            age=age,
        )

    # -------------------------------------------------------------------------------- on the observing thread
    def open_link(self, timeout: float) -> None:
        """Open the camera and receive its first image."""
        source = self._load_source()
        deadline = time.monotonic() + timeout
        feed = self._feed = source(timeout)
        shot = None
        while shot is None or time.monotonic() - shot.monotonic > self._config.max_age:
            if (left := deadline - time.monotonic()) <= 0.0:
                raise DeviceTimeout(
                    "{device} sent no current image within {timeout:.1f} s", device=self.who, timeout=timeout
                )
            shot = feed.next(min(RECEIVE_TIMEOUT, left)) or shot
        self._store(shot)
        if self._exposure is not None:  # this is a reconnect
            try:
                feed.set_exposure(self._exposure, min(EXPOSURE_TIMEOUT, max(deadline - time.monotonic(), 0.01)))
            except Refused:
                self._exposure = None

    def _load_source(self) -> "Callable[[float], Feed]":
        """Return the function that opens the source in the settings.

        It imports depthai. That takes seconds on a busy computer, and is not part of the time limit of the camera.
        """
        os.environ.setdefault("DEPTHAI_LEVEL", "error")  # depthai warns of missing USB, which is normal in a container
        try:
            if self._config.network is not None:
                from .network_feed import NetworkFeed

                return partial(NetworkFeed, self.who, self.name, self._config)
            from .device_feed import DeviceFeed

            return partial(DeviceFeed, self.who, self._config)
        except ModuleNotFoundError as e:
            raise NotConnected(
                "{device}: depthai is not installed. Install the extra `depthai`: arcor2-hw[depthai].",
                str(e),
                device=self.who,
            ) from e
        except ImportError as e:
            raise NotConnected("{device}: depthai cannot be loaded: {reason}", device=self.who, reason=e) from e

    def watch(self, stopping: threading.Event) -> None:
        """Receive images until `stopping` is set. Raises DeviceTimeout when none come."""
        feed = self.feed
        self._received_at = checked_at = time.monotonic()
        while not stopping.is_set():
            shot = feed.next(RECEIVE_TIMEOUT)
            present = time.monotonic()
            if shot is not None:
                self._store(shot)
            elif present - self._received_at > self._config.frame_timeout:
                raise DeviceTimeout(
                    "{device} has sent no image for {age:.1f} s", device=self.who, age=present - self._received_at
                )
            if present - checked_at > CHECK_PERIOD:
                checked_at = present
                self._update_alarms(feed)

    def close_link(self) -> None:
        """Close the camera; does nothing when closed."""
        feed, self._feed = self._feed, None
        if feed is not None:
            feed.close()

    def on_lost(self, error: DeviceError) -> None:
        """Wake the calls that wait for an image."""
        self._wake()

    def _store(self, shot: "ImagePair") -> None:
        self._received_at = time.monotonic()
        with self._new_image:
            self._newest = shot
            self.images_received += 1
            self._new_image.notify_all()

    def _update_alarms(self, feed: "Feed") -> None:
        temperature, newest = feed.temperature(), self._newest
        self.set_alarm("hot", temperature is not None and temperature >= HOT)
        age = 0.0 if newest is None else self._received_at - newest.monotonic
        self.set_alarm("frozen", age > self._config.frame_timeout)

    def _wake(self) -> None:
        with self._new_image:
            self._new_image.notify_all()
