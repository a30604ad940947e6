"""Wire: the cable between a driver and its device, real or simulated; it can be cut, and records its traffic."""

import abc
import collections
import threading
import time
from collections.abc import Sequence
from typing import Final, Literal

from arcor2_hw.data.base import Data
from arcor2_hw.testing.frames import Frames

LONGEST_RECORD: Final = 200_000
"""Maximum number of recorded pieces; a camera with 30 images per second fills half of it in an hour."""
MAX_HELD: Final = 1 << 20
"""Data that a cut cable holds back, bytes, like the buffers of both ends."""

Side = Literal["driver", "device"]


class Piece(Data, frozen=True):
    """Data that one end sent at one moment: monotonic time in s, sender, number of the connection."""

    at: float
    by: Side
    link: int
    data: bytes


class Wire(abc.ABC):
    """Forwards bytes both ways on its own thread. For one driver; all methods may be called from any thread."""

    def __init__(self) -> None:
        self._record: collections.deque[Piece] = collections.deque(maxlen=LONGEST_RECORD)
        self._lock = threading.RLock()
        self._cut = False
        self._tear_next = False

    # -------------------------------------------------------------------------------- life
    @property
    @abc.abstractmethod
    def address(self) -> str:
        """Return what the driver has to open instead of the device: `host:port`, or a path."""

    @abc.abstractmethod
    def start(self) -> None:
        """Start forwarding.

        Raises:
            OSError: The near end cannot be opened.
        """

    @abc.abstractmethod
    def close(self) -> None:
        """Close both ends. It does nothing when they are closed."""

    # -------------------------------------------------------------------------------- faults
    @abc.abstractmethod
    def reset(self) -> None:
        """Break the connection once at both ends; a new one is accepted at once."""

    @abc.abstractmethod
    def _mended(self) -> None:
        """Handle data that was held back; the lock is held."""

    def cut(self) -> None:
        """Forward nothing from now on and notify nobody, as when the cable is unplugged."""
        with self._lock:
            self._cut = True

    def half_frame(self) -> None:
        """Forward half of what the device sends next, and nothing from then on."""
        with self._lock:
            self._tear_next = True

    def heal(self) -> None:
        """Undo `cut` and `half_frame`."""
        with self._lock:
            self._tear_next = False
            if self._cut:
                self._cut = False
                self._mended()

    def _torn(self, data: bytes) -> tuple[bytes, bool]:
        """Return the part of the device's bytes to forward, and whether the rest was torn off; the lock is held."""
        if not self._tear_next:
            return data, False
        self._tear_next, self._cut = False, True
        return data[: max(1, len(data) // 2)], True

    # -------------------------------------------------------------------------------- record
    def _keep(self, by: Side, link: int, data: bytes) -> None:
        self._record.append(Piece(time.monotonic(), by, link, data))

    def record(self) -> Sequence[Piece]:
        """Return what was forwarded since `forget`, in order of time."""
        with self._lock:
            return tuple(self._record)

    def forget(self) -> None:
        """Start a new record."""
        with self._lock:
            self._record.clear()

    def frames(self, protocol: Frames, by: Side = "driver") -> list[bytes]:
        """Return the frames that one side sent, connection by connection."""
        streams: dict[int, bytearray] = {}
        for piece in self.record():
            if piece.by == by:
                streams.setdefault(piece.link, bytearray()).extend(piece.data)
        return [frame for _, stream in sorted(streams.items()) for frame in protocol.split(bytes(stream))]

    def acting(self, protocol: Frames) -> list[str]:
        """Return descriptions of the driver's frames that act on the device."""
        return [words for frame in self.frames(protocol) if (words := protocol.acting(frame))]
