"""The observing side of RTDE, port 30004: set up an output recipe, then take sample after sample.

Source: Universal Robots, "RTDE guide" (protocol version 2). Beside the library's own receiver because that one wakes
some ten times per sample and skips samples that nobody fetched in time, and because its constructor holds the
interpreter and waits without end for a controller that accepts and then says nothing. The figures are in
docs/devices/universal-robots.md.
"""

import socket
import struct
import time
from typing import Final, Self

from arcor2_hw.exceptions import ConnectionLost, DeviceFault, DeviceTimeout, NotConnected

PORT: Final = 30004
MAX_FRAME: Final = 4096  # a recipe of everything there is stays below
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
    """Cut complete frames (type, payload) off a buffer; give them and the rest. ValueError for what is no frame."""
    found, at, end = [], 0, len(buffer)
    while end - at >= _HEADER.size:
        size, kind = _HEADER.unpack_from(buffer, at)
        if not _HEADER.size <= size <= MAX_FRAME:
            raise ValueError(f"a frame of {size} bytes")
        if end - at < size:
            break
        found.append((kind, buffer[at + _HEADER.size : at + size]))
        at += size
    return found, buffer[at:]


def recipe(names: list[str], payload: bytes) -> tuple[int, struct.Struct]:
    """Read the answer to an output set-up: the recipe's number and the layout of its data behind that number.

    DeviceFault names the variables that the controller does not have; ValueError for nonsense.
    """
    if not payload:
        raise ValueError("an empty recipe")
    types = payload[1:].decode("ascii", "replace").rstrip(",").split(",")
    missing = [name for name, kind in zip(names, types, strict=False) if kind == "NOT_FOUND"]
    if missing:
        raise DeviceFault(f"the controller does not know {', '.join(missing)}", ", ".join(types))
    if len(types) != len(names) or not set(types) <= _FORMATS.keys():
        raise ValueError(f"a recipe of {', '.join(types)}")
    return payload[0], struct.Struct(">" + "".join(_FORMATS[kind] for kind in types))


class RtdeStream:
    """A started stream of one recipe. Make it by `open`; used by one thread."""

    def __init__(self, host: str, port: int, opened: socket.socket) -> None:
        self.address = f"{host}:{port}"
        self.version: Version = (0, 0, 0, 0)
        self._socket = opened
        self._buffer = b""
        self._number = 0
        self._layout = struct.Struct("")

    @classmethod
    def open(cls, host: str, names: list[str], timeout: float, port: int = PORT) -> Self:
        """Connect, agree on the recipe and start it, all within `timeout` s.

        Raises NotConnected when nobody listens, DeviceTimeout when nothing is answered, ConnectionLost when the
        exchange breaks off, each naming host and port; DeviceFault when a variable does not exist.
        """
        deadline = time.monotonic() + timeout
        address = f"{host}:{port}"
        try:
            opened = socket.create_connection((host, port), timeout)
        except TimeoutError:
            raise DeviceTimeout(f"UR controller {address} cannot be reached within {timeout:g} s") from None
        except ConnectionResetError as e:  # it listens: the reset may overtake the news that it accepted
            raise ConnectionLost(f"UR controller {address} broke off the exchange", str(e)) from e
        except OSError as e:
            raise NotConnected(f"no UR controller at {address}: {e.strerror or e}", str(e)) from e
        stream = cls(host, port, opened)
        try:
            opened.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            stream._set_up(names, deadline)
        except TimeoutError:
            stream.close()
            raise DeviceTimeout(f"UR controller {address} accepts but does not answer within {timeout:g} s") from None
        except (OSError, ValueError, struct.error) as e:
            stream.close()
            raise ConnectionLost(f"UR controller {address} broke off the exchange", str(e)) from e
        except BaseException:
            stream.close()
            raise
        return stream

    def read(self, wait: float) -> list[tuple[float | int, ...]]:
        """Give the samples that have come, after waiting at most `wait` s for the first; empty when none came.

        Raises ConnectionLost when the controller closes, resets, or sends what is no RTDE.
        """
        try:
            if self._socket.gettimeout() != wait:
                self._socket.settimeout(wait)
            data = self._socket.recv(16 * MAX_FRAME)
        except TimeoutError:
            return []
        except OSError as e:
            raise ConnectionLost(f"the connection to UR controller {self.address} broke", str(e)) from e
        if not data:
            raise ConnectionLost(f"UR controller {self.address} closed the connection")
        try:
            found, self._buffer = frames(self._buffer + data if self._buffer else data)
            return [self._layout.unpack(f[1:]) for kind, f in found if kind == _DATA and f[0] == self._number]
        except (ValueError, IndexError, struct.error) as e:
            raise ConnectionLost(f"UR controller {self.address} sends what is no RTDE", str(e)) from e

    def close(self) -> None:
        """Close; harmless when closed."""
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
            found, self._buffer = frames(self._buffer)
            for number, (came, answer) in enumerate(found):
                if came == kind:
                    behind = b"".join(_HEADER.pack(_HEADER.size + len(f), k) + f for k, f in found[number + 1 :])
                    self._buffer = behind + self._buffer
                    return answer
                if came not in (_TEXT, _DATA):
                    raise ValueError(f"a frame of type {came} instead of {kind}")
            self._socket.settimeout(max(deadline - time.monotonic(), 0.001))
            data = self._socket.recv(MAX_FRAME)
            if not data:
                raise ConnectionError("closed by the controller")
            self._buffer += data
