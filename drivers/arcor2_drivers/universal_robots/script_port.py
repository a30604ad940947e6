"""The script port, 30003: takes a program as text. There is no answer, only a stream of states."""

import contextlib
import socket
import time
from typing import Final, Self

from arcor2_hw.exceptions import ConnectionLost, DeviceTimeout, NotConnected

PORT: Final = 30003
_CHUNK: Final = 1 << 16


class ScriptPort:
    """One connection. Keep it open until the program plays: closing it early could discard the text."""

    def __init__(self, address: str, opened: socket.socket) -> None:
        self.address = address
        self._socket = opened

    @classmethod
    def open(cls, host: str, timeout: float, port: int = PORT) -> Self:
        """Connect. Raise NotConnected or DeviceTimeout."""
        address = f"{host}:{port}"
        try:
            return cls(address, socket.create_connection((host, port), timeout))
        except TimeoutError:
            raise DeviceTimeout("The script port {address} does not answer.", address=address) from None
        except OSError as e:
            raise NotConnected("No script port at {address}.", str(e), address=address) from e

    def send(self, program: str, timeout: float) -> None:
        """Send a program. Raise DeviceTimeout or ConnectionLost."""
        deadline = time.monotonic() + timeout
        rest = memoryview(program.encode("ascii"))
        try:
            while rest:
                self._socket.settimeout(max(deadline - time.monotonic(), 0.001))
                rest = rest[self._socket.send(rest) :]
        except TimeoutError:
            raise DeviceTimeout(
                "The script port {address} did not take a program in {timeout:g} s.",
                address=self.address,
                timeout=timeout,
            ) from None
        except OSError as e:
            raise ConnectionLost(
                "The script port {address} closed the connection.", str(e), address=self.address
            ) from e

    def drain(self) -> None:
        """Discard the stream of the controller, so that its buffer does not fill."""
        with contextlib.suppress(OSError):
            self._socket.settimeout(0.0)
            while self._socket.recv(_CHUNK):
                pass

    def close(self) -> None:
        """Close the connection."""
        self._socket.close()
