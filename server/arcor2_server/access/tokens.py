"""Tokens for clients, each with a role. The token file stores only hashes."""

import contextlib
import fcntl
import hashlib
import hmac
import secrets
from collections.abc import Generator
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Final

import msgspec

from arcor2_hw.data.base import Data, Timestamp, now
from arcor2_hw.data.role import Role
from arcor2_hw.exceptions import Conflict, InvalidData, NotFound, StorageError
from arcor2_server.files import aside, write_private

FILE: Final = "tokens.json"
COPY: Final = "tokens.copy.json"
LONGEST_NAME: Final = 100


class Token(Data, frozen=True):
    """One token: its name, role and expiry; `digest` is the SHA-256 of its secret.

    The secret has 256 random bits, so that no slow hash is needed.
    """

    id: str
    name: str
    role: Role
    digest: str
    created: Timestamp
    expires: Timestamp | None = None

    @property
    def expired(self) -> bool:
        """Return whether its time is over."""
        return self.expires is not None and datetime.fromisoformat(self.expires) <= datetime.now(UTC)


_decode = msgspec.json.Decoder(list[Token]).decode


class TokenFile:
    """The tokens of one data directory. Methods raise StorageError naming the file.

    Other processes may change the file at any time; a changed file is read again. Each change is written to a backup
    first, which is used if the file is damaged.
    """

    def __init__(self, data_dir: Path) -> None:
        self._path = data_dir / FILE
        self._copy = data_dir / COPY
        self._seen: tuple[int, int, int] | None = None
        self._tokens: list[Token] = []
        self.damage = ""
        """What is wrong with the file and what to do, as sentences; empty when it is intact."""
        self.unusable = False
        """Whether neither the file nor its backup can be read, so that no token is valid."""

    def all(self) -> list[Token]:
        """Return all tokens, the expired too; empty when there never was one, or they are lost to damage."""
        try:
            status = self._path.stat()
            stamp = (status.st_mtime_ns, status.st_size, status.st_ino)
            if stamp != self._seen:
                self._tokens, self._seen = self._read(), stamp
        except FileNotFoundError:
            self._tokens, self._seen, self.damage, self.unusable = [], None, "", False
        except OSError as error:
            raise StorageError(
                "the file of tokens {path} cannot be used: {reason}", path=self._path, reason=error
            ) from error
        return self._tokens

    def _read(self) -> list[Token]:
        self.damage, self.unusable = "", False
        try:
            return _decode(self._path.read_bytes())
        except msgspec.DecodeError as error:
            self.damage = f"The file of tokens {self._path} is damaged: {str(error).rstrip('.')}."
        try:
            tokens = _decode(self._copy.read_bytes())
            self.damage += f" The tokens are those of its copy {self._copy}."
        except (OSError, msgspec.DecodeError):
            tokens, self.unusable = self._tokens, not self._tokens
            self.damage += (
                " Its copy cannot be used either, so nobody can connect with a token."
                if self.unusable
                else " The tokens that were read before it was damaged stay valid until the server ends."
            )
            self.damage += " Make new tokens with `arcor2-hw token add`; the damaged file is then stored aside."
        return tokens

    def repair(self) -> str:
        """Replace a damaged file by its copy, or write the copy where it is missing. Returns what was wrong."""
        tokens, damage = self.all(), self.damage
        if self.unusable or not (tokens or damage):
            return damage
        if damage or not self._copy.exists():
            with self._changing():
                pass
        return damage

    def find(self, secret: str) -> Token | None:
        """Return the token with this secret, None if there is none or it has expired."""
        digest = hashlib.sha256(secret.encode(errors="replace")).hexdigest()
        found = None
        for token in self.all():  # all of them, so that the time taken tells nothing
            if hmac.compare_digest(token.digest, digest):
                found = token
        return None if found is None or found.expired else found

    def valid(self, token: Token) -> bool:
        """Return whether a token is still there and its time is not over."""
        return not token.expired and any(each.id == token.id for each in self.all())

    def add(self, name: str, role: Role, days: int | None = None) -> tuple[Token, str]:
        """Create a token; return it with its secret, which is not stored.

        Raise InvalidData or Conflict if that is impossible.
        """
        if not name.strip() or len(name) > LONGEST_NAME or not name.isprintable():
            raise InvalidData(
                "A token needs the name of a person or a device, of {longest_name} characters at most.",
                longest_name=LONGEST_NAME,
            )
        secret = secrets.token_urlsafe(32)
        expires = None
        if days is not None:
            expires = (datetime.now(UTC) + timedelta(days=days)).isoformat(timespec="seconds")
        digest = hashlib.sha256(secret.encode()).hexdigest()
        token = Token(secrets.token_hex(4), name, role, digest, now(), expires)
        with self._changing() as tokens:
            if any(each.name == name and not each.expired for each in tokens):
                raise Conflict("There is a token for {name!r} already: revoke it first.", name=name)
            tokens.append(token)
        return token, secret

    def revoke(self, which: str) -> list[Token]:
        """Delete the tokens with this id or name, and return them. Raise NotFound if there is none."""
        with self._changing() as tokens:
            gone = [token for token in tokens if which in (token.id, token.name)]
            if not gone:
                raise NotFound("There is no token {which!r}.", which=which)
            tokens[:] = [token for token in tokens if token not in gone]
        return gone

    @contextlib.contextmanager
    def _changing(self) -> Generator[list[Token], None, None]:
        """Provide the list to change; it is on disk, readable by its owner alone, when this ends."""
        try:
            self._path.parent.mkdir(parents=True, exist_ok=True)
            with self._path.with_suffix(".lock").open("ab") as lock:
                fcntl.flock(lock, fcntl.LOCK_EX)
                tokens = list(self.all())
                yield tokens
                content = msgspec.json.format(msgspec.json.encode(tokens))
                if self.damage:
                    aside(self._path, now()).hardlink_to(self._path)
                write_private(self._copy, content)
                write_private(self._path, content)
        except OSError as error:
            raise StorageError(
                "the file of tokens {path} cannot be written: {reason}", path=self._path, reason=error.strerror
            ) from error
