"""The primary port, 30001: read once for the arm's own kinematics, which the first robot state after connecting has.

Layout from general knowledge of the interface: a message is its length (u32), its type (u8) and what follows; a robot
state (type 16) holds packages of the same form, of which package 5 tells six checksums, theta, a, d and alpha of the
six joints, and a status. Big-endian. Nothing is ever sent there.
"""

import contextlib
import math
import socket
import struct
import time
from collections.abc import Iterator
from typing import Final

from arcor2_hw.data.robot import DhParameters, KinematicCalibration
from arcor2_hw.exceptions import ConnectionLost, DeviceTimeout, NotConnected

PORT: Final = 30001
TIMEOUT: Final = 2.0
"""s: states come ten times a second, the first of them with the kinematics."""
MAX_MESSAGE: Final = 1 << 16
_HEADER: Final = struct.Struct(">IB")
_STATE: Final = 16
_KINEMATICS: Final = 5
_LAYOUT: Final = struct.Struct(">6I24dI")
_LONGEST: Final = 1000.0
"""m: nearly parallel axes may be told with d of metres, and back; more is nonsense."""


def parts(buffer: bytes) -> tuple[list[tuple[int, bytes]], bytes]:
    """Cut complete messages, or packages, (type, content) off a buffer; give them and the rest. ValueError for none."""
    found, at = [], 0
    while len(buffer) - at >= _HEADER.size:
        size, kind = _HEADER.unpack_from(buffer, at)
        if not _HEADER.size <= size <= MAX_MESSAGE:
            raise ValueError(f"a message of {size} bytes")
        if len(buffer) - at < size:
            break
        found.append((kind, buffer[at + _HEADER.size : at + size]))
        at += size
    return found, buffer[at:]


def calibration_in(message: bytes) -> KinematicCalibration | None:
    """Find the kinematics in the content of a robot state; None when it has none. ValueError for nonsense."""
    packages, _ = parts(message)
    for kind, content in packages:
        if kind == _KINEMATICS:
            if len(content) < _LAYOUT.size:
                raise ValueError(f"kinematics of {len(content)} bytes")
            numbers = _LAYOUT.unpack_from(content)
            theta, a, d, alpha = (numbers[at : at + 6] for at in (6, 12, 18, 24))
            if not all(math.isfinite(value) and abs(value) < _LONGEST for value in numbers[6:30]):
                raise ValueError("kinematics that are no numbers")
            joints = [DhParameters(*row) for row in zip(theta, d, a, alpha, strict=True)]
            return KinematicCalibration(joints, "-".join(f"{checksum:08x}" for checksum in numbers[:6]))
    return None


def read_calibration(host: str, timeout: float = TIMEOUT, port: int = PORT) -> KinematicCalibration:
    """Connect, wait for the state that tells the kinematics, close.

    Raises NotConnected, DeviceTimeout, ConnectionLost, each naming host and port.
    """
    address = f"{host}:{port}"
    try:
        with contextlib.closing(socket.create_connection((host, port), timeout)) as opened:
            for kind, content in _messages(opened, time.monotonic() + timeout):
                if kind == _STATE and (found := calibration_in(content)) is not None:
                    return found
    except TimeoutError:
        raise DeviceTimeout(f"UR controller {address} tells no kinematics within {timeout:g} s") from None
    except ConnectionRefusedError as e:
        raise NotConnected(f"no UR controller at {address}", str(e)) from e
    except (OSError, ValueError) as e:
        raise ConnectionLost(f"UR controller {address} broke off the exchange", str(e)) from e
    raise ConnectionLost(f"UR controller {address} closed the connection")


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
