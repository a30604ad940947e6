"""The ring of recent values, in memory that the host shares with the server: it survives a killed host.

It consists of segments that are written in turn. Each starts with all present values, so it can be read alone.
"""

import mmap
import os
import secrets
import struct
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Final

import msgspec

SEGMENTS: Final = 8
SEGMENT_SIZE: Final = 512 * 1024
"""Size of a segment, bytes. If the values need more space, the ring covers a shorter time."""
SIZE: Final = SEGMENTS * SEGMENT_SIZE

INTERRUPTED: Final = "run-{run}{other}.ring"
"""Name of the file with the ring of a run that the end of the server interrupted. other: differs by host."""

_HEAD: Final = struct.Struct("<QQ")
"""Generation of a segment, 0 for an unused one, and the length of its records."""
_LENGTH: Final = struct.Struct("<I")
ROOM: Final = SEGMENT_SIZE - _HEAD.size
"""Space for the records of a segment, bytes."""


def create() -> int:
    """Return the file descriptor of the memory of a new ring. It exists while a process has it open."""
    descriptor = os.memfd_create("arcor2-hw-ring")
    os.ftruncate(descriptor, SIZE)
    return descriptor


class Ring:
    """The memory of a ring. One thread at a time writes it; another process may read it at any time.

    Args:
        descriptor: file descriptor of its memory, which is closed; None for memory of this process only.
    """

    def __init__(self, descriptor: int | None = None) -> None:
        self._memory = mmap.mmap(-1 if descriptor is None else descriptor, SIZE)
        if descriptor is not None:
            os.close(descriptor)
        heads = [_HEAD.unpack_from(self._memory, number * SEGMENT_SIZE) for number in range(SEGMENTS)]
        self._generation: int = max(generation for generation, _ in heads)
        self._length = ROOM
        """Used space of the present segment, bytes; a new ring has no present one."""

    def begin_segment(self) -> None:
        """Continue in the oldest segment, whose records are deleted."""
        self._generation += 1
        self._length = 0
        start = self._start
        _HEAD.pack_into(self._memory, start, 0, 0)
        _HEAD.pack_into(self._memory, start, self._generation, 0)

    @property
    def _start(self) -> int:
        return self._generation % SEGMENTS * SEGMENT_SIZE

    def append(self, record: bytes) -> bool:
        """Append a record to the present segment. Return false if it has not enough space."""
        size = _LENGTH.size + len(record)
        if self._length + size > ROOM:
            return False
        start = self._start
        at = start + _HEAD.size + self._length
        self._memory[at : at + size] = _LENGTH.pack(len(record)) + record
        self._length += size  # last, so that a reader never sees a part of a record
        _HEAD.pack_into(self._memory, start, self._generation, self._length)
        return True

    def segments(self) -> list[bytes]:
        """Return a copy of the used segments, oldest first, without one that was overwritten meanwhile."""
        found: dict[int, bytes] = {}
        for number in range(SEGMENTS):
            start = number * SEGMENT_SIZE
            generation, length = _HEAD.unpack_from(self._memory, start)
            content = self._memory[start + _HEAD.size : start + _HEAD.size + min(length, ROOM)]
            if generation and _HEAD.unpack_from(self._memory, start)[0] == generation:
                found[generation] = content
        return [found[generation] for generation in sorted(found)]

    def appended(self, generation: int, length: int) -> Iterator[tuple[int, bytes]]:
        """Yield the data appended after a position: generations of segments, oldest first, and their new records.

        Args:
            generation: generation of the segment of the position; 0 for the start.
            length: length of the records of this segment before the position, bytes.
        """
        heads = [(*_HEAD.unpack_from(self._memory, number * SEGMENT_SIZE), number) for number in range(SEGMENTS)]
        for found, used, number in sorted(heads):
            begin = length if found == generation else 0
            if found >= max(generation, 1) and used > begin:
                start = number * SEGMENT_SIZE
                content = self._memory[start + _HEAD.size + begin : start + _HEAD.size + min(used, ROOM)]
                if _HEAD.unpack_from(self._memory, start)[0] == found:
                    yield found, content


Rings = list[Ring]
"""The rings of the hosts of a scene or program, the main one first. A host that joins them adds its ring."""


def save(segments: list[bytes], directory: Path, run: int, *, main: bool = True) -> None:
    """Store the ring of a run that the end of the server interrupts. The next server makes a recording of it.

    Args:
        segments: the segments of the ring.
        directory: the directory of recordings.
        run: number of the run.
        main: whether it is the ring of the main host.

    Raises:
        OSError: the file cannot be written.
    """
    directory.mkdir(parents=True, exist_ok=True, mode=0o700)
    path = directory / INTERRUPTED.format(run=run, other="" if main else f"-{secrets.token_hex(4)}")
    fresh = path.with_suffix(".new")
    fresh.touch(0o600)
    with fresh.open("wb") as file:
        file.write(msgspec.msgpack.encode([time.monotonic(), time.time(), segments]))
        file.flush()
        os.fsync(file.fileno())
    fresh.replace(path)


def records(segment: bytes) -> Iterator[memoryview]:
    """Yield the records of a segment."""
    view, at = memoryview(segment), 0
    while at + _LENGTH.size <= len(view):
        (length,) = _LENGTH.unpack_from(view, at)
        at += _LENGTH.size
        if at + length > len(view):
            return
        yield view[at : at + length]
        at += length
