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
from arcor2_hw.messages import Message
from arcor2_server.files import damaged_copy_path, write_private

FILE: Final = "tokens.json"
COPY: Final = "tokens.copy.json"
MAX_NAME: Final = 100


class Token(Data, frozen=True):
    """One token: its name, role and expiry; `digest` is the SHA-256 of its secret.

    The secret has 256 random bits, so that no slow hash is needed. A `shared` token belongs to a device at which
    persons log on; its role is the highest one that they have there.
    """

    id: str
    name: str
    role: Role
    digest: str
    created: Timestamp
    expires: Timestamp | None = None
    shared: bool = False

    @property
    def expired(self) -> bool:
        """Whether the token has expired."""
        return self.expires is not None and datetime.fromisoformat(self.expires) <= datetime.now(UTC)


_decode = msgspec.json.Decoder(list[Token]).decode


class TokenFile:
    """The tokens of one data directory. Methods raise StorageError if the file cannot be used.

    Other processes may change the file at any time; a changed file is read again. Each change is first written to a
    copy, which is used if the file is damaged.
    """

    def __init__(self, data_dir: Path) -> None:
        self._path = data_dir / FILE
        self._copy = data_dir / COPY
        self._seen: tuple[int, int, int] | None = None
        self._tokens: list[Token] = []
        self.damage: Message | None = None
        """The problem of the file and its remedy, as sentences; None if the file is intact."""
        self.unusable = False
        """Whether neither the file nor its copy can be read, so that no token is valid."""

    def all(self) -> list[Token]:
        """Return all tokens, including expired ones; empty if there are none, or neither file nor copy can be read."""
        try:
            status = self._path.stat()
            stamp = (status.st_mtime_ns, status.st_size, status.st_ino)
            if stamp != self._seen:
                self._tokens, self._seen = self._read(), stamp
        except FileNotFoundError:
            self._tokens, self._seen, self.damage, self.unusable = [], None, None, False
        except OSError as error:
            raise StorageError(
                "the token file {path} cannot be used: {reason}", path=self._path, reason=error
            ) from error
        return self._tokens

    def _read(self) -> list[Token]:
        self.damage, self.unusable = None, False
        try:
            return _decode(self._path.read_bytes())
        except msgspec.DecodeError as error:
            reason = str(error).rstrip(".")
            damage = [Message.of("The token file {path} is damaged: {reason}.", path=self._path, reason=reason)]
        try:
            tokens = _decode(self._copy.read_bytes())
            damage.append(Message.of("Its copy {path} is used instead.", path=self._copy))
        except (OSError, msgspec.DecodeError):
            tokens, self.unusable = self._tokens, not self._tokens
            admitted = (
                "Its copy cannot be used either, so no client can connect with a token."
                if self.unusable
                else "The tokens that were read before stay valid until the server stops."
            )
            remedy = "Create new tokens with `arcor2-hw token add`; this also renames the damaged file."
            damage += [Message.of(admitted), Message.of(remedy)]
        self.damage = Message.joined(damage)
        return tokens

    def repair(self) -> Message | None:
        """Replace a damaged file by its copy, or create a missing copy. Return the problem, None if there is none."""
        tokens, damage = self.all(), self.damage
        if self.unusable or not (tokens or damage):
            return damage
        if damage or not self._copy.exists():
            with self._changing():
                pass
        return damage

    def find(self, secret: str) -> Token | None:
        """Return the valid token with this secret, None if there is none."""
        digest = hashlib.sha256(secret.encode(errors="replace")).hexdigest()
        found = None
        for token in self.all():  # all of them, so that the duration reveals nothing
            if hmac.compare_digest(token.digest, digest):
                found = token
        return None if found is None or found.expired else found

    def valid(self, token: Token) -> bool:
        """Return whether a token still exists and has not expired."""
        return not token.expired and any(each.id == token.id for each in self.all())

    def add(self, name: str, role: Role, days: int | None = None, *, shared: bool = False) -> tuple[Token, str]:
        """Create a token; return it with its secret, which is not stored.

        Args:
            name: name of the user or device.
            role: role of the token.
            days: validity, days; None for unlimited.
            shared: whether it belongs to a device at which persons log on.

        Raises:
            InvalidData: the name is not valid.
            Conflict: there is a valid token with this name.
        """
        if not name.strip() or len(name) > MAX_NAME or not name.isprintable():
            raise InvalidData(
                "A token needs the name of a user or device with at most {longest_name} characters.",
                longest_name=MAX_NAME,
            )
        secret = secrets.token_hex(
            32
        )  # never starts with a dash, so that it is not taken for an option of the command line
        expires = None
        if days is not None:
            expires = (datetime.now(UTC) + timedelta(days=days)).isoformat(timespec="seconds")
        digest = hashlib.sha256(secret.encode()).hexdigest()
        token = Token(secrets.token_hex(4), name, role, digest, now(), expires, shared)
        with self._changing() as tokens:
            if any(each.name == name and not each.expired for each in tokens):
                raise Conflict("There is a token for {name!r} already: revoke it first.", name=name)
            tokens.append(token)
        return token, secret

    def revoke(self, which: str) -> list[Token]:
        """Delete and return the tokens with this id or name. Raise NotFound if there is none."""
        with self._changing() as tokens:
            revoked = [token for token in tokens if which in (token.id, token.name)]
            if not revoked:
                raise NotFound("Token {which!r} does not exist.", which=which)
            tokens[:] = [token for token in tokens if token not in revoked]
        return revoked

    @contextlib.contextmanager
    def _changing(self) -> Generator[list[Token], None, None]:
        """Provide the list of tokens for a change; write it to a file that only its owner can read."""
        try:
            self._path.parent.mkdir(parents=True, exist_ok=True)
            with self._path.with_suffix(".lock").open("ab") as lock:
                fcntl.flock(lock, fcntl.LOCK_EX)
                tokens = list(self.all())
                yield tokens
                content = msgspec.json.format(msgspec.json.encode(tokens))
                if self.damage:
                    damaged_copy_path(self._path, now()).hardlink_to(self._path)
                write_private(self._copy, content)
                write_private(self._path, content)
        except OSError as error:
            raise StorageError(
                "the token file {path} cannot be written: {reason}", path=self._path, reason=error.strerror
            ) from error
