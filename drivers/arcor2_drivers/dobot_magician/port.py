"""The serial port of the arm: one command, one answer."""

import contextlib
from typing import Final

import serial

from arcor2_hw.exceptions import ConnectionLost, DeviceTimeout, NotConnected
from arcor2_hw.keep_alive import RunningTime
from arcor2_hw.messages import Message

from .frames import FrameBuffer, encode

BAUD_RATE: Final = 115200
READ_WAIT: Final = 0.02
"""Time limit for the first byte of a read, s."""
WRITE_TIMEOUT: Final = 1.0
"""Time to write a command, s: long enough for a process that is not scheduled while it writes."""


class Port:
    """An open port, for one thread at a time."""

    def __init__(self, who: str | Message, path: str) -> None:
        """Open the port. Raise NotConnected."""
        self.who = who
        self._frames = FrameBuffer()
        try:
            self._serial = serial.Serial(
                path, BAUD_RATE, timeout=READ_WAIT, write_timeout=WRITE_TIMEOUT, exclusive=True
            )
            self._serial.reset_input_buffer()
        except (serial.SerialException, OSError, ValueError) as e:
            text = (
                "{device}: the port is used by another program"
                if "exclusively" in str(e)
                else "{device}: the port cannot be opened"
            )
            raise NotConnected(text, str(e), device=who) from e

    @property
    def garbage(self) -> int:
        """Return the number of bytes that belonged to no frame."""
        return self._frames.garbage

    def ask(self, command: int, control: int, parameters: bytes, timeout: float, *, first: bool = False) -> bytes:
        """Send a command and return the parameters of the answer.

        Args:
            command: Id of the command.
            control: Control byte.
            parameters: Parameters of the command.
            timeout: Time for the answer, s.
            first: Fail with DeviceTimeout if the answer to another command comes first, because the arm answers too
                late.

        Raises:
            DeviceTimeout: No answer came in time.
            ConnectionLost: The port failed.
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
                        raise DeviceTimeout(
                            "{device} answers too late.", f"{frame.command} came before {command}", device=self.who
                        )
                if clock() >= timeout:
                    raise DeviceTimeout(
                        "{device} did not answer within {timeout:g} s.",
                        f"id {command}, {self.garbage} bytes of garbage so far",
                        device=self.who,
                        timeout=timeout,
                    )
        except serial.SerialTimeoutException as e:
            raise DeviceTimeout("{device} accepts no bytes.", str(e), device=self.who) from e
        except (serial.SerialException, OSError, TypeError) as e:  # TypeError: raised by pyserial on a closed port
            raise ConnectionLost("{device}: the connection was lost. Check the cable.", str(e), device=self.who) from e

    def close(self) -> None:
        """Close the port, if it is open."""
        with contextlib.suppress(serial.SerialException, OSError):
            self._serial.close()
