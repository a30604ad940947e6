"""The script port, 30003: takes a program as text. There is no answer, only a stream of states."""

import contextlib
import socket
import time
from typing import Final, Self

from arcor2_hw.messages import Message

from .sockets import connect, exchange

PORT: Final = 30003
NAME: Final = Message.of("script port")
"""Name of the port in errors."""
_CHUNK: Final = 1 << 16


class ScriptPort:
    """One connection. Keep it open until the program plays: closing it early could discard the text."""

    def __init__(self, address: str, opened: socket.socket) -> None:
        self.address = address
        self._socket = opened

    @classmethod
    def open(cls, host: str, timeout: float, port: int = PORT) -> Self:
        """Connect. Raise NotConnected or DeviceTimeout."""
        return cls(f"{host}:{port}", connect(NAME, host, port, timeout))

    def send(self, program: str, timeout: float) -> None:
        """Send a program. Raise DeviceTimeout or ConnectionLost."""
        deadline = time.monotonic() + timeout
        rest = memoryview(program.encode("ascii"))
        with exchange(NAME, self.address, timeout):
            while rest:
                self._socket.settimeout(max(deadline - time.monotonic(), 0.001))
                rest = rest[self._socket.send(rest) :]

    def drain(self) -> None:
        """Discard the stream of the controller, so that its buffer does not fill."""
        with contextlib.suppress(OSError):
            self._socket.settimeout(0.0)
            while self._socket.recv(_CHUNK):
                pass

    def close(self) -> None:
        """Close the connection."""
        self._socket.close()
