"""Recorder: the traffic of each case in a compressed file, limited in size and without secrets."""

import base64
import gzip
import hashlib
import urllib.parse
from collections.abc import Collection, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import msgspec

from arcor2_hw.data.secret import HIDDEN
from arcor2_hw.testing.report import Recording
from arcor2_hw.testing.wire import Piece, Side

FILE: Final = "wire.jsonl.gz"
PER_SIDE: Final = 32 << 10
"""Maximum amount of recorded data of one case and one side, bytes: its beginning and its end."""
_SHORTEST: Final = 4
"""Minimum length of a secret that is masked; the bytes of a shorter one occur too often by chance."""


def forms(secrets: Collection[str], users: Collection[str] = ()) -> list[bytes]:
    """Return secrets in the forms in which they are sent: plain, in a URL, and in the header of HTTP Basic.

    Args:
        secrets: The secrets. Those of less than 4 characters are ignored.
        users: Names that may be sent together with a secret.
    """
    found: set[bytes] = set()
    for secret in secrets:
        if len(secret) >= _SHORTEST:
            found |= {secret.encode(), urllib.parse.quote(secret, safe="").encode(), base64.b64encode(secret.encode())}
            found |= {base64.b64encode(f"{user}:{secret}".encode()) for user in users}
    return sorted(found, key=len, reverse=True)


def redacted(text: str, secrets: Iterable[bytes]) -> str:
    """Return a text without secrets."""
    for secret in secrets:
        text = text.replace(secret.decode(errors="replace"), HIDDEN)
    return text


def masked(pieces: Sequence[Piece], secrets: Iterable[bytes]) -> list[Piece]:
    """Replace each byte of a secret by `*`, also where it is divided among several pieces."""
    streams: dict[tuple[int, Side], bytearray] = {}
    for piece in pieces:
        streams.setdefault((piece.link, piece.by), bytearray()).extend(piece.data)
    for stream in streams.values():
        for secret in secrets:
            at = stream.find(secret)
            while at >= 0:
                stream[at : at + len(secret)] = b"*" * len(secret)
                at = stream.find(secret, at + len(secret))
    result = []
    for piece in pieces:
        stream = streams[piece.link, piece.by]
        result.append(msgspec.structs.replace(piece, data=bytes(stream[: len(piece.data)])))
        del stream[: len(piece.data)]
    return result


def shortened(pieces: Sequence[Piece]) -> tuple[list[Piece], Mapping[Side, int]]:
    """Return the first and last pieces of each side, and the number of omitted bytes."""
    whole: dict[Side, int] = {"driver": 0, "device": 0}
    for piece in pieces:
        whole[piece.by] += len(piece.data)
    result: list[Piece] = []
    passed: dict[Side, int] = {"driver": 0, "device": 0}
    left_off: dict[Side, int] = {"driver": 0, "device": 0}
    for piece in pieces:
        start = passed[piece.by]
        passed[piece.by] = end = start + len(piece.data)
        if end <= PER_SIDE // 2 or start >= whole[piece.by] - PER_SIDE // 2:
            result.append(piece)
        else:
            left_off[piece.by] += len(piece.data)
    return result, left_off


class Recorder:
    """The recording in a folder."""

    def __init__(self, folder: Path, secrets: Sequence[bytes]) -> None:
        self._path = folder / FILE
        self._secrets = secrets
        self._path.write_bytes(b"")

    def add(self, case: str, pieces: Sequence[Piece]) -> None:
        """Add the traffic of a case; times are relative to its first piece."""
        if not pieces:
            return
        kept, left_off = shortened(masked(pieces, self._secrets))
        began = pieces[0].at
        lines: list[dict[str, Any]] = [
            {"case": case, "at": round(each.at - began, 6), "by": each.by, "link": each.link, "hex": each.data.hex()}
            for each in kept
        ]
        if any(left_off.values()):
            lines.append({"case": case, "left_off": left_off})
        encoded = b"".join(msgspec.json.encode(line) + b"\n" for line in lines)
        with self._path.open("ab") as file:
            file.write(gzip.compress(encoded, mtime=0))

    def recording(self) -> Recording | None:
        """Return name and digest of the file, or None if nothing was recorded."""
        content = self._path.read_bytes()
        return Recording(FILE, hashlib.sha256(content).hexdigest()) if content else None
