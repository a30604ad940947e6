"""The SDO server of the drive (CiA 301, 7.2.4): expedited and segmented transfers; block transfers are refused."""

from __future__ import annotations

import struct
from collections.abc import Callable

from arcor2_fakes.conveyor.dictionary import Abort, Dictionary

_UNKNOWN_COMMAND, _TOGGLE, _LENGTH = 0x05040001, 0x05030000, 0x06070010
_UPLOAD, _UPLOAD_SEGMENT, _DOWNLOAD, _DOWNLOAD_SEGMENT, _ABORT = 0x40, 0x60, 0x20, 0x00, 0x80
_EXPEDITED, _SIZED, _TOGGLE_BIT, _LAST = 0x02, 0x01, 0x10, 0x01


class SdoServer:
    """Answers requests; `written(index, subindex, data)` is called with each download before it is executed."""

    def __init__(self, dictionary: Dictionary, written: Callable[[int, int, bytes], object]) -> None:
        self._dictionary, self._written = dictionary, written
        self._object = 0, 0
        self._reset()

    def _reset(self) -> None:
        self._toggle = 0
        self._to_send: bytes | None = None
        self._to_receive: bytearray | None = None
        self._size: int | None = None

    def answer(self, request: bytes) -> bytes:
        """Return the answer to a request of 8 bytes; nothing to an abort."""
        specifier, index, subindex = struct.unpack_from("<BHB", request)
        try:
            if specifier & 0xE0 in (_UPLOAD_SEGMENT, _DOWNLOAD_SEGMENT):
                return self._segment(specifier, request[1:])
            self._reset()
            self._object = index, subindex
            match specifier & 0xE0:
                case 0x40:
                    return self._start_upload()
                case 0x20:
                    return self._start_download(specifier, request[4:])
            if specifier == _ABORT:
                return b""
            raise Abort(_UNKNOWN_COMMAND)
        except Abort as abort:
            self._reset()
            return struct.pack("<BHBI", _ABORT, *self._object, abort.code)

    def _start_upload(self) -> bytes:
        value = self._dictionary.read(*self._object)
        if len(value) <= 4:
            specifier = _UPLOAD | (4 - len(value)) << 2 | _EXPEDITED | _SIZED
            return struct.pack("<BHB4s", specifier, *self._object, value)
        self._to_send = value
        return struct.pack("<BHBI", _UPLOAD | _SIZED, *self._object, len(value))

    def _start_download(self, specifier: int, data: bytes) -> bytes:
        size = self._dictionary.writable_size(*self._object)
        if specifier & _EXPEDITED:
            self._write(data[: 4 - (specifier >> 2 & 3) if specifier & _SIZED else size])
        else:
            self._size = int.from_bytes(data, "little") if specifier & _SIZED else None
            self._to_receive = bytearray()
        return struct.pack("<BHB4x", 0x60, *self._object)

    def _segment(self, specifier: int, data: bytes) -> bytes:
        upload = specifier & 0xE0 == _UPLOAD_SEGMENT
        if (self._to_send if upload else self._to_receive) is None:
            raise Abort(_UNKNOWN_COMMAND)
        toggle = specifier & _TOGGLE_BIT
        if toggle != self._toggle:
            raise Abort(_TOGGLE)
        self._toggle ^= _TOGGLE_BIT
        if self._to_send is not None:
            part, rest = self._to_send[:7], self._to_send[7:]
            self._to_send = rest or None
            return bytes([toggle | (7 - len(part)) << 1 | (not rest)]) + part.ljust(7, b"\0")
        assert self._to_receive is not None
        self._to_receive += data[: 7 - (specifier >> 1 & 7)]
        if specifier & _LAST:
            received, self._to_receive = bytes(self._to_receive), None
            if self._size not in (None, len(received)):
                raise Abort(_LENGTH)
            self._write(received)
        return struct.pack("<B7x", 0x20 | toggle)

    def _write(self, data: bytes) -> None:
        self._written(*self._object, data)
        self._dictionary.write(*self._object, data)
