"""Tokens: who may connect, and in which role; kept in a file of which nobody can read a token again."""

import contextlib
import fcntl
import hashlib
import hmac
import os
import secrets
from collections.abc import Generator
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Final

import msgspec

from arcor2_hw.data.base import Data, Timestamp, now
from arcor2_hw.data.role import Role
from arcor2_hw.exceptions import Conflict, InvalidData, NotFound, StorageError

FILE: Final = "tokens.json"
LONGEST_NAME: Final = 100


class Token(Data, frozen=True):
    """One token: for whom, in which role, until when; `digest` is the SHA-256 of its secret, which has 256 random bits
    and so needs no slow hash.
    """

    id: str
    name: str
    role: Role
    digest: str
    created: Timestamp
    expires: Timestamp | None = None

    @property
    def expired(self) -> bool:
        """Tell whether its time is over."""
        return self.expires is not None and datetime.fromisoformat(self.expires) <= datetime.now(UTC)


_decode = msgspec.json.Decoder(list[Token]).decode


class TokenFile:
    """The tokens of one data directory. Methods raise StorageError naming the file.

    Other processes may change the file at any time: it is read again when it is another one.
    """

    def __init__(self, data_dir: Path) -> None:
        self._path = data_dir / FILE
        self._seen: tuple[int, int, int] | None = None
        self._tokens: list[Token] = []

    def all(self) -> list[Token]:
        """Give all tokens, the expired too; empty when there never was one."""
        try:
            status = self._path.stat()
            stamp = (status.st_mtime_ns, status.st_size, status.st_ino)
            if stamp != self._seen:
                self._tokens, self._seen = _decode(self._path.read_bytes()), stamp
        except FileNotFoundError:
            self._tokens, self._seen = [], None
        except (OSError, msgspec.DecodeError) as error:
            raise StorageError(f"the file of tokens {self._path} cannot be used: {error}") from error
        return self._tokens

    def find(self, secret: str) -> Token | None:
        """Give the token with this secret, None when there is none or its time is over."""
        digest = hashlib.sha256(secret.encode(errors="replace")).hexdigest()
        found = None
        for token in self.all():  # all of them, so that the time taken tells nothing
            if hmac.compare_digest(token.digest, digest):
                found = token
        return None if found is None or found.expired else found

    def valid(self, token: Token) -> bool:
        """Tell whether a token is still there and its time is not over."""
        return not token.expired and any(each.id == token.id for each in self.all())

    def add(self, name: str, role: Role, days: int | None = None) -> tuple[Token, str]:
        """Make a token; gives it with its secret, which is nowhere kept. InvalidData, Conflict."""
        if not name.strip() or len(name) > LONGEST_NAME or not name.isprintable():
            raise InvalidData(f"A token needs the name of a person or a device, of {LONGEST_NAME} characters at most.")
        secret = secrets.token_urlsafe(32)
        expires = None
        if days is not None:
            expires = (datetime.now(UTC) + timedelta(days=days)).isoformat(timespec="seconds")
        digest = hashlib.sha256(secret.encode()).hexdigest()
        token = Token(secrets.token_hex(4), name, role, digest, now(), expires)
        with self._changing() as tokens:
            if any(each.name == name and not each.expired for each in tokens):
                raise Conflict(f"There is a token for {name!r} already: revoke it first.")
            tokens.append(token)
        return token, secret

    def revoke(self, which: str) -> list[Token]:
        """Take out the tokens of this id or name, and give them. NotFound."""
        with self._changing() as tokens:
            gone = [token for token in tokens if which in (token.id, token.name)]
            if not gone:
                raise NotFound(f"There is no token {which!r}.")
            tokens[:] = [token for token in tokens if token not in gone]
        return gone

    @contextlib.contextmanager
    def _changing(self) -> Generator[list[Token], None, None]:
        """Have the list to change; it is on disk, readable by its owner alone, when this ends."""
        try:
            self._path.parent.mkdir(parents=True, exist_ok=True)
            with self._path.with_suffix(".lock").open("ab") as lock:
                fcntl.flock(lock, fcntl.LOCK_EX)
                tokens = list(self.all())
                yield tokens
                fresh = self._path.with_suffix(".new")
                fresh.unlink(missing_ok=True)
                with open(os.open(fresh, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "wb") as file:  # noqa: PTH123
                    file.write(msgspec.json.format(msgspec.json.encode(tokens)))
                    file.flush()
                    os.fsync(file.fileno())
                fresh.replace(self._path)
        except OSError as error:
            raise StorageError(f"the file of tokens {self._path} cannot be written: {error.strerror}") from error
