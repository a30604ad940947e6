"""Assets over REST, streamed in both directions (protocol, section 13)."""

import asyncio
from collections.abc import AsyncIterator
from dataclasses import dataclass
from typing import IO

from msgspec import UNSET

from arcor2_hw.data.base import Data, Timestamp, Unset
from arcor2_hw.data.role import Role
from arcor2_hw.messages import translatable
from arcor2_server.object_types.notifications import TypeNotifications
from arcor2_server.rest.operations import MIB, Binary, Upload, operation
from arcor2_server.rest.scenes import STORAGE, check_id
from arcor2_server.storage import Asset, AssetStore
from arcor2_server.storage.assets import CHUNK, MAX_ASSET


class AssetQuery(Data, frozen=True):
    """Id of the asset (by default a new one), description, and whether to replace an asset with this id."""

    id: str | Unset = UNSET
    description: str | Unset = UNSET
    upsert: bool = False


class AssetInfo(Data, frozen=True):
    """Metadata of an asset."""

    id: str
    created: Timestamp
    modified: Timestamp
    file_name: str | Unset = UNSET
    description: str | Unset = UNSET


def _info(asset: Asset) -> AssetInfo:
    return AssetInfo(asset.id, asset.created, asset.modified, asset.file_name, asset.description)


async def _chunks(file: IO[bytes]) -> AsyncIterator[bytes]:
    while chunk := await asyncio.to_thread(file.read, CHUNK):
        yield chunk


@dataclass(frozen=True, slots=True)
class AssetOperations:
    """Assets over REST, streamed in both directions (protocol, section 13)."""

    _assets: AssetStore
    _type_notifications: TypeNotifications

    @operation(
        "POST",
        "/assets",
        STORAGE,
        Role.TECHNICIAN,
        file="assetData",
        title=translatable("Uploading a file"),
        shown_from=MIB,
        limit=MAX_ASSET + MIB,
    )
    async def post_asset(self, query: AssetQuery, upload: Upload) -> AssetInfo:
        """Upload an asset: a mesh, a robot description or any other file."""
        key = None if isinstance(query.id, Unset) else query.id
        if key is not None:
            check_id(key, "asset")
        asset = await self._assets.put(
            _chunks(upload.file),
            key,
            file_name=upload.filename or UNSET,
            description=query.description,
            upsert=query.upsert,
        )
        await self._type_notifications.uploaded()
        return _info(asset)

    @operation("GET", "/assets/info", STORAGE, Role.OPERATOR)
    async def list_assets(self) -> list[AssetInfo]:
        """Return the metadata of all assets."""
        return [_info(asset) for asset in self._assets.infos()]

    @operation("GET", "/assets/{asset_id}/exists", STORAGE, Role.OPERATOR)
    async def asset_exists(self, asset_id: str) -> bool:
        """Return whether an asset exists."""
        return self._assets.exists(asset_id)

    @operation("GET", "/assets/{asset_id}/data", STORAGE, Role.OPERATOR, media_type="application/octet-stream")
    async def asset_data(self, asset_id: str) -> Binary:
        """Return the content of an asset."""
        asset = self._assets.info(asset_id)
        name = asset.id if isinstance(asset.file_name, Unset) else asset.file_name
        return Binary(self._assets.read(asset), "application/octet-stream", name, asset.size)

    @operation("DELETE", "/assets/{asset_id}", STORAGE, Role.TECHNICIAN)
    async def delete_asset(self, asset_id: str) -> None:
        """Delete an asset. Object types that need it then report a problem."""
        await self._assets.delete(asset_id)
        await self._type_notifications.uploaded()
