"""The primary port: sends each client one robot state with the kinematics of the arm, as a controller does first.

A message is its length (u32), its type and its content. A robot state (type 16) consists of packages of the same form;
package 5 has the DH parameters of the arm. Numbers are big-endian. The layout is from general knowledge of the
interface. Not modelled: other packages, and the stream of states that follows.
"""

import math
import struct

from arcor2_fakes.ur.kinematics import Geometry
from arcor2_fakes.wire import Connection

_HEADER = struct.Struct(">IB")
_ROBOT_STATE, _ROBOT_MESSAGE = 16, 20
_VERSION_MESSAGE = 3
_ROBOT_MODE, _KINEMATICS = 0, 5
_CHECKSUMS = (0x1D2C3B4A, 0x2D2C3B4A, 0x3D2C3B4A, 0x4D2C3B4A, 0x5D2C3B4A, 0x6D2C3B4A)


def _framed(kind: int, content: bytes) -> bytes:
    return _HEADER.pack(_HEADER.size + len(content), kind) + content


class PrimaryPort:
    """All clients of the primary port."""

    def __init__(self, geometry: Geometry, version: tuple[int, ...]) -> None:
        self._version = version
        g, quarter = geometry, math.pi / 2.0
        self._nominal = (
            (0.0,) * 6,
            (0.0, g.a2, g.a3, 0.0, 0.0, 0.0),
            (g.d1, 0.0, 0.0, g.d4, g.d5, g.d6),
            (quarter, 0.0, 0.0, quarter, -quarter, 0.0),
        )
        self._deltas = [[0.0] * 6 for _ in range(4)]
        self._reported = True

    def calibrate(self, deltas: list[list[float]], reported: bool = True) -> None:
        """Set what a calibration adds to theta, a, d and alpha; `reported`: whether the primary port reports it."""
        if [len(row) for row in deltas] != [6] * 4:
            raise ValueError("four rows of six numbers")
        self._deltas, self._reported = deltas, reported

    def opened(self, connection: Connection) -> None:
        """Serve a client; its data is ignored."""
        connection.received = lambda _: None
        project = b"URControl"
        version = struct.pack(">QbBB", 0, -2, _VERSION_MESSAGE, len(project)) + project
        version += struct.pack(">BBii", self._version[0], self._version[1], self._version[2], self._version[3])
        connection.send(_framed(_ROBOT_MESSAGE, version + b"\0"))
        state = _framed(_ROBOT_MODE, bytes(37))
        if self._reported:
            state += _framed(_KINEMATICS, self._kinematics())
        connection.send(_framed(_ROBOT_STATE, state))

    def _kinematics(self) -> bytes:
        rows = [
            n + d
            for row, delta in zip(self._nominal, self._deltas, strict=True)
            for n, d in zip(row, delta, strict=True)
        ]
        return struct.pack(">6I24dI", *_CHECKSUMS, *rows, 0)
