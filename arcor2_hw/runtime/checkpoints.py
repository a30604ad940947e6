"""Checkpoints of runs on disk: two files written alternately, so that a power cut leaves the other one valid."""

import os
import struct
import zlib
from pathlib import Path
from typing import Final, Protocol
from urllib.parse import quote, unquote

import msgspec

from arcor2_hw.data.parts import PartInventory
from arcor2_hw.exceptions import StorageError
from arcor2_hw.files import sync

_HEADER: Final = struct.Struct("<QII")
"""Sequence number, length and CRC-32 of the content."""
_SUFFIXES: Final = (".0", ".1")

_encode = msgspec.msgpack.Encoder().encode
_decode = msgspec.msgpack.Decoder(PartInventory).decode


class Checkpoints(Protocol):
    """Storage for the newest checkpoint of a scene."""

    def write(self, inventory: PartInventory) -> None:
        """Store a checkpoint. It is on disk when this returns. Raises StorageError."""

    def read(self) -> PartInventory | None:
        """Return the newest valid checkpoint, None if there is none. Raises StorageError."""

    def close(self) -> None:
        """End the use."""


class CheckpointFile:
    """The newest checkpoint of a scene. Each write costs one fdatasync.

    Args:
        directory: the directory of all checkpoints.
        scene_id: the scene.
    """

    def __init__(self, directory: Path, scene_id: str) -> None:
        self._paths = [directory / (quote(scene_id, safe="") + suffix) for suffix in _SUFFIXES]
        self._files: list[int] = []
        self._sequence = max((found[0] for path in self._paths if (found := _read(path)) is not None), default=0)

    def write(self, inventory: PartInventory) -> None:
        """Store a checkpoint. It is on disk when this returns. Raises StorageError."""
        try:
            if not self._files:
                self._paths[0].parent.mkdir(parents=True, exist_ok=True)
                self._files = [os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600) for path in self._paths]
                sync(self._paths[0].parent)
            self._sequence += 1
            body = _encode(inventory)
            file = self._files[self._sequence % 2]
            os.pwrite(file, _HEADER.pack(self._sequence, len(body), zlib.crc32(body)) + body, 0)
            os.fdatasync(file)
        except OSError as error:
            raise StorageError("The state of the run cannot be stored: {reason}", reason=error) from error

    def read(self) -> PartInventory | None:
        """Return the newest valid checkpoint, None if there is none."""
        found = [one for path in self._paths if (one := _read(path)) is not None]
        return max(found, key=lambda one: one[0])[1] if found else None

    def close(self) -> None:
        """Close the files."""
        while self._files:
            os.close(self._files.pop())


def stored_scenes(directory: Path) -> list[str]:
    """Return the ids of the scenes that have checkpoints."""
    return sorted({unquote(path.stem) for suffix in _SUFFIXES for path in directory.glob(f"*{suffix}")})


def _read(path: Path) -> tuple[int, PartInventory] | None:
    """Return sequence number and content of a file, None if it does not exist or was written incompletely."""
    try:
        data = path.read_bytes()
        sequence, length, checksum = _HEADER.unpack_from(data)
        body = data[_HEADER.size : _HEADER.size + length]
        if len(body) != length or zlib.crc32(body) != checksum:
            return None
        return sequence, _decode(body)
    except (OSError, struct.error, msgspec.MsgspecError):
        return None
