"""The child process of `KeepAlive`, and the detection of a dead, busy or frozen parent for any child process.

A busy parent may block its interpreter for some tenths of a second. That must not trip a device's watchdog, so a child
process feeds it. The parent reports by pulses that its supervising thread works. The child ends at once when the parent
dies (end of its standard input), and when no pulse was sent for FROZEN_AFTER s.

Only the standard library is imported here, so that the child starts in about 20 ms. A driver with a child process of
its own uses `Parent`.
"""

import enum
import os
import select
import sys
import time

FROZEN_AFTER = 0.8
"""Time without a pulse after which the parent counts as frozen, s. A parent is often busy for 0.5 s."""
NICENESS = -10
"""Requested niceness; most computers refuse it."""
PULSE = b"="
"""First byte of a line that is a pulse. The time of sending follows, in seconds of the monotonic clock."""


def hurry() -> None:
    """Run before other processes, if permitted. A service needs LimitNICE for it.

    Where the kernel groups processes by session, niceness counts only within a session. Therefore the niceness of
    the session is set, too. This process has a session of its own.
    """
    try:
        os.setpriority(os.PRIO_PROCESS, 0, NICENESS)
        with open("/proc/self/autogroup", "w") as session:  # noqa: PTH123 - pathlib takes too long to import
            session.write(str(NICENESS))
    except OSError:
        pass


class ParentEnd(enum.Enum):
    """Why a child process has to end."""

    GONE = "gone"
    FROZEN = "frozen"


class Parent:
    """The parent of this process, which writes lines to a file descriptor. For use by one thread."""

    def __init__(self, fd: int = 0) -> None:
        self.ended: ParentEnd | None = None
        self.pulse = time.monotonic()
        """Time of the newest pulse on the monotonic clock, which is the same in all processes, s."""
        self._fd = fd
        self._rest = b""

    def lines(self, timeout: float) -> list[bytes]:
        """Wait at most `timeout` s for lines from the parent and return them without pulses; set `ended`."""
        left = self.pulse + FROZEN_AFTER - time.monotonic()
        ready, _, _ = select.select([self._fd], [], [], max(min(timeout, left), 0.0))
        if not ready:
            if left <= 0.0:  # pulses that arrived while this process was not running have been read by now
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
    """Write `message` to standard output every `period` s while the parent lives and was silent for `quiet` s.

    A line on standard error reports that it is ready.
    """
    hurry()
    parent, sent = Parent(), 0.0
    os.write(2, b"\n")  # ready
    while parent.ended is None:
        due = max(sent + period, parent.pulse + quiet)
        parent.lines(due - time.monotonic())
        if parent.ended is None and time.monotonic() >= max(due, parent.pulse + quiet):
            try:
                os.write(1, message)
            except BlockingIOError:
                pass  # the line is full; its other messages also trigger the watchdog
            except OSError:  # the line is closed; the parent detects that itself
                return
            sent = time.monotonic()


if __name__ == "__main__":
    main(bytes.fromhex(sys.argv[1]), float(sys.argv[2]), float(sys.argv[3]))
