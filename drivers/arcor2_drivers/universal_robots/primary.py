"""The primary port, 30001: the calibrated kinematics of this robot, in the first robot state after connecting.

A message is its length (u32), its type (u8) and its content. A robot state (type 16) consists of packages of the same
form. Package 5 has six checksums, then theta, a, d and alpha of the six joints, then a status. Numbers are big-endian.
The layout is from general knowledge of the interface. Nothing is sent to this port.
"""

import contextlib
import math
import socket
import struct
import time
from collections.abc import Iterator
from typing import Final

from arcor2_hw.data.robot import DhParameters, KinematicCalibration
from arcor2_hw.messages import Message

from .sockets import connect, exchange

PORT: Final = 30001
NAME: Final = Message.of("primary port")
"""Name of the port in errors."""
TIMEOUT: Final = 2.0
"""Time for the kinematics to arrive, s: the controller sends ten states per second."""
MAX_MESSAGE: Final = 1 << 16
"""Maximum size of a message, bytes."""
_HEADER: Final = struct.Struct(">IB")
_STATE: Final = 16
_KINEMATICS: Final = 5
_LAYOUT: Final = struct.Struct(">6I24dI")
_MAX_PARAMETER: Final = 1000.0
"""Maximum plausible parameter, m or rad: nearly parallel axes may have a d of several metres."""


def parts(buffer: bytes) -> tuple[list[tuple[int, bytes]], bytes]:
    """Split a buffer into complete messages or packages (type, content) and the remaining bytes.

    Raises:
        ValueError: A length is impossible.
    """
    found, at = [], 0
    while len(buffer) - at >= _HEADER.size:
        size, kind = _HEADER.unpack_from(buffer, at)
        if not _HEADER.size <= size <= MAX_MESSAGE:
            raise ValueError(f"invalid message length: {size} bytes")
        if len(buffer) - at < size:
            break
        found.append((kind, buffer[at + _HEADER.size : at + size]))
        at += size
    return found, buffer[at:]


def calibration_in(message: bytes) -> KinematicCalibration | None:
    """Return the kinematics in the content of a robot state, or None. Raise ValueError for invalid data."""
    packages, _ = parts(message)
    for kind, content in packages:
        if kind == _KINEMATICS:
            if len(content) < _LAYOUT.size:
                raise ValueError(f"invalid length of the kinematics: {len(content)} bytes")
            numbers = _LAYOUT.unpack_from(content)
            theta, a, d, alpha = (numbers[at : at + 6] for at in (6, 12, 18, 24))
            if not all(math.isfinite(value) and abs(value) < _MAX_PARAMETER for value in numbers[6:30]):
                raise ValueError("the kinematics contain impossible numbers")
            joints = [DhParameters(*row) for row in zip(theta, d, a, alpha, strict=True)]
            return KinematicCalibration(joints, "-".join(f"{checksum:08x}" for checksum in numbers[:6]))
    return None


def read_calibration(host: str, timeout: float = TIMEOUT, port: int = PORT) -> KinematicCalibration:
    """Connect, wait for the state with the kinematics, and close.

    Raises:
        NotConnected: The connection is refused.
        DeviceTimeout: No kinematics arrived within `timeout` s.
        ConnectionLost: The controller closed the connection.
    """
    address = f"{host}:{port}"
    with contextlib.closing(connect(NAME, host, port, timeout)) as opened, exchange(NAME, address, timeout):
        for kind, content in _messages(opened, time.monotonic() + timeout):
            if kind == _STATE and (found := calibration_in(content)) is not None:
                return found
        raise ConnectionError("closed by the controller")


def _messages(opened: socket.socket, deadline: float) -> Iterator[tuple[int, bytes]]:
    rest = b""
    while True:
        opened.settimeout(max(deadline - time.monotonic(), 0.001))
        data = opened.recv(MAX_MESSAGE)
        if not data:
            return
        found, rest = parts(rest + data)
        yield from found
        if time.monotonic() > deadline:
            raise TimeoutError
