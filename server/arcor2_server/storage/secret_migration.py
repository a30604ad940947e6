"""Moves secrets that saved documents and packages contain in plain text to the secret store."""

import asyncio
from typing import TYPE_CHECKING, TypeVar

import msgspec
import structlog
from sqlalchemy import select

from arcor2_hw.data.project import Project
from arcor2_hw.data.scene import Scene, SceneObject, SceneObjectOverride
from arcor2_server.storage.models import ProjectRow, ProjectTablesRow, SceneRow
from arcor2_server.storage.packages import Packages
from arcor2_server.storage.setting_secrets import SettingSecrets, objects_of

if TYPE_CHECKING:
    from arcor2_server.storage.store import Storage

log = structlog.get_logger(__name__)
T = TypeVar("T")


async def hide_stored(storage: "Storage", secrets: SettingSecrets) -> int:
    """Replace secrets in all saved documents by references; return the number of changed documents.

    Unreadable documents are left unchanged.

    Raises:
        StorageError: A document or the secret store cannot be written.
    """
    changed = 0
    async with storage.writing() as session:
        objects: dict[str, SceneObject] = {}
        for scene_row in await session.scalars(select(SceneRow)):
            scene = _decoded(scene_row.document, Scene)
            if scene is None:
                continue
            objects |= objects_of(scene)
            if (hidden := secrets.hide_in_scene(scene)) is not scene:
                scene_row.document, changed = msgspec.json.encode(hidden), changed + 1
        for project_row in await session.scalars(select(ProjectRow)):
            project = _decoded(project_row.document, Project)
            if project is None or not project.object_overrides:
                continue
            overrides = secrets.hide_in_overrides(project.object_overrides, objects)
            if overrides != project.object_overrides:
                fresh = msgspec.structs.replace(project, object_overrides=overrides)
                project_row.document, changed = msgspec.json.encode(fresh), changed + 1
        for tables_row in await session.scalars(select(ProjectTablesRow)):
            given = _decoded(tables_row.object_parameters, list[SceneObjectOverride])
            if given and (overrides := secrets.hide_in_overrides(given, objects)) != given:
                tables_row.object_parameters, changed = msgspec.json.encode(overrides), changed + 1
        await secrets.store.flush()  # before the documents lose the values
    if changed:
        await storage.purge()
    return changed


def _decoded(content: bytes, kind: type[T]) -> T | None:
    try:
        return msgspec.json.decode(content, type=kind)
    except msgspec.DecodeError:
        return None


async def migrate_secrets(storage: "Storage", packages: Packages, secrets: SettingSecrets) -> None:
    """Move the secrets. Documents are searched once, and again when object types declare further secret settings.

    Raises:
        StorageError: A document or the secret store cannot be written.
    """
    store, declared = secrets.store, secrets.declared()
    if store.scanned is not None and declared <= store.scanned:
        return
    with secrets.migrating():
        found = await hide_stored(storage, secrets) + await asyncio.to_thread(packages.hide_secrets)
    store.note_scanned(declared | (store.scanned or set()))
    await store.flush()
    if found:
        log.info("secrets moved to the secret store", documents=found)
