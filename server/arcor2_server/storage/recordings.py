"""Recordings of alarms and failed runs: one file for each, next to the journal. All methods block.

A file has a header, the information about the recording, and its content as compressed columns, each with a checksum.
Opening the store reads only the information, so there is no index that could differ from the files.
"""

import contextlib
import re
import shutil
import struct
import zlib
from pathlib import Path
from typing import Final, NamedTuple

import msgspec
import structlog

from arcor2_hw.data.recordings import RecordedValues, RecordingInfo
from arcor2_hw.exceptions import NotFound, StorageError
from arcor2_hw.runtime.ring import INTERRUPTED
from arcor2_server.files import DIRECTORY_MODE, replace_file

log = structlog.get_logger(__name__)

MAX_RECORDINGS: Final = 100
"""Maximum number of recordings."""
MAX_BYTES: Final = 200_000_000
"""Maximum size of all recordings, bytes."""
MIN_FREE_SPACE: Final = 100_000_000
"""Free space of the disk below which nothing is recorded, bytes."""
LARGEST: Final = 64 * 1024 * 1024
"""Maximum size of the content of a recording, bytes."""

_HEADER: Final = struct.Struct("<8sIIII")
"""Magic number; length and CRC-32 of the information, length and CRC-32 of the content."""
_MAGIC: Final = b"A2HWREC1"
_NAME: Final = re.compile(r"(\d{1,9})\.rec")
_RING: Final = re.compile(
    re.escape(INTERRUPTED).replace(r"\{run\}", r"(\d{1,9})").replace(r"\{other\}", "(-[0-9a-f]{8})?")
)
_encode: Final = msgspec.msgpack.Encoder().encode
_decode_info: Final = msgspec.msgpack.Decoder(RecordingInfo).decode
_decode_values: Final = msgspec.msgpack.Decoder(RecordedValues).decode


class SavedRing(NamedTuple):
    """The rings of a run that the end of the server interrupted.

    paths: their files. monotonic, wall: when the main host has stored its ring, s. rings: the segments of each host.
    """

    paths: list[Path]
    run: int
    monotonic: float
    wall: float
    rings: list[list[bytes]]


class RecordingFiles:
    """The files of all recordings.

    Args:
        directory: their directory.
    """

    def __init__(self, directory: Path) -> None:
        self._directory = directory

    def _path(self, number: int) -> Path:
        return self._directory / f"{number:06}.rec"

    def _numbers(self) -> list[int]:
        """Return the numbers of all files, also of damaged ones, oldest first."""
        found = (_NAME.fullmatch(path.name) for path in self._directory.glob("*.rec"))
        return sorted(int(name[1]) for name in found if name)

    def next_number(self) -> int:
        """Return a number that no file has, greater than all others."""
        return max(self._numbers(), default=0) + 1

    def all(self) -> list[RecordingInfo]:
        """Return the information about all readable recordings, oldest first. A damaged file is left out."""
        found = []
        for number in self._numbers():
            try:
                found.append(self._info(number))
            except (OSError, StorageError) as error:
                log.warning("recording left out", number=number, reason=str(error))
        return found

    def _info(self, number: int) -> RecordingInfo:
        with self._path(number).open("rb") as file:
            head = file.read(_HEADER.size)
            magic, length, checksum, content, _ = _header(head, number)
            info = file.read(length)
        if magic != _MAGIC or zlib.crc32(info) != checksum:
            raise _damaged(number)
        try:
            return msgspec.structs.replace(_decode_info(info), number=number, size=_HEADER.size + length + content)
        except msgspec.MsgspecError as error:
            raise _damaged(number) from error

    def values(self, number: int) -> RecordedValues:
        """Return the content of a recording. Raise NotFound if there is none, StorageError if it is damaged."""
        try:
            data = self._path(number).read_bytes()
        except FileNotFoundError as error:
            raise not_found(number) from error
        except OSError as error:
            raise StorageError("Recording {number} cannot be read: {reason}", number=number, reason=error) from error
        _, skipped, _, length, checksum = _header(data[: _HEADER.size], number)
        body = data[_HEADER.size + skipped :][:length]
        if len(body) != length or zlib.crc32(body) != checksum:
            raise _damaged(number)
        try:
            inflate = zlib.decompressobj()
            return _decode_values(inflate.decompress(body, LARGEST))
        except (zlib.error, msgspec.MsgspecError) as error:
            raise _damaged(number) from error

    def put(self, info: RecordingInfo, values: RecordedValues) -> RecordingInfo:
        """Store a recording, or replace it; return it with its size. Raise StorageError, also for a full disk."""
        try:
            self._directory.mkdir(parents=True, exist_ok=True, mode=DIRECTORY_MODE)
            if shutil.disk_usage(self._directory).free < MIN_FREE_SPACE:
                raise StorageError("The disk of the server is nearly full. Nothing is recorded.")
            head, body = _encode(info), zlib.compress(_encode(values), 6)
            content = _HEADER.pack(_MAGIC, len(head), zlib.crc32(head), len(body), zlib.crc32(body)) + head + body
            replace_file(self._path(info.number), content)
        except OSError as error:
            raise StorageError("The recording cannot be stored: {reason}", reason=error) from error
        return msgspec.structs.replace(info, size=len(content))

    def delete_oldest(self, most: int = MAX_RECORDINGS, most_bytes: int = MAX_BYTES) -> list[int]:
        """Delete the oldest files until the limits are met; return their numbers."""
        deleted, total = [], 0
        for count, number in enumerate(reversed(self._numbers()), 1):
            with contextlib.suppress(OSError):
                total += self._path(number).stat().st_size
            if count > most or (total > most_bytes and count > 1):
                self.delete(number)
                deleted.append(number)
        return deleted

    def delete(self, number: int) -> None:
        """Delete a file if it exists."""
        try:
            self._path(number).unlink(missing_ok=True)
        except OSError as error:
            log.warning("recording not deleted", number=number, reason=str(error))

    def saved_rings(self) -> list[SavedRing]:
        """Return the rings that hosts have stored because the server ended, by run.

        Damaged files, and those of runs whose main host has stored none, because they had ended, are deleted.
        """
        found: dict[int, SavedRing] = {}
        for path in sorted(self._directory.glob("*.ring"), key=lambda each: (len(each.name), each.name)):
            name = _RING.fullmatch(path.name)
            try:
                kind = tuple[float, float, list[bytes]]
                monotonic, wall, segments = msgspec.msgpack.decode(path.read_bytes(), type=kind)
            except (OSError, msgspec.MsgspecError) as error:
                log.warning("recording of an interrupted run left out", file=path.name, reason=str(error))
                self.discard(path)
                continue
            if name is None:
                continue
            run = int(name[1])
            if name[2] is None:
                found[run] = SavedRing([path], run, monotonic, wall, [segments])
            elif run in found:
                found[run].paths.append(path)
                found[run].rings.append(segments)
            else:
                self.discard(path)
        return list(found.values())

    def discard(self, path: Path) -> None:
        """Delete the file of a ring."""
        with contextlib.suppress(OSError):
            path.unlink(missing_ok=True)


def not_found(number: int | str) -> NotFound:
    """Return the error for a recording that does not exist."""
    return NotFound("Recording {number} does not exist. Only the newest ones are stored.", number=number)


def _header(head: bytes, number: int) -> tuple[bytes, int, int, int, int]:
    if len(head) != _HEADER.size:
        raise _damaged(number)
    magic, info, info_checksum, content, checksum = _HEADER.unpack(head)
    return magic, info, info_checksum, content, checksum


def _damaged(number: int) -> StorageError:
    return StorageError("The file of recording {number} is damaged.", number=number)
