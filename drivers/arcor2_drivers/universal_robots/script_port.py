"""The script port, 30003: a program goes in as text. There is no answer, only a stream of states."""

import contextlib
import socket
import time
from typing import Final, Self

from arcor2_hw.exceptions import ConnectionLost, DeviceTimeout, NotConnected

PORT: Final = 30003
_CHUNK: Final = 1 << 16


class ScriptPort:
    """One connection, kept until the program is seen to play: closing it early could throw the text away."""

    def __init__(self, address: str, opened: socket.socket) -> None:
        self.address = address
        self._socket = opened

    @classmethod
    def open(cls, host: str, timeout: float, port: int = PORT) -> Self:
        """Connect. Raises NotConnected, DeviceTimeout."""
        address = f"{host}:{port}"
        try:
            return cls(address, socket.create_connection((host, port), timeout))
        except TimeoutError:
            raise DeviceTimeout(f"the script port {address} does not answer") from None
        except OSError as e:
            raise NotConnected(f"no script port at {address}", str(e)) from e

    def send(self, program: str, timeout: float) -> None:
        """Send a program. Raises DeviceTimeout, ConnectionLost."""
        until = time.monotonic() + timeout
        left = memoryview(program.encode("ascii"))
        try:
            while left:
                self._socket.settimeout(max(until - time.monotonic(), 0.001))
                left = left[self._socket.send(left) :]
        except TimeoutError:
            raise DeviceTimeout(f"the script port {self.address} took no program in {timeout:g} s") from None
        except OSError as e:
            raise ConnectionLost(f"the script port {self.address} closed the connection", str(e)) from e

    def drain(self) -> None:
        """Throw away what the controller streams, so that it does not wait for us."""
        with contextlib.suppress(OSError):
            self._socket.settimeout(0.0)
            while self._socket.recv(_CHUNK):
                pass

    def close(self) -> None:
        """Close."""
        self._socket.close()
