"""Saved documents: scenes, projects with their sources, object types, collision models."""

from arcor2_server.storage.store import DocumentId, Storage

__all__ = ["DocumentId", "Storage"]
