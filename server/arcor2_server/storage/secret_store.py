"""Values of secret settings, stored separately from the documents that refer to them."""

import asyncio
import threading
from pathlib import Path

import msgspec

from arcor2_hw.data.base import Data
from arcor2_hw.data.secret import new_reference
from arcor2_hw.exceptions import StorageError
from arcor2_hw.messages import Message
from arcor2_server.files import write_private
from arcor2_server.storage.damage_notices import DataDamage


class Secret(Data, frozen=True):
    """One secret value with its object type and setting.

    Attributes:
        type: The object type.
        setting: The name of the setting.
        value: The secret.
        address: Hosts that the value may be sent to; None in files of older versions until the value is used.
    """

    type: str
    setting: str
    value: str
    address: str | None = None


class _Content(msgspec.Struct):
    secrets: dict[str, Secret] = msgspec.field(default_factory=dict)
    scanned: set[tuple[str, str]] | None = None
    """The secret settings (object type, name) that stored documents were searched for; None: never."""


class SecretStore:
    """The file of secrets, readable only by its owner. Thread-safe; added values are on disk after `flush`."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._content = _Content()
        self._changed = False
        self._lock = threading.Lock()
        self.values: frozenset[str] = frozenset()
        """All values, to hide them in texts."""

    def load(self, damage: DataDamage) -> None:
        """Read the file; report a damaged one. Raise StorageError if it cannot be read."""
        loss = Message.of("The passwords of devices are lost: enter them again.")
        self._content = damage.read_json(self._path, _Content, loss) or _Content()
        self.values = frozenset(secret.value for secret in self._content.secrets.values())

    @property
    def scanned(self) -> set[tuple[str, str]] | None:
        """The secret settings that stored documents were searched for; None: never."""
        return self._content.scanned

    def note_scanned(self, settings: set[tuple[str, str]]) -> None:
        """Note for which secret settings stored documents were searched."""
        with self._lock:
            self._content.scanned = settings
            self._changed = True

    def find(self, reference: str) -> Secret | None:
        """Return a secret, None if it is not stored."""
        return self._content.secrets.get(reference)

    def bind(self, reference: str, address: str) -> Secret | None:
        """Set the address of a secret that has none; return the secret, None if it is not stored."""
        with self._lock:
            secret = self._content.secrets.get(reference)
            if secret is not None and secret.address is None:
                secret = self._content.secrets[reference] = msgspec.structs.replace(secret, address=address)
                self._changed = True
            return secret

    def add(self, secret: Secret, *, reuse: bool = False) -> str:
        """Store a secret; return its reference. `reuse`: return the reference of an equal secret, if there is one."""
        with self._lock:
            if reuse:
                for reference, stored in self._content.secrets.items():
                    if stored == secret:
                        return reference
            reference = new_reference()
            self._content.secrets[reference] = secret
            self.values |= {secret.value}
            self._changed = True
        return reference

    def save(self) -> None:
        """Write added values. Raise StorageError if the file cannot be written."""
        with self._lock:
            if not self._changed:
                return
            try:
                write_private(self._path, msgspec.json.format(msgspec.json.encode(self._content)))
            except OSError as error:
                raise StorageError(
                    "Secrets cannot be stored in {path}: {reason}", path=self._path, reason=error.strerror
                ) from error
            self._changed = False

    async def flush(self) -> None:
        """Write added values without blocking the event loop. Raise StorageError if the file cannot be written."""
        if self._changed:
            await asyncio.to_thread(self.save)
