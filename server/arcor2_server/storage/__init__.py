"""Saved documents: scenes, projects with their sources, object types, collision models; and assets as files."""

from arcor2_server.storage.assets import Asset, AssetStore
from arcor2_server.storage.store import DocumentId, Storage

__all__ = ["Asset", "AssetStore", "DocumentId", "Storage"]
