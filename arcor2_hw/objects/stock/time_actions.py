"""Time: sleep, present time, stopwatches."""

import threading
import time
from typing import ClassVar

from arcor2_hw.actions import action
from arcor2_hw.exceptions import Cancelled, NotFound
from arcor2_hw.objects import Generic, Settings


class TimeActions(Generic):
    """Sleeps, returns the time and measures durations."""

    category = "Program"
    icon = "time"
    _ABSTRACT = False
    display_name = "Time"
    CANCEL_MAPPING: ClassVar[dict[str, str]] = {"sleep": "cancel"}

    def __init__(self, obj_id: str, name: str, settings: Settings | None = None) -> None:
        super().__init__(obj_id, name, settings)
        self._cancelled = threading.Event()
        self._started: dict[str, float] = {}

    @action(deadline=None)
    def sleep(self, seconds: float = 1.0, *, an: str | None = None) -> None:
        """Wait for some time.

        :param seconds: duration, s
        """
        assert 0.0 <= seconds <= 86400.0

        self._cancelled.clear()
        if self._cancelled.wait(seconds):
            raise Cancelled("{name}: the sleep was cancelled", name=self.name)

    def cancel(self) -> None:
        """Cancel the present sleep."""
        self._cancelled.set()

    @action
    def time_ns(self, *, an: str | None = None) -> int:
        """Return the present time: nanoseconds since 1970 in UTC."""
        return time.time_ns()

    @action
    def start_stopwatch(self, stopwatch: str = "stopwatch", *, an: str | None = None) -> None:
        """Start a stopwatch from zero.

        :param stopwatch: name of the stopwatch
        """
        self._started[stopwatch] = time.monotonic()

    @action
    def elapsed(self, stopwatch: str = "stopwatch", *, an: str | None = None) -> float:
        """Return the time since a stopwatch was started, s. It continues to run, and ignores changes of the clock.

        :param stopwatch: name of the stopwatch
        """
        try:
            return time.monotonic() - self._started[stopwatch]
        except KeyError:
            raise NotFound(
                "{name}: stopwatch {stopwatch!r} was not started", name=self.name, stopwatch=stopwatch
            ) from None
