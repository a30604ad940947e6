"""Wire: the cable between a driver and its device, real or fake: it can be cut and torn, and keeps what passed."""

import abc
import collections
import threading
import time
from collections.abc import Sequence
from typing import Final, Literal

from arcor2_hw.data.base import Data
from arcor2_hw.testing.frames import Frames

LONGEST_RECORD: Final = 200_000
"""Pieces that are kept; a picture a frame of 30 a second for an hour would be half of it."""
MAX_HELD: Final = 1 << 20
"""Bytes that a cut cable holds back, as the buffers of the two ends would."""

Side = Literal["driver", "device"]


class Piece(Data, frozen=True):
    """What one end sent at one moment: monotonic time in s, who sent it, on which of its connections."""

    at: float
    by: Side
    link: int
    data: bytes


class Wire(abc.ABC):
    """Forwards bytes both ways on a thread of its own. For one driver; all methods may be called from any thread."""

    def __init__(self) -> None:
        self._record: collections.deque[Piece] = collections.deque(maxlen=LONGEST_RECORD)
        self._lock = threading.RLock()
        self._cut = False
        self._tear_next = False

    # -------------------------------------------------------------------------------- life
    @property
    @abc.abstractmethod
    def address(self) -> str:
        """Give what the driver has to open instead of the device: `host:port`, or a path."""

    @abc.abstractmethod
    def start(self) -> None:
        """Begin to forward. Raises OSError when the own end cannot be opened."""

    @abc.abstractmethod
    def close(self) -> None:
        """Close both ends; harmless at any time."""

    # -------------------------------------------------------------------------------- faults
    @abc.abstractmethod
    def reset(self) -> None:
        """Break the connection once, told to both ends; a new one is taken at once."""

    @abc.abstractmethod
    def _mended(self) -> None:
        """Deal with what was held back, the lock held."""

    def cut(self) -> None:
        """Let nothing pass any more and tell nobody, as when the cable is drawn."""
        with self._lock:
            self._cut = True

    def half_frame(self) -> None:
        """Let half of what the device sends next pass, and nothing from then on."""
        with self._lock:
            self._tear_next = True

    def heal(self) -> None:
        """Undo `cut` and `half_frame`; harmless at any time."""
        with self._lock:
            self._tear_next = False
            if self._cut:
                self._cut = False
                self._mended()

    def _torn(self, data: bytes) -> tuple[bytes, bool]:
        """Give what passes of the device's bytes, and whether the rest was torn off; the lock is held."""
        if not self._tear_next:
            return data, False
        self._tear_next, self._cut = False, True
        return data[: max(1, len(data) // 2)], True

    # -------------------------------------------------------------------------------- record
    def _keep(self, by: Side, link: int, data: bytes) -> None:
        self._record.append(Piece(time.monotonic(), by, link, data))

    def record(self) -> Sequence[Piece]:
        """Give what passed since `forget`, in order of time."""
        with self._lock:
            return tuple(self._record)

    def forget(self) -> None:
        """Begin a new record."""
        with self._lock:
            self._record.clear()

    def frames(self, protocol: Frames, by: Side = "driver") -> list[bytes]:
        """Give the frames that one side sent, connection by connection."""
        streams: dict[int, bytearray] = {}
        for piece in self.record():
            if piece.by == by:
                streams.setdefault(piece.link, bytearray()).extend(piece.data)
        return [frame for _, stream in sorted(streams.items()) for frame in protocol.split(bytes(stream))]

    def acting(self, protocol: Frames) -> list[str]:
        """Give, in words, the driver's frames that act on the device."""
        return [words for frame in self.frames(protocol) if (words := protocol.acting(frame))]
