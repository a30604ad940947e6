"""The child process behind `KeepAlive`, and how any child process judges whether its parent is alive, busy or frozen.

A busy parent may hold its interpreter for some tenths of a second. That must not trip a device's watchdog, so the
kicks come from a child. The parent reports by pulses that its supervising thread works. The child ends at once when the
parent dies (end of its standard input), and when no pulse was sent for FROZEN_AFTER s.

Only the standard library is imported here, so that the child starts in some 20 ms. A driver with a child process of
its own uses `Parent`.
"""

import enum
import os
import select
import sys
import time

FROZEN_AFTER = 0.8
"""Seconds without a pulse after which the parent counts as frozen. A parent is often busy for 0.5 s."""
PULSE = b"="
"""First byte of a line that is a pulse; the time it was sent follows, in seconds of the monotonic clock."""


class ParentEnd(enum.Enum):
    """Why a child process has to end."""

    GONE = "gone"
    FROZEN = "frozen"


class Parent:
    """The parent of this process as seen from a file descriptor that it writes lines to. For one thread."""

    def __init__(self, fd: int = 0) -> None:
        self.ended: ParentEnd | None = None
        self.pulse = time.monotonic()
        """When the newest pulse was sent (monotonic clock, the same in all processes)."""
        self._fd = fd
        self._rest = b""

    def lines(self, timeout: float) -> list[bytes]:
        """Wait at most `timeout` s for lines from the parent and return them, without pulses; sets `ended`."""
        left = self.pulse + FROZEN_AFTER - time.monotonic()
        ready, _, _ = select.select([self._fd], [], [], max(min(timeout, left), 0.0))
        if not ready:
            if left <= 0.0:  # pulses that waited while this process was not running have been read by now
                self.ended = ParentEnd.FROZEN
            return []
        data = os.read(self._fd, 65536)
        if not data:
            self.ended = ParentEnd.GONE
            return []
        *lines, self._rest = (self._rest + data).split(b"\n")
        for line in lines:
            if line.startswith(PULSE):
                self.pulse = float(line[len(PULSE) :])
        return [line for line in lines if not line.startswith(PULSE)]


def main(message: bytes, period: float, quiet: float) -> None:
    """Write `message` to standard output each `period` s while the parent lives and was silent for `quiet` s.

    A line on standard error reports that it is ready.
    """
    parent, sent = Parent(), 0.0
    os.write(2, b"\n")  # ready
    while parent.ended is None:
        due = max(sent + period, parent.pulse + quiet)
        parent.lines(due - time.monotonic())
        if parent.ended is None and time.monotonic() >= max(due, parent.pulse + quiet):
            try:
                os.write(1, message)
            except BlockingIOError:
                pass  # the line is full: whoever wrote that much keeps the device's watchdog quiet as well
            except OSError:  # the line is gone; the parent notices by itself
                return
            sent = time.monotonic()


if __name__ == "__main__":
    main(bytes.fromhex(sys.argv[1]), float(sys.argv[2]), float(sys.argv[3]))
