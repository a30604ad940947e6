"""CAN by socketcand's raw mode over TCP, as a python-can bus.

python-can's own client has no time limit while it connects, and takes a connection that was closed for a bus on which
nothing happens. Its syntax of frames is used; the socket is ours. From general knowledge of socketcand's protocol and
python-can's client: no document was at hand.
"""

import select
import socket
import time
from collections import deque
from typing import Any, Final

import can
from can.interfaces.socketcand.socketcand import (
    convert_ascii_message_to_can_message,
    convert_can_message_to_ascii_message,
)

LONGEST: Final = 256
"""Bytes from < to >; what is longer is noise."""


class SocketcandBus(can.BusABC):
    """One bus of a socketcand server. Every failure is a can.CanError or an OSError.

    channel: name of the bus at the server, as can0. timeout: s for connecting and the three greetings together.
    """

    def __init__(self, channel: str, host: str, port: int, timeout: float) -> None:
        self.channel_info = f"socketcand {channel} at {host}:{port}"
        self._came = b""
        self._frames: deque[can.Message] = deque()
        deadline = time.monotonic() + timeout
        self._socket = socket.create_connection((host, port), timeout)
        try:
            self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            self._greeted("hi", deadline)
            for command in (f"open {channel}", "rawmode"):
                self._socket.sendall(f"< {command} >".encode())
                self._greeted("ok", deadline)
        except BaseException:
            self._socket.close()
            self._is_shutdown = True
            raise
        super().__init__(channel=channel)

    def _greeted(self, wanted: str, deadline: float) -> None:
        while (told := self._next()) is None:
            if not self._receive(deadline - time.monotonic()):
                raise can.CanTimeoutError(f"{self.channel_info} does not say <{wanted}>")
        if told.split()[1:-1] != [wanted]:
            raise can.CanInitializationError(f"{self.channel_info} says {told!r} instead of <{wanted}>")

    def _receive(self, timeout: float) -> bool:
        """Take what has come within `timeout` s; tell whether anything has."""
        ready, _, _ = select.select([self._socket], [], [], max(0.0, timeout))
        if not ready:
            return False
        data = self._socket.recv(65536)
        if not data:
            raise can.CanOperationError(f"{self.channel_info} has closed the connection")
        self._came += data
        return True

    def _next(self) -> str | None:
        """Return the next whole message, from < to >. Raises ValueError for what is none."""
        end = self._came.find(b">")
        if end < 0:
            if len(self._came) > LONGEST:
                self._came = b""
                raise ValueError("no message of socketcand")
            return None
        told, self._came = self._came[: end + 1].strip(), self._came[end + 1 :]
        if not told.startswith(b"<") or len(told) > LONGEST:
            raise ValueError(f"no message of socketcand: {told[:40]!r}")
        return told.decode("ascii")

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        deadline = time.monotonic() + (1e6 if timeout is None else timeout)
        while True:
            while (told := self._next()) is not None:
                if told.startswith("< frame ") and (frame := convert_ascii_message_to_can_message(told)) is not None:
                    return frame, False
                if told.startswith("< error "):
                    raise can.CanOperationError(f"{self.channel_info}: {told}")
            if not self._receive(deadline - time.monotonic()):
                return None, False

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        """Send a frame within `timeout` s. Raises can.CanError, OSError."""
        self._socket.settimeout(timeout or 1.0)
        try:
            self._socket.sendall(convert_can_message_to_ascii_message(msg).encode())
        except TimeoutError as error:
            raise can.CanTimeoutError(f"{self.channel_info} takes no frame") from error

    def flush(self) -> None:
        """Throw away what has come and is no message."""
        self._came = b""

    def wake(self) -> None:
        """Let a thread that waits for a frame fail."""
        self._socket.shutdown(socket.SHUT_RDWR)

    def shutdown(self) -> None:
        """Close; does nothing when closed."""
        super().shutdown()
        self._socket.close()

    def fileno(self) -> int:
        """Return the socket's descriptor."""
        return self._socket.fileno()

    def _apply_filters(self, filters: Any) -> None:
        """Filter nothing; python-can does it in `recv`."""
