"""Timers of the cell host: one thread for periodic and single calls."""

import heapq
import itertools
import logging
import threading
import time
from collections.abc import Callable

_log = logging.getLogger(__name__)


class Clock:
    """Call functions once or periodically, on one thread. The functions must return quickly."""

    def __init__(self) -> None:
        self._due: list[tuple[float, int, float, Callable[[], object]]] = []
        self._number = itertools.count()
        self._changed = threading.Condition()

    def start(self) -> None:
        """Start the thread."""
        threading.Thread(target=self._run, name="clock", daemon=True).start()

    def after(self, seconds: float, function: Callable[[], object]) -> None:
        """Call a function once, `seconds` from now."""
        self._add(time.monotonic() + seconds, 0.0, function)

    def every(self, period: float, function: Callable[[], object]) -> None:
        """Call a function now and every `period` s."""
        self._add(time.monotonic(), period, function)

    def _add(self, moment: float, period: float, function: Callable[[], object]) -> None:
        with self._changed:
            heapq.heappush(self._due, (moment, next(self._number), period, function))
            if self._due[0][3] is function:
                self._changed.notify()

    def _run(self) -> None:
        while True:
            with self._changed:
                if not self._due:
                    self._changed.wait()
                    continue
                moment, _, period, function = self._due[0]
                now = time.monotonic()
                if moment > now:
                    self._changed.wait(moment - now)
                    continue
                heapq.heappop(self._due)
                if period:
                    # Calls that were missed while the process was suspended are skipped.
                    heapq.heappush(self._due, (max(moment + period, now), next(self._number), period, function))
            try:
                function()
            except Exception:  # noqa: BLE001 - the other timers must continue
                _log.exception("Timer function %s failed", function)
