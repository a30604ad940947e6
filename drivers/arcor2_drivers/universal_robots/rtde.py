"""The observing side of RTDE, port 30004: set up an output recipe, then read the stream of samples.

Source: Universal Robots, "RTDE guide" (protocol version 2). The library's own receiver is not used: it wakes about ten
times per sample and skips samples that were not fetched in time, and its constructor blocks the interpreter and waits
without limit for a controller that accepts a connection and sends nothing. docs/devices/universal-robots.md has the
measurements.
"""

import socket
import struct
import time
from typing import Final, Self

from arcor2_hw.exceptions import DeviceFault
from arcor2_hw.messages import Message

from .sockets import connect, exchange

PORT: Final = 30004
NAME: Final = Message.of("RTDE port")
"""Name of the port in errors."""
MAX_FRAME: Final = 4096
"""Maximum size of a frame, bytes; a recipe of all variables is smaller."""
_PROTOCOL: Final = 2
_HEADER: Final = struct.Struct(">HB")
_VERSION, _CONTROLLER, _OUTPUTS, _START, _DATA, _TEXT = (ord(letter) for letter in "VvOSUM")
_FORMATS: Final = {
    "BOOL": "?",
    "UINT8": "B",
    "INT32": "i",
    "UINT32": "I",
    "UINT64": "Q",
    "DOUBLE": "d",
    "VECTOR3D": "3d",
    "VECTOR6D": "6d",
    "VECTOR6INT32": "6i",
    "VECTOR6UINT32": "6I",
}

Version = tuple[int, int, int, int]


def frames(buffer: bytes) -> tuple[list[tuple[int, bytes]], bytes]:
    """Split a buffer into complete frames (type, payload) and the remaining bytes.

    Raise ValueError for invalid data.
    """
    found, at, end = [], 0, len(buffer)
    while end - at >= _HEADER.size:
        size, kind = _HEADER.unpack_from(buffer, at)
        if not _HEADER.size <= size <= MAX_FRAME:
            raise ValueError(f"invalid frame length: {size} bytes")
        if end - at < size:
            break
        found.append((kind, buffer[at + _HEADER.size : at + size]))
        at += size
    return found, buffer[at:]


def recipe(names: list[str], payload: bytes) -> tuple[int, struct.Struct]:
    """Decode the answer to an output set-up.

    Returns:
        The number of the recipe, and the layout of the data that follows this number in a frame.

    Raises:
        DeviceFault: The controller does not have a variable.
        ValueError: The answer is garbage.
    """
    if not payload:
        raise ValueError("the recipe is empty")
    types = payload[1:].decode("ascii", "replace").rstrip(",").split(",")
    missing = [name for name, kind in zip(names, types, strict=False) if kind == "NOT_FOUND"]
    if missing:
        raise DeviceFault("The controller does not have {missing}.", ", ".join(types), missing=", ".join(missing))
    if len(types) != len(names) or not set(types) <= _FORMATS.keys():
        raise ValueError(f"unexpected types in the recipe: {', '.join(types)}")
    return payload[0], struct.Struct(">" + "".join(_FORMATS[kind] for kind in types))


class RtdeStream:
    """A started stream of one recipe. Create it by `open`; for one thread."""

    def __init__(self, host: str, port: int, opened: socket.socket) -> None:
        self.address = f"{host}:{port}"
        self.version: Version = (0, 0, 0, 0)
        self._socket = opened
        self._buffer = b""
        self._number = 0
        self._layout = struct.Struct("")

    @classmethod
    def open(cls, host: str, names: list[str], timeout: float, port: int = PORT) -> Self:
        """Connect, set the recipe up and start it, all within `timeout` s.

        Raises:
            NotConnected: The connection is refused, or the host is unreachable.
            DeviceTimeout: The controller does not answer.
            ConnectionLost: The controller closes the connection.
            DeviceFault: The controller does not have a variable.
        """
        deadline = time.monotonic() + timeout
        opened = connect(NAME, host, port, timeout)
        stream = cls(host, port, opened)
        try:
            with exchange(NAME, stream.address, timeout):
                opened.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                stream._set_up(names, deadline)
        except BaseException:
            stream.close()
            raise
        return stream

    def read(self, wait: float) -> list[tuple[float | int, ...]]:
        """Return the received samples. Wait at most `wait` s for the first one.

        Raises:
            ConnectionLost: The controller closed or reset the connection, or sent garbage.
        """
        with exchange(NAME, self.address, wait):
            if self._socket.gettimeout() != wait:
                self._socket.settimeout(wait)
            try:
                data = self._socket.recv(16 * MAX_FRAME)
            except TimeoutError:
                return []
            if not data:
                raise ConnectionError("closed by the controller")
            found, self._buffer = frames(self._buffer + data if self._buffer else data)
            return [self._layout.unpack(f[1:]) for kind, f in found if kind == _DATA and f[0] == self._number]

    def close(self) -> None:
        """Close the connection, if it is open."""
        self._socket.close()

    def _set_up(self, names: list[str], deadline: float) -> None:
        if self._ask(_VERSION, struct.pack(">H", _PROTOCOL), deadline)[:1] != b"\1":
            raise ValueError("RTDE protocol version 2 is refused")
        major, minor, bugfix, build = struct.unpack_from(">4I", self._ask(_CONTROLLER, b"", deadline))
        self.version = major, minor, bugfix, build
        frequency = 500.0 if major >= 5 else 125.0
        answer = self._ask(_OUTPUTS, struct.pack(">d", frequency) + ",".join(names).encode("ascii"), deadline)
        self._number, self._layout = recipe(names, answer)
        if self._ask(_START, b"", deadline)[:1] != b"\1":
            raise ValueError("the stream is refused")

    def _ask(self, kind: int, payload: bytes, deadline: float) -> bytes:
        self._socket.settimeout(max(deadline - time.monotonic(), 0.001))
        self._socket.sendall(_HEADER.pack(_HEADER.size + len(payload), kind) + payload)
        while True:
            found, rest = frames(self._buffer)
            for number, (received, answer) in enumerate(found):
                if received == kind:
                    later = (_HEADER.pack(_HEADER.size + len(f), k) + f for k, f in found[number + 1 :])
                    self._buffer = b"".join(later) + rest
                    return answer
                if received not in (_TEXT, _DATA):
                    raise ValueError(f"received a frame of type {received} instead of {kind}")
            self._socket.settimeout(max(deadline - time.monotonic(), 0.001))
            data = self._socket.recv(MAX_FRAME)
            if not data:
                raise ConnectionError("closed by the controller")
            self._buffer = rest + data
