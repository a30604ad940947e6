"""The token for `/metrics`. It permits only reading metrics. Without a token, metrics are disabled."""

import hashlib
import hmac
import secrets
from pathlib import Path
from typing import Final

from arcor2_hw.exceptions import StorageError
from arcor2_server.files import write_private

FILE: Final = "metrics-token"


class MetricsToken:
    """The token of one data directory. The file contains the SHA-256 of its secret, which has 256 random bits.

    Other processes may change the file at any time. Methods raise StorageError if it cannot be used.
    """

    def __init__(self, data_dir: Path) -> None:
        self._path = data_dir / FILE

    def create(self) -> str:
        """Create a token that replaces the previous one; return its secret."""
        secret = secrets.token_urlsafe(32)
        try:
            write_private(self._path, _digest(secret).encode())
        except OSError as error:
            raise self._failed(error) from error
        return secret

    def remove(self) -> bool:
        """Remove the token; return whether there was one."""
        try:
            self._path.unlink()
        except FileNotFoundError:
            return False
        except OSError as error:
            raise self._failed(error) from error
        return True

    def check(self, secret: str) -> bool | None:
        """Return whether a secret is the token's, in constant time; None if there is no token."""
        try:
            stored = self._path.read_bytes().strip()
        except FileNotFoundError:
            return None
        except OSError as error:
            raise self._failed(error) from error
        return hmac.compare_digest(stored, _digest(secret).encode())

    def _failed(self, error: OSError) -> StorageError:
        return StorageError(
            "The file of the metrics token {path} cannot be used: {reason}.", path=self._path, reason=error
        )


def _digest(secret: str) -> str:
    return hashlib.sha256(secret.encode()).hexdigest()
