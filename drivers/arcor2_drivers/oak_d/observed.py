"""The observed camera: one thread takes every picture from the feed and keeps the newest."""

import atexit
import os
import threading
import time
from typing import TYPE_CHECKING, Final

from arcor2_hw.data.base import Timestamp, now
from arcor2_hw.data.device import Alarm, Connection, Health, Severity
from arcor2_hw.exceptions import Cancelled, DeviceError, DeviceTimeout, NotConnected, Refused, Stale
from arcor2_hw.objects.observing import Observing

from .settings import OakDSettings

if TYPE_CHECKING:
    from .feed import Feed, Shot

WAIT: Final = 0.1
LOOK_PERIOD: Final = 0.5
"""Time between looks at the temperature and at what a picture shows, s."""
HOT: Final = 90.0
"""deg C; the chip switches itself off at 105 (from general knowledge of the Myriad X)."""
EXPOSURE_TIMEOUT: Final = 1.0

_ALARMS: Final = {
    "hot": (Severity.WARNING, "the camera is too hot", "let air pass it, or mount it on metal"),
    "frozen": (Severity.ERROR, "the camera repeats an old picture", "disconnect and connect; switch it off and on"),
}


class Observed:
    """Keeps the newest picture of one camera."""

    def __init__(self, name: str, settings: OakDSettings) -> None:
        self.who = f"{name} at {settings.address or 'the only camera'}"
        self.observing = Observing(self.who, self._open, self._watch, self._close, self._lost)
        self._name, self._settings = name, settings
        self._feed: Feed | None = None
        self._newest: Shot | None = None
        self._came = 0.0
        self._stops = 0
        self.taken = 0
        """Number of images received since the object was made."""
        self._news = threading.Condition()
        self._alarms: dict[str, Alarm] = {}
        self._exposure: float | None = None

    # -------------------------------------------------------------------------------- asked by everybody
    @property
    def feed(self) -> "Feed":
        """Return the feed. Raises NotConnected, ConnectionLost."""
        self.observing.check()
        feed = self._feed
        if feed is None:
            raise NotConnected("{device} is not connected", device=self.who)
        return feed

    def newest(self, max_age: float) -> "Shot":
        """Return the newest picture. Raises Stale when it is older than `max_age` s, NotConnected, ConnectionLost."""
        self.observing.check()
        return self._fresh(self._newest, max_age)

    def after(self, moment: float, timeout: float) -> "Shot":
        """Wait for the first picture whose exposure ended after `moment` (monotonic, s).

        Raises Cancelled by `stop_waiting`, ConnectionLost, and after `timeout` s Stale.
        """
        deadline = time.monotonic() + timeout
        with self._news:
            stops = self._stops
            while True:
                self.observing.check()
                if self._stops != stops:
                    raise Cancelled("{device}: waiting for a picture was stopped", device=self.who)
                newest = self._newest
                if newest is not None and newest.monotonic > moment:
                    return newest
                if (left := deadline - time.monotonic()) <= 0.0:
                    break
                self._news.wait(left)
        age = "never" if newest is None else f"{time.monotonic() - newest.monotonic:.2f} s ago"
        raise Stale(
            "{device} gave no new picture within {timeout:g} s; the last was taken {age}",
            device=self.who,
            timeout=timeout,
            age=age,
        )

    def stop_waiting(self) -> None:
        """End the calls that wait for a picture, with Cancelled."""
        with self._news:
            self._stops += 1
            self._news.notify_all()

    @property
    def latency(self) -> float:
        """Return how old the newest picture was when it came, s. Raises NotConnected, ConnectionLost."""
        self.observing.check()
        newest = self._newest
        return float("inf") if newest is None else self._came - newest.monotonic

    def _fresh(self, shot: "Shot | None", max_age: float) -> "Shot":
        age = float("inf") if shot is None else time.monotonic() - shot.monotonic
        if shot is None or age > max_age:
            raise Stale(
                "{device}: the newest picture is {age:.2f} s old, {max_age:g} s at most are asked for",
                device=self.who,
                age=age,
                max_age=max_age,
            )
        return shot

    def set_exposure(self, exposure: float | None) -> None:
        """Set the exposure; it is set again when the camera comes back after a loss."""
        self.feed.set_exposure(exposure, EXPOSURE_TIMEOUT)
        self._exposure = exposure

    def alarms(self) -> list[Alarm]:
        """Return what a person should deal with; it ends with its cause."""
        return list(self._alarms.values())

    def health(self) -> Health:
        """Return the camera's condition."""
        if self.observing.state in (Connection.LOST, Connection.FAILED) or "frozen" in self._alarms:
            return Health.FAILURE
        return Health.OFF_SPEC if self._alarms else Health.NORMAL

    def connect(self, timeout: float) -> None:
        """Begin to observe within `timeout` s. Raises NotConnected, DeviceTimeout, DeviceFault."""
        self.observing.start(timeout)
        # A pipeline that is still there when the interpreter ends takes the process down with it.
        atexit.unregister(self.disconnect)
        atexit.register(self.disconnect)

    def disconnect(self) -> None:
        """Stop observing; does nothing when stopped."""
        atexit.unregister(self.disconnect)
        self.observing.stop()
        self._newest = None
        self._exposure = None
        self._alarms.clear()
        self._wake()

    # -------------------------------------------------------------------------------- on the observing thread
    def _open(self, timeout: float) -> None:
        deadline = time.monotonic() + timeout
        opened = self._opened(timeout)
        self._feed = opened
        shot = None
        while shot is None or time.monotonic() - shot.monotonic > self._settings.max_age:
            if (left := deadline - time.monotonic()) <= 0.0:
                old = "no" if shot is None else "only an old"
                raise DeviceTimeout(
                    "{device} sent {old} picture within {timeout:.1f} s", device=self.who, old=old, timeout=timeout
                )
            shot = opened.next(min(WAIT, left)) or shot
        self._take(shot)
        if self._exposure is not None:  # it has come back
            try:
                opened.set_exposure(self._exposure, min(EXPOSURE_TIMEOUT, max(deadline - time.monotonic(), 0.01)))
            except Refused:
                self._exposure = None

    def _opened(self, timeout: float) -> "Feed":
        """Open the source that the settings name; depthai is loaded by that."""
        os.environ.setdefault("DEPTHAI_LEVEL", "error")  # it warns of USB, which a container or a server may well lack
        try:
            if self._settings.network is not None:
                from .network_feed import NetworkFeed

                return NetworkFeed(self.who, self._name, self._settings, timeout)
            from .device_feed import DeviceFeed

            return DeviceFeed(self.who, self._name, self._settings, timeout)
        except ModuleNotFoundError as e:
            raise NotConnected(
                "{device}: depthai is not installed here; it comes with the extra `depthai` (arcor2-hw[depthai])",
                str(e),
                device=self.who,
            ) from e
        except ImportError as e:
            raise NotConnected(
                "{device}: depthai is installed and cannot be loaded: {reason}", device=self.who, reason=e
            ) from e

    def _watch(self, stopping: threading.Event) -> None:
        feed = self._feed
        if feed is None:
            raise NotConnected("{device} is not connected", device=self.who)
        self._came = looked = time.monotonic()
        while not stopping.is_set():
            shot = feed.next(WAIT)
            moment = time.monotonic()
            if shot is not None:
                self._take(shot)
            elif moment - self._came > self._settings.frame_timeout:
                raise DeviceTimeout(
                    "{device} has sent no picture for {moment:.1f} s", device=self.who, moment=moment - self._came
                )
            if moment - looked > LOOK_PERIOD:
                looked = moment
                self._look(feed)

    def _take(self, shot: "Shot") -> None:
        self._came = time.monotonic()
        with self._news:
            self._newest = shot
            self.taken += 1
            self._news.notify_all()

    def _look(self, feed: "Feed") -> None:
        temperature = feed.temperature()
        self._alarm("hot", temperature is not None and temperature >= HOT)
        newest = self._newest
        self._alarm("frozen", newest is not None and self._came - newest.monotonic > self._settings.frame_timeout)

    def _alarm(self, code: str, on: bool) -> None:
        if not on:
            self._alarms.pop(code, None)
        elif code not in self._alarms:
            severity, text, remedy = _ALARMS[code]
            since: Timestamp = now()
            self._alarms[code] = Alarm(code, severity, text, remedy, since)

    def _close(self) -> None:
        feed, self._feed = self._feed, None
        if feed is not None:
            feed.close()

    def _lost(self, error: DeviceError) -> None:
        self._wake()

    def _wake(self) -> None:
        with self._news:
            self._news.notify_all()
