"""Assets (meshes, robot descriptions): files named by the hash of their content, records by the hash of their id.

Paths contain no part of an id or file name. Files are written to a temporary path, flushed and renamed, so a crash
leaves either the old asset or the new one.
"""

import asyncio
import contextlib
import hashlib
import os
import tempfile
from collections.abc import AsyncIterable, AsyncIterator, Iterator
from pathlib import Path
from typing import Final, Literal, Self

import msgspec
import structlog
from msgspec import UNSET

from arcor2_hw.data.base import Data, Timestamp, Unset, new_id, now
from arcor2_hw.exceptions import Conflict, InvalidData, NotFound, StorageError
from arcor2_hw.files import sync
from arcor2_hw.messages import translatable
from arcor2_server.files import replace_file

log = structlog.get_logger(__name__)

MAX_ASSET: Final = 256 * 1024 * 1024
"""Maximum size of one asset, bytes. The meshes of a robot have some tens of MiB."""
MAX_ID: Final = 255
"""Maximum length of an id, characters."""
CHUNK: Final = 256 * 1024
"""Size of a chunk that is read from a file, bytes."""
_FAILED: Final = translatable(
    {
        "use": "The assets in {directory} cannot be used: {reason}",
        "read": "The assets in {directory} cannot be read: {reason}",
        "write": "The assets in {directory} cannot be written: {reason}",
    }
)


class TooLarge(InvalidData):
    """The uploaded file is larger than allowed."""

    code = "too_large"


class Asset(Data, frozen=True):
    """The record of one asset. `size` in bytes; `digest`: SHA-256 of the content in hexadecimal."""

    id: str
    created: Timestamp
    modified: Timestamp
    size: int
    digest: str
    file_name: str | Unset = UNSET
    description: str | Unset = UNSET


class AssetStore:
    """All assets; the records are in memory. For use on one event loop.

    `revision` grows with every change. Methods that touch the disk raise StorageError naming the directory.
    """

    def __init__(self, directory: Path, limit: int = MAX_ASSET) -> None:
        self.revision = 0
        self.limit = limit
        self._directory = directory
        self._content = directory / "content"
        self._records = directory / "records"
        self._incoming = directory / "incoming"
        self._assets: dict[str, Asset] = {}
        self._offered: dict[str, Asset] = {}
        self._changing = asyncio.Lock()

    @classmethod
    async def open(cls, directory: Path, limit: int = MAX_ASSET) -> Self:
        """Open or create the store. Delete incomplete files of a crash."""
        store = cls(directory, limit)
        with store._storage_errors("use"):
            store._assets = await asyncio.to_thread(store._load)
        return store

    def _load(self) -> dict[str, Asset]:
        for folder in (self._content, self._records, self._incoming):
            folder.mkdir(parents=True, exist_ok=True)
        for left in self._incoming.iterdir():
            left.unlink()
        assets: dict[str, Asset] = {}
        decoder = msgspec.json.Decoder(Asset)
        for path in sorted(self._records.glob("*.json")):
            try:
                asset = decoder.decode(path.read_bytes())
            except msgspec.DecodeError as error:
                log.warning("asset ignored: its record is damaged", record=str(path), reason=str(error))
                continue
            if not self._path(asset.digest).is_file():
                log.warning("asset ignored: its content is missing", asset=asset.id, digest=asset.digest)
                continue
            assets[asset.id] = asset
        return assets

    # ------------------------------------------------------------------------------------------------ look-ups
    def infos(self) -> list[Asset]:
        """Return all uploaded assets by id, without those of installed drivers."""
        return [self._assets[key] for key in sorted(self._assets)]

    def exists(self, key: str) -> bool:
        """Return whether there is such an asset."""
        return key in self._assets or key in self._offered

    def info(self, key: str) -> Asset:
        """Return the record of an asset. Raise NotFound if there is none."""
        found = self._assets.get(key) or self._offered.get(key)
        if found is None:
            raise NotFound("Asset {key!r} does not exist.", key=key)
        return found

    def file(self, key: str) -> Path:
        """Return the file with the present content of an asset. Raise NotFound if there is no such asset."""
        return self._path(self.info(key).digest).absolute()

    async def read(self, asset: Asset) -> AsyncIterator[bytes]:
        """Return the content of the version of an asset that `info` returned, in chunks."""
        with self._storage_errors("read"):
            file = await asyncio.to_thread(self._path(asset.digest).open, "rb")
        with file:
            while True:
                with self._storage_errors("read"):
                    chunk = await asyncio.to_thread(file.read, CHUNK)
                if not chunk:
                    return
                yield chunk

    # ------------------------------------------------------------------------------------------------ changes
    async def put(
        self,
        content: AsyncIterable[bytes],
        key: str | None = None,
        *,
        file_name: str | Unset = UNSET,
        description: str | Unset = UNSET,
        upsert: bool = False,
    ) -> Asset:
        """Store an asset from a stream.

        Args:
            content: The stream.
            key: The id; None for a new one.
            file_name: The name of the uploaded file.
            description: A text for users.
            upsert: Replace an asset with this id.

        Raises:
            Conflict: There is an asset with this id.
            InvalidData: The id is invalid.
            TooLarge: The content is larger than allowed.
        """
        key = new_id("asset") if key is None else _checked(key)
        self._refuse_known(key, upsert)
        with self._storage_errors("write"):
            descriptor, name = await asyncio.to_thread(tempfile.mkstemp, dir=self._incoming)
        try:
            size, digest = await self._receive(content, descriptor)
            async with self._changing:
                self._refuse_known(key, upsert)
                old = self._assets.get(key)
                stamp = now()
                asset = Asset(key, old.created if old else stamp, stamp, size, digest, file_name, description)
                with self._storage_errors("write"):
                    await asyncio.to_thread(self._place, Path(name), asset)
                self._assets[key] = asset
                self.revision += 1
                if old is not None:
                    await self._drop_unused(old.digest)
        finally:
            os.close(descriptor)
            with contextlib.suppress(FileNotFoundError):  # renamed by _place
                os.unlink(name)  # noqa: PTH108 - not on a thread, for which a cancelled task would not wait
        return asset

    async def offer(self, key: str, content: bytes, description: str | Unset = UNSET) -> None:
        """Offer an asset of an installed distribution until the store is closed.

        An uploaded asset with the same id hides it. Clients cannot delete it.
        """
        key, digest = _checked(key), hashlib.sha256(content).hexdigest()
        async with self._changing:
            with self._storage_errors("write"):
                await asyncio.to_thread(self._store, content, digest)
            stamp = now()
            self._offered[key] = Asset(key, stamp, stamp, len(content), digest, key, description)
            self.revision += 1

    async def delete(self, key: str) -> None:
        """Delete an asset. Running downloads are completed.

        Raises:
            NotFound: The asset does not exist.
            Conflict: It belongs to an installed distribution.
        """
        async with self._changing:
            asset = self.info(key)
            if key not in self._assets:
                raise Conflict("The asset {key!r} belongs to an installed driver and cannot be deleted.", key=key)
            with self._storage_errors("write"):
                await asyncio.to_thread(self._record(key).unlink, missing_ok=True)
                await asyncio.to_thread(sync, self._records)
            del self._assets[key]
            self.revision += 1
            await self._drop_unused(asset.digest)

    # ------------------------------------------------------------------------------------------------ internals
    def _refuse_known(self, key: str, upsert: bool) -> None:
        if self.exists(key) and not upsert:
            raise Conflict("The asset {key!r} exists already.", key=key)

    async def _receive(self, content: AsyncIterable[bytes], descriptor: int) -> tuple[int, str]:
        size = 0
        hashed = hashlib.sha256()
        async for chunk in content:
            size += len(chunk)
            if size > self.limit:
                raise TooLarge("The asset is larger than {limit} bytes.", limit=self.limit)
            with self._storage_errors("write"):
                await asyncio.to_thread(_append, descriptor, chunk, hashed)
        with self._storage_errors("write"):
            await asyncio.to_thread(os.fsync, descriptor)
        return size, hashed.hexdigest()

    def _place(self, received: Path, asset: Asset) -> None:
        place = self._path(asset.digest)
        place.parent.mkdir(exist_ok=True)
        received.replace(place)
        sync(place.parent)
        sync(self._content)
        replace_file(self._record(asset.id), msgspec.json.encode(asset), temporary=self._incoming / "record")
        sync(self._records)

    def _store(self, content: bytes, digest: str) -> None:
        place = self._path(digest)
        if place.is_file() and place.stat().st_size == len(content):
            return
        place.parent.mkdir(exist_ok=True)
        replace_file(place, content, durable=False, temporary=self._incoming / "offered")

    async def _drop_unused(self, digest: str) -> None:
        if all(asset.digest != digest for asset in [*self._assets.values(), *self._offered.values()]):
            with self._storage_errors("write"):
                await asyncio.to_thread(self._path(digest).unlink, missing_ok=True)

    def _path(self, digest: str) -> Path:
        return self._content / digest[:2] / digest

    def _record(self, key: str) -> Path:
        return self._records / f"{hashlib.sha256(key.encode()).hexdigest()}.json"

    @contextlib.contextmanager
    def _storage_errors(self, operation: Literal["use", "read", "write"]) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            text = _FAILED[operation]
            raise StorageError(text, str(error), directory=self._directory, reason=error.strerror) from error


def _checked(key: str) -> str:
    if not key or len(key) > MAX_ID or not key.isprintable():
        raise InvalidData("The id of an asset has 1 to {max_id} printable characters.", max_id=MAX_ID)
    return key


def _append(descriptor: int, chunk: bytes, hashed: "hashlib._Hash") -> None:
    hashed.update(chunk)
    rest = memoryview(chunk)
    while rest:
        rest = rest[os.write(descriptor, rest) :]
