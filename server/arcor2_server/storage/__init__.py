"""Stores: saved documents, assets, packages and secrets."""

from arcor2_server.storage.assets import Asset, AssetStore
from arcor2_server.storage.store import DocumentId, Storage

__all__ = ["Asset", "AssetStore", "DocumentId", "Storage"]
