"""Verification of minisign signatures, see https://jedisct1.github.io/minisign/#signature-format."""

import base64
import binascii
import hashlib
from pathlib import Path
from typing import Final

from cryptography.exceptions import InvalidSignature
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PublicKey

from arcor2_hw.exceptions import InvalidData

_KEY: Final = b"Ed"
_PREHASHED: Final = b"ED"
"""Signatures of the BLAKE2b digest of a file. Signatures of the file itself are no longer made by default."""
_TRUSTED: Final = "trusted comment: "


def read_public_key(text: str) -> bytes:
    """Return the number and the key of a public key: its base64 text, or the content of its file.

    Raises:
        InvalidData: the text is not a public key of minisign.
    """
    lines = [line for line in text.strip().splitlines() if line and not line.startswith("untrusted comment:")]
    key = _decoded(lines[0]) if len(lines) == 1 else b""
    if len(key) != 42 or not key.startswith(_KEY):
        raise InvalidData("The public key is not one of minisign; it starts with RW and has 56 characters.")
    return key[2:]


def verify(content: Path, signature: Path, public_key: bytes) -> str:
    """Verify the signature of a file, and return the comment that was signed with it.

    Raises:
        InvalidData: the signature is not valid, or was made with another key.
        OSError: a file cannot be read.
    """
    number, key = public_key[:8], Ed25519PublicKey.from_public_bytes(public_key[8:])
    lines = signature.read_text(errors="replace").splitlines()
    if len(lines) != 4 or not lines[2].startswith(_TRUSTED):
        raise InvalidData("{path} is not a signature of minisign.", path=signature)
    signed, comment, both = _decoded(lines[1]), lines[2].removeprefix(_TRUSTED), _decoded(lines[3])
    if len(signed) != 74 or not signed.startswith(_PREHASHED):
        raise InvalidData("{path} is not a signature of minisign.", path=signature)
    if signed[2:10] != number:
        raise InvalidData("{path} was signed with another key.", path=content)
    try:
        key.verify(signed[10:], hashlib.blake2b(content.read_bytes()).digest())
        key.verify(both, signed[10:] + comment.encode())
    except InvalidSignature:
        raise InvalidData("The signature of {path} is not valid.", path=content) from None
    return comment


def _decoded(text: str) -> bytes:
    try:
        return base64.b64decode(text, validate=True)
    except (binascii.Error, ValueError):
        return b""
