"""A cell host that measures the processor time of its recorder. The server of the benchmark starts it as a script.

Every call of the recorder is measured with the clock of its own thread, so that other threads and processes do not
count. The environment variable ARCOR2_HW_RECORDER_TIMES names a directory. There, each host writes a file with a line
per second: the time, and the processor time of the recorder, of the measurement and of the process so far, s.
"""

import functools
import os
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

from arcor2_hw.runtime.host import main
from arcor2_hw.runtime.recorder import Recorder

PERIOD: Final = 1.0
METHODS: Final = (
    *("state_taken", "_observe", "observed", "joints", "device_changed"),
    *("action_started", "action_ended"),
)
"""The methods that the host calls, and the job that `state_taken` submits."""


class Times:
    """The processor time of the recorder, summed over all threads."""

    def __init__(self, file: Path) -> None:
        self._file = file
        self._lock = threading.Lock()
        self._inside = threading.local()
        self._used = 0.0
        self._calls = 0
        self._due = 0.0
        began = time.thread_time()
        for _ in range(1000):
            time.thread_time()
        self._own = (time.thread_time() - began) / 1000.0
        """Processor time of reading the clock, s. A call contains one reading."""

    def measured(self, method: Callable[..., Any]) -> Callable[..., Any]:
        """Return a method that counts its processor time, unless the recorder itself calls it."""

        @functools.wraps(method)
        def call(*args: Any, **kwargs: Any) -> Any:
            if getattr(self._inside, "yes", False):
                return method(*args, **kwargs)
            self._inside.yes = True
            began = time.thread_time()
            try:
                return method(*args, **kwargs)
            finally:
                used = time.thread_time() - began
                self._inside.yes = False
                self._add(used)

        return call

    def _add(self, used: float) -> None:
        with self._lock:
            self._used += used
            self._calls += 1
            moment = time.monotonic()
            if moment >= self._due:
                self._due = moment + PERIOD
                with self._file.open("a") as file:
                    file.write(f"{moment} {self._used} {self._calls * self._own} {time.process_time()}\n")


if __name__ == "__main__":
    times = Times(Path(os.environ["ARCOR2_HW_RECORDER_TIMES"]) / f"{os.getpid()}.txt")
    for name in METHODS:
        setattr(Recorder, name, times.measured(getattr(Recorder, name)))
    main()
