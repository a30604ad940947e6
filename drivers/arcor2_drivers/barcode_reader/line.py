"""The serial line to the reader: a path, or `socket://host:port` with the same bytes."""

import contextlib
import socket
import threading
import time
import urllib.parse
from typing import Final

import serial

from arcor2_hw.exceptions import ConnectionLost, DeviceTimeout, NotConnected

from .lines import CR, LineBuffer

LOOK: Final = 0.05
"""Seconds a read waits for the first byte before the thread looks whether it should end."""
WRITE_TIMEOUT: Final = 0.5


class SerialLine:
    """An open line. Read by one thread; written to by any, a whole command at a time."""

    def __init__(self, name: str, port: str, baud_rate: int, timeout: float) -> None:
        """Open within `timeout` s. Raises NotConnected or DeviceTimeout naming the port."""
        self.who = f"{name} at {port}"
        self._one_write = threading.Lock()
        self._lines = LineBuffer()
        self._socket: socket.socket | None = None
        if port.startswith("socket://"):
            _reach(self.who, port, timeout)
        try:
            self._serial = serial.serial_for_url(
                port,
                baudrate=baud_rate,
                timeout=LOOK,
                write_timeout=WRITE_TIMEOUT,
                exclusive=None if "://" in port else True,
            )
        except (serial.SerialException, OSError, ValueError) as e:
            busy = "exclusively" in str(e)
            why = "is used by another program" if busy else "cannot be opened"
            raise NotConnected(f"{self.who}: the port {why}", str(e)) from e
        self._socket = getattr(self._serial, "_socket", None)

    @property
    def garbage(self) -> int:
        """Count the lines that were no answer."""
        return self._lines.garbage

    def read(self) -> list[str]:
        """Give the lines that have come; waits 50 ms for the first byte. Raises ConnectionLost naming the port."""
        try:
            data = self._serial.read(1)
            if data:
                data += self._serial.read(self._serial.in_waiting)
        except (serial.SerialException, OSError, TypeError) as e:  # TypeError: closed by another thread meanwhile
            raise ConnectionLost(
                f"{self.who}: the connection was lost: unplugged, or the port was closed", str(e)
            ) from e
        return self._lines.feed(data) if data else []

    def write(self, command: str) -> None:
        """Send a command. Raises ConnectionLost naming the port."""
        try:
            with self._one_write:
                self._serial.write(command.encode("ascii") + CR)
        except serial.SerialTimeoutException as e:
            raise DeviceTimeout(f"{self.who} takes no bytes", str(e)) from e
        except (serial.SerialException, OSError, TypeError) as e:
            raise ConnectionLost(
                f"{self.who}: the connection was lost: unplugged, or the port was closed", str(e)
            ) from e

    def close(self) -> None:
        """Close; harmless when closed."""
        with contextlib.suppress(serial.SerialException, OSError):
            self._serial.close()
        if self._socket is not None:
            self._socket.close()  # pyserial forgets a socket that its peer has reset, without closing it


def _reach(who: str, port: str, timeout: float) -> None:
    """See that somebody listens: pyserial itself waits five seconds for that, whatever it is told."""
    where = urllib.parse.urlsplit(port)
    began = time.monotonic()
    try:
        if where.hostname is None or where.port is None:
            raise ValueError("it must be socket://host:port")
        socket.create_connection((where.hostname, where.port), timeout).close()
    except TimeoutError:
        took = time.monotonic() - began
        raise DeviceTimeout(f"{who} cannot be reached within {took:.1f} s") from None
    except (OSError, ValueError) as e:
        raise NotConnected(f"{who}: the port cannot be opened", str(e)) from e
