"""The serial port of the arm: one question, one answer."""

import contextlib
from typing import Final

import serial

from arcor2_hw.exceptions import ConnectionLost, DeviceTimeout, NotConnected
from arcor2_hw.keep_alive import RunningTime

from .frames import FrameBuffer, encode

BAUD_RATE: Final = 115200
LOOK: Final = 0.02
"""Seconds a read waits for the first byte before it is seen whether the time is up."""
WRITE_TIMEOUT: Final = 1.0
"""Seconds to write a question. A process that stands still in writing must not take that for a port that is stuck."""


class Port:
    """An open port; used by one thread at a time."""

    def __init__(self, who: str, path: str) -> None:
        """Open. Raises NotConnected naming the port."""
        self.who = who
        self._frames = FrameBuffer()
        try:
            self._serial = serial.Serial(path, BAUD_RATE, timeout=LOOK, write_timeout=WRITE_TIMEOUT, exclusive=True)
            self._serial.reset_input_buffer()
        except (serial.SerialException, OSError, ValueError) as e:
            why = "is used by another program" if "exclusively" in str(e) else "cannot be opened"
            raise NotConnected(f"{who}: the port {why}", str(e)) from e

    @property
    def garbage(self) -> int:
        """Count the bytes that belonged to no frame."""
        return self._frames.garbage

    def ask(self, command: int, control: int, parameters: bytes, timeout: float, *, first: bool = False) -> bytes:
        """Give the parameters of the answer. Raises DeviceTimeout after `timeout` s, ConnectionLost naming the port.

        With `first` an answer to another question before it is a DeviceTimeout: the arm lags behind.
        """
        clock = RunningTime()
        try:
            self._serial.write(encode(command, control, parameters))
            while True:
                data = self._serial.read(1)
                if data:
                    data += self._serial.read(self._serial.in_waiting)
                for frame in self._frames.feed(data):
                    if (frame.command, frame.control) == (command, control):
                        return frame.parameters
                    if first:
                        raise DeviceTimeout(f"{self.who} lags behind", f"{frame.command} came before {command}")
                if clock() >= timeout:
                    raise DeviceTimeout(
                        f"{self.who} did not answer within {timeout:g} s",
                        f"id {command}, {self.garbage} bytes of garbage so far",
                    )
        except serial.SerialTimeoutException as e:
            raise DeviceTimeout(f"{self.who} takes no bytes", str(e)) from e
        except (serial.SerialException, OSError, TypeError) as e:  # TypeError: pyserial's own, on a closed port
            raise ConnectionLost(
                f"{self.who}: the connection was lost: unplugged, or the port was closed", str(e)
            ) from e

    def close(self) -> None:
        """Close; harmless when closed."""
        with contextlib.suppress(serial.SerialException, OSError):
            self._serial.close()
