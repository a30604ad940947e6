"""Ed25519 keys in the text form of NATS: base32 of a prefix, the key and a CRC-16.

Source: https://github.com/nats-io/nkeys, README.md.
"""

import base64
import binascii
from enum import IntEnum
from typing import Final, Self

from cryptography.hazmat.primitives import serialization
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey

from arcor2_hw.exceptions import InvalidData

_SEED_PREFIX: Final = 18 << 3
_KEY_SIZE: Final = 32
_CRC_SIZE: Final = 2


class Kind(IntEnum):
    """What a key identifies. The value is the prefix of its public key."""

    OPERATOR = 14 << 3
    """Signs accounts."""
    ACCOUNT = 0
    """Signs users."""
    USER = 20 << 3
    """Connects to the broker."""


class SigningKey:
    """A private key.

    Args:
        kind: what it identifies.
        key: the key.
    """

    def __init__(self, kind: Kind, key: Ed25519PrivateKey) -> None:
        self._kind, self._key = kind, key

    @classmethod
    def create(cls, kind: Kind) -> Self:
        """Create a key."""
        return cls(kind, Ed25519PrivateKey.generate())

    @classmethod
    def from_seed(cls, seed: str) -> Self:
        """Return the key of a seed.

        Raises:
            InvalidData: the text is not a seed.
        """
        raw = _decoded(seed)
        if len(raw) != 2 + _KEY_SIZE or raw[0] & 0xF8 != _SEED_PREFIX:
            raise InvalidData("A key in the file of credentials is damaged.")
        prefix = (raw[0] & 7) << 5 | raw[1] >> 3
        return cls(Kind(prefix), Ed25519PrivateKey.from_private_bytes(raw[2:]))

    @property
    def seed(self) -> str:
        """Return the private key as text."""
        kind = self._kind
        return _encoded(bytes((_SEED_PREFIX | kind >> 5, (kind & 31) << 3)) + self._key.private_bytes_raw())

    @property
    def public(self) -> str:
        """Return the public key as text."""
        raw = self._key.public_key().public_bytes(serialization.Encoding.Raw, serialization.PublicFormat.Raw)
        return _encoded(bytes((self._kind,)) + raw)

    def sign(self, content: bytes) -> bytes:
        """Return the signature of a content."""
        return self._key.sign(content)


def is_user_key(text: str) -> bool:
    """Return whether a text is the public key of a user."""
    try:
        raw = _decoded(text)
    except InvalidData:
        return False
    return len(raw) == 1 + _KEY_SIZE and raw[0] == Kind.USER


def _encoded(raw: bytes) -> str:
    return base64.b32encode(raw + _crc(raw)).decode().rstrip("=")


def _decoded(text: str) -> bytes:
    try:
        raw = base64.b32decode(text + "=" * (-len(text) % 8))
    except ValueError:
        raw = b""
    content, crc = raw[:-_CRC_SIZE], raw[-_CRC_SIZE:]
    if not content or crc != _crc(content):
        raise InvalidData("A key in the file of credentials is damaged.")
    return content


def _crc(raw: bytes) -> bytes:
    return binascii.crc_hqx(raw, 0).to_bytes(_CRC_SIZE, "little")
