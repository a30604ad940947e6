"""SocketcandBus: a python-can bus for the raw mode of socketcand over TCP.

The client of python-can has no time limit while it connects, and does not detect a closed connection. This bus uses its
syntax of frames with its own socket. No specification of the protocol was available.
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
"""Longest message from < to >, bytes; longer ones are noise."""


class SocketcandBus(can.BusABC):
    """A bus of a socketcand server. Every failure is a can.CanError or an OSError.

    Args:
        channel: Name of the bus at the server, such as can0.
        host: Name or address of the server.
        port: TCP port of the server.
        timeout: Time limit for connecting and greeting, s.
    """

    def __init__(self, channel: str, host: str, port: int, timeout: float) -> None:
        self.channel_info = f"socketcand {channel} at {host}:{port}"
        self._buffer = b""
        self._frames: deque[can.Message] = deque()
        deadline = time.monotonic() + timeout
        self._socket = socket.create_connection((host, port), timeout)
        try:
            self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            self._expect("hi", deadline)
            for command in (f"open {channel}", "rawmode"):
                self._socket.sendall(f"< {command} >".encode())
                self._expect("ok", deadline)
        except BaseException:
            self._socket.close()
            self._is_shutdown = True
            raise
        super().__init__(channel=channel)

    def _expect(self, wanted: str, deadline: float) -> None:
        while (text := self._next()) is None:
            if not self._receive(deadline - time.monotonic()):
                raise can.CanTimeoutError(f"{self.channel_info} did not send <{wanted}>")
        if text.split()[1:-1] != [wanted]:
            raise can.CanInitializationError(f"{self.channel_info} sent {text!r} instead of <{wanted}>")

    def _receive(self, timeout: float) -> bool:
        """Receive bytes within `timeout` s; return whether any came."""
        ready, _, _ = select.select([self._socket], [], [], max(0.0, timeout))
        if not ready:
            return False
        data = self._socket.recv(65536)
        if not data:
            raise can.CanOperationError(f"{self.channel_info} has closed the connection")
        self._buffer += data
        return True

    def _next(self) -> str | None:
        """Return the next complete message, from < to >. Raises ValueError for an invalid one."""
        end = self._buffer.find(b">")
        if end < 0:
            if len(self._buffer) > LONGEST:
                self._buffer = b""
                raise ValueError("not a socketcand message: too long")
            return None
        text, self._buffer = self._buffer[: end + 1].strip(), self._buffer[end + 1 :]
        if not text.startswith(b"<") or len(text) > LONGEST:
            raise ValueError(f"not a socketcand message: {text[:40]!r}")
        return text.decode("ascii")

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        deadline = time.monotonic() + (1e6 if timeout is None else timeout)
        while True:
            while (text := self._next()) is not None:
                if text.startswith("< frame ") and (frame := convert_ascii_message_to_can_message(text)) is not None:
                    return frame, False
                if text.startswith("< error "):
                    raise can.CanOperationError(f"{self.channel_info}: {text}")
            if not self._receive(deadline - time.monotonic()):
                return None, False

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        """Send a frame within `timeout` s. Raises can.CanError, OSError."""
        self._socket.settimeout(timeout or 1.0)
        try:
            self._socket.sendall(convert_can_message_to_ascii_message(msg).encode())
        except TimeoutError as error:
            raise can.CanTimeoutError(f"{self.channel_info} accepts no frames") from error

    def flush(self) -> None:
        """Discard invalid bytes."""
        self._buffer = b""

    def wake(self) -> None:
        """Make a thread that waits for a frame fail."""
        self._socket.shutdown(socket.SHUT_RDWR)

    def shutdown(self) -> None:
        """Close; does nothing when closed."""
        super().shutdown()
        self._socket.close()

    def fileno(self) -> int:
        """Return the socket's descriptor."""
        return self._socket.fileno()

    def _apply_filters(self, filters: Any) -> None:
        """Do nothing; `recv` of python-can filters."""
