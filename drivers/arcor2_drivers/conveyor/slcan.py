"""SlcanBus: a python-can bus for Lawicel adapters that reads all available bytes at once.

The bus of python-can reads single bytes and releases the interpreter for each. While an action computes, it cannot keep
up with a drive that sends its state 100 times per second.
"""

import os
import select

import can
from can.interfaces.slcan import slcanBus

CHUNK = 4096
TERMINATORS = b"\r\a"
"""End of a line; the second one reports an error."""


class SlcanBus(slcanBus):
    """A Lawicel adapter on a serial port or at `socket://host:port`. Every failure is a can.CanError."""

    def _read(self, timeout: float | None) -> str | None:
        """Return the first line that came within `timeout` s, or None; further lines are queued."""
        try:
            fd = self.fileno()
            ready, _, _ = select.select([fd], [], [], timeout)
            data = os.read(fd, CHUNK) if ready else b""
        except (OSError, ValueError) as error:
            raise can.CanOperationError("could not read from the adapter") from error
        if ready and not data:
            raise can.CanOperationError("the adapter has closed the connection")
        for byte in data:
            self._buffer.append(byte)
            if byte in TERMINATORS:
                line, self._buffer = self._buffer, bytearray()
                self._queue.put(line.decode())
        return None if self._queue.empty() else self._queue.get_nowait()
