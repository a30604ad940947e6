"""Hashes of PINs and cards, which are never stored, logged or exported in clear text."""

import hashlib
import hmac
import itertools
import secrets
from pathlib import Path
from typing import Final

from arcor2_hw.exceptions import InvalidData, StorageError
from arcor2_server.files import write_private
from arcor2_server.storage.persons import PinHash

MIN_PIN_LENGTH: Final = 4
MAX_PIN_LENGTH: Final = 12
MIN_CARD_LENGTH: Final = 4
CARD_KEY: Final = "cards.key"
"""File of the data directory with the key of the hashes of cards."""
_KEY_SIZE: Final = 32
_N: Final = 2**14
"""Cost of scrypt. One hash takes 50 to 100 ms and 16 MiB."""
_R: Final = 8
_P: Final = 1
_MAX_MEMORY: Final = 64 * 1024 * 1024


def check_pin(pin: str) -> None:
    """Raise InvalidData if a PIN is not acceptable."""
    if not (pin.isascii() and pin.isdecimal() and MIN_PIN_LENGTH <= len(pin) <= MAX_PIN_LENGTH):
        raise InvalidData("A PIN has {least} to {most} digits.", least=MIN_PIN_LENGTH, most=MAX_PIN_LENGTH)
    steps = {(int(after) - int(before)) % 10 for before, after in itertools.pairwise(pin)}
    if len(steps) == 1 and steps <= {0, 1, 9}:
        raise InvalidData("This PIN is easy to guess. Use digits that are neither equal nor consecutive.")


def hash_pin(pin: str) -> PinHash:
    """Return the hash of a PIN. It takes 50 to 100 ms, so call it in a thread."""
    salt = secrets.token_bytes(16)
    return PinHash(salt.hex(), _scrypt(pin, salt, _N, _R, _P).hex(), _N, _R, _P)


def matches(pin: str, stored: PinHash) -> bool:
    """Return whether a PIN has this hash. The duration does not depend on the PIN. Call it in a thread."""
    digest = _scrypt(pin, bytes.fromhex(stored.salt), stored.n, stored.r, stored.p)
    return hmac.compare_digest(digest, bytes.fromhex(stored.digest))


def _scrypt(pin: str, salt: bytes, n: int, r: int, p: int) -> bytes:
    return hashlib.scrypt(pin.encode(), salt=salt, n=n, r=r, p=p, maxmem=_MAX_MEMORY, dklen=32)


class CardHashes:
    """Hashes the numbers of cards with a key, since they are too short for a plain hash.

    Args:
        data_dir: directory of the file of the key, which is created for the first card.
    """

    def __init__(self, data_dir: Path) -> None:
        self._path = data_dir / CARD_KEY

    def of(self, card: str) -> str:
        """Return the hash of the number of a card, hexadecimal.

        Raises:
            InvalidData: the number is not acceptable.
            StorageError: the key cannot be read or created.
        """
        number = card.strip()
        if len(number) < MIN_CARD_LENGTH or not number.isprintable():
            raise InvalidData("The number of a card has at least {least} characters.", least=MIN_CARD_LENGTH)
        return hmac.digest(self._key(), number.encode(), "sha256").hex()

    def _key(self) -> bytes:
        try:
            if not self._path.exists():
                write_private(self._path, secrets.token_bytes(_KEY_SIZE))
            key = self._path.read_bytes()
        except OSError as error:
            raise StorageError("The key {path} cannot be used: {reason}.", path=self._path, reason=error) from error
        if len(key) != _KEY_SIZE:
            raise StorageError("The key {path} is damaged. Delete it and read all cards again.", path=self._path)
        return key
