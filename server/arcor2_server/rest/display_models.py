"""Meshes and robots made ready for clients, over REST (docs/protocol.md)."""

import asyncio

from arcor2_hw.data.role import Role
from arcor2_hw.exceptions import NotFound
from arcor2_server.rest.operations import Kept, operation
from arcor2_server.services import Services

MEDIA_TYPE = "model/gltf-binary"


@operation("GET", "/api/assets/{asset_id}/shown", "ARCOR2-HW", Role.OPERATOR, media_type=MEDIA_TYPE)
async def asset_shown(services: Services, asset_id: str) -> Kept:
    """Give a mesh, or a robot's description with its meshes, as it is shown: one binary glTF."""
    shown = await services.prepared.get(asset_id)

    async def read(gzipped: bool) -> bytes:
        file = shown.packed if gzipped and shown.packed is not None else shown.plain
        try:
            return await asyncio.to_thread(file.read_bytes)
        except FileNotFoundError:
            raise NotFound(f"What was prepared of the asset {asset_id!r} was dropped just now: ask again.") from None

    return Kept(read, MEDIA_TYPE, shown.etag, gzipped=shown.packed is not None)
