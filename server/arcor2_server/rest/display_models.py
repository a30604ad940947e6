"""Meshes and robot models converted for display, over REST (docs/protocol.md)."""

import asyncio
from dataclasses import dataclass

from arcor2_hw.data.role import Role
from arcor2_hw.exceptions import NotFound
from arcor2_server.rest.operations import CacheableContent, operation
from arcor2_server.workspace.display_models import DisplayModels

MEDIA_TYPE = "model/gltf-binary"


@dataclass(frozen=True, slots=True)
class DisplayModelOperations:
    """Meshes and robot models converted for display, over REST (docs/protocol.md)."""

    _display_models: DisplayModels

    @operation("GET", "/api/assets/{asset_id}/shown", "ARCOR2-HW", Role.OPERATOR, media_type=MEDIA_TYPE)
    async def asset_shown(self, asset_id: str) -> CacheableContent:
        """Return a mesh, or a robot description with its meshes, as a binary glTF file."""
        model = await self._display_models.get(asset_id)

        async def read(gzipped: bool) -> bytes:
            file = model.packed if gzipped and model.packed is not None else model.plain
            try:
                return await asyncio.to_thread(file.read_bytes)
            except FileNotFoundError:
                raise NotFound(
                    "The display model of the asset {asset_id!r} was just deleted from the cache. Try again.",
                    asset_id=asset_id,
                ) from None

        return CacheableContent(read, MEDIA_TYPE, model.etag, gzipped=model.packed is not None)
