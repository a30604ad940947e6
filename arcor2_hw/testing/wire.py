"""Wire: a cable between a driver and its device, real or simulated, that can be cut and records its traffic."""

import abc
import collections
import threading
import time
from collections.abc import Sequence
from typing import Final, Literal

from arcor2_hw.data.base import Data
from arcor2_hw.testing.frames import Frames

MAX_RECORD: Final = 200_000
"""Maximum number of recorded pieces. A camera with 30 images per second fills half of it in an hour."""
MAX_HELD: Final = 1 << 20
"""Maximum amount of data that a cut wire buffers, bytes."""

Side = Literal["driver", "device"]


class Piece(Data, frozen=True):
    """Data that one end sent at once: monotonic time, s; sender; number of the connection."""

    at: float
    by: Side
    link: int
    data: bytes


class Wire(abc.ABC):
    """Forward bytes in both directions on its own thread. All methods may be called from any thread."""

    def __init__(self) -> None:
        self._record: collections.deque[Piece] = collections.deque(maxlen=MAX_RECORD)
        self._lock = threading.RLock()
        self._cut = False
        self._tear_next = False

    # -------------------------------------------------------------------------------- life
    @property
    @abc.abstractmethod
    def address(self) -> str:
        """Return the address that the driver opens instead of the device: `host:port` or a path."""

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
    def _healed(self) -> None:
        """Handle the buffered data after a cut. The caller holds the lock."""

    def cut(self) -> None:
        """Stop forwarding without closing connections, as when the cable is unplugged."""
        with self._lock:
            self._cut = True

    def half_frame(self) -> None:
        """Forward half of the next data from the device, then nothing more."""
        with self._lock:
            self._tear_next = True

    def heal(self) -> None:
        """Undo `cut` and `half_frame`."""
        with self._lock:
            self._tear_next = False
            if self._cut:
                self._cut = False
                self._healed()

    def _torn(self, data: bytes) -> tuple[bytes, bool]:
        """Return the bytes of the device to forward, and whether the rest is discarded. The caller holds the lock."""
        if not self._tear_next:
            return data, False
        self._tear_next, self._cut = False, True
        return data[: max(1, len(data) // 2)], True

    # -------------------------------------------------------------------------------- record
    def _keep(self, by: Side, link: int, data: bytes) -> None:
        self._record.append(Piece(time.monotonic(), by, link, data))

    def record(self) -> Sequence[Piece]:
        """Return the recorded data since `forget`, in order of time."""
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
